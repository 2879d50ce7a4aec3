//! The pillars of a new design as its file says them, each choice with its reason.

use std::path::Path;

use crate::cell_study::{CellRequest, ChosenCell};
use crate::design::MOST_NORMAL_DEG;
use crate::rcwa::Material;
use crate::text::printable;
use crate::{LatticeKind, PillarShape, Result};

/// Materials that are taken where none is named, each up to a wavelength (um), and the word for it.
const FILMS: [(f64, &str); 5] = [
    (0.35, "sin_philipp_1973"),
    (0.4, "gan_barker_1973"),
    (0.85, "sin_luke_2015"),
    (2.0, "a_si_pierce_1972"),
    (f64::INFINITY, "c_si_salzberg_1957"),
];

/// Longest wavelength that light arrives through fused silica at (um); beyond it, through silicon.
const GLASS_UM: f64 = 3.7;

/// Half of the band about the wavelength that `metalith cells` tabulates, over the wavelength.
const BAND: f64 = 0.01;

/// Width of the window of a PSF, in wavelengths over the numerical aperture, and its bounds in samples.
const WINDOW: f64 = 20.0;
const SAMPLES: [f64; 2] = [64.0, 512.0];

/// Film and substrate, by the names that the design has for them.
pub(crate) struct Materials {
    pub film: Material,
    pub substrate: Material,
    names: [String; 2],
    /// True where it was named by the user.
    said: [bool; 2],
}

impl Materials {
    /// Materials that are named, else those for a wavelength (um). Paths count from `folder`.
    pub(crate) fn new(film: Option<&str>, substrate: Option<&str>, wavelength_um: f64, folder: &Path) -> Result<Self> {
        let usual = FILMS.iter().find(|(most_um, _)| wavelength_um <= *most_um);
        let usual = usual.map_or(FILMS[2].1, |(_, name)| name);
        let glass = if wavelength_um <= GLASS_UM {
            "fused_silica_malitson_1965"
        } else {
            "c_si_salzberg_1957"
        };
        let said = [film.is_some(), substrate.is_some()];
        let read = |text: &str| -> Result<(Material, String)> {
            let material = Material::resolve(text, folder)?;
            // It must be known at the wavelength before anything else is said of it.
            material.index(wavelength_um)?;
            let name = if Material::is_table(text) {
                text.to_owned()
            } else {
                material.name().to_owned()
            };
            Ok((material, name))
        };
        let (film, film_name) = read(film.unwrap_or(usual))?;
        let (substrate, substrate_name) = read(substrate.unwrap_or(glass))?;
        Ok(Self {
            film,
            substrate,
            names: [film_name, substrate_name],
            said,
        })
    }

    /// Band about a wavelength (nm), as a list of TOML, where the film is known: that of `metalith cells`.
    pub(crate) fn band_nm(&self, nm: f64) -> Option<String> {
        let (low_um, high_um) = self.film.range_um();
        let low = (nm * (1.0 - BAND)).floor().max((low_um * 1e3).ceil());
        let high = (nm * (1.0 + BAND)).ceil().min((high_um * 1e3).floor());
        (low < high).then(|| format!("[{low}, {high}]"))
    }

    /// Names of film and substrate as a design has them.
    pub(crate) fn names(&self) -> [&str; 2] {
        [&self.names[0], &self.names[1]]
    }

    /// Word for the film in sentences.
    fn film_word(&self) -> String {
        let name = &self.names[0];
        let words = [
            ("sin_", "SiN"),
            ("tio2_", "TiO2"),
            ("a_si_", "a-Si"),
            ("c_si_", "Si"),
            ("gan_", "GaN"),
            ("nb2o5_", "Nb2O5"),
        ];
        let known = words.iter().find(|(begin, _)| name.starts_with(begin));
        known.map_or_else(
            || printable(name).replace(['"', '\\'], ""),
            |(_, word)| (*word).to_owned(),
        )
    }
}

/// The pillars of a new design: texts of its file.
pub(crate) struct StartCell {
    pub pillars: String,
    pub lattice: &'static str,
    pub film_word: String,
    /// Keys of `[cell]`, the section `[mapping]`, keys of `[verify]`.
    pub keys: String,
    pub mapping: String,
    pub verify: String,
}

