//! Design rules: a layout and a deck of rules -> a report in which every rule has run, was skipped, or failed.
//!
//! The layout is read once more after its first reading. Every outline is looked at in the cell that it is
//! drawn in, and what is wrong with it is counted once for each copy of the cell; squares on the lattice
//! of an element become a width map, everything else is kept as it stands, and rules about distances,
//! density and place look at those. **Closed when in doubt**: what did not run is not clean.

mod aperture;
mod budget;
mod deck;
mod density;
mod design;
pub mod diff;
mod export;
mod field;
mod found;
mod gather;
mod lattice;
mod layers;
mod marks;
mod outline;
mod pairs;
mod polygon;
mod report;
mod rule;
mod scene;
mod spacing;
mod tree;
mod waiver;
mod width;

pub use deck::Deck;
pub use export::{junit, lyrdb, sarif, text};
pub use found::Marker;
pub use report::{DrcReport, RuleReport};
pub use rule::{Severity, Status};
pub use waiver::{Date, Waiver, Waivers};

use found::Found;
use metalith_core::{Error, Progress, Result};
use metalith_design::Design;
use metalith_gds::Layout;
use rule::{Needs, Rule};
use scene::Scene;

/// What is checked besides the layout itself.
#[derive(Default)]
pub struct CheckInput<'a> {
    /// Further files that are written on the same glass, such as the apertures.
    pub with: Vec<&'a Layout>,
    /// The design that the layout should hold.
    pub design: Option<&'a Design>,
    pub waivers: Option<&'a Waivers>,
    /// Today, for the expiry of waivers.
    pub today: Date,
    /// Most markers that are kept a rule; all are counted.
    pub markers: usize,
}

/// Check a layout against a deck.
///
/// # Errors
/// If a file cannot be read again, the files do not share one database unit, or the user stopped it. What a
/// rule cannot do is in the report, not an error.
pub fn check(layout: &Layout, deck: &Deck, input: &CheckInput<'_>, progress: &dyn Progress) -> Result<DrcReport> {
    for other in &input.with {
        if other.unit_nm() != layout.unit_nm() {
            return Err(Error::invalid(
                format!(
                    "{} has a database unit of {} nm, {} one of {} nm",
                    layout.path().display(),
                    layout.unit_nm(),
                    other.path().display(),
                    other.unit_nm()
                ),
                "write both with the same unit",
            ));
        }
    }
    let mut rules = deck.rules(input.design.is_some())?;
    let mut found: Vec<Found> = rules
        .iter()
        .map(|r| Found::new(&r.id, layout.unit_nm(), input))
        .collect();
    let scene = gather::gather(layout, deck, input, &mut rules, &mut found, progress)?;
    progress.begin("rules", rules.len() as u64);
    let mut statuses = Vec::with_capacity(rules.len());
    for (rule, found) in rules.iter_mut().zip(&mut found) {
        if progress.stopped() {
            return Err(Error::Interrupted);
        }
        statuses.push(judge(rule.in_force, rule.rule.as_mut(), &scene, found));
        progress.advance(1);
    }
    Ok(report::assemble(&scene, deck, rules, statuses, found, input))
}

fn judge(in_force: bool, rule: &mut dyn Rule, scene: &Scene<'_>, found: &mut Found) -> Status {
    if !in_force {
        return Status::NotInForce;
    }
    let missing = match rule.needs() {
        Needs::Numbers => None,
        Needs::Outlines => scene.unread.as_ref(),
        Needs::Geometry => scene.incomplete.as_ref(),
    };
    if let Some(why) = missing {
        return Status::Failed(why.clone());
    }
    rule.judge(scene, found)
}
