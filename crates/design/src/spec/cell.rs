//! `[cell]`: the pillar and what surrounds it.

use serde::Serialize;

use metalith_core::document::{Limits, Section};

/// The unit cell: a square pillar on a square lattice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSpec {
    /// Distance of neighbouring pillars (nm), even.
    pub pitch_nm: u32,
    /// Height of the pillars (nm).
    pub pillar_height_nm: f64,
    /// Narrowest and widest pillar that may be written (nm), both multiples of the step.
    pub width_range_nm: (u16, u16),
    /// Widths are multiples of this (nm), even, so that edges of centred squares are whole nanometres.
    pub width_step_nm: u16,
    /// Name of the pillar's material, or path of a CSV table of n and k.
    pub pillar_material: String,
    /// Name of the substrate's material, or path of a CSV table of n and k.
    pub substrate_material: String,
    /// Refractive index between the pillars and towards the sensor.
    pub ambient_index: f64,
}

/// Longest pitch (nm).
const WIDEST_PITCH_NM: u32 = 2000;

impl CellSpec {
    pub(crate) fn read(s: &Section<'_, '_>) -> Self {
        let pitch_nm = s.integer("pitch_nm", 100..=i64::from(WIDEST_PITCH_NM), "nm") as u32;
        if !pitch_nm.is_multiple_of(2) {
            s.fault(
                "pitch_nm",
                format!("a pitch of {pitch_nm} nm is odd"),
                "use an even number: half a pitch must be whole nanometres",
            );
        }
        let step = s.optional_integer("width_step_nm", 2..=100, "nm").unwrap_or(2) as u16;
        if !step.is_multiple_of(2) {
            s.fault(
                "width_step_nm",
                format!("a width step of {step} nm is odd"),
                "use an even number, so that all edges are on the 1 nm grid",
            );
        }
        // A pitch with a fault bounds nothing.
        let widest = if s.sound(&["cell.pitch_nm"]) {
            pitch_nm
        } else {
            WIDEST_PITCH_NM
        };
        let low = s.integer("width_min_nm", 10..=i64::from(widest), "nm") as u16;
        let high = s.integer("width_max_nm", 10..=i64::from(widest), "nm") as u16;
        for (key, width) in [("width_min_nm", low), ("width_max_nm", high)] {
            if step > 0 && width % step != 0 {
                s.fault_given(
                    &["cell.width_step_nm"],
                    key,
                    format!("{width} nm is not a multiple of the width step"),
                    format!("use a multiple of {step} nm"),
                );
            }
        }
        if low > high {
            s.fault_given(
                &["cell.width_min_nm"],
                "width_max_nm",
                "the widest pillar is narrower than the narrowest",
                "exchange the two",
            );
        }
        // Widths and places are whole nanometres; the key is there so that a design says so.
        s.optional_integer("database_unit_nm", 1..=1, "nm, the only unit that is written");
        let cell = Self {
            pitch_nm: pitch_nm & !1,
            pillar_height_nm: s.float("pillar_height_nm", Limits::new(10.0..=5000.0, "nm")),
            width_range_nm: (low, high),
            width_step_nm: step,
            pillar_material: s
                .optional_text("pillar_material")
                .unwrap_or_else(|| "sin_luke_2015".into()),
            substrate_material: s
                .optional_text("substrate_material")
                .unwrap_or_else(|| "fused_silica_malitson_1965".into()),
            ambient_index: s
                .optional_float("ambient_index", Limits::new(1.0..=3.0, ""))
                .unwrap_or(1.0),
        };
        s.finish();
        cell
    }

    /// All widths that may be written (nm), narrowest first.
    pub fn widths_nm(&self) -> impl Iterator<Item = u16> + use<> {
        (self.width_range_nm.0..=self.width_range_nm.1).step_by(usize::from(self.width_step_nm))
    }
}
