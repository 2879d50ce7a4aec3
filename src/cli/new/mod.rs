//! `metalith new`: a commented design to start from.

mod like;
mod start_cell;

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::cell::cache_folder;
use metalith::cell_study::{CellRequest, ChosenCell};
use metalith::{AtomicFile, Design, Error, LatticeKind, PillarShape, Pitch, Result, numerical_aperture};

use super::shipped_designs::ShippedDesign;
use super::{Outcome, Terminal, print_line};
use metalith::schema::FileKind;
use start_cell::{Materials, StartCell};

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

/// Steering of arrays where nobody says another (degrees).
const STEERING_DEG: f64 = 15.0;

/// Write a commented design file to start from: pillars, mapping, layout and simulation of a lens for one wavelength.
///
/// Without any option on the pillars and without a wavelength it is the 3 x 3 array of the silicon nitride pillars of the paper, for
/// colour.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  metalith new lens.toml --material tio2 --wavelength-nm 633 --diameter-um 500 --focal-length-um 1000\n  metalith \
                  run lens.toml\n  metalith new mine.toml --diameter-um 200 --focal-length-um 480\n  metalith new pair.toml --like \
                  birefringent_532"
)]
pub(crate) struct NewArgs {
    /// The file to write, which gives the design its name. An existing file is never replaced.
    design: PathBuf,

    /// Elements along x and y, such as 3x3; one if left out.
    #[arg(long, value_name = "NxN", value_parser = array, conflicts_with = "elements")]
    array: Option<(u32, u32)>,

    /// Number of elements along an axis.
    #[arg(long, value_name = "N", hide = true)]
    elements: Option<u32>,

    /// Diameter of a lens (um); 60 if left out.
    #[arg(long, value_name = "UM")]
    diameter_um: Option<f64>,

    /// Focal length (um); 2.4 times the diameter if left out.
    #[arg(long, value_name = "UM")]
    focal_length_um: Option<f64>,

    /// Wavelength of the phase, of the mapping and of the wedges (nm).
    #[arg(long, value_name = "NM")]
    wavelength_nm: Option<f64>,

    /// Steering angle that each step from the centre element adds (degrees); 15 in arrays if left out.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    steering_deg: Option<f64>,

    /// Material of the pillars: a name or formula, such as tio2, sin, a-si, si, gan, or a .csv or refractiveindex.info .yml file. By the
    /// wavelength if left out.
    #[arg(long, value_name = "MATERIAL")]
    material: Option<String>,

    /// Material that light arrives through; fused silica if left out, silicon beyond 3.7 um.
    #[arg(long, value_name = "MATERIAL")]
    substrate: Option<String>,

    /// Cross-section of the pillars; circle if left out.
    #[arg(long, value_name = "SHAPE", value_parser = ["circle", "square"])]
    shape: Option<String>,

    /// Lattice of the pillars; square if left out.
    #[arg(long, value_name = "LATTICE", value_parser = ["square", "hexagonal"])]
    lattice: Option<String>,

    /// Height of the pillars (nm); chosen for a full wave of phase if left out.
    #[arg(long, value_name = "NM")]
    pillar_height_nm: Option<f64>,

    /// Pitch (nm), a multiple of 0.05; chosen below that which diffracts, and for the aperture, if left out. The database unit
    /// follows from it.
    #[arg(long, value_name = "NM", value_parser = pitch)]
    pitch_nm: Option<Pitch>,

    /// Begin with a shipped design and the files that it reads instead: other pillars, lattices, materials, wavelengths, phases and
    /// arrays. With other options it is rescaled: chip and marks follow the lenses, pillars and mapping are chosen anew.
    #[arg(long, value_name = "DESIGN", value_parser = ShippedDesign::names())]
    like: Option<String>,
}

/// Distance of the polygon of an opening from its circle (nm).
fn chord_nm(diameter_um: f64, margin_um: f64) -> f64 {
    // A polygon of n sides is off its circle by R (pi / n)^2 / 2; a few sides fewer than are allowed.
    let side_angle = std::f64::consts::PI / f64::from(MOST_SIDES);
    let opening_nm = (0.5 * diameter_um + margin_um) * 1e3;
    (0.5 * opening_nm * side_angle.powi(2)).ceil().max(FINEST_CHORD_NM)
}

/// Diameters and focal lengths that a design may have (um): refused before a cell is solved for them.
const DIAMETERS_UM: std::ops::RangeInclusive<f64> = 5.0..=100_000.0;
const FOCAL_LENGTHS_UM: std::ops::RangeInclusive<f64> = 1.0..=100_000.0;

/// Shortest and longest pitch of a design (nm).
const PITCHES_NM: std::ops::RangeInclusive<f64> = 100.0..=20_000.0;

/// A pitch.
fn pitch(text: &str) -> Result<Pitch, String> {
    let nm: f64 = text
        .trim()
        .parse()
        .map_err(|_| "give a number of nanometres, such as 350 or 433.3")?;
    if !PITCHES_NM.contains(&nm) {
        return Err(format!("give 100 to 20000 nm, not {nm}"));
    }
    Pitch::of_nm(nm).ok_or_else(|| format!("give a multiple of 0.05 nm, such as {}", (nm * 20.0).round() / 20.0))
}

/// Numbers of elements along x and y.
fn array(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once(['x', 'X', ',']).and_then(|(x, y)| {
        let number = |text: &str| text.trim().parse::<u32>().ok();
        Some((number(x)?, number(y)?))
    });
    let within = parsed.filter(|(x, y)| (1..=99).contains(x) && (1..=99).contains(y));
    within.ok_or_else(|| "give two whole numbers from 1 to 99, such as 3x3".into())
}

