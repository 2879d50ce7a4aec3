//! `metalith new`: a commented design to start from.

use std::path::PathBuf;

use clap::Args;
use metalith::{AtomicFile, Design, Error, Result};

use super::shipped_designs::ShippedDesign;
use super::{Outcome, Terminal, print_line};

/// The design, with braces around what is filled in.
const TEMPLATE: &str = include_str!("new.toml");

/// Marks and the edge of the chip lie this far outside the outermost lens (um): local marks, global marks, edge.
const OUTSIDE_UM: [f64; 3] = [60.0, 150.0, 220.0];

/// Distance from the rim of a lens to the metal (um).
const MARGIN_UM: f64 = 2.0;

/// Sides of an opening, below the 200 vertices that the template allows.
const MOST_SIDES: u32 = 190;

/// Finer than this no writer places an edge of metal (nm).
const FINEST_CHORD_NM: f64 = 5.0;

/// Wavelengths that the cell of silicon nitride is made for (nm).
const VISIBLE_NM: std::ops::RangeInclusive<f64> = 400.0..=700.0;

/// Wavelengths that the cell of amorphous silicon is made for (nm).
const INFRARED_NM: std::ops::RangeInclusive<f64> = 850.0..=1600.0;

/// Designs of the repository whose cells are for other long waves, each up to a wavelength (nm).
const LONGER: [(f64, &str); 3] = [
    (850.0, "asi_940"),
    (2000.0, "hexagonal_1550"),
    (f64::INFINITY, "silicon_10600"),
];

/// The cell that a design begins with, and its mapping.
struct StartCell {
    pillars: &'static str,
    /// The line of `shape`, where pillars are no squares.
    shape: &'static str,
    pitch_nm: f64,
    height_nm: f64,
    widths_nm: [f64; 2],
    film: &'static str,
    film_word: &'static str,
    mapping_nm: f64,
    coefficients: &'static str,
    verify_nm: String,
}

impl StartCell {
    /// Cell for a wavelength (nm).
    fn for_nm(nm: f64) -> Self {
        if !INFRARED_NM.contains(&nm) {
            return Self {
                pillars: "square",
                shape: "",
                pitch_nm: 350.0,
                height_nm: 700.0,
                widths_nm: [100.0, 300.0],
                film: "sin_luke_2015",
                film_word: "SiN",
                mapping_nm: 452.0,
                coefficients: "0.2923, 0.6809, -0.1484",
                verify_nm: "455, 530, 660".into(),
            };
        }
        // The cell of `designs/asi_940.toml`, as much larger as the wave: light sees the same, but for the index of the film.
        let scaled = |nm_at_940: f64| nm_at_940 * nm / 940.0;
        Self {
            pillars: "round",
            shape: "shape = \"circle\"              # widths are diameters\n",
            pitch_nm: 2.0 * scaled(225.0).round(),
            height_nm: scaled(550.0).round(),
            widths_nm: [2.0 * scaled(50.0).floor(), 2.0 * scaled(175.0).ceil()],
            film: "a_si_pierce_1972",
            film_word: "a-Si",
            mapping_nm: nm,
            coefficients: "0.2829, 1.0687, -3.6741, 6.9390, -6.4505, 2.4704",
            verify_nm: nm.to_string(),
        }
    }
}

/// Write a commented design file to start from.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  metalith new mine.toml --diameter-um 200 --focal-length-um 480\n  metalith run mine.toml\n  metalith new pair.toml --like birefringent_532"
)]
pub struct NewArgs {
    /// The file to write, which gives the design its name. An existing file is never replaced.
    design: PathBuf,

    /// Number of elements along an axis.
    #[arg(long, value_name = "N", default_value_t = 3)]
    elements: u32,

    /// Diameter of a lens (um).
    #[arg(long, value_name = "UM", default_value_t = 60.0)]
    diameter_um: f64,

    /// Focal length (um); 2.4 times the diameter if left out.
    #[arg(long, value_name = "UM")]
    focal_length_um: Option<f64>,

    /// Wavelength of the phase and of the wedges (nm). The pillars are silicon nitride for 400 to 700 nm, amorphous
    /// silicon from 850 to 1600 nm.
    #[arg(long, value_name = "NM", default_value_t = 550.0)]
    wavelength_nm: f64,

    /// Steering angle that each step from the centre element adds (degrees).
    #[arg(long, value_name = "DEG", default_value_t = 15.0)]
    steering_deg: f64,

    /// Begin with a shipped design and the files that it reads instead: other pillars, lattices, materials,
    /// wavelengths, phases and arrays.
    #[arg(long, value_name = "DESIGN", value_parser = ShippedDesign::names(), conflicts_with_all = ["elements", "diameter_um",
        "focal_length_um", "wavelength_nm", "steering_deg"])]
    like: Option<String>,
}

