//! A new design: the commented text of a design file, from the few numbers that a lens is asked by. Pillars are chosen for
//! material, wavelength and aperture; each choice is written with its reason.

mod start_cell;

use std::path::Path;

use crate::cell::cache_folder;
use crate::cell_study::{CellRequest, ChosenCell};
use crate::design::{DIAMETER, FOCAL_LENGTH};
use crate::report::sig;
use crate::{Error, LatticeKind, PillarShape, Pitch, Progress, Result, numerical_aperture};

pub(crate) use start_cell::Materials;
use start_cell::StartCell;

/// The design, with braces around what is filled in.
const TEMPLATE: &str = include_str!("template.toml");

/// Marks and the edge of the chip lie this far outside the outermost lens (um): local marks, global marks, edge.
const OUTSIDE_UM: [f64; 3] = [60.0, 150.0, 220.0];

/// Distance from the rim of a lens to the metal (um).
const MARGIN_UM: f64 = 2.0;

/// Sides of an opening, below the 200 vertices that the template allows.
const MOST_SIDES: u32 = 190;

/// Finer than this no writer places an edge of metal (nm).
const FINEST_CHORD_NM: f64 = 5.0;

/// Shorter wavelengths are micrometres (nm).
const SHORTEST_NM: f64 = 10.0;

/// Ratios of focal length and diameter of a lens. Beyond these one of both is in another unit: f/0.1 is an aperture of 0.98.
const F_NUMBERS: std::ops::RangeInclusive<f64> = 0.1..=1000.0;

/// Narrowest pillar that a design file takes (nm).
const NARROWEST_NM: u16 = 10;

/// Shortest and longest pitch of a design (nm).
const PITCHES_NM: std::ops::RangeInclusive<f64> = 100.0..=20_000.0;

/// Steering of arrays where nobody says another (degrees).
const STEERING_DEG: f64 = 15.0;

/// What is asked of a new design. What is left out is chosen; with nothing said of pillars and light it is an array of the silicon
/// nitride pillars of the paper (Chakravarthula et al. 2023), for colour.
#[derive(Clone, Debug, Default)]
pub struct NewDesign {
    /// Elements along x and y; one if left out, in colour 3 x 3.
    pub elements: Option<(u32, u32)>,
    /// Diameter of a lens (um); 60 if left out.
    pub diameter_um: Option<f64>,
    /// Focal length (um); 2.4 times the diameter if left out.
    pub focal_length_um: Option<f64>,
    /// Wavelength of the phase, of the mapping and of the wedges (nm); 550 if left out.
    pub wavelength_nm: Option<f64>,
    /// Steering angle that each step from the centre element adds (degrees); 15 in arrays if left out.
    pub steering_deg: Option<f64>,
    /// Material of the pillars, a name, a formula or a table, and that which light arrives through; by the wavelength if left out.
    pub material: Option<String>,
    pub substrate: Option<String>,
    /// Cross-section and lattice; circles on a square lattice if left out.
    pub shape: Option<PillarShape>,
    pub lattice: Option<LatticeKind>,
    /// Height, pitch, narrowest and widest pillar (nm); chosen if left out.
    pub pillar_height_nm: Option<f64>,
    pub pitch_nm: Option<Pitch>,
    pub width_min_nm: Option<u16>,
    pub width_max_nm: Option<u16>,
}

/// Reason why a design is refused, with the remedy.
struct Refusal {
    id: &'static str,
    what: String,
    hint: String,
}

const OUT_OF_RANGE: &str = "new/out-of-range";

/// The text of a new design, and a sentence on its mapping where its pillars were chosen.
#[derive(Clone, Debug)]
pub struct NewDesignText {
    pub text: String,
    pub mapping: Option<String>,
}

/// A pitch of so many nanometres.
///
/// # Errors
/// If a design cannot have it, with what must be given instead.
pub fn pitch_of_nm(nm: f64) -> Result<Pitch, String> {
    if !PITCHES_NM.contains(&nm) {
        return Err(format!("give 100 to 20000 nm, not {nm}"));
    }
    Pitch::of_nm(nm).ok_or_else(|| format!("give a multiple of 0.05 nm, such as {}", (nm * 20.0).round() / 20.0))
}