impl NewArgs {
    /// True if anything is said of pillars or light.
    fn changes_pillars(&self) -> bool {
        let said = [&self.material, &self.substrate, &self.shape, &self.lattice];
        said.iter().any(|option| option.is_some())
            || self.wavelength_nm.is_some()
            || self.pillar_height_nm.is_some()
            || self.pitch_nm.is_some()
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
        let single = if self.is_for_colour() { 3 } else { 1 };
        let along = self.elements.unwrap_or(single);
        self.array.unwrap_or((along, along))
    }

    fn steering_deg(&self) -> f64 {
        let usual = if self.elements() == (1, 1) && !self.is_for_colour() {
            0.0
        } else {
            STEERING_DEG
        };
        self.steering_deg.unwrap_or(usual)
    }

    /// The pillars, and all that follows from them.
    fn cell(&self, terminal: &Terminal) -> Result<StartCell> {
        if self.is_for_colour() {
            return Ok(StartCell::of_the_paper());
        }
        let (nm, focal_length_um) = (self.wavelength_nm(), self.focal_length_um());
        let is_lens = DIAMETERS_UM.contains(&self.diameter_um()) && FOCAL_LENGTHS_UM.contains(&focal_length_um);
        if !(nm.is_finite() && nm > 0.0 && is_lens && self.steering_deg().abs() < 90.0) {
            return Err(Error::refused(
                "new/out-of-range",
                format!(
                    "a lens of {} um, f = {focal_length_um} um, for {nm} nm",
                    self.diameter_um()
                ),
                "give a diameter from 5 to 100000 um, a focal length from 1 to 100000 um, a positive wavelength and steering of less than \
                 90 degrees",
            ));
        }
        let wavelength_um = nm * 1e-3;
        let folder = self.design.parent().unwrap_or(Path::new(""));
        let materials = Materials::new(
            self.material.as_deref(),
            self.substrate.as_deref(),
            wavelength_um,
            folder,
        )?;
        let (request, cell) = self.choose_cell(
            &materials,
            wavelength_um,
            [self.diameter_um(), focal_length_um],
            (self.elements(), self.steering_deg()),
            (PillarShape::Circle, LatticeKind::Square),
            terminal,
        )?;
        Ok(StartCell::chosen(&request, &cell, &materials))
    }

    /// Pillars chosen for a lens of a diameter and focal length (um) in an array of so many elements with a steering
    /// angle (degrees): what was requested, and the choice. Shape and lattice are those given unless an option says
    /// others.
    fn choose_cell(
        &self,
        materials: &Materials,
        wavelength_um: f64,
        [diameter_um, focal_length_um]: [f64; 2],
        ((x, y), steering_deg): ((u32, u32), f64),
        (shape, lattice): (PillarShape, LatticeKind),
        terminal: &Terminal,
    ) -> Result<(CellRequest, ChosenCell)> {
        let radius_um = 0.5 * diameter_um;
        let steps = 0.5 * f64::from(x.max(y).saturating_sub(1));
        let request = CellRequest {
            film: materials.film.clone(),
            substrate: materials.substrate.clone(),
            wavelength_um,
            shape: match self.shape.as_deref() {
                Some("square") => PillarShape::Square,
                Some(_) => PillarShape::Circle,
                None => shape,
            },
            lattice: match self.lattice.as_deref() {
                Some("hexagonal") => LatticeKind::Hexagonal,
                Some(_) => LatticeKind::Square,
                None => lattice,
            },
            numerical_aperture: numerical_aperture(radius_um, focal_length_um),
            steering_sine: (steps * steering_deg).to_radians().sin().abs(),
            pitch_nm: self.pitch_nm,
            height_nm: self.pillar_height_nm,
        };
        let chosen = request.choose(cache_folder().as_deref(), terminal)?;
        terminal.clear();
        terminal.say(&chosen.mapping.words());
        Ok((request, chosen))
    }

    /// The text of the design.
    fn text(&self, name: &str, cell: &StartCell) -> String {
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
            ("{name}", name.to_owned()),
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

pub(crate) fn run(args: &NewArgs, terminal: &Terminal) -> Result<Outcome> {
    if args.design.exists() {
        return Err(Error::refused(
            "new/exists",
            format!("{} exists", args.design.display()),
            "give another name, or move the file away",
        ));
    }
    if let Some(nm) = args.wavelength_nm
        && nm > 0.0
        && nm < SHORTEST_NM
    {
        return Err(Error::refused(
            "new/out-of-range",
            format!("a lens for {nm} nm"),
            format!("nanometres are meant: {}?", (nm * 1e6).round() / 1e3),
        ));
    }
    let name = args.design.file_stem().unwrap_or_default().to_string_lossy();
    if let Some(like) = &args.like {
        let rescaled = |text| Ok(FileKind::Design.reference() + &args.rescaled(text, &args.design, terminal)?);
        for file in ShippedDesign::of(like).write(&args.design, &name, rescaled)? {
            print_line!("{}", file.display());
        }
        FileKind::Design.write_beside(&args.design)?;
        print_line!("next: metalith run {}", args.design.display());
        return Ok(Outcome::Fine);
    }
    let text = FileKind::Design.reference() + &args.text(&name, &args.cell(terminal)?);
    // What cannot be is said before a file stands there.
    let design = Design::parse_without_library(&args.design, &text)?;
    terminal.warnings(&design.warnings()?);
    AtomicFile::write(&args.design, text.as_bytes())?;
    FileKind::Design.write_beside(&args.design)?;
    print_line!("{}", args.design.display());
    print_line!("next: metalith run {}", args.design.display());
    Ok(Outcome::Fine)
}
