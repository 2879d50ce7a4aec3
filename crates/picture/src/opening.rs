//! How a studio is opened: kernels and veil of a chip made, or taken from the disk.

use std::path::{Path, PathBuf};

use metalith_camera::{Camera, ChannelSampling};
use metalith_cell::{Fidelity, cache_folder};
use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result};
use metalith_design::{Design, cell_models};
use metalith_gds::extract::Extraction;
use metalith_layout::read_pillars;
use metalith_made::{CalibratedModel, MadeChip, SimulationCase};
use serde::Serialize;

use crate::assumed::Assumed;
use crate::kernels::{BankSpec, KernelBank};
use crate::restore::LearnedDenoiser;
use crate::scene::SceneImage;
use crate::sight::{check_coverage, check_view, check_windows};
use crate::spectra::{SceneSpectrum, rgb_basis};
use crate::studio::Studio;
use crate::veil::Veil;
use crate::{ChannelColours, ChipInLight, ElementView, cache, element_views, sampling_of};

/// Field of an element that kernels are made for: the angle from its axis, behind it (degrees). Light that leaves more
/// steeply is the veil's. A lens of the paper sees 60 degrees.
const FIELD_DEG: f64 = 30.0;
/// Nodes an axis of this field.
const NODES: usize = 17;
/// Radius of lenses whose accurate fields cost next to nothing, and whose fast ones err by more (um).
const SMALL_UM: f64 = 150.0;
/// Pixels an axis of a kernel.
const WINDOW: usize = 64;
/// Folder of kernels within that of a plan.
const KERNELS: &str = "kernels";

impl BankSpec {
    /// For the elements of a design before a camera.
    pub fn standard(design: &Design, camera: &Camera) -> Self {
        Self {
            pixel_um: camera.sensor.pixel_um,
            window: WINDOW,
            nodes: NODES,
            reach_um: design.lens.focal_length_um * FIELD_DEG.to_radians().tan(),
            accurate: design.lens.radius_um() < SMALL_UM,
        }
    }
}

/// Where kernels and veil are kept between runs.
#[derive(Clone, Debug)]
pub struct KeptKernels {
    /// Nowhere, if left out.
    folder: Option<PathBuf>,
    make: bool,
    /// Whether the folder was asked for: what cannot be kept there is an error. That of a user only saves time.
    asked: bool,
}

impl KeptKernels {
    /// Where this user keeps tables of cells too.
    pub fn of_user() -> Self {
        Self {
            folder: cache_folder(),
            make: true,
            asked: false,
        }
    }

    /// In a folder; made if they are not there.
    pub fn made(folder: &Path) -> Self {
        Self {
            folder: Some(folder.join(KERNELS)),
            make: true,
            asked: true,
        }
    }

    /// In a folder where they were made.
    pub fn only(folder: &Path) -> Self {
        Self {
            make: false,
            ..Self::made(folder)
        }
    }

    /// Keep something by what writes it into the folder, if there is one.
    fn keep(&self, what: &str, write: impl FnOnce(&Path) -> Result<()>, progress: &dyn Progress) -> Result<()> {
        match self.folder.as_deref().map(write) {
            Some(Err(error)) if !self.asked => {
                progress.note(&format!("{what} not kept: {error}"));
                Ok(())
            }
            Some(done) => done,
            None => Ok(()),
        }
    }
}

/// What scenes in a camera ask of kernels.
struct Wanted<'a> {
    design: &'a Design,
    camera: &'a Camera,
    scene: &'a SceneImage,
    elements: Vec<ElementView>,
    channels: Vec<ChannelSampling>,
    /// Spectra of the scenes, and the primaries of the restoration among or after them.
    basis: Vec<SceneSpectrum>,
    /// Where the primaries begin.
    primaries: usize,
    spec: BankSpec,
}

/// What decides a bank, as text.
#[derive(Serialize)]
struct Inputs<'a> {
    solver: u32,
    layout: &'a str,
    design: &'a str,
    lens_um: [f64; 2],
    elements: &'a [ElementView],
    camera: &'a Camera,
    model: &'a str,
    /// The cell that pillars are simulated by, and the wavelengths that it has tables of unlike neighbours for.
    fidelity: Fidelity,
    tabulated_um: &'a [f64],
    /// Of pillars that change polarisation, whether an analyser is before the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    analyser: Option<bool>,
    basis: &'a [SceneSpectrum],
    spec: &'a BankSpec,
    scene_distance_um: f64,
}

