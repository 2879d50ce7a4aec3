//! All that the library of a design says about its cell and its mapping.

use std::collections::BTreeSet;

use serde::Serialize;

use metalith_cell::{
    AVOIDED_BELOW, BadCell, Basis, CellModel, ForwardFit, ForwardPolynomial, InverseFit, InversePolynomial, MappedCell,
    MappingError, MappingTable, PhaseCurve, RampOrders, RigorousCell, TableInterpolation, bad_cells, curves_over,
    fit_forward, fit_inverse, forward_errors, round_trip,
};
use metalith_core::{Error, Result};
use metalith_design::Design;
use metalith_design::array::PillarRule;

use crate::SteeredStudy;

/// Steps of the band that the best mapping sends light to the first order in.
const BEST_STEPS: f64 = 30.0;

/// Name of the mapping of a design that is solved from its cell.
const SOLVED: &str = "solved";

/// Degree of the inverse polynomial that stands for `fitted`.
const FITTED_DEGREE: usize = 3;

/// Degrees of the inverse fits from which the best polynomial is sought.
const BEST_DEGREES: [usize; 3] = [2, 3, 5];

/// Highest degrees that are tried.
const HIGHEST_INVERSE: usize = 6;
const HIGHEST_FORWARD: usize = 6;

/// Options of [`CellStudy::new`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StudyOptions {
    /// Power of the zero order below which a width is bad.
    pub threshold: f64,
}

impl Default for StudyOptions {
    fn default() -> Self {
        Self {
            threshold: AVOIDED_BELOW,
        }
    }
}

impl StudyOptions {
    /// Check what is asked, before cells are solved for it.
    ///
    /// # Errors
    /// If the threshold is not a share of power.
    pub fn check(&self) -> Result<()> {
        if (0.0..1.0).contains(&self.threshold) {
            Ok(())
        } else {
            Err(Error::refused(
                "cells/threshold-out-of-range",
                format!("the limit of the zeroth order is {}", self.threshold),
                "give a share of the incident power from 0 to 1, such as 0.3",
            ))
        }
    }
}

/// A mapping and what it does with light.
#[derive(Clone, Debug, Serialize)]
pub struct MappingStudy {
    pub name: &'static str,
    /// Error against the rigorous phase at the wavelength of the mapping.
    pub phase: MappingError,
    /// Orders at the wavelengths of [`CellStudy::compared_um`].
    pub led: Vec<RampOrders>,
    /// Error over the band.
    pub band: Vec<RampOrders>,
    /// Coefficients, of a mapping that is a polynomial.
    pub coefficients: Option<Vec<f64>>,
    #[serde(skip)]
    pub table: MappingTable,
}

/// Shares of light that count as equal: no lens shows the difference.
const EQUAL: f64 = 5e-4;

impl MappingStudy {
    /// Mean power of the first order at the wavelengths that mappings are compared at.
    pub fn compared(&self) -> f64 {
        self.led.iter().map(|o| o.first).sum::<f64>() / self.led.len().max(1) as f64
    }

    /// Mean power of an order over the band.
    pub fn mean(&self, of: impl Fn(&RampOrders) -> f64) -> f64 {
        self.band.iter().map(of).sum::<f64>() / self.band.len() as f64
    }
}

/// The inverse polynomials that were fitted, and why a degree has none.
#[derive(Clone, Debug, Serialize)]
pub struct InverseTrial {
    pub basis: Basis,
    pub degree: usize,
    /// Fit; `None` where no polynomial of this degree stays within the widths of the cell.
    pub fit: Option<InverseFit>,
}

/// Fits, bad widths and mappings of a design's cell.
#[derive(Clone, Debug, Serialize)]
pub struct CellStudy {
    pub design: String,
    pub film: String,
    pub substrate: String,
    pub orders: usize,
    pub tolerance: f64,
    /// Cells solved for the library.
    pub points: usize,
    /// Transmission between their wavelengths, and its error.
    pub interpolation: TableInterpolation,
    /// Wavelength of the mapping (um).
    pub mapping_um: f64,
    /// The cell that the mappings are for.
    pub mapped_cell: MappedCell,
    /// Wavelengths that mappings are compared at, and the band of the best (um).
    pub compared_um: Vec<f64>,
    pub best_band_um: (f64, f64),
    /// Turns between the narrowest and the widest pillar at that wavelength.
    pub span_waves: f64,
    pub options: StudyOptions,
    /// The mapping of the design, polynomial or table, by rigorous theory.
    pub design_round_trip: MappingError,
    pub inverse: Vec<InverseTrial>,
    /// Published forward polynomial, at each wavelength and overall; of the cell of the paper alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forward_published: Option<(Vec<(f64, MappingError)>, MappingError)>,
    /// Degrees from 2.
    pub forward: Vec<ForwardFit>,
    /// Every 10 nm.
    pub bad: Vec<BadCell>,
    pub mappings: Vec<MappingStudy>,
    /// Mappings of steered elements, where they were asked for.
    pub steered: Vec<SteeredStudy>,
    /// Every 2 nm of the band and of the widths, for the maps.
    #[serde(skip)]
    pub curves: Vec<PhaseCurve>,
}

