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
use crate::spectra::{SceneSpectrum, rgb_basis};
use crate::studio::Studio;
use crate::veil::{LightShares, Veil};
use crate::{ChannelColours, ChipInLight, ElementView, SceneView, cache, element_views, sampling_of};

/// Field of an element that kernels are made for: the angle from its axis, behind it (degrees). Light that leaves more
/// steeply is the veil's. A lens of the paper sees 60 degrees.
const FIELD_DEG: f64 = 30.0;
/// Nodes an axis of this field.
const NODES: usize = 17;
/// Radius of lenses whose accurate fields cost next to nothing, and whose fast ones err by more (um).
const SMALL_UM: f64 = 150.0;
/// Pixels an axis of a kernel.
const WINDOW: usize = 64;
/// Least share of the light that travels to the sensor in the windows of the kernels: with less there is no image.
/// `prototype_3x3` has 40 %.
const LEAST_IN_WINDOWS: f64 = 0.02;
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
}

impl KeptKernels {
    /// Where this user keeps tables of cells too.
    pub fn of_user() -> Self {
        Self {
            folder: cache_folder(),
            make: true,
        }
    }

    /// In a folder; made if they are not there.
    pub fn made(folder: &Path) -> Self {
        Self {
            folder: Some(folder.join(KERNELS)),
            make: true,
        }
    }

    /// In a folder where they were made.
    pub fn only(folder: &Path) -> Self {
        Self {
            make: false,
            ..Self::made(folder)
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
    /// the array sees, or the user stopped it.
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
    /// As [`Studio::open`]; if nothing may be made and something is not there.
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
                        if let Some(folder) = folder {
                            cache::keep_bank(folder, &inputs, &bank)?;
                        }
                        bank
                    }
                };
                let veil = wanted.veil(&chip, &bank, progress)?;
                if let Some(folder) = folder {
                    cache::keep_veil(folder, &veil_inputs, &veil)?;
                }
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

/// Kernels must hold a part of the light that can be called an image.
fn check_windows(veil: &Veil, bases: usize, channels: &[ChannelSampling], spec: &BankSpec) -> Result<()> {
    for (channel, shares) in channels.iter().zip(veil.budget.chunks(bases)) {
        let all = LightShares::sum(shares);
        let travelling = all.in_kernels + all.veil + all.beyond;
        if all.in_kernels < LEAST_IN_WINDOWS * travelling {
            return Err(Error::invalid(
                format!(
                    "windows of {} pixels of {} um are too small for the images of a point: they hold {:.2} % of the light of channel `{}` that travels to the sensor",
                    spec.window,
                    spec.pixel_um,
                    100.0 * all.in_kernels / travelling.max(f64::MIN_POSITIVE),
                    channel.name
                ),
                "give a sensor with larger pixels, or a layout that images at the distance of the sensor",
            ));
        }
    }
    Ok(())
}

/// A camera must see the chip, and the array the scene.
fn check_view(elements: &[ElementView], spec: &BankSpec, camera: &Camera, view: &SceneView) -> Result<()> {
    if !(view.field_deg > 0.0 && view.field_deg < 175.0 && view.distance_um > 0.0) {
        return Err(Error::invalid(
            format!(
                "a field of {} degrees at a distance of {} um",
                view.field_deg, view.distance_um
            ),
            "give a field from 1 to 174 degrees and a positive distance",
        ));
    }
    let sensor = &camera.sensor;
    let half = [f64::from(sensor.columns), f64::from(sensor.rows)].map(|n| 0.5 * n * sensor.pixel_um);
    // Places of the scene along its border and its middle.
    let seen = |row: f64, column: f64| {
        elements.iter().any(|e| {
            let sines = e.sines(view.tangents(row, column), view.distance_um);
            let um = e.wedge.wavelength_um;
            e.landing_um(sines, um).is_some_and(|p| {
                let on = |a: usize| (p[a] + e.centre_um[a] - sensor.offset_um[a]).abs() <= half[a];
                p.iter().all(|v| v.abs() <= spec.reach_um) && on(0) && on(1)
            })
        })
    };
    let (last_row, last_column) = (view.rows as f64 - 1.0, view.columns as f64 - 1.0);
    if !seen(0.5 * last_row, 0.5 * last_column) {
        return Err(Error::invalid(
            "the camera does not see the chip: the middle of the scene falls beside the sensor",
            "check `offset_um`, `columns` and `rows` of the sensor",
        ));
    }
    // Corners and the middles of the edges: sines grow less than tangents, so that either may be the farther off.
    let (middle_row, middle_column) = (0.5 * last_row, 0.5 * last_column);
    let border = [0.0, middle_row, last_row]
        .into_iter()
        .flat_map(|row| [0.0, middle_column, last_column].map(|column| (row, column)));
    if let Some((row, column)) = border.into_iter().find(|(r, c)| !seen(*r, *c)) {
        let [tx, ty] = view.tangents(row, column);
        return Err(Error::invalid(
            format!(
                "the scene is wider than the array sees: no element sees its border at ({:.1}, {:.1}) degrees and has it on the sensor",
                tx.atan().to_degrees(),
                ty.atan().to_degrees()
            ),
            "give a smaller field of the scene",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_whose_veil_cannot_be_held_is_refused() {
        let mut sensor = Camera::three_bands(5.86).sensor;
        assert!(Veil::check_size(&sensor, 3, 6).is_ok());
        (sensor.rows, sensor.columns) = (100_000, 100_000);
        let error = Veil::check_size(&sensor, 3, 3).unwrap_err().to_string();
        assert!(error.contains("100000 x 100000"), "{error}");
    }

    #[test]
    fn windows_without_an_image_are_refused() {
        let camera = Camera::three_bands(5.86);
        let channels = camera.sampling([400.0, 700.0], 12.5).unwrap().channels;
        let spec = BankSpec {
            pixel_um: 5.86,
            window: WINDOW,
            nodes: 3,
            reach_um: 10.0,
            accurate: false,
        };
        let with = |in_kernels: f64| {
            let mut veil = Veil::none(&camera.sensor, channels.len(), 2);
            for shares in &mut veil.budget {
                *shares = LightShares {
                    arrives: 1.0,
                    in_kernels,
                    veil: 0.5,
                    ..LightShares::default()
                };
            }
            check_windows(&veil, 2, &channels, &spec)
        };
        assert!(with(0.3).is_ok());
        let error = with(0.005).unwrap_err().to_string();
        assert!(error.contains("too small"), "{error}");
    }
}
