//! Comparison of the layout with its design, and of the design with the limits of the cell.

use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::rule::{NO_DESIGN, Needs, NotRun, Rule, RuleOutcome};
use super::work::{Stop, Work};

use std::borrow::Cow;

use metalith_core::document::{Limits, Section};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{AskedLight, Design, Medium};
use metalith_pillars::{Lattice, PillarId, PillarRows};

enum Against {
    Count,
    Widths,
    /// Share of neighbouring sites whose phase differs by more than pi.
    PhaseStep(f64),
    NoLatticeOrders {
        /// Medium that the rule checks; `None` for both.
        medium: Option<Medium>,
        light: AskedLight,
    },
}

/// Media and light of `lattice_orders` as the keys have them.
const MEDIA: [(&str, Option<Medium>); 3] = [
    ("both", None),
    ("ambient", Some(Medium::Ambient)),
    ("substrate", Some(Medium::Substrate)),
];
const LIGHT: [(&str, AskedLight); 2] = [("all", AskedLight::All), ("middle", AskedLight::Middle)];

pub(super) fn read(check: &str, s: &Section<'_, '_>, _context: &Context) -> Option<Box<dyn Rule>> {
    Some(Box::new(match check {
        "pillar_count" => Against::Count,
        "width_map" => Against::Widths,
        "phase_step" => Against::PhaseStep(s.float("max_share", Limits::new(0.0..=1.0, "of all steps"))),
        "lattice_orders" => Against::NoLatticeOrders {
            medium: s.choice("medium", &MEDIA, Some(None)),
            light: s.choice("light", &LIGHT, Some(AskedLight::All)),
        },
        _ => return None,
    }))
}

