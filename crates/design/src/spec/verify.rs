//! `[verify]`: what is computed from the written file, and what must hold of it.

use std::path::PathBuf;

use serde::Serialize;

use metalith_cell::{Analyser, Fidelity, OBLIQUE_RECTANGLES, Polarisation, PolarisedLight, PublishedCell};
use metalith_core::document::{Limits, Section};
use metalith_pillars::PolarisationBasis;

use super::CellSpec;
use super::lens::WAVELENGTH;

/// Edge of a sensor pixel where nothing says it (um): that of the camera of the paper.
pub const USUAL_PIXEL_UM: f64 = 5.86;

/// Simulation of the layout that was read back, and the limits of its figures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerifySpec {
    /// Wavelengths of the PSFs (um).
    pub wavelengths_um: Vec<f64>,
    /// Field angles, counted from where an element looks.
    pub field_angles: Vec<FieldAngle>,
    /// The cell that the layout is judged by.
    pub fidelity: Fidelity,
    /// Angle at which light is taken to pass the cells.
    pub incidence: CellIncidence,
    /// Edge of the square window about the chief ray, in samples of one pitch.
    pub window_samples: usize,
    /// Edge of a sensor pixel (um).
    pub pixel_um: f64,
    /// Polarisation of the light that is simulated, where pillars change it and it is not that which they focus.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polarisation: Option<Polarisation>,
    /// Analyser before the sensor, if any, where pillars change polarisation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub analyser: Option<Analyser>,
    /// Camera file that the figures of white light are for; three flat bands where none is named.
    pub camera: Option<PathBuf>,
    pub limits: LimitSpec,
}

/// The angle of incidence that the cells are solved for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CellIncidence {
    /// Along the normal, whatever the field angle; the same cell everywhere.
    Normal,
    /// Oblique incidence: the angle at which light arrives at each element from each field angle, both polarisations; the
    /// cells are solved once for each direction and wavelength.
    #[serde(rename = "oblique")]
    Oblique,
}

/// A direction of light as an element sees it, from the middle of its field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FieldAngle {
    pub x_deg: f64,
    pub y_deg: f64,
}

/// Limits past which a layout is not what was designed. All differences are extracted against designed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LimitSpec {
    /// Pillars whose width differs from the intended one, and pillars missing or extra.
    pub wrong_widths_max: u64,
    /// Shapes on the pillar layer that are not a pillar on the lattice.
    pub foreign_shapes_max: u64,
    /// Root mean square phase error of the mapping, against the phase of pillars in lattices of equals (rad).
    pub mapping_phase_rms_max_rad: f64,
    /// Root mean square phase error of rounding widths to the step (rad).
    pub rounding_phase_rms_max_rad: f64,
    /// Strehl of the layout over that of the unrounded design phase.
    pub strehl_ratio_min: f64,
    /// Strehl ratio of the layout, against the ideal PSF.
    pub strehl_min: f64,
    /// Distance of the centroids (um).
    pub centroid_shift_max_um: f64,
    /// Largest difference of the MTF at half and at all of the finest frequency that the pixels tell.
    pub mtf_difference_max: f64,
    /// Root mean square difference of the PSFs over that of the designed one.
    pub psf_difference_max: f64,
    /// Least contrast of a point of the scene in white light in any channel of the camera, pixel included, along the
    /// worse of x and y.
    pub polychromatic_mtf_min: f64,
    /// Frequency that it counts at (line pairs a millimetre), where it is not half of the finest that the pixels of the camera tell.
    pub polychromatic_mtf_lp_mm: Option<f64>,
    /// Least share of the light of a point, of what arrives in any channel of the camera, in a square of two pixels.
    pub polychromatic_energy_2_pixels_min: f64,
}