impl NewArgs {
    /// The text of the design.
    fn text(&self, name: &str) -> String {
        // Lenses as far apart as in `designs/prototype_3x3.toml`: 2.42 times their diameter, on whole nanometres.
        let spacing_um = (2.42 * self.diameter_um * 1e3).round() * 1e-3;
        let outermost_um = 0.5 * f64::from(self.elements.saturating_sub(1)) * spacing_um + 0.5 * self.diameter_um;
        let [local_um, global_um, edge_um] = OUTSIDE_UM.map(|d| (outermost_um + d).ceil());
        let focal_length_um = self.focal_length_um.unwrap_or(2.4 * self.diameter_um);
        // A polygon of n sides is off its circle by R (pi / n)^2 / 2; a few sides fewer than are allowed.
        let side_angle = std::f64::consts::PI / f64::from(MOST_SIDES);
        let opening_nm = (0.5 * self.diameter_um + MARGIN_UM) * 1e3;
        let chord_nm = (0.5 * opening_nm * side_angle.powi(2)).ceil().max(FINEST_CHORD_NM);
        let cell = StartCell::for_nm(self.wavelength_nm);
        let values = [
            ("{pillars}", cell.pillars.to_owned()),
            ("{shape}", cell.shape.to_owned()),
            ("{pitch_nm}", cell.pitch_nm.to_string()),
            ("{height_nm}", cell.height_nm.to_string()),
            ("{width_min_nm}", cell.widths_nm[0].to_string()),
            ("{width_max_nm}", cell.widths_nm[1].to_string()),
            ("{film}", cell.film.to_owned()),
            // Notes of the two materials below one another.
            ("{after_film}", " ".repeat(32 - cell.film.len())),
            ("{film_word}", cell.film_word.to_owned()),
            ("{mapping_nm}", cell.mapping_nm.to_string()),
            ("{coefficients}", cell.coefficients.to_owned()),
            ("{verify_nm}", cell.verify_nm),
            ("{name}", name.to_owned()),
            ("{elements}", self.elements.to_string()),
            ("{diameter_um}", self.diameter_um.to_string()),
            ("{focal_length_um}", focal_length_um.to_string()),
            ("{wavelength_nm}", self.wavelength_nm.to_string()),
            ("{chord_nm}", chord_nm.to_string()),
            ("{margin_um}", MARGIN_UM.to_string()),
            ("{steering_deg}", self.steering_deg.to_string()),
            ("{spacing_um}", format!("{spacing_um:.3}")),
            ("{chip_um}", (2.0 * edge_um).to_string()),
            ("{global_um}", global_um.to_string()),
            ("{local_um}", local_um.to_string()),
        ];
        values
            .iter()
            .fold(TEMPLATE.to_owned(), |text, (place, value)| text.replace(place, value))
    }
}

pub fn run(args: &NewArgs, terminal: &Terminal) -> Result<Outcome> {
    if args.design.exists() {
        return Err(Error::refused(
            "new/exists",
            format!("{} exists", args.design.display()),
            "give another name, or move the file away",
        ));
    }
    let name = args.design.file_stem().unwrap_or_default().to_string_lossy();
    if let Some(like) = &args.like {
        for file in ShippedDesign::of(like).write(&args.design, &name)? {
            print_line!("{}", file.display());
        }
        print_line!("next: metalith run {}", args.design.display());
        return Ok(Outcome::Fine);
    }
    let text = args.text(&name);
    // What cannot be is said before a file stands there.
    Design::parse(&args.design, &text)?;
    AtomicFile::write(&args.design, text.as_bytes())?;
    let nm = args.wavelength_nm;
    if INFRARED_NM.contains(&nm) {
        terminal.say(&format!(
            "note: [cell] and [mapping] of {} are those of designs/asi_940.toml, as much larger as the wave: let `metalith cells` find \
             the mapping of your film",
            args.design.display(),
        ));
    } else if !VISIBLE_NM.contains(&nm) {
        let longer = LONGER
            .iter()
            .find(|(most_nm, _)| nm > *VISIBLE_NM.end() && nm <= *most_nm);
        let like = longer.map_or(String::new(), |(_, like)| format!("begin with `--like {like}`, or "));
        terminal.say(&format!(
            "note: [cell], [mapping] and [verify] of {} are for {} to {} nm, not for {nm} nm: {like}change them, and let `metalith \
             cells` find the mapping",
            args.design.display(),
            VISIBLE_NM.start(),
            VISIBLE_NM.end(),
        ));
    }
    print_line!("{}", args.design.display());
    match INFRARED_NM.contains(&nm) || VISIBLE_NM.contains(&nm) {
        true => print_line!("next: metalith run {}", args.design.display()),
        false => print_line!("next: change it, then metalith run {}", args.design.display()),
    }
    Ok(Outcome::Fine)
}
