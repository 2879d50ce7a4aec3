//! `[cell]`: the pillar and what surrounds it.

use serde::Serialize;

use super::lens::WAVELENGTH;
use metalith_cell::InversePolynomial;
use metalith_core::PillarShape;
use metalith_core::document::{Limits, Section};

/// The unit cell: a pillar on a square lattice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSpec {
    /// Distance of neighbouring pillars (nm), even.
    pub pitch_nm: u32,
    /// Cross-section of the pillars.
    #[serde(skip_serializing_if = "PillarShape::is_square")]
    pub shape: PillarShape,
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
    /// Material there, over [`CellSpec::ambient_index`]: a name or the path of a CSV table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient_material: Option<String>,
    /// What lies between substrate and pillars, from the substrate upwards.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub under: Vec<UnderSpec>,
    /// Wavelengths that the cell is tabulated over (um), if the design says so. Decides nothing of the layout.
    #[serde(skip)]
    pub band_um: Option<(f64, f64)>,
}

/// A layer without structure under the pillars.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnderSpec {
    /// Name of its material, or path of a CSV table of n and k.
    pub material: String,
    /// Thickness (nm).
    pub height_nm: f64,
}

/// Longest pitch (nm): that of pillars for the thermal infrared.
const WIDEST_PITCH_NM: u32 = 20_000;

/// Materials of a design that names none.
const DEFAULT_FILM: &str = "sin_luke_2015";
const DEFAULT_SUBSTRATE: &str = "fused_silica_malitson_1965";

/// Tallest pillar and thickest layer (nm).
const TALLEST_NM: f64 = 50_000.0;

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
        let pillar_material = s
            .optional_text("pillar_material")
            .unwrap_or_else(|| DEFAULT_FILM.into());
        let cell = Self {
            pitch_nm: pitch_nm & !1,
            shape: s.choice("shape", &PillarShape::CHOICES, Some(PillarShape::Square)),
            pillar_height_nm: s.float("pillar_height_nm", Limits::new(10.0..=TALLEST_NM, "nm")),
            width_range_nm: (low, high),
            width_step_nm: step,
            under: read_under(s, &pillar_material),
            band_um: read_band(s),
            pillar_material,
            substrate_material: s
                .optional_text("substrate_material")
                .unwrap_or_else(|| DEFAULT_SUBSTRATE.into()),
            ambient_index: s
                .optional_float("ambient_index", Limits::new(1.0..=3.0, ""))
                .unwrap_or(1.0),
            ambient_material: s.optional_text("ambient_material"),
        };
        s.finish();
        cell
    }

    /// Whether it is the cell of the paper: square pillars of silicon nitride, 700 nm high on a pitch of 350 nm, on glass, in
    /// air. Published polynomials, and errors that were measured against truth data, are of it.
    pub fn is_of_the_paper(&self) -> bool {
        self.shape.is_square()
            && self.pitch_nm == 350
            && self.pillar_height_nm == 700.0
            && self.pillar_material == DEFAULT_FILM
            && self.substrate_material == DEFAULT_SUBSTRATE
            && self.ambient_index == 1.0
            && self.ambient_material.is_none()
            && self.under.is_empty()
    }

    /// Whether a mapping asks only for widths that may be written, to within half a step.
    pub fn fits(&self, mapping: &InversePolynomial) -> bool {
        let (low, high) = mapping.range();
        let pitch = f64::from(self.pitch_nm);
        let (narrow, wide) = self.width_range_nm;
        let half_step = f64::from(self.width_step_nm) / 2.0;
        low * pitch >= f64::from(narrow) - half_step && high * pitch <= f64::from(wide) + half_step
    }

    /// All widths that may be written (nm), narrowest first.
    pub fn widths_nm(&self) -> impl Iterator<Item = u16> + use<> {
        (self.width_range_nm.0..=self.width_range_nm.1).step_by(usize::from(self.width_step_nm))
    }
}

/// A spacer on the substrate, then what the etch left of the film.
fn read_under(s: &Section<'_, '_>, pillar_material: &str) -> Vec<UnderSpec> {
    let height = |key: &str| {
        s.optional_float(key, Limits::new(0.0..=TALLEST_NM, "nm"))
            .unwrap_or(0.0)
    };
    let spacer_nm = height("spacer_nm");
    let spacer = s.optional_text("spacer_material");
    if spacer_nm > 0.0 && spacer.is_none() {
        s.fault(
            "spacer_nm",
            "a spacer of no material",
            "add `spacer_material`: a name or the path of a CSV table",
        );
    }
    let layers = [
        (spacer.unwrap_or_default(), spacer_nm),
        (pillar_material.to_owned(), height("residual_nm")),
    ];
    let layers = layers.into_iter().filter(|(_, height_nm)| *height_nm > 0.0);
    layers
        .map(|(material, height_nm)| UnderSpec { material, height_nm })
        .collect()
}

/// The band, shortest wavelength first.
pub(super) fn read_band(s: &Section<'_, '_>) -> Option<(f64, f64)> {
    if !s.has("band_nm") {
        return None;
    }
    let [short, long] = s.array::<2>("band_nm", WAVELENGTH);
    if short >= long {
        s.fault(
            "band_nm",
            format!("a band from {short} to {long} nm"),
            "give the shortest wavelength first, then the longest",
        );
    }
    Some((short * 1e-3, long * 1e-3))
}