impl Studio {
    /// For a layout of a design behind a camera file, as drawn or as a calibrated model says, and scenes of a field. Kernels
    /// and veil are kept on the disk.
    ///
    /// # Errors
    /// If elements have lenses of their own, the layout cannot be read, the camera does not see the chip, a scene is wider than
    /// the array sees, a spectral cube has not the wavelengths that the camera counts, kernels or veil are too large, or the user
    /// stopped it. That they cannot be kept is a note to `progress`.
    pub fn open(
        design: &Design,
        layout: &Path,
        camera: &Camera,
        model: Option<&CalibratedModel>,
        scene: &SceneImage,
        progress: &dyn Progress,
    ) -> Result<Self> {
        Self::open_kept(design, layout, camera, model, scene, &KeptKernels::of_user(), progress)
    }

    /// The same with kernels and veil that are kept elsewhere.
    ///
    /// # Errors
    /// As [`Studio::open`]; if nothing may be made and something is not there, or what was made cannot be kept in a folder that
    /// was asked for.
    pub fn open_kept(
        design: &Design,
        layout: &Path,
        camera: &Camera,
        model: Option<&CalibratedModel>,
        scene: &SceneImage,
        kept: &KeptKernels,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let wanted = Wanted::new(design, camera, scene)?;
        progress.begin("reading the layout", 1);
        let inputs = wanted.inputs(&hex(&file_digest(layout)?), model)?;
        let field = format!("{}x{} {}", scene.view.rows, scene.view.columns, scene.view.field_deg);
        let veil_inputs = [&inputs[..], field.as_bytes()].concat();
        let folder = kept.folder.as_deref();
        let bank = folder.and_then(|f| cache::kept_bank(f, &inputs));
        let veil = folder.and_then(|f| cache::kept_veil(f, &veil_inputs));
        let from_cache = [bank.is_some(), veil.is_some()];
        if let (
            KeptKernels {
                folder: Some(folder),
                make: false,
                ..
            },
            [false, _] | [_, false],
        ) = (kept, from_cache)
        {
            return Err(Error::invalid(
                format!("{} does not hold the kernels of this camera", folder.display()),
                "plan the set again; a shard makes no kernels of its own",
            ));
        }
        let (bank, veil) = match (bank, veil) {
            (Some(bank), Some(veil)) => (bank, veil),
            (bank, _) => {
                let extraction = read_pillars(design, layout, progress)?;
                let models;
                let made;
                let case = match model {
                    Some(model) => {
                        made = MadeChip::new(&design.cell_stack()?, model)?;
                        SimulationCase::Made(&made)
                    }
                    None => {
                        models = cell_models(design, &[design.verify.fidelity])?;
                        SimulationCase::Cell(models[0].as_ref())
                    }
                };
                let chip = wanted.chip(&extraction, case, progress)?;
                let bank = match bank {
                    Some(bank) => bank,
                    None => {
                        let bank = wanted.bank(&chip, progress)?;
                        let write = |folder: &Path| cache::keep_bank(folder, &inputs, &bank);
                        kept.keep("the kernels are", write, progress)?;
                        bank
                    }
                };
                let veil = wanted.veil(&chip, &bank, progress)?;
                let write = |folder: &Path| cache::keep_veil(folder, &veil_inputs, &veil);
                kept.keep("the veil is", write, progress)?;
                (bank, veil)
            }
        };
        Ok(Self {
            from_cache,
            ..wanted.studio(bank, veil)?
        })
    }

    /// For pillars that were read and a case that is at hand, such as one of many draws of a chip: nothing is kept on the
    /// disk. `nodes`: places an axis of the field of each element at which kernels are formed, as many as
    /// [`BankSpec::standard`] has if left out.
    ///
    /// # Errors
    /// As [`Studio::open`].
    pub fn of_pillars(
        design: &Design,
        extraction: &Extraction,
        case: SimulationCase<'_>,
        camera: &Camera,
        scene: &SceneImage,
        nodes: Option<usize>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let mut wanted = Wanted::new(design, camera, scene)?;
        wanted.spec.nodes = nodes.unwrap_or(wanted.spec.nodes);
        let chip = wanted.chip(extraction, case, progress)?;
        let bank = wanted.bank(&chip, progress)?;
        let veil = wanted.veil(&chip, &bank, progress)?;
        wanted.studio(bank, veil)
    }
}