impl VerifySpec {
    pub(crate) fn read(s: &Section<'_, '_>, cell: &CellSpec) -> Self {
        let wavelengths_nm = s.floats("wavelengths_nm", WAVELENGTH);
        if wavelengths_nm.is_empty() {
            s.fault(
                "wavelengths_nm",
                "no wavelength to verify at",
                "add `wavelengths_nm`: a list of numbers in nm",
            );
        }
        let x = s.floats("field_x_deg", ANGLE);
        let mut y = s.floats("field_y_deg", ANGLE);
        if s.has("field_y_deg") && y.len() != x.len() {
            s.fault_given(
                &["verify.field_x_deg"],
                "field_y_deg",
                format!("{} angles along y for {} along x", y.len(), x.len()),
                "give one entry for each of `field_x_deg`",
            );
        }
        y.resize(x.len(), 0.0);
        let mut field_angles: Vec<_> = x
            .iter()
            .zip(&y)
            .map(|(&x_deg, &y_deg)| FieldAngle { x_deg, y_deg })
            .collect();
        if field_angles.is_empty() {
            field_angles.push(FieldAngle { x_deg: 0.0, y_deg: 0.0 });
        }
        let spec = Self {
            wavelengths_um: wavelengths_nm.iter().map(|nm| nm * 1e-3).collect(),
            field_angles,
            fidelity: read_fidelity(s, cell),
            incidence: read_incidence(s, cell),
            window_samples: s.integer_or("window_samples", 16..=2048, "samples", 256) as usize,
            pixel_um: s.float_or("pixel_um", Limits::new(0.1..=100.0, "um"), USUAL_PIXEL_UM),
            polarisation: read_polarisation(s, cell),
            analyser: read_analyser(s, cell),
            camera: s.optional_file("camera"),
            limits: LimitSpec::read(s.optional_section("limits").as_ref()),
        };
        s.finish();
        spec
    }

    /// Source and detector of light at pillars that distinguish polarisations.
    pub fn light(&self) -> PolarisedLight {
        PolarisedLight {
            arriving: self.polarisation,
            analyser: self.analyser,
        }
    }
}

/// Angles of linear polarisation, of source and detector.
const AXIS: Limits = Limits::new(-Polarisation::MOST_DEG..=Polarisation::MOST_DEG, "degrees");

/// The light that is simulated, if it is not that which is focused.
fn read_polarisation(s: &Section<'_, '_>, cell: &CellSpec) -> Option<Polarisation> {
    const KEY: &str = "polarisation";
    let named = s.optional_choice_or_float(KEY, &Polarisation::CHOICES, AXIS, Polarisation::Linear)?;
    polarising(s, KEY, "light of a polarisation", cell);
    let usual = cell.focused(None)?.polarisation();
    Some(named).filter(|light| *light != usual)
}

/// Analyser before the sensor.
fn read_analyser(s: &Section<'_, '_>, cell: &CellSpec) -> Option<Analyser> {
    const KEY: &str = "analyser";
    let named = Analyser::CHOICES.map(|(name, one)| (name, Some(one)));
    let choices = [&[("none", None)], &named[..]].concat();
    let analyser = s.optional_choice_or_float(KEY, &choices, AXIS, |deg| Some(Analyser::Linear(deg)))??;
    polarising(s, KEY, "an analyser", cell);
    if analyser == Analyser::Circular && cell.shape.basis() == Some(PolarisationBasis::Linear) {
        s.fault_given(
            &["cell.shape"],
            KEY,
            "a circular analyser behind upright rectangles, which focus no hand",
            "use x, y or the angle of a linear one",
        );
    }
    cell.shape.basis().map(|_| analyser)
}

/// A fault at what counts only for pillars that distinguish polarisations.
fn polarising(s: &Section<'_, '_>, key: &str, what: &str, cell: &CellSpec) {
    if cell.shape.basis().is_none() {
        s.fault_given(
            &["cell.shape"],
            key,
            format!("{what} for {}", cell.shape.plural()),
            "leave it out: it counts for rectangles alone, the others are simulated in light that is not polarised",
        );
    }
}

fn read_incidence(s: &Section<'_, '_>, cell: &CellSpec) -> CellIncidence {
    let choices = [("normal", CellIncidence::Normal), ("oblique", CellIncidence::Oblique)];
    s.renamed("as_lit", "oblique");
    let incidence = s.choice("incidence", &choices, Some(CellIncidence::Normal));
    if incidence == CellIncidence::Oblique && cell.shape.basis().is_some() {
        let [what, hint] = OBLIQUE_RECTANGLES;
        s.fault_given(&["cell.shape"], "incidence", what, hint);
    }
    incidence
}