impl Rule for Against {
    fn words(&self) -> String {
        match self {
            Self::Count => "as many pillars as designed, in every element".into(),
            Self::Widths => "widths as designed, at every site".into(),
            Self::PhaseStep(share) => format!("at most {share} of the steps from pillar to pillar exceed pi"),
            Self::NoLatticeOrders { medium, light } => format!(
                "the lattice sends no light {}into oblique orders of {}",
                match light {
                    AskedLight::All => "",
                    AskedLight::Middle => "from the middle of a field ",
                },
                medium.map_or("the media beside it", Medium::words)
            ),
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let Some(design) = flat.design else {
            return Err(NotRun::Skipped(NO_DESIGN.into()));
        };
        match self {
            Self::Count | Self::Widths => self.compare(flat, found),
            Self::PhaseStep(share) => phase_step(flat, design, *share, found),
            Self::NoLatticeOrders { medium, light } => lattice_orders(design, *medium, *light, found),
        }
    }

    fn needs(&self) -> Needs {
        match self {
            Self::Count | Self::Widths => Needs::Array,
            Self::PhaseStep(_) | Self::NoLatticeOrders { .. } => Needs::Numbers,
        }
    }
}

impl Against {
    fn compare(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let array = flat.array.expect("made where a rule needs it");
        for (k, (read, placed)) in flat.elements.iter().zip(&array.placed).enumerate() {
            let n = read.site.lattice.sites();
            flat.work.spend((n as u64).pow(2))?;
            let name = &read.site.name;
            if let Self::Count = self {
                let (there, wanted) = (read.widths.pillars(), array.rows(placed).pillars());
                if there != wanted {
                    found.plain(&format!("{name} {there}"), || {
                        format!("{there} pillars in {name}, {wanted} designed")
                    });
                }
                continue;
            }
            let designed = array.all_rows(placed);
            let [mut room, mut other_room] = [Vec::new(), Vec::new()];
            for row in 0..n {
                let there = read.widths.row(row, 0..n, &mut room);
                let wanted = designed.row(row, 0..n, &mut other_room);
                if there == wanted {
                    continue;
                }
                for (column, (&w, &wanted)) in there.iter().zip(wanted).enumerate() {
                    // Missing and additional pillars are a matter of count.
                    if w != wanted && w != 0 && wanted != 0 {
                        found.rect(&flat.pillar(k, row, column), || {
                            if flat.shape.has_width() {
                                format!("{w} nm wide, {wanted} nm designed")
                            } else {
                                let words = |number| flat.shape.words(PillarId(number));
                                format!("{}, designed {}", words(w), words(wanted))
                            }
                        });
                    }
                }
            }
        }
        Ok(())
    }
}

fn phase_step(flat: &FlatLayout<'_>, design: &Design, most: f64, found: &mut Findings) -> RuleOutcome {
    let lattice = design.lattice();
    // Light along x and along y may have a phase each.
    let seen = std::iter::once(Cow::Borrowed(design)).chain(design.along_y().map(Cow::Owned));
    let lenses: Vec<LensPhase> = seen.map(|seen| LensPhase::of(&seen)).collect();
    let light = |k: usize| match (lenses.len(), k) {
        (1, _) => "",
        (_, 0) => " for light along x",
        _ => " for light along y",
    };
    for (element, k, lens) in design
        .elements()
        .into_iter()
        .flat_map(|e| lenses.iter().enumerate().map(move |(k, lens)| (e, k, lens)))
    {
        let phase = ElementPhase::of(lens, &element);
        let (steps, steep) = steps(flat.work, lattice, &phase)?;
        let share = steep as f64 / steps.max(1) as f64;
        found.facts.push((
            format!("share of steps beyond pi in {}{}", element.label(), light(k)),
            share,
        ));
        if share > most {
            let name = element.label() + light(k);
            found.plain(&name, || {
                format!("{share:.4} of the steps of {name} exceed pi, at most {most}")
            });
        }
    }
    Ok(())
}

/// Steps between neighbouring sites, and those beyond half a turn.
fn steps(work: &Work<'_>, lattice: Lattice, phase: &ElementPhase<'_>) -> Result<(u64, u64), Stop> {
    if !lattice.is_square() {
        return steps_to_neighbours(work, lattice, phase);
    }
    if phase.is_radial() {
        return radial_steps(work, lattice, phase);
    }
    all_steps(work, lattice, phase)
}

/// True if the phase differs by more than half a wave from one site to another, by the [parts](ElementPhase::parts) of
/// their phases: the part of maps, which are known up to whole waves, goes the short way.
fn is_steep(from: [f64; 2], to: [f64; 2]) -> bool {
    let mapped = to[1] - from[1];
    ((to[0] - from[0]) + (mapped - mapped.round())).abs() > 0.5
}

/// Variant of [`steps`] to the neighbours of a lattice of any kind.
fn steps_to_neighbours(work: &Work<'_>, lattice: Lattice, phase: &ElementPhase<'_>) -> Result<(u64, u64), Stop> {
    let (n, mut all, mut steep) = (lattice.sites(), 0, 0);
    let phases = |iy: usize| -> Vec<Option<[f64; 2]>> { (0..n).map(|ix| phase.parts(ix, iy)).collect() };
    let mut own = phases(0);
    for iy in 0..n {
        work.look()?;
        let above = if iy + 1 < n { phases(iy + 1) } else { Vec::new() };
        for (ix, here) in own.iter().enumerate() {
            let Some(here) = here else { continue };
            for &[right, up] in lattice.neighbours() {
                let row = if up == 0 { &own } else { &above };
                let column = ix.checked_add_signed(right as isize);
                if let Some(Some(there)) = column.and_then(|c| row.get(c)) {
                    all += 1;
                    steep += u64::from(is_steep(*here, *there));
                }
            }
        }
        own = above;
    }
    Ok((all, steep))
}

/// Variant of [`steps`] for any phase on a square lattice.
fn all_steps(work: &Work<'_>, lattice: Lattice, phase: &ElementPhase<'_>) -> Result<(u64, u64), Stop> {
    let (mut all, mut steep) = (0, 0);
    // Phases of the row before; every site is computed once.
    let mut before: Vec<Option<[f64; 2]>> = vec![None; lattice.sites()];
    for iy in 0..lattice.sites() {
        work.look()?;
        let mut left = None;
        for (ix, below) in before.iter_mut().enumerate() {
            let own = phase.parts(ix, iy);
            if let Some(own) = own {
                for other in [left, *below].into_iter().flatten() {
                    all += 1;
                    steep += u64::from(is_steep(own, other));
                }
            }
            left = own;
            *below = own;
        }
    }
    Ok((all, steep))
}

/// Variant of [`steps`] for a phase that is equal in all eighths: steps along the rows of a quarter stand for all.
fn radial_steps(work: &Work<'_>, lattice: Lattice, phase: &ElementPhase<'_>) -> Result<(u64, u64), Stop> {
    let (n, mut all, mut steep) = (lattice.sites(), 0, 0);
    let odd = n % 2;
    for iy in n / 2..n {
        work.look()?;
        // An even row has a step between its halves, of nothing.
        let middle = phase.turns(n / 2, iy);
        let (mut along, mut beyond) = (u64::from(odd == 0 && middle.is_some()), 0);
        let mut left = middle;
        for ix in n / 2 + 1..n {
            let own: Option<f64> = phase.turns(ix, iy);
            if let (Some(own), Some(left)) = (own, left) {
                along += 2;
                beyond += 2 * u64::from((own - left).abs() > 0.5);
            }
            left = own;
        }
        let rows = if odd == 1 && iy == n / 2 { 1 } else { 2 };
        (all, steep) = (all + rows * along, steep + rows * beyond);
    }
    // As many along columns.
    Ok((2 * all, 2 * steep))
}

fn lattice_orders(design: &Design, medium: Option<Medium>, light: AskedLight, found: &mut Findings) -> RuleOutcome {
    let all = design
        .lattice_orders(light)
        .map_err(|error| NotRun::Failed(error.to_string()))?;
    for orders in all.iter().filter(|o| medium.is_none_or(|m| m == o.medium)) {
        let nm = orders.wavelength_um * 1e3;
        found.plain(&format!("{nm:.3} {}", orders.medium.words()), || orders.words());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::work::{Allowance, Work};
    use super::*;
    use metalith_core::{Silent, Wedge};
    use metalith_design::phase::RadialPhase;

    /// A quarter of an unsteered lens counts as all of it: even and odd lattices.
    #[test]
    fn a_quarter_has_the_steps_of_the_whole() {
        let radial = RadialPhase::Hyperbola {
            wavelength_um: 0.55,
            focal_length_um: 4.0,
        };
        for sites in [1, 2, 3, 40, 41] {
            let lattice = Lattice::new(350, sites).unwrap();
            let lens = LensPhase::new(lattice, 350 * sites as u32, &radial);
            let wedge = Wedge {
                wavelength_um: 0.55,
                sin_x: 0.0,
                sin_y: 0.0,
            };
            let phase = ElementPhase::new(&lens, &wedge);
            let work = Work::new(&Allowance::of([]), &Silent);
            let whole = all_steps(&work, lattice, &phase).unwrap();
            assert_eq!(radial_steps(&work, lattice, &phase).unwrap(), whole);
            assert_eq!(steps_to_neighbours(&work, lattice, &phase).unwrap(), whole);
            assert!(sites < 40 || (whole.1 > 0 && whole.1 < whole.0));
        }
    }
}
