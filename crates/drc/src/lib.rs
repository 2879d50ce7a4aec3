//! Design rules: a layout and a deck of rules -> a report in which every rule has run, was skipped, or failed.
//!
//! The layout is read once more after its first reading. Every outline is looked at in the cell that it is
//! drawn in, and what is wrong with it is counted once for each copy of the cell; squares on the lattice
//! of an element become a width map, everything else is kept as it stands, and rules about distances,
//! density and place look at those. **Fail closed**: a rule that did not run is not clean.

mod aperture;
mod body;
mod budget;
mod collect_shapes;
mod context;
mod deck;
mod density;
mod design;
pub mod diff;
mod drawn_outline;
mod elements;
mod export;
mod findings;
mod flat_layout;
mod generic;
mod grids;
mod input;
mod layers;
mod marks;
mod measure;
mod new_rules;
mod outline;
mod pairs;
mod polygon;
mod recognition;
mod report;
mod rule;
mod spacing;
mod tolerance;
mod tree;
mod waiver;
mod width;
mod winding;
mod work;
mod write_fields;

pub use deck::{Deck, LayoutLayers};
pub use export::{junit, lyrdb, sarif, text};
pub use findings::Marker;
pub use generic::check_generic;
pub use input::CheckInput;
pub use new_rules::{NewRules, new_rules};
pub use recognition::add_recognition;
pub use report::{DrcReport, RuleReport};
pub use rule::{Severity, Status};
pub use waiver::{Date, Waiver, Waivers};

use findings::Findings;
use flat_layout::FlatLayout;
use metalith_core::{Error, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_gds::Layout;
use rule::{DeckRule, Needs, NotRun};
use work::{Allowance, Work};

/// Check a layout against a deck.
///
/// # Errors
/// If a file cannot be read again, the files do not share one database unit, or the user stopped it. What a
/// rule cannot do is in the report, not an error.
pub fn check(layout: &Layout, deck: &Deck, input: &CheckInput<'_>, progress: &dyn Progress) -> Result<DrcReport> {
    same_unit(layout, input)?;
    let in_force = |r: &DeckRule| r.always || input.design.is_some();
    let needs_array = deck
        .rules()
        .iter()
        .any(|r| in_force(r) && r.rule.needs() == Needs::Array);
    let built = match (input.design, input.array) {
        (Some(design), None) if needs_array => Some(PillarArray::build(design, progress)?),
        _ => None,
    };
    let allowance = Allowance::of(std::iter::once(layout).chain(input.with.iter().copied()));
    let work = Work::new(&allowance, progress);
    let mut found: Vec<Findings> = deck
        .rules()
        .iter()
        .map(|r| Findings::new(&r.id, layout.unit_nm(), input))
        .collect();
    let mut flat = collect_shapes::gather(layout, deck, input, &allowance, &work, &mut found, progress)?;
    flat.array = input.array.or(built.as_ref());
    progress.begin("rules", deck.rules().len() as u64);
    let mut statuses = Vec::with_capacity(deck.rules().len());
    for (rule, found) in deck.rules().iter().zip(&mut found) {
        progress.check_stopped()?;
        statuses.push(if in_force(rule) {
            judge(rule, &flat, found)?
        } else {
            Status::NotInForce
        });
        progress.advance(1);
    }
    Ok(report::assemble(&flat, deck, statuses, found, input))
}

fn same_unit(layout: &Layout, input: &CheckInput<'_>) -> Result<()> {
    match input.with.iter().find(|other| other.unit_nm() != layout.unit_nm()) {
        None => Ok(()),
        Some(other) => Err(Error::refused(
            "layout/units-differ",
            format!(
                "{} has a database unit of {} nm, {} one of {} nm",
                layout.path().display(),
                layout.unit_nm(),
                other.path().display(),
                other.unit_nm()
            ),
            "write both with the same unit",
        )),
    }
}

fn judge(rule: &DeckRule, flat: &FlatLayout<'_>, found: &mut Findings) -> Result<Status> {
    let missing = match rule.rule.needs() {
        Needs::Numbers => None,
        Needs::Outlines => flat.unread.as_ref(),
        Needs::Geometry | Needs::Array => flat.incomplete.as_ref(),
    };
    if let Some(why) = missing {
        return Ok(Status::Failed(why.clone()));
    }
    match rule.rule.judge(flat, found) {
        Ok(()) => Ok(Status::Run),
        Err(NotRun::Skipped(why)) => Ok(Status::Skipped(why)),
        Err(NotRun::NotApplicable(why)) => Ok(Status::NotApplicable(why)),
        Err(NotRun::Failed(why)) => Ok(Status::Failed(why)),
        Err(NotRun::Interrupted) => Err(Error::Interrupted),
    }
}
