//! Mappings for steered elements, chosen by what their pillars do among dissimilar neighbours.
//!
//! Where the phase is steep, neighbours differ from one to the next, and the mapping that brings most light into the first
//! order of equal neighbours is not the best one. Here the pillars of a sample of sites, drawn by a polynomial, transmit by
//! the sum over pairs ([`NeighbourTable`]); the coefficients are those with most light in the first order, mean of
//! the wavelengths that the design compares mappings at. What is found is judged by supercells of rows of the element's own pillars.

mod first_order;
mod site_sample;

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use metalith_cell::{
    CellStack, InversePolynomial, Mapping, NeighbourResponse, NeighbourTable, NeighbourTableSpec, simplex,
};
use metalith_core::{Error, Progress, Result, Wedge};
use metalith_design::phase::LensPhase;
use metalith_design::{Design, Element, SteeringSteps};

use first_order::judge;
use site_sample::SiteSample;

/// Share of the light in the first order at one wavelength, with the common mapping and with the element's own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SteeredLight {
    pub wavelength_um: f64,
    /// Light by the sum over pairs, mean of s and p, over a sample of the element's sites.
    pub pairs: [f64; 2],
    /// Light by supercells of rows of the element's pillars, all rows together.
    pub supercells: [f64; 2],
}

/// The mapping of the elements that are steered by so many steps.
#[derive(Clone, Debug, Serialize)]
pub struct SteeredStudy {
    /// Steps from the middle of the array along the two axes, the larger first.
    pub steps: SteeringSteps,
    pub coefficients: Vec<f64>,
    /// Light at each of the wavelengths that the design compares mappings at.
    pub light: Vec<SteeredLight>,
}

impl SteeredStudy {
    /// First order with the element's own mapping over that with the common one: means over the wavelengths, by supercells.
    pub fn gain(&self) -> f64 {
        let sum = |k: usize| self.light.iter().map(|l| l.supercells[k]).sum::<f64>();
        sum(1) / sum(0)
    }

    /// True if supercells find more light with the element's own mapping. The sum over pairs that it was chosen by errs
    /// by a few hundredths, and may promise what is not there.
    pub fn is_better(&self) -> bool {
        self.gain() > 1.0
    }
}

/// Find a mapping for each distinct steered element of a design; tables of neighbours are kept in the folder `cache`.
///
/// # Errors
/// If the common mapping is a table, the lens has a phase over the plane, elements have their own lenses or are placed one by
/// one, a cell cannot be solved, or the user stopped it.
pub fn study_steered(design: &Design, cache: Option<&Path>, progress: &dyn Progress) -> Result<Vec<SteeredStudy>> {
    if design.mapping.table.is_some() {
        return Err(Error::refused(
            "cells/steered-without-polynomial",
            "mappings of steered elements start from a polynomial, and the design has a table",
            "give `coefficients` in [mapping]",
        ));
    }
    let who = "the search for mappings of steered elements";
    design.one_lens(who)?;
    design.radial_phase(who)?;
    if !design.array.placed.is_empty() {
        return Err(Error::refused(
            "cells/elements-not-on-grid",
            format!("{who} needs elements on a grid, and the design places them one by one"),
            "use `elements`, `spacing_um` and `steering_deg` of [array] in place of [[element]]",
        ));
    }
    let stack = design.cell_stack()?;
    let lens = LensPhase::new(design.lattice(), design.lens.diameter_nm, &design.lens.phase);
    steered(design)
        .into_iter()
        .map(|(steps, wedges)| study(design, &stack, &lens, steps, &wedges, cache, progress))
        .collect()
}

