//! `[lens]` and `[phase]`: the lens that all elements share.

use serde::Serialize;

use super::CellSpec;
use crate::phase::{Interpolation, RadialPhase};
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
        let phase = read_phase(phase, focal_length_um, f64::from(diameter_nm) * 0.5e-3);
        Self {
            diameter_nm,
            focal_length_um,
            phase,
        }
    }

    /// Half the diameter (um).
    pub fn radius_um(&self) -> f64 {
        f64::from(self.diameter_nm) * 0.5e-3
    }
}

fn read_phase(s: &Section<'_, '_>, focal_length_um: f64, radius_um: f64) -> RadialPhase {
    #[derive(Clone, Copy)]
    enum PhaseSource {
        Hyperbola,
        EvenPowers,
        Table,
    }
    let sources = [
        ("hyperbola", PhaseSource::Hyperbola),
        ("even_powers", PhaseSource::EvenPowers),
        ("table", PhaseSource::Table),
    ];
    let phase = match s.choice("source", &sources, None) {
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
        PhaseSource::Table => RadialPhase::table(
            s.file("file"),
            s.choice(
                "interpolation",
                &[("linear", Interpolation::Linear), ("nearest", Interpolation::Nearest)],
                Some(Interpolation::Linear),
            ),
        ),
    };
    s.finish();
    phase
}

/// A hundred million turns: beyond it the fraction of a turn has fewer digits in double precision than a layout needs.
const COEFFICIENT: Limits = Limits {
    range: -6e8..=6e8,
    unit: "rad",
};

/// Wavelengths from the ultraviolet to the thermal infrared: a value in um instead of nm falls outside.
pub(super) const WAVELENGTH: Limits = Limits {
    range: 150.0..=20_000.0,
    unit: "nm",
};