impl<'a> Wanted<'a> {
    fn new(design: &'a Design, camera: &'a Camera, scene: &'a SceneImage) -> Result<Self> {
        design.one_lens("the simulation of pictures")?;
        let elements = element_views(design, camera);
        let mut basis = scene.basis.clone();
        let primaries = if basis == rgb_basis() { 0 } else { basis.len() };
        if primaries > 0 {
            basis.extend_from_slice(rgb_basis());
        }
        let spec = BankSpec::standard(design, camera);
        let channels = sampling_of(design, camera)?.channels;
        Veil::check_size(&camera.sensor, channels.len(), basis.len())?;
        if primaries > 0 {
            check_coverage(scene, &channels)?;
        }
        check_view(&elements, &spec, camera, &scene.view)?;
        Ok(Self {
            design,
            camera,
            scene,
            elements,
            channels,
            basis,
            primaries,
            spec,
        })
    }

    /// What decides the kernels of a layout.
    fn inputs(&self, layout: &str, model: Option<&CalibratedModel>) -> Result<Vec<u8>> {
        let lens = &self.design.lens;
        let model_text = model.map_or_else(String::new, |m| format!("{:?}", m.perturbation));
        let mut unexposed = self.camera.clone();
        // What only acts after the light has landed, and the colour of the filter, do not decide kernels.
        unexposed.name = String::new();
        unexposed.exposure = Camera::three_bands(1.0).exposure;
        let inputs = Inputs {
            solver: metalith_cell::kept::solver_of(self.design.cell.shape),
            layout,
            design: &self.design.optics_digest()?,
            lens_um: [lens.radius_um(), lens.focal_length_um],
            elements: &self.elements,
            camera: &unexposed,
            model: &model_text,
            fidelity: model.map_or(self.design.verify.fidelity, |_| Fidelity::Calibrated),
            tabulated_um: &self.design.verify.wavelengths_um,
            analyser: (self.design.cell.shape.rectangles()).map(|_| self.design.verify.analyser),
            basis: &self.basis,
            spec: &self.spec,
            // JSON knows no infinity.
            scene_distance_um: self.scene.view.distance_um.min(f64::MAX),
        };
        serde_json::to_vec(&inputs).map_err(|e| Error::invalid(e.to_string(), "report this"))
    }

    fn chip<'c>(
        &self,
        extraction: &'c Extraction,
        case: SimulationCase<'c>,
        progress: &dyn Progress,
    ) -> Result<ChipInLight<'c>> {
        let distance_um = self.scene.view.distance_um;
        ChipInLight::new(self.design, extraction, case, self.camera, distance_um, progress)
    }

    fn bank(&self, chip: &ChipInLight<'_>, progress: &dyn Progress) -> Result<KernelBank> {
        KernelBank::build(chip, &self.basis, self.spec, progress)
    }

    fn veil(&self, chip: &ChipInLight<'_>, bank: &KernelBank, progress: &dyn Progress) -> Result<Veil> {
        Veil::build(chip, bank, &self.basis, &self.camera.sensor, &self.scene.view, progress)
    }

    fn studio(self, bank: KernelBank, veil: Veil) -> Result<Studio> {
        check_windows(&veil, bank.bases, &self.channels, &bank.spec)?;
        let studio = Studio {
            design: self.design.clone(),
            camera: self.camera.clone(),
            bank,
            veil,
            elements: self.elements,
            colours: ChannelColours::of(&self.channels),
            channels: self.channels,
            basis: self.basis,
            scene_spectra: self.scene.basis.len(),
            primaries: self.primaries,
            view: self.scene.view,
            gain: Vec::new(),
            from_cache: [false; 2],
            assumed: Assumed::default(),
            prior: LearnedDenoiser::shipped()?,
        };
        studio.exposed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// Holds the notes.
    struct Listener(Mutex<Vec<String>>);

    impl Progress for Listener {
        fn begin(&self, _what: &str, _steps: u64) {}

        fn advance(&self, _steps: u64) {}

        fn note(&self, text: &str) {
            self.0.lock().unwrap().push(text.into());
        }
    }

    #[test]
    fn what_cannot_be_kept_for_a_user_is_a_note() {
        let place = tempfile::tempdir().unwrap();
        // A file stands where a folder should.
        let file = place.path().join("file");
        std::fs::write(&file, "").unwrap();
        let sensor = Camera::three_bands(5.86).sensor;
        let veil = Veil::none(&sensor, 1, 1);
        let write = |folder: &Path| cache::keep_veil(folder, b"inputs", &veil);
        let listener = Listener(Mutex::default());
        let asked = KeptKernels::made(&file);
        assert!(asked.keep("the veil is", write, &listener).is_err());
        let of_user = KeptKernels {
            folder: asked.folder.clone(),
            ..KeptKernels::of_user()
        };
        of_user.keep("the veil is", write, &listener).unwrap();
        let notes = listener.0.into_inner().unwrap();
        assert!(
            notes.len() == 1 && notes[0].starts_with("the veil is not kept: "),
            "{notes:?}"
        );
    }
}
