//! The light that `metalith psf` simulates: wavelengths that were asked for, and what a camera counts.

use metalith::design::{CellFile, USUAL_PIXEL_UM, VISIBLE_UM, band_about};
use metalith::sensor::{Camera, Sampling};
use metalith::verify::white_sampling;
use metalith::{Extraction, Result};

use super::{FidelityArg, PsfArgs};
use crate::cli::Terminal;

/// Wavelengths that are taken where none are named (nm).
const USUAL_NM: [f64; 3] = [455.0, 530.0, 660.0];

/// Distance from pillar tops to sensor where none is stated (um): the focal length of the paper.
pub(super) const USUAL_DISTANCE_UM: f64 = 2400.0;

/// The light that a layout is simulated in.
pub(super) struct PsfLight {
    /// Wavelengths of single PSFs (um).
    pub wavelengths_um: Vec<f64>,
    pub white: Option<WhiteLight>,
}

/// White light for a camera.
pub(super) struct WhiteLight {
    pub camera: Camera,
    /// Sampling of it that is simulated.
    pub sampling: Sampling,
    /// Single wavelengths that stand for its channels (um).
    colours_um: Vec<f64>,
}

impl WhiteLight {
    /// Light that a camera counts behind lenses of these radii and focal lengths (um), as far as cells are known.
    fn of(camera: Camera, known_um: (f64, f64), lenses_um: &[[f64; 2]]) -> Result<Self> {
        let sampling = white_sampling(&camera, [known_um.0 * 1e3, known_um.1 * 1e3], lenses_um)?;
        let [short, long] = sampling.ends_nm();
        let mut colours_nm = USUAL_NM.to_vec();
        if !colours_nm.iter().all(|nm| (short..=long).contains(nm)) {
            colours_nm = sampling.channels.iter().map(|c| (c.mean_um() * 1e3).round()).collect();
        }
        Ok(Self {
            camera,
            sampling,
            colours_um: colours_nm.into_iter().map(|nm| nm * 1e-3).collect(),
        })
    }
}

impl PsfLight {
    /// Wavelengths that have tables of unlike neighbours (um), rising: white light is known between them, and little beyond.
    pub(crate) fn tabulated_um(&self) -> Vec<f64> {
        let of_white = self.white.iter().flat_map(|white| &white.colours_um);
        let mut all: Vec<f64> = self.wavelengths_um.iter().chain(of_white).copied().collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// The band that it lies in (um), as far as materials are known.
    pub(crate) fn band_um(&self, known_um: (f64, f64)) -> (f64, f64) {
        let ends_nm = self.white.iter().flat_map(|white| white.sampling.ends_nm());
        let of_white = ends_nm.map(|nm| nm * 1e-3);
        band_about(self.wavelengths_um.iter().copied().chain(of_white), known_um)
    }
}

impl PsfArgs {
    /// The options with what the design states that `--cell` names, where no option says another.
    #[must_use]
    pub(super) fn with_design(mut self, stated: Option<CellFile>) -> Self {
        let of_design = stated.as_ref().and_then(|file| file.focal_length_um);
        self.distance_um = self.asked_distance_um.or(of_design).unwrap_or(USUAL_DISTANCE_UM);
        if let Some(file) = &stated
            && self.wavelengths_nm.is_empty()
            && self.camera.is_none()
        {
            // Digits as stated, without the rounding of the unit.
            self.wavelengths_nm = file.wavelengths_um.iter().map(|um| (um * 1e9).round() / 1e6).collect();
        }
        self.stated = stated;
        self
    }

    /// Say first which values are guesses.
    pub(super) fn say_guesses(&self, terminal: &Terminal) {
        if self.extract_only {
            return;
        }
        let of_design = self.stated.as_ref().and_then(|file| file.focal_length_um).is_some();
        let is_published = matches!(self.fidelity, FidelityArg::Published) && self.model.is_none();
        // Each guess, and the option that would say it.
        let guesses = [
            (self.stated.is_none() && !is_published)
                .then(|| (format!("pillars of {}", self.pillars()), "`--cell DESIGN.toml`")),
            (self.asked_distance_um.is_none() && !of_design)
                .then(|| (format!("{USUAL_DISTANCE_UM} um to the sensor"), "--distance-um")),
            (self.wavelengths_nm.is_empty() && self.camera.is_none())
                .then(|| ("455, 530 and 660 nm".to_owned(), "--wavelength-nm")),
        ];
        let (guesses, options): (Vec<String>, Vec<&str>) = guesses.into_iter().flatten().unzip();
        if !guesses.is_empty() {
            terminal.say(&format!(
                "assumed, because no option says it: {}; give {}",
                guesses.join("; "),
                options.join(", ")
            ));
        }
    }

    /// The light that the options ask for.
    ///
    /// # Errors
    /// If the camera or a material cannot be used, or a channel counts no light at which the cell is known.
    pub(super) fn light(&self, found: &Extraction) -> Result<PsfLight> {
        let lenses_um = found.elements.iter().map(|e| {
            let [x, y] = e.site.lattice.sides_nm();
            [0.5e-3 * x.max(y) as f64, self.distance_um]
        });
        let lenses_um: Vec<[f64; 2]> = lenses_um.collect();
        let white = match &self.camera {
            Some(file) => Some(WhiteLight::of(Camera::read(file)?, self.known_um(found)?, &lenses_um)?),
            None => None,
        };
        let wavelengths_um = match (self.wavelengths_nm.as_slice(), &white) {
            ([], Some(white)) => white.colours_um.clone(),
            ([], None) => USUAL_NM.map(|nm| nm * 1e-3).to_vec(),
            (named, _) => named.iter().map(|nm| nm * 1e-3).collect(),
        };
        Ok(PsfLight { wavelengths_um, white })
    }