/// Distance of the polygon of an opening from its circle (nm).
pub(crate) fn chord_nm(diameter_um: f64, margin_um: f64) -> f64 {
    // A polygon of n sides is off its circle by R (pi / n)^2 / 2; a few sides fewer than are allowed.
    let side_angle = std::f64::consts::PI / f64::from(MOST_SIDES);
    let opening_nm = (0.5 * diameter_um + margin_um) * 1e3;
    (0.5 * opening_nm * side_angle.powi(2)).ceil().max(FINEST_CHORD_NM)
}

impl NewDesign {
    /// True if anything is said of pillars or light.
    pub(crate) fn changes_pillars(&self) -> bool {
        let words = [
            self.material.is_some(),
            self.substrate.is_some(),
            self.shape.is_some(),
            self.lattice.is_some(),
        ];
        let lengths = [
            self.wavelength_nm.is_some(),
            self.pillar_height_nm.is_some(),
            self.pitch_nm.is_some(),
        ];
        let widths = [self.width_min_nm.is_some(), self.width_max_nm.is_some()];
        words.contains(&true) || lengths.contains(&true) || widths.contains(&true)
    }

    /// True if the design is for colour, with the pillars of the paper.
    fn is_for_colour(&self) -> bool {
        !self.changes_pillars()
    }

    fn diameter_um(&self) -> f64 {
        self.diameter_um.unwrap_or(60.0)
    }

    fn focal_length_um(&self) -> f64 {
        self.focal_length_um.unwrap_or(2.4 * self.diameter_um())
    }

    fn wavelength_nm(&self) -> f64 {
        self.wavelength_nm.unwrap_or(550.0)
    }

    fn elements(&self) -> (u32, u32) {
        let along = if self.is_for_colour() { 3 } else { 1 };
        self.elements.unwrap_or((along, along))
    }

    fn steering_deg(&self) -> f64 {
        let usual = if self.elements() == (1, 1) && !self.is_for_colour() {
            0.0
        } else {
            STEERING_DEG
        };
        self.steering_deg.unwrap_or(usual)
    }

    /// Refuse what no lens has, all of it at once.
    ///
    /// # Errors
    /// With each value that is out of range or in another unit, and limits of widths that no pillars are within.
    pub(crate) fn check(&self) -> Result<()> {
        let found = [
            self.other_units(),
            self.short_wavelength(),
            self.out_of_range(),
            self.narrow_pillars(),
            self.exchanged_widths(),
            self.squares_in_staggered_rows(),
        ];
        let found: Vec<Refusal> = found.into_iter().flatten().collect();
        let Some(first) = found.first() else { return Ok(()) };
        let all = |of: fn(&Refusal) -> &str| found.iter().map(of).collect::<Vec<_>>().join("; ");
        Err(Error::refused(first.id, all(|one| &one.what), all(|one| &one.hint)))
    }

    /// A focal length or diameter that is one of millimetres beside the other.
    fn other_units(&self) -> Option<Refusal> {
        let (focal, diameter) = self.focal_length_um.zip(self.diameter_um)?;
        let f_number = focal / diameter;
        let is_off = focal > 0.0 && diameter > 0.0 && f_number.is_finite() && !F_NUMBERS.contains(&f_number);
        let (name, um) = if f_number < 1.0 {
            ("a focal length", focal)
        } else {
            ("a diameter", diameter)
        };
        is_off.then(|| Refusal {
            id: OUT_OF_RANGE,
            what: format!("a lens of {diameter} um and f = {focal} um, f/{}", sig(f_number, 2)),
            hint: format!(
                "micrometres are meant: {name} of {um} mm is {}? f/{} to f/{} are designed",
                um * 1e3,
                F_NUMBERS.start(),
                F_NUMBERS.end()
            ),
        })
    }

    /// A wavelength that is one of micrometres, or of metres.
    fn short_wavelength(&self) -> Option<Refusal> {
        let nm = self.wavelength_nm.filter(|nm| *nm > 0.0 && *nm < SHORTEST_NM)?;
        // Shorter than a picometre it is in metres.
        let meant = if nm < 1e-3 { nm * 1e9 } else { nm * 1e3 };
        Some(Refusal {
            id: OUT_OF_RANGE,
            what: format!("a lens for {nm} nm"),
            hint: format!("nanometres are meant: {}?", (meant * 1e3).round() / 1e3),
        })
    }