impl CellStudy {
    /// The mapping with the most light in the first order, as the mean over [`CellStudy::compared_um`]; of equals the first, which is
    /// the design's own.
    pub fn best(&self) -> Option<&MappingStudy> {
        let light = MappingStudy::compared;
        self.mappings
            .iter()
            .reduce(|a, b| if light(b) > light(a) + EQUAL { b } else { a })
    }

    /// Study the cell of a design.
    ///
    /// # Errors
    /// If the threshold is not a share of power, or the widths of the design are too few.
    pub fn new(design: &Design, cell: &RigorousCell, options: StudyOptions) -> Result<Self> {
        options.check()?;
        let spec = cell.table().spec();
        let pitch_nm = f64::from(design.cell.pitch_nm);
        let (low, high) = design.cell.width_range_nm;
        let every_nm: Vec<u16> = (low..=high).collect();
        let mapping_um = design.mapping.wavelength_um;
        let fine = PhaseCurve::new(cell, mapping_um, &every_nm)?;
        let inverse: Vec<_> = [Basis::AllPowers, Basis::EvenPowers]
            .into_iter()
            .flat_map(|basis| (1..=HIGHEST_INVERSE).map(move |degree| (basis, degree)))
            .map(|(basis, degree)| InverseTrial {
                basis,
                degree,
                fit: fit_inverse(&fine, pitch_nm, basis, degree, options.threshold).ok(),
            })
            .collect();
        let forward_curves = curves_over(cell, spec.band_um, (low, high))?;
        let forward = (2..=HIGHEST_FORWARD)
            .map(|degree| fit_forward(&forward_curves, pitch_nm, degree))
            .collect::<Result<Vec<_>>>()?;
        let writable: Vec<u16> = design.cell.widths_nm().collect();
        let bad = bad_cells(cell, &steps(spec.band_um, 0.010), &writable, options.threshold)?;
        let mappings = mappings(design, cell, &inverse, &writable, options)?;
        let curves = steps(spec.band_um, 0.002)
            .into_iter()
            .map(|wavelength_um| PhaseCurve::new(cell, wavelength_um, &writable))
            .collect::<Result<Vec<_>>>()?;
        Ok(Self {
            design: design.name.clone(),
            film: spec.stack.film.source().to_owned(),
            substrate: spec.stack.substrate.source().to_owned(),
            orders: spec.orders,
            tolerance: spec.tolerance,
            points: cell.table().points(),
            interpolation: cell.table().interpolation(),
            mapping_um,
            mapped_cell: design.cell.mapped(mapping_um),
            compared_um: design.compared_um().to_vec(),
            best_band_um: design.mapping_band_um()?,
            span_waves: fine.turns[fine.turns.len() - 1] - fine.turns[0],
            options,
            design_round_trip: error_of_design(design, &fine),
            inverse,
            forward_published: design
                .cell
                .is_of_the_paper()
                .then(|| forward_errors(&ForwardPolynomial::published(), &forward_curves, pitch_nm)),
            forward,
            bad,
            mappings,
            steered: Vec::new(),
            curves,
        })
    }
}

/// Phase error of the mapping that a design draws by, at the wavelength of `curve`.
fn error_of_design(design: &Design, curve: &PhaseCurve) -> MappingError {
    match &design.mapping.table {
        Some(table) => table.phase_error(curve),
        None => round_trip(&design.mapping.polynomial, curve, f64::from(design.cell.pitch_nm)),
    }
}

/// Wavelengths of a band at about this step (um), both ends included.
fn steps(band_um: (f64, f64), step_um: f64) -> Vec<f64> {
    let count = ((band_um.1 - band_um.0) / step_um).round().max(1.0) as usize;
    (0..=count)
        .map(|i| band_um.0 + (band_um.1 - band_um.0) * i as f64 / count as f64)
        .collect()
}