    /// Wavelengths that the cell is known for (um): those of its materials, of the published polynomials the visible.
    fn known_um(&self, found: &Extraction) -> Result<(f64, f64)> {
        if self.model.is_none() && matches!(self.fidelity, FidelityArg::Published) {
            return Ok(VISIBLE_UM);
        }
        Ok(self.stack(found)?.range_um())
    }

    /// Edge of a pixel (um).
    pub(super) fn pixel_um(&self, light: &PsfLight) -> f64 {
        let of_camera = light.white.as_ref().map(|w| w.camera.sensor.pixel_um);
        self.pixel_um.or(of_camera).unwrap_or(USUAL_PIXEL_UM)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use metalith::{Design, PillarShape};

    use super::*;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        psf: PsfArgs,
    }

    /// The options, of a layout that is not there, with the cell of a file of this text.
    fn options(words: &[&str], cell: Option<&str>) -> PsfArgs {
        let words = [&["metalith", "layout.gds"][..], words].concat();
        let options = Program::try_parse_from(words).map_err(|e| e.to_string()).unwrap().psf;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cell.toml");
        let stated = cell.map(|text| {
            std::fs::write(&path, text).unwrap();
            CellFile::read(&path).unwrap()
        });
        PsfArgs { stated, ..options }
    }

    /// Extraction without pillars, of this shape on a square lattice of 350 nm.
    fn nothing(shape: PillarShape) -> Extraction {
        Extraction {
            top: String::new(),
            shape,
            elements: Vec::new(),
            pillars: 0,
            turned_deg: None,
            oddities: Default::default(),
            survey: Default::default(),
        }
    }

    fn camera(name: &str) -> String {
        let file = metalith_testing::root().join(format!("cameras/{name}.toml"));
        file.display().to_string()
    }

    fn um(nm: &[f64]) -> Vec<f64> {
        nm.iter().map(|nm| nm * 1e-3).collect()
    }

    const SILICON: &str = "[cell]\npitch_nm = 350\npillar_height_nm = 700\nwidth_min_nm = 100\nwidth_max_nm = 300\n\
                           pillar_material = \"a_si_pierce_1972\"\n";

    /// Wavelengths, tables and pixels are of the camera, where it does not count the usual light.
    #[test]
    fn light_is_that_of_the_camera() {
        let found = nothing(PillarShape::Circle);
        let light = |words: &[&str]| {
            let options = options(words, Some(SILICON));
            let light = options.light(&found).unwrap();
            let pixel_um = options.pixel_um(&light);
            (light, pixel_um)
        };
        let (infrared, pixel_um) = light(&["--camera", &camera("swir")]);
        assert_eq!((infrared.wavelengths_um, pixel_um), (um(&[1550.0]), 5.0));
        let (both, pixel_um) = light(&[
            "--camera",
            &camera("swir"),
            "--wavelength-nm",
            "1530",
            "--pixel-um",
            "3",
        ]);
        assert_eq!((both.tabulated_um(), pixel_um), (um(&[1530.0, 1550.0]), 3.0));
        let (visible, pixel_um) = light(&["--camera", &camera("gt1930")]);
        assert_eq!((visible.wavelengths_um, pixel_um), (um(&USUAL_NM), 5.86));
        // Silicon nitride of the paper's polynomials says nothing of the infrared.
        let published = options(&["--fidelity", "published", "--camera", &camera("swir")], None);
        assert!(published.light(&found).is_err());
    }

    /// Polynomials are fitted over the light that is asked for, within what materials are known for.
    #[test]
    fn the_band_is_that_of_the_light() {
        let found = nothing(PillarShape::Circle);
        let band = |words: &[&str]| {
            let options = options(words, Some(SILICON));
            let known_um = options.stack(&found).unwrap().range_um();
            options.light(&found).unwrap().band_um(known_um)
        };
        let (short, long) = band(&["--wavelength-nm", "940"]);
        assert!(
            short > 0.91 && short < 0.912 && long > 0.968 && long < 0.97,
            "{short} {long}"
        );
        // The visible of designs, from where the film is known.
        let (short, long) = band(&[]);
        assert!(short > 0.413 && short < 0.414 && long == 0.7, "{short} {long}");
        let (short, long) = band(&["--camera", &camera("swir"), "--wavelength-nm", "1550"]);
        assert!(
            short > 1.45 && short < 1.54 && long > 1.57 && long < 1.65,
            "{short} {long}"
        );
    }

    /// A whole design states the cell, by its section alone.
    #[test]
    fn the_cell_is_that_of_a_design() {
        let path = metalith_testing::design("mini_3x3");
        let text = std::fs::read_to_string(&path).unwrap();
        let own = "[cell]\nspacer_nm = 40\nspacer_material = \"alumina_malitson_dodge_1972\"\nresidual_nm = 25\n";
        let text = metalith_testing::accepting(&text).replacen("[cell]\n", own, 1);
        let text = text.replacen("ambient_index = 1.0", "ambient_index = 1.33", 1);
        let text = text.replacen("pillar_height_nm = 700", "pillar_height_nm = 20000", 1);
        let design = Design::parse(&path, &text).unwrap();
        let options = options(&[], Some(&text));
        let found = nothing(PillarShape::Square);
        let stack = options.stack(&found).unwrap();
        assert_eq!(stack, design.cell_stack().unwrap());
        let pillars = options.pillars();
        assert!(pillars.contains("40 nm of alumina") && pillars.contains("25 nm") && pillars.contains("n = 1.33"));
    }
}