    /// Lengths and angles that no lens has.
    fn out_of_range(&self) -> Option<Refusal> {
        let within = |name: &str, um: f64, range: &std::ops::RangeInclusive<f64>| {
            let hint = format!("give {name} from {} to {} um", range.start(), range.end());
            (!range.contains(&um)).then(|| (format!("{name} of {um} um"), hint))
        };
        let (nm, steering_deg) = (self.wavelength_nm(), self.steering_deg());
        let found = [
            within("a diameter", self.diameter_um(), &DIAMETER.range),
            // One that follows from the diameter is not named beside it.
            self.focal_length_um
                .and_then(|um| within("a focal length", um, &FOCAL_LENGTH.range)),
            (!(nm.is_finite() && nm > 0.0))
                .then(|| (format!("a wavelength of {nm} nm"), "give a positive wavelength".into())),
            (steering_deg.is_nan() || steering_deg.abs() >= 90.0).then(|| {
                let hint = "give steering of less than 90 degrees".into();
                (format!("steering by {steering_deg} degrees"), hint)
            }),
        ];
        let (what, hint): (Vec<String>, Vec<String>) = found.into_iter().flatten().unzip();
        (!what.is_empty()).then(|| Refusal {
            id: OUT_OF_RANGE,
            what: what.join(", "),
            hint: hint.join(", "),
        })
    }

    /// Pillars that no design file takes.
    fn narrow_pillars(&self) -> Option<Refusal> {
        let given = [self.width_min_nm, self.width_max_nm].into_iter().flatten();
        let nm = given.min().filter(|nm| *nm < NARROWEST_NM)?;
        Some(Refusal {
            id: OUT_OF_RANGE,
            what: format!("pillars {nm} nm wide"),
            hint: format!("give widths of {NARROWEST_NM} nm or more"),
        })
    }

    /// Squares on a hexagonal lattice: their cell is solved for circles alone.
    fn squares_in_staggered_rows(&self) -> Option<Refusal> {
        let given = (self.shape == Some(PillarShape::Square)) && self.lattice == Some(LatticeKind::Hexagonal);
        given.then(|| Refusal {
            id: "new/squares-in-staggered-rows",
            what: "square pillars on a hexagonal lattice".into(),
            hint: "give `--shape circle`, or `--lattice square`".into(),
        })
    }

    /// Limits of widths that no pillars are within.
    fn exchanged_widths(&self) -> Option<Refusal> {
        let (least, most) = self
            .width_min_nm
            .zip(self.width_max_nm)
            .filter(|(least, most)| least >= most)?;
        Some(Refusal {
            id: "new/widths-exchanged",
            what: format!("a narrowest pillar of {least} nm and a widest of {most} nm"),
            hint: "give a widest pillar that is wider than the narrowest".into(),
        })
    }

    /// Pillars chosen for a lens of a diameter and focal length (um) in an array of so many elements with a steering
    /// angle (degrees): what was requested, and the choice. Shape and lattice are those given unless an option says
    /// others.
    pub(crate) fn choose_cell(
        &self,
        materials: &Materials,
        wavelength_um: f64,
        [diameter_um, focal_length_um]: [f64; 2],
        ((x, y), steering_deg): ((u32, u32), f64),
        (shape, lattice): (PillarShape, LatticeKind),
        progress: &dyn Progress,
    ) -> Result<(CellRequest, ChosenCell)> {
        let radius_um = 0.5 * diameter_um;
        let steps = 0.5 * f64::from(x.max(y).saturating_sub(1));
        let request = CellRequest {
            film: materials.film.clone(),
            substrate: materials.substrate.clone(),
            wavelength_um,
            shape: self.shape.unwrap_or(shape),
            lattice: self.lattice.unwrap_or(lattice),
            numerical_aperture: numerical_aperture(radius_um, focal_length_um),
            steering_sine: (steps * steering_deg).to_radians().sin().abs(),
            pitch_nm: self.pitch_nm,
            height_nm: self.pillar_height_nm,
            width_min_nm: self.width_min_nm,
            width_max_nm: self.width_max_nm,
        };
        let chosen = request.choose(cache_folder().as_deref(), progress)?;
        Ok((request, chosen))
    }