/// A key and its value, with a note behind.
fn line(key: &str, value: impl std::fmt::Display, note: &str) -> String {
    let said = format!("{key} = {value}");
    match note {
        "" => format!("{said}\n"),
        note => format!("{said:<29} # {note}\n"),
    }
}

/// The database unit with its reason; nothing where it is 1 nm.
fn unit_line(cell: &ChosenCell) -> String {
    let (unit, pitch) = (cell.database_unit, cell.pitch_nm);
    let why = match (unit.divides_half(pitch), unit.divides(pitch)) {
        _ if unit.is_nanometre() => return String::new(),
        (true, _) => format!("the largest of which half of {pitch} nm is a multiple: no pillar is off its place"),
        (_, true) => format!(
            "the largest of which {pitch} nm is a multiple: a pillar stands in the centre, none is off its place"
        ),
        _ => "the finest; pillars are rounded to it".to_owned(),
    };
    line("database_unit_nm", unit, &why)
}

/// Reason for a limit of widths (nm): that it is as asked, or the nearest step to what was asked.
fn in_steps(asked: Option<u16>, taken: u16, why: &str) -> String {
    let origin = match asked {
        None => return why.to_owned(),
        Some(nm) if nm == taken => "as asked".to_owned(),
        Some(nm) => format!("for {nm} as asked, in whole steps"),
    };
    if why.is_empty() {
        origin
    } else {
        format!("{origin}; {why}")
    }
}

impl StartCell {
    /// The silicon nitride pillars of the paper, for colour.
    pub(crate) fn of_the_paper() -> Self {
        let keys = [
            line("pitch_nm", 350, ""),
            line("pillar_height_nm", 700, ""),
            line("width_min_nm", 100, ""),
            line("width_max_nm", 300, ""),
            line(
                "width_step_nm",
                2,
                "even: edges of centred squares are whole nanometres",
            ),
            line("database_unit_nm", 1, ""),
            line(
                "pillar_material",
                "\"sin_luke_2015\"",
                "or a CSV file with wavelength_nm, n, k: measure your film",
            ),
            line(
                "substrate_material",
                "\"fused_silica_malitson_1965\"",
                "light arrives through it",
            ),
            line("ambient_index", "1.0", ""),
        ];
        let mapping = [
            "[mapping]                     # published, for this cell alone; source = \"cells\" solves that of any other\n".to_owned(),
            "                              # duty cycle = sum of coefficients * u^i, u = phase in waves\n".to_owned(),
            line("wavelength_nm", 452, ""),
            line("basis", "\"all_powers\"", ""),
            line("coefficients", "[0.2923, 0.6809, -0.1484]", ""),
        ];
        let verify = [
            line("wavelengths_nm", "[455, 530, 660]", ""),
            line("field_x_deg", "[0, 15]", "from the viewing direction of an element"),
            line("field_y_deg", "[0, 0]", ""),
            line("window_samples", 256, "pitches, centred on the chief ray"),
            line("pixel_um", 5.86, "edge of a sensor pixel"),
            "# camera = \"cameras/gt1930.toml\"   # polychromatic figures by this camera instead of three flat bands\n"
                .to_owned(),
        ];
        Self {
            pillars: "square pillars".into(),
            lattice: "square",
            film_word: "SiN".into(),
            keys: keys.concat(),
            mapping: mapping.concat(),
            verify: verify.concat(),
        }
    }