/// The wedges of each pair of steps but none, the least first, turned so that light arrives from +x and +y, and on a square lattice as
/// tables have it, from +x more than from +y: that has one wedge for each pair. On a hexagonal one x and y are not alike.
fn steered(design: &Design) -> Vec<(SteeringSteps, Vec<Wedge>)> {
    let is_square = design.cell.lattice.is_square();
    let turned = |element: Element| {
        let [x, y] = [element.wedge.sin_x, element.wedge.sin_y].map(f64::abs);
        let [x, y] = if is_square { [x.max(y), x.min(y)] } else { [x, y] };
        let wedge = Wedge {
            sin_x: -x,
            sin_y: -y,
            ..element.wedge
        };
        Some((SteeringSteps::of(&design.array, element.index)?, wedge))
    };
    let mut elements: Vec<_> = design.elements().into_iter().filter_map(turned).collect();
    elements.retain(|(steps, _)| *steps != SteeringSteps::NONE);
    elements.sort_by(|(a, _), (b, _)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut all: Vec<(SteeringSteps, Vec<Wedge>)> = Vec::new();
    for (steps, wedge) in elements {
        match all.last_mut().filter(|(known, _)| *known == steps) {
            None => all.push((steps, vec![wedge])),
            Some((_, wedges)) if is_square || wedges.contains(&wedge) => {}
            Some((_, wedges)) => wedges.push(wedge),
        }
    }
    all
}

/// Elements with one wedge: a sample of their sites, and the tables of neighbours in their light, by wavelength.
struct IlluminatedSample {
    sample: SiteSample,
    tables: Vec<[NeighbourResponse; 2]>,
}

impl IlluminatedSample {
    fn new(
        design: &Design,
        stack: &CellStack,
        lens: &LensPhase,
        wedge: &Wedge,
        cache: Option<&Path>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        // Any width that may be written, whatever mapping is found.
        let writable: Vec<u16> = design.cell.widths_nm().collect();
        let mapping = Mapping::new(|u| writable[(u * writable.len() as f64) as usize]);
        let table = |&um: &f64| {
            let spec = NeighbourTableSpec {
                wavelength_um: um,
                sines: wedge.looks_at(um).into(),
            };
            let table = NeighbourTable::obtain(&spec, stack, std::slice::from_ref(&mapping), cache, progress)?;
            Ok(table.responses(1.0))
        };
        Ok(Self {
            sample: SiteSample::new(lens, wedge),
            tables: design.compared_um().iter().map(table).collect::<Result<_>>()?,
        })
    }

    /// Shares of the light in the first order, mean over elements with several wedges, by wavelength.
    fn shares(all: &[Self], width_nm: impl Fn(f64) -> f64 + Sync) -> Vec<f64> {
        let mut sums = vec![0.0; all[0].tables.len()];
        for lit in all {
            let shares = lit.sample.shares(&width_nm, &lit.tables);
            sums.iter_mut().zip(shares).for_each(|(sum, share)| *sum += share);
        }
        sums.iter().map(|sum| sum / all.len() as f64).collect()
    }
}

fn study(
    design: &Design,
    stack: &CellStack,
    lens: &LensPhase,
    steps: SteeringSteps,
    wedges: &[Wedge],
    cache: Option<&Path>,
    progress: &dyn Progress,
) -> Result<SteeredStudy> {
    let lit = |wedge| IlluminatedSample::new(design, stack, lens, wedge, cache, progress);
    let lit = wedges.iter().map(lit).collect::<Result<Vec<_>>>()?;
    let common = &design.mapping.polynomial;
    progress.begin(
        &format!("mapping of elements {} and {} steps off", steps.0, steps.1),
        STARTS as u64,
    );
    let found: Vec<InversePolynomial> = starts(design)
        .into_par_iter()
        .map(|start| {
            let best = best(design, &start, &lit);
            progress.advance(1);
            best
        })
        .collect();
    progress.check_stopped()?;
    let shares = |polynomial: &InversePolynomial| IlluminatedSample::shares(&lit, |u| width_nm(design, polynomial, u));
    let mean = |polynomial: &InversePolynomial| shares(polynomial).iter().sum::<f64>();
    let best = found
        .into_iter()
        .max_by(|a, b| mean(a).total_cmp(&mean(b)))
        .expect("there are starts");
    let pairs = [shares(common), shares(&best)];
    let mut light = Vec::new();
    for (k, &um) in design.compared_um().iter().enumerate() {
        let judged = |polynomial: &InversePolynomial| -> Result<f64> {
            let width_nm = |u| width_nm(design, polynomial, u);
            let mut sum = 0.0;
            for wedge in wedges {
                sum += judge(stack, lens, wedge, (um, wedge.looks_at(um).into()), &width_nm, progress)?;
            }
            Ok(sum / wedges.len() as f64)
        };
        light.push(SteeredLight {
            wavelength_um: um,
            pairs: [pairs[0][k], pairs[1][k]],
            supercells: [judged(common)?, judged(&best)?],
        });
    }
    Ok(SteeredStudy {
        steps,
        coefficients: best.coefficients,
        light,
    })
}

/// Number of polynomials that the search starts from.
const STARTS: usize = 2;

/// The common mapping, and widths that rise evenly from the narrowest to the widest, of the same degree.
fn starts(design: &Design) -> [InversePolynomial; STARTS] {
    let common = design.mapping.polynomial.clone();
    let (low, high) = design.cell.width_range_nm;
    let [low, high] = [low, high].map(|w| f64::from(w) / f64::from(design.cell.pitch_nm));
    let mut even = vec![0.0; common.coefficients.len().max(2)];
    // A tenth of the range stays free at either end, or the search would begin at its border.
    even[0] = low + 0.1 * (high - low);
    even[1] = 0.8 * (high - low);
    let even = InversePolynomial {
        coefficients: even,
        ..common.clone()
    };
    [common, even]
}

fn best(design: &Design, start: &InversePolynomial, lit: &[IlluminatedSample]) -> InversePolynomial {
    let rounded = |coefficients: &[f64]| coefficients.iter().map(|c| (c * ROUNDED).round() as i64).collect();
    let with = |rounded: &[i64]| InversePolynomial {
        coefficients: rounded.iter().map(|c| *c as f64 / ROUNDED).collect(),
        ..start.clone()
    };
    let pitch_nm = f64::from(design.cell.pitch_nm);
    let (low, high) = design.cell.width_range_nm;
    let loss = |polynomial: &InversePolynomial| {
        let (narrow, wide) = polynomial.range();
        // A mapping that leaves the widths is not one, however well its clamped form does.
        let outside = (f64::from(low) - narrow * pitch_nm)
            .max(wide * pitch_nm - f64::from(high))
            .max(0.0);
        let shares = IlluminatedSample::shares(lit, |u| width_nm(design, polynomial, u));
        outside - shares.iter().sum::<f64>() / shares.len() as f64
    };
    // The simplex shrinks below what coefficients are rounded to: most of its steps ask for what is known.
    let known: RefCell<HashMap<Vec<i64>, f64>> = RefCell::default();
    let kept = |coefficients: &[f64]| {
        let key: Vec<i64> = rounded(coefficients);
        if let Some(loss) = known.borrow().get(&key) {
            return *loss;
        }
        let found = loss(&with(&key));
        known.borrow_mut().insert(key, found);
        found
    };
    let best: Vec<i64> = rounded(&simplex(&start.coefficients, kept));
    with(&best)
}

/// Coefficients are found to this part of one, as design files have them.
const ROUNDED: f64 = 1e4;

/// Width before rounding (nm), within those that may be written, for a phase (turns).
fn width_nm(design: &Design, polynomial: &InversePolynomial, u: f64) -> f64 {
    let (low, high) = design.cell.width_range_nm;
    (polynomial.duty(u) * f64::from(design.cell.pitch_nm)).clamp(f64::from(low), f64::from(high))
}

#[cfg(test)]
mod tests {
    use metalith_core::Silent;

    use super::*;

    fn changed(name: &str, change: impl FnOnce(String) -> String) -> Design {
        let path = format!("{}/../../designs/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let text = change(std::fs::read_to_string(&path).unwrap());
        Design::parse(Path::new(&path), &text).unwrap()
    }

    fn mini(elements: &str) -> Design {
        changed("mini_3x3", |text| text.replacen("elements = [3, 3]", elements, 1))
    }

    fn refused(design: &Design) -> &'static str {
        study_steered(design, None, &Silent).unwrap_err().id()
    }

    /// Of an even number of columns the nearest to the middle are half a step off.
    #[test]
    fn elements_are_told_by_what_they_are_steered_by() {
        let steps = |elements: &str| -> Vec<SteeringSteps> {
            steered(&mini(elements)).into_iter().map(|(steps, _)| steps).collect()
        };
        assert_eq!(
            steps("elements = [3, 3]"),
            [SteeringSteps(1.0, 0.0), SteeringSteps(1.0, 1.0)]
        );
        assert_eq!(
            steps("elements = [2, 3]"),
            [SteeringSteps(0.5, 0.0), SteeringSteps(1.0, 0.5)]
        );
        for (SteeringSteps(first, second), wedges) in steered(&mini("elements = [2, 3]")) {
            let [wedge] = wedges[..] else { panic!("{wedges:?}") };
            let sine = |steps: f64| (15.0 * steps).to_radians().sin();
            assert_eq!([-wedge.sin_x, -wedge.sin_y], [sine(first), sine(second)]);
        }
    }

    /// Those that are steered along x and along y have one mapping, found for both.
    #[test]
    fn x_and_y_of_a_hexagonal_lattice_are_not_alike() {
        let design = changed("hexagonal_1550", |text| {
            text.replacen("elements = [1, 1]", "elements = [3, 3]\nsteering_deg = 10", 1)
                .replacen("size_um = [300, 300]", "size_um = [900, 900]", 1)
        });
        let all = steered(&design);
        let sines: Vec<Vec<[bool; 2]>> = all
            .iter()
            .map(|(_, wedges)| {
                wedges
                    .iter()
                    .map(|w| [w.sin_x, w.sin_y].map(|sine| sine < 0.0))
                    .collect()
            })
            .collect();
        assert_eq!(sines.len(), 2);
        assert_eq!(sines[1], [[true, true]]);
        assert!(sines[0].len() == 2 && sines[0].contains(&[true, false]) && sines[0].contains(&[false, true]));
    }

    #[test]
    fn what_the_search_does_not_know_is_refused() {
        let over_the_plane = refused(&changed("hologram", |text| text));
        assert_eq!(over_the_plane, "design/phase-not-radial");
        let placed = |text: String| {
            let (head, rest) = text.split_once("[[phase.term]]").unwrap();
            format!("{head}[array]{}", rest.split_once("[array]").unwrap().1)
        };
        assert_eq!(refused(&changed("hologram", placed)), "cells/elements-not-on-grid");
    }
}