    /// The text of the design with a name. Paths of materials count from `folder`.
    ///
    /// # Errors
    /// If no pillars make the lens, a material is not known at the wavelength, or the user stopped it: with the number, and the
    /// nearest value that works.
    pub fn text(&self, name: &str, folder: &Path, progress: &dyn Progress) -> Result<NewDesignText> {
        if self.is_for_colour() {
            let text = self.filled(name, &StartCell::of_the_paper());
            return Ok(NewDesignText { text, mapping: None });
        }
        self.check()?;
        let wavelength_um = self.wavelength_nm() * 1e-3;
        let (film, substrate) = (self.material.as_deref(), self.substrate.as_deref());
        let materials = Materials::new(film, substrate, wavelength_um, folder)?;
        let (request, cell) = self.choose_cell(
            &materials,
            wavelength_um,
            [self.diameter_um(), self.focal_length_um()],
            (self.elements(), self.steering_deg()),
            (PillarShape::Circle, LatticeKind::Square),
            progress,
        )?;
        let text = self.filled(name, &StartCell::chosen(&request, &cell, &materials));
        let mapping = Some(cell.mapping.words());
        Ok(NewDesignText { text, mapping })
    }

    /// The template with the pillars of a cell.
    fn filled(&self, name: &str, cell: &StartCell) -> String {
        // Lenses as far apart as in `designs/prototype_3x3.toml`: 2.42 times their diameter, on whole nanometres.
        let spacing_um = (2.42 * self.diameter_um() * 1e3).round() * 1e-3;
        let (x, y) = self.elements();
        let outside = |elements: u32| {
            let outermost_um = 0.5 * f64::from(elements.saturating_sub(1)) * spacing_um + 0.5 * self.diameter_um();
            OUTSIDE_UM.map(|d| (outermost_um + d).ceil())
        };
        let ([local_x, global_x, edge_x], [local_y, global_y, edge_y]) = (outside(x), outside(y));
        let chord_nm = chord_nm(self.diameter_um(), MARGIN_UM);
        let nm = self.wavelength_nm();
        let title = match (x, y) {
            (1, 1) => format!("{} lens for {nm} nm", cell.film_word),
            _ => format!("{x} x {y} array of metalenses"),
        };
        let values = [
            ("{pillars}", cell.pillars.clone()),
            ("{lattice}", cell.lattice.to_owned()),
            ("{cell}", cell.keys.clone()),
            ("{mapping}", cell.mapping.clone()),
            ("{verify}", cell.verify.clone()),
            (
                "{mapping_limit}",
                if self.is_for_colour() { "mapping_phase_rms_max_rad = 0.6   # the published polynomial errs by 0.57 rad rms against RCWA at 452 nm\n" } else { "" }
                .to_owned(),
            ),
            ("{film_word}", cell.film_word.clone()),
            ("{title}", title),
            ("{name}", name.replace('\\', r"\\").replace('"', "\\\"")),
            ("{elements_x}", x.to_string()),
            ("{elements_y}", y.to_string()),
            ("{diameter_um}", self.diameter_um().to_string()),
            ("{focal_length_um}", self.focal_length_um().to_string()),
            ("{wavelength_nm}", nm.to_string()),
            ("{chord_nm}", chord_nm.to_string()),
            ("{margin_um}", MARGIN_UM.to_string()),
            ("{steering_deg}", self.steering_deg().to_string()),
            ("{spacing_um}", format!("{spacing_um:.3}")),
            ("{chip_x}", (2.0 * edge_x).to_string()),
            ("{chip_y}", (2.0 * edge_y).to_string()),
            ("{global_x}", global_x.to_string()),
            ("{global_y}", global_y.to_string()),
            ("{local_x}", local_x.to_string()),
            ("{local_y}", local_y.to_string()),
        ];
        values
            .iter()
            .fold(TEMPLATE.to_owned(), |text, (place, value)| text.replace(place, value))
    }
}
