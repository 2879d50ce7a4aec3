//! `metalith new`: a commented design to start from.

mod like;

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use metalith::schema::FileKind;
use metalith::{AtomicFile, Design, Error, LatticeKind, NewDesign, PillarShape, Pitch, Result, pitch_of_nm};

use super::shipped_designs::ShippedDesign;
use super::{Outcome, Terminal, print_line};
use like::Like;

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
    #[arg(long, value_name = "SHAPE", value_parser = one_of(["circle", "square"], [PillarShape::Circle, PillarShape::Square]))]
    shape: Option<PillarShape>,

    /// Lattice of the pillars; square if left out.
    #[arg(long, value_name = "LATTICE", value_parser = one_of(["square", "hexagonal"], [LatticeKind::Square, LatticeKind::Hexagonal]))]
    lattice: Option<LatticeKind>,

    /// Height of the pillars (nm); chosen for a full wave of phase if left out.
    #[arg(long, value_name = "NM")]
    pillar_height_nm: Option<f64>,

    /// Pitch (nm), a multiple of 0.05; chosen below that which diffracts, and for the aperture, if left out. The database unit
    /// follows from it.
    #[arg(long, value_name = "NM", value_parser = pitch)]
    pitch_nm: Option<Pitch>,

    /// Narrowest pillar (nm); a quarter of the pitch and at least 50 nm if left out. Ask your cleanroom.
    #[arg(long, value_name = "NM")]
    width_min_nm: Option<u16>,

    /// Widest pillar (nm); the pitch less a gap of 15 %, at least 50 nm, if left out.
    #[arg(long, value_name = "NM")]
    width_max_nm: Option<u16>,

    /// Begin with a shipped design and the files that it reads instead: other pillars, lattices, materials, wavelengths, phases and
    /// arrays. With other options it is rescaled: chip and marks follow the lenses, pillars and mapping are chosen anew.
    #[arg(long, value_name = "DESIGN", value_parser = ShippedDesign::names())]
    like: Option<String>,
}

/// Lenses of a smaller diameter are rare, and may be meant in millimetres (um).
const SMALL_UM: f64 = 40.0;

/// A pitch.
fn pitch(text: &str) -> Result<Pitch, String> {
    let nm: f64 = text
        .trim()
        .parse()
        .map_err(|_| "give a number of nanometres, such as 350 or 433.3")?;
    pitch_of_nm(nm)
}

/// A word that stands for a value.
fn one_of<T: Copy + Send + Sync + 'static>(
    words: [&'static str; 2],
    values: [T; 2],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(words).map(move |word| values[usize::from(word != words[0])])
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
    fn asked(&self) -> NewDesign {
        NewDesign {
            elements: self.array.or(self.elements.map(|along| (along, along))),
            diameter_um: self.diameter_um,
            focal_length_um: self.focal_length_um,
            wavelength_nm: self.wavelength_nm,
            steering_deg: self.steering_deg,
            material: self.material.clone(),
            substrate: self.substrate.clone(),
            shape: self.shape,
            lattice: self.lattice,
            pillar_height_nm: self.pillar_height_nm,
            pitch_nm: self.pitch_nm,
            width_min_nm: self.width_min_nm,
            width_max_nm: self.width_max_nm,
        }
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
    let asked = args.asked();
    asked.check()?;
    let name = args.design.file_stem().unwrap_or_default().to_string_lossy();
    if let Some(shipped) = &args.like {
        let like = Like {
            shipped,
            path: &args.design,
            asked,
        };
        let rescaled = |text| Ok(FileKind::Design.reference() + &like.rescaled(text, terminal)?);
        for file in ShippedDesign::of(shipped).write(&args.design, &name, rescaled)? {
            print_line!("{}", file.display());
        }
        FileKind::Design.write_beside(&args.design)?;
        print_line!("next: metalith run {}", args.design.display());
        return Ok(Outcome::Fine);
    }
    let folder = args.design.parent().unwrap_or(Path::new(""));
    let made = asked.text(&name, folder, terminal)?;
    if let Some(um) = args.diameter_um.filter(|um| *um < SMALL_UM) {
        terminal.clear();
        terminal.say(&format!(
            "note: a lens of {um} um; micrometres are meant, {um} mm is {}",
            um * 1e3
        ));
    }
    if let Some(mapping) = &made.mapping {
        terminal.clear();
        terminal.say(mapping);
    }
    let text = FileKind::Design.reference() + &made.text;
    // What cannot be is said before a file stands there.
    let design = Design::parse_without_library(&args.design, &text).inspect_err(|_| {
        terminal.clear();
        terminal.say(&format!(
            "{} is not written: the options make a design with mistakes",
            args.design.display()
        ));
    })?;
    terminal.warnings(&design.warnings()?);
    AtomicFile::write(&args.design, text.as_bytes())?;
    FileKind::Design.write_beside(&args.design)?;
    print_line!("{}", args.design.display());
    print_line!("next: metalith run {}", args.design.display());
    Ok(Outcome::Fine)
}
