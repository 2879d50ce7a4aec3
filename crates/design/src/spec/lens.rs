//! `[lens]` and `[phase]`: the lens that all elements share.

use serde::Serialize;

use super::{CellSpec, term};
use crate::phase::{Interpolation, PhaseTerm, RadialPhase};
use metalith_core::Lattice;
use metalith_core::document::{Limits, Section};

/// The lens that all elements of the array share.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LensSpec {
    /// Pillars stand where their centre is within this diameter (nm).
    pub diameter_nm: u32,
    /// Distance from the pillar tops to the sensor (um).
    pub focal_length_um: f64,
    /// Phase over the radius, before wedge and modulo.
    pub phase: RadialPhase,
    /// Phases over the plane that are added to it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub terms: Vec<PhaseTerm>,
}

impl LensSpec {
    pub fn read(lens: &Section<'_, '_>, phase: &Section<'_, '_>, cell: &CellSpec) -> Self {
        let diameter_um = lens.float("diameter_um", Limits::new(5.0..=100_000.0, "um"));
        let diameter_nm = (diameter_um * 1e3).round() as u32;
        if (diameter_um * 1e3 - f64::from(diameter_nm)).abs() > 1e-6 {
            lens.fault(
                "diameter_um",
                format!("{diameter_um} um is not whole nanometres"),
                "round it to 0.001 um",
            );
        }
        if Lattice::covering(diameter_nm, cell.pitch_nm).is_err() {
            lens.fault_given(
                &["cell.pitch_nm"],
                "diameter_um",
                "the lens has no sites on this lattice",
                "make it larger than the pitch",
            );
        }
        let focal_length_um = lens.float("focal_length_um", Limits::new(1.0..=100_000.0, "um"));
        lens.finish();
        let radius_um = f64::from(diameter_nm) * 0.5e-3;
        let terms = phase.sections("term");
        let terms = terms
            .iter()
            .map(|s| term::read(s, focal_length_um, radius_um))
            .collect();
        let radial = read_radial(phase, focal_length_um, radius_um);
        phase.finish();
        Self {
            diameter_nm,
            focal_length_um,
            phase: radial,
            terms,
        }
    }

    /// Half the diameter (um).
    pub fn radius_um(&self) -> f64 {
        f64::from(self.diameter_nm) * 0.5e-3
    }
}

/// The phase over the radius that a section says.
pub(super) fn read_radial(s: &Section<'_, '_>, focal_length_um: f64, radius_um: f64) -> RadialPhase {
    #[derive(Clone, Copy)]
    enum PhaseSource {
        Hyperbola,
        EvenPowers,
        Table,
        Flat,
    }
    let sources = [
        ("hyperbola", PhaseSource::Hyperbola),
        ("even_powers", PhaseSource::EvenPowers),
        ("table", PhaseSource::Table),
        ("flat", PhaseSource::Flat),
    ];
    match s.choice("source", &sources, None) {
        PhaseSource::Hyperbola => RadialPhase::Hyperbola {
            wavelength_um: s.float("wavelength_nm", WAVELENGTH) * 1e-3,
            focal_length_um: s
                .optional_float("focal_length_um", Limits::new(1.0..=100_000.0, "um"))
                .unwrap_or(focal_length_um),
        },
        PhaseSource::EvenPowers => {
            let coefficients_rad = s.floats("coefficients_rad", COEFFICIENT);
            if coefficients_rad.is_empty() {
                s.fault(
                    "coefficients_rad",
                    "a phase of even powers needs coefficients",
                    "list those of (r/R)^2, (r/R)^4, ... in radians",
                );
            }
            RadialPhase::EvenPowers {
                coefficients_rad,
                normalisation_um: s
                    .optional_float("normalisation_radius_um", Limits::new(1e-3..=1e6, "um"))
                    .unwrap_or(radius_um),
            }
        }
        PhaseSource::Table => RadialPhase::table(s.file("file"), Interpolation::read(s)),
        PhaseSource::Flat => RadialPhase::Flat,
    }
}

/// A hundred million turns: beyond it the fraction of a turn has fewer digits in double precision than a layout needs.
pub(super) const COEFFICIENT: Limits = Limits {
    range: -6e8..=6e8,
    unit: "rad",
};

/// Wavelengths from the ultraviolet to the thermal infrared: a value in um instead of nm falls outside.
pub(super) const WAVELENGTH: Limits = Limits {
    range: 150.0..=20_000.0,
    unit: "nm",
};