/// The mapping of the design beside the published, fitted, exact and best ones.
fn mappings(
    design: &Design,
    cell: &RigorousCell,
    inverse: &[InverseTrial],
    writable: &[u16],
    options: StudyOptions,
) -> Result<Vec<MappingStudy>> {
    let pitch_nm = f64::from(design.cell.pitch_nm);
    let of_polynomial = |polynomial: &InversePolynomial| {
        let mut mapping = design.mapping.clone();
        mapping.polynomial = polynomial.clone();
        mapping.table = None;
        let rule = PillarRule::new(&design.cell, &mapping);
        MappingTable::sampled(|u| rule.width_nm(u))
    };
    let curve = PhaseCurve::new(cell, design.mapping.wavelength_um, writable)?;
    let best_band = design.mapping_band_um()?;
    let best_curves = steps(best_band, (best_band.1 - best_band.0) / BEST_STEPS)
        .into_iter()
        .map(|l| PhaseCurve::new(cell, l, writable))
        .collect::<Result<Vec<_>>>()?;
    let mut found: Vec<(&'static str, MappingTable, Option<Vec<f64>>)> = Vec::new();
    let mut polynomial = |name, polynomial: &InversePolynomial| {
        found.push((name, of_polynomial(polynomial), Some(polynomial.coefficients.clone())));
    };
    if design.mapping.table.is_none() {
        polynomial("design", &design.mapping.polynomial);
    }
    let published = InversePolynomial::published();
    // The widths of the paper say nothing of another cell.
    if design.cell.is_of_the_paper() {
        polynomial("published", &published);
    }
    let fitted = inverse
        .iter()
        .find(|trial| trial.basis == Basis::AllPowers && trial.degree == FITTED_DEGREE);
    if let Some(fit) = fitted.and_then(|trial| trial.fit.as_ref()) {
        polynomial("fitted", &fit.polynomial);
    }
    let fits = inverse
        .iter()
        .filter(|t| t.basis == Basis::AllPowers && BEST_DEGREES.contains(&t.degree));
    let best = fits
        .filter_map(|trial| trial.fit.as_ref())
        .map(|fit| &fit.polynomial)
        .chain([&published])
        .map(|start| MappingTable::best_polynomial(start, &best_curves, pitch_nm))
        .map(|found| (of_polynomial(&found).first_order(&best_curves), found))
        .reduce(|a, b| if b.0 > a.0 { b } else { a });
    if let Some((_, best)) = &best {
        polynomial("best polynomial", best);
    }
    if let Some(table) = &design.mapping.table {
        let name = if design.mapping.from_cells { SOLVED } else { "design" };
        found.insert(0, (name, table.clone(), None));
    }
    let exact = MappingTable::nearest(&curve, &[])?;
    let led_bad = bad_cells(cell, design.compared_um(), writable, options.threshold)?;
    let avoid: BTreeSet<u16> = led_bad.iter().map(|b| b.width_nm).collect();
    let avoid: Vec<u16> = avoid.into_iter().collect();
    let exchanged = exact.exchanged(&best_curves);
    found.push(("exact", exact, None));
    if avoid.len() < writable.len() {
        found.push((
            "exact, bad widths avoided",
            MappingTable::nearest(&curve, &avoid)?,
            None,
        ));
    }
    found.push(("most light", exchanged, None));

    let band = steps(cell.table().spec().band_um, 0.005);
    found
        .into_iter()
        .map(|(name, table, coefficients)| {
            let orders = |wavelengths: &[f64]| -> Result<Vec<RampOrders>> {
                wavelengths
                    .iter()
                    .map(|&l| table.orders(cell as &dyn CellModel, l))
                    .collect()
            };
            Ok(MappingStudy {
                name,
                phase: table.phase_error(&curve),
                led: orders(design.compared_um())?,
                band: orders(&band)?,
                coefficients,
                table,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_cell::PointwiseCell;
    use metalith_rcwa::Orders;

    /// Diffraction orders along an axis: enough to tell a mapping of this cell from one of another.
    const ORDERS: usize = 5;
    /// Rms errors (rad): at so few orders the shipped table has 0.06, the polynomial that stands beside it, of another cell, 0.5.
    const OWN_RAD: f64 = 0.15;
    const OTHERS_RAD: f64 = 0.3;

    /// A design that maps by a table errs by what its table errs by.
    #[test]
    fn the_error_of_a_table_is_its_own() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/tio2_532.toml");
        let design = Design::read(path.as_ref()).unwrap();
        assert!(design.mapping.table.is_some() && !design.cell.is_of_the_paper());
        let widths: Vec<u16> = design.cell.widths_nm().collect();
        let stack = design.cell_stack().unwrap();
        let cell = PointwiseCell::with_orders(stack, widths.iter().copied(), Orders::new(ORDERS).unwrap());
        let curve = PhaseCurve::new(&cell, design.mapping.wavelength_um, &widths).unwrap();
        let own = error_of_design(&design, &curve).rms_rad;
        let others = round_trip(&design.mapping.polynomial, &curve, f64::from(design.cell.pitch_nm)).rms_rad;
        assert!(own < OWN_RAD && others > OTHERS_RAD, "{own} {others}");
    }
}