    /// A cell that was chosen.
    pub(crate) fn chosen(request: &CellRequest, cell: &ChosenCell, materials: &Materials) -> Self {
        // The digits of the wavelength as stated, without the rounding of its unit.
        let nm = (request.wavelength_um * 1e9).round() / 1e6;
        let given = |is_given: bool, why: String| if is_given { format!("as asked; {why}") } else { why };
        let index = |material: &Material| material.index(request.wavelength_um).map_or(1.0, |n| n.re);
        let (shape, pillars) = match request.shape {
            PillarShape::Square => ("square", "square pillars"),
            _ => ("circle", "round pillars"),
        };
        let lattice = match request.lattice {
            LatticeKind::Square => "square",
            LatticeKind::Hexagonal => "hexagonal",
        };
        let mapping = &cell.mapping;
        let source = |material: &Material, said: bool| {
            given(
                said,
                format!("n = {:.3} at {nm} nm; {}", index(material), material.source()),
            )
        };
        let [film, substrate] = [0, 1].map(|k| format!("\"{}\"", materials.names[k].replace('\\', "/")));
        let mut keys = vec![
            line(
                "shape",
                format!("\"{shape}\""),
                "widths are diameters of circles, edges of squares",
            ),
            line("lattice", format!("\"{lattice}\""), ""),
            line(
                "pitch_nm",
                cell.pitch_nm,
                &given(
                    request.pitch_nm.is_some(),
                    format!(
                        "the lattice diffracts into the substrate from {:.1} nm on, the aperture needs {:.1} nm or less",
                        cell.diffracts_nm, cell.nyquist_nm
                    ),
                ),
            ),
            unit_line(cell),
            line(
                "pillar_height_nm",
                cell.height_nm,
                &given(
                    request.height_nm.is_some(),
                    format!(
                        "of {} cells tried: phases of {:.2} waves, {:.2} of the light in the first order",
                        cell.tried, mapping.span_waves, mapping.light.first
                    ),
                ),
            ),
            line(
                "width_min_nm",
                cell.widths_nm.0,
                &in_steps(
                    request.width_min_nm,
                    cell.widths_nm.0,
                    "a guess: ask your cleanroom for its narrowest pillar and gap",
                ),
            ),
            line(
                "width_max_nm",
                cell.widths_nm.1,
                &in_steps(request.width_max_nm, cell.widths_nm.1, ""),
            ),
            line(
                "width_step_nm",
                cell.step_nm,
                "even: edges of centred pillars are whole nanometres",
            ),
            line("pillar_material", film, &source(&materials.film, materials.said[0])),
            line(
                "substrate_material",
                substrate,
                &format!(
                    "light arrives through it; {}",
                    source(&materials.substrate, materials.said[1])
                ),
            ),
            line("ambient_index", "1.0", ""),
        ];
        if let Some(band) = materials.band_nm(nm) {
            keys.push(line(
                "band_nm",
                band,
                "the light of pictures, which `metalith cells` tabulates; decides nothing of the layout",
            ));
        }
        let mapping_text = [
            "[mapping]                     # the width with the nearest phase, without widths that transmit little\n"
                .to_owned(),
            line(
                "source",
                "\"cells\"",
                "solved from [cell] when it is needed, and kept; `metalith cells --write` puts a file in its place",
            ),
            line("wavelength_nm", nm, ""),
        ];
        let aperture = request.numerical_aperture;
        let spot_nm = nm / aperture.max(1e-6);
        let samples = (WINDOW * spot_nm / f64::from(cell.pitch_nm)).clamp(SAMPLES[0], SAMPLES[1]);
        let pixel_um = ((0.25 * spot_nm / 100.0).round() / 10.0).clamp(0.1, 100.0);
        let steered_deg = request.steering_sine.asin().to_degrees();
        let incidence = if steered_deg > MOST_NORMAL_DEG {
            line(
                "incidence",
                "\"oblique\"",
                "cells are solved at the angle of arrival: the outermost elements are steered far",
            )
        } else {
            String::new()
        };
        let verify = [
            line(
                "fidelity",
                "\"rigorous\"",
                "each pillar among equal ones (local periodic approximation)",
            ),
            incidence,
            line("wavelengths_nm", format!("[{nm}]"), ""),
            line(
                "field_x_deg",
                "[0]",
                "from the viewing direction of an element; more angles: [0, 5]",
            ),
            line("field_y_deg", "[0]", ""),
            line(
                "window_samples",
                2.0 * (samples / 2.0).round(),
                "pitches, centred on the chief ray",
            ),
            line(
                "pixel_um",
                pixel_um,
                "edge of a sensor pixel; about a quarter of wavelength over aperture: put yours here",
            ),
        ];
        Self {
            pillars: pillars.into(),
            lattice,
            film_word: materials.film_word(),
            keys: keys.concat(),
            mapping: mapping_text.concat(),
            verify: verify.concat(),
        }
    }
}