/// The cell that judges, if it is left out: dissimilar neighbours for the cell that they were compared with real rows
/// of, else equal ones.
fn read_fidelity(s: &Section<'_, '_>, cell: &CellSpec) -> Fidelity {
    let usual = if cell.is_of_the_paper() {
        Fidelity::Neighbours
    } else {
        Fidelity::Rigorous
    };
    let choices = [
        ("neighbours", Fidelity::Neighbours),
        ("rigorous", Fidelity::Rigorous),
        ("fitted", Fidelity::Fitted),
        ("published", Fidelity::Published),
    ];
    let fidelity = s.choice("fidelity", &choices, Some(usual));
    if let Some((what, hint)) = fidelity.refusal(cell.shape, cell.lattice) {
        s.fault_given(&["cell.shape", "cell.lattice"], "fidelity", what, hint);
    } else if fidelity == Fidelity::Published && cell.is_known_to_be_another(s) {
        s.fault("fidelity", PublishedCell::OTHERS, PublishedCell::ANOTHER_CELL);
    }
    fidelity
}

/// Phase errors have this rms if they are random (rad): no limit beyond it fails.
const RANDOM_RMS_RAD: f64 = 1.8;

impl LimitSpec {
    fn read(section: Option<&Section<'_, '_>>) -> Self {
        let mut limits = Self {
            wrong_widths_max: 0,
            foreign_shapes_max: 0,
            mapping_phase_rms_max_rad: 0.3,
            rounding_phase_rms_max_rad: 0.05,
            strehl_ratio_min: 0.0,
            strehl_min: 0.0,
            centroid_shift_max_um: f64::MAX,
            mtf_difference_max: f64::MAX,
            psf_difference_max: f64::MAX,
            polychromatic_mtf_min: 0.0,
            polychromatic_mtf_lp_mm: None,
            polychromatic_energy_2_pixels_min: 0.0,
        };
        let Some(s) = section else { return limits };
        for name in ["mtf_min", "mtf_lp_mm", "energy_2_pixels_min"] {
            s.renamed(&format!("white_{name}"), &format!("polychromatic_{name}"));
        }
        let count = |key, default: u64| s.integer_or(key, 0..=i64::MAX, "", default as i64) as u64;
        let real = |key, unit, default: f64| s.float_or(key, Limits::new(0.0..=f64::MAX, unit), default);
        limits.wrong_widths_max = count("wrong_widths_max", limits.wrong_widths_max);
        limits.foreign_shapes_max = count("foreign_shapes_max", limits.foreign_shapes_max);
        let within = |key, most, unit, default| s.float_or(key, Limits::new(0.0..=most, unit), default);
        limits.mapping_phase_rms_max_rad = within(
            "mapping_phase_rms_max_rad",
            RANDOM_RMS_RAD,
            "rad",
            limits.mapping_phase_rms_max_rad,
        );
        limits.rounding_phase_rms_max_rad = within(
            "rounding_phase_rms_max_rad",
            RANDOM_RMS_RAD,
            "rad",
            limits.rounding_phase_rms_max_rad,
        );
        limits.strehl_ratio_min = within("strehl_ratio_min", 2.0, "", limits.strehl_ratio_min);
        limits.strehl_min = within("strehl_min", 1.0, "", limits.strehl_min);
        limits.centroid_shift_max_um = real("centroid_shift_max_um", "um", limits.centroid_shift_max_um);
        limits.mtf_difference_max = within("mtf_difference_max", 1.0, "", limits.mtf_difference_max);
        limits.psf_difference_max = real("psf_difference_max", "", limits.psf_difference_max);
        let share = |key| s.float_or(key, Limits::new(0.0..=1.0, ""), 0.0);
        limits.polychromatic_mtf_min = share("polychromatic_mtf_min");
        limits.polychromatic_energy_2_pixels_min = share("polychromatic_energy_2_pixels_min");
        limits.polychromatic_mtf_lp_mm = s.optional_float(
            "polychromatic_mtf_lp_mm",
            Limits::new(1.0..=1000.0, "line pairs a millimetre"),
        );
        s.finish();
        limits
    }
}

const ANGLE: Limits = Limits {
    range: -89.0..=89.0,
    unit: "degrees",
};
