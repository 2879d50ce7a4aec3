//! Measures of the pillars of a layout: pitches, and the smallest gap between shapes.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::deck::Deck;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::input::CheckInput;
use super::pairs::near;
use super::rule::{NotRun, Rule, RuleOutcome};
use super::spacing::neighbours;
use metalith_core::{Error, Progress, Result};
use metalith_gds::{LayerNumber, Layout};
use metalith_pillars::{PillarId, PillarRows, PillarShape};

/// Gaps that are looked for where there is no lattice (nm).
const REACH_NM: f64 = 1000.0;

/// Measures of the pillars of a layout.
#[derive(Clone, Debug, Default)]
pub(super) struct Measures {
    pub shape: PillarShape,
    /// Elements by their pitch (nm, in steps of it).
    pub pitches_nm: Vec<f64>,
    pub elements: usize,
    pub pillars: u64,
    /// Shapes of the pillar layer off every lattice.
    pub loose: u64,
    /// Smallest gap between two shapes that do not overlap (nm); none where all are farther apart than was looked.
    pub gap_nm: Option<f64>,
}

/// The rule that measures and finds no violation.
struct Measure(Arc<Mutex<Measures>>);

impl Rule for Measure {
    fn words(&self) -> String {
        "what the pillars measure".into()
    }

    fn judge(&self, flat: &FlatLayout<'_>, _found: &mut Findings) -> RuleOutcome {
        let mut pitches: BTreeMap<u64, f64> = BTreeMap::new();
        for e in &flat.elements {
            let nm = e.site.lattice.pitch_nm().nm();
            pitches.insert(nm.to_bits(), nm);
        }
        let mut gap_nm = least_on_lattices(flat);
        let most = gap_nm.unwrap_or_else(|| pitches.values().copied().fold(REACH_NM, f64::max));
        near(flat, flat.pillars, flat.units(most).ceil() as i64, |a, b| {
            if !a.overlaps(&b) {
                let nm = a.gap(&b) * flat.unit_nm;
                gap_nm = Some(gap_nm.map_or(nm, |least| least.min(nm)));
            }
        })
        .map_err(NotRun::from)?;
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Measures {
            shape: flat.shape,
            pitches_nm: pitches.into_values().collect(),
            elements: flat.elements.len(),
            pillars: flat.pillars_on_lattices(),
            loose: flat.loose(flat.pillars).map_or(0, super::flat_layout::LooseShapes::len),
            gap_nm: gap_nm.filter(|nm| *nm > 0.0),
        };
        Ok(())
    }
}

/// Smallest gap between pillars of one lattice, of those that do not overlap (nm).
fn least_on_lattices(flat: &FlatLayout<'_>) -> Option<f64> {
    let mut least: Option<f64> = None;
    for e in &flat.elements {
        let (lattice, widths) = (e.site.lattice, e.widths.histogram().len());
        let steps = lattice.steps_nm();
        for &(up, right) in neighbours(&lattice) {
            let apart = [steps[0] * right as f64, steps[1] * up as f64];
            // A lens has millions of pairs of some hundred widths.
            let mut known = vec![false; widths.saturating_mul(widths).min(1 << 24)];
            let (n, mut room, mut room_up) = (lattice.sites(), Vec::new(), Vec::new());
            for row in 0..n.saturating_sub(up) {
                let own = e.widths.row(row, 0..n, &mut room).to_vec();
                let other = e.widths.row(row + up, 0..n, &mut room_up);
                for (column, &a) in own.iter().enumerate().filter(|(_, a)| **a != 0) {
                    let b = column.checked_add_signed(right).and_then(|c| other.get(c));
                    let Some(&b) = b.filter(|b| **b != 0) else { continue };
                    let pair = usize::from(a) * widths + usize::from(b);
                    if known.get_mut(pair).is_some_and(|known| std::mem::replace(known, true)) {
                        continue;
                    }
                    let gap = flat.shape.gap([a, b].map(PillarId), apart);
                    if gap > 0.0 {
                        least = Some(least.map_or(gap, |least| least.min(gap)));
                    }
                }
            }
        }
    }
    least
}

/// Measure the pillars on a layer.
///
/// # Errors
/// If the layout cannot be read, or the work is out of proportion to it.
pub(super) fn measure(layout: &Layout, pillars: LayerNumber, progress: &dyn Progress) -> Result<Measures> {
    let found = Arc::new(Mutex::new(Measures::default()));
    let deck = Deck::of_rule("measure", vec![pillars], Box::new(Measure(found.clone())));
    let input = CheckInput::default();
    let report = super::check(layout, &deck, &input, progress)?;
    if let Some(why) = report.rules.iter().find_map(|rule| rule.status.reason()) {
        return Err(Error::refused(
            "check/not-measured",
            format!("{}: {why}", layout.path().display()),
            "check the layout with --rules, which names what is wrong with it",
        ));
    }
    let found = found.lock().unwrap_or_else(PoisonError::into_inner).clone();
    Ok(found)
}
