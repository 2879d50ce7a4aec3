//! A chip, its camera and the field of a scene: everything that pictures of it need, made once or taken from the disk.

use std::path::Path;

use metalith_camera::{Camera, ChannelSampling};
use metalith_cell::{Fidelity, cache_folder};
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result};
use metalith_design::{Design, cell_models};
use metalith_layout::read_pillars;
use metalith_made::{CalibratedModel, MadeChip, SimulationCase};
use ndarray::{Array2, Array3};
use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::assumed::Assumed;
use crate::exposure::{Frame, expose, gains, sensitivity};
use crate::kernels::{BankSpec, KernelBank};
use crate::operator::{Detail, FrameOperator, SceneInputs, ScenePoints};
use crate::restore::{
    LearnedDenoiser, Recorded, RestorationMethod, SceneStatistics, restore_joint, restore_samples, restore_separate,
};
use crate::scene::SceneImage;
use crate::spectra::{SceneSpectrum, rgb_basis};
use crate::veil::{LightShares, Veil};
use crate::{ChannelColours, ChipInLight, ElementView, SceneSpace, SceneView, cache, element_views, sampling_of};

/// What pictures are taken with.
#[derive(Clone)]
pub struct Studio {
    pub design: Design,
    pub camera: Camera,
    pub bank: KernelBank,
    pub veil: Veil,
    pub elements: Vec<ElementView>,
    pub channels: Vec<ChannelSampling>,
    /// Spectra of the bank: those of the scenes, and the primaries of the restoration among or after them.
    pub basis: Vec<SceneSpectrum>,
    /// How many of them are the scenes'.
    scene_spectra: usize,
    /// Where the primaries begin.
    primaries: usize,
    pub view: SceneView,
    /// Signal of a unit of light in each channel.
    pub gain: Vec<f64>,
    pub colours: ChannelColours,
    /// Whether kernels and veil were found on the disk.
    pub from_cache: [bool; 2],
    /// What is assumed instead of what is known; nothing, unless asked for.
    pub assumed: Assumed,
    /// What is known of pictures from photographs; as it comes with the program, unless another is put here.
    pub prior: LearnedDenoiser,
}

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
    basis: &'a [SceneSpectrum],
    spec: &'a BankSpec,
    scene_distance_um: f64,
}

/// SHA-256 of a file, read piece by piece.
fn digest(path: &Path) -> Result<String> {
    let mut file = std::fs::File::open(path).map_err(Error::io("read", path))?;
    let mut hasher = Sha256::new();
    std::io::copy(&mut file, &mut hasher).map_err(Error::io("read", path))?;
    Ok(hex(&hasher.finalize()))
}

impl Studio {
    /// For a layout of a design behind a camera file, as drawn or as a calibrated model says, and scenes of a field.
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
        design.one_lens("the simulation of pictures")?;
        let elements = element_views(design, camera);
        let channels = sampling_of(design, camera)?.channels;
        let mut basis = scene.basis.clone();
        let primaries = if basis == rgb_basis() { 0 } else { basis.len() };
        if primaries > 0 {
            basis.extend_from_slice(rgb_basis());
        }
        let spec = BankSpec::standard(design, camera);
        check_view(&elements, &spec, camera, &scene.view)?;
        progress.begin("reading the layout", 1);
        let layout_digest = digest(layout)?;
        let model_text = model.map_or_else(String::new, |m| format!("{:?}", m.perturbation));
        let mut unexposed = camera.clone();
        // What only acts after the light has landed, and the colour of the filter, do not decide kernels.
        unexposed.name = String::new();
        unexposed.exposure = Camera::three_bands(1.0).exposure;
        let inputs = Inputs {
            solver: metalith_cell::kept::solver_of(design.cell.shape),
            layout: &layout_digest,
            design: &design.digest(),
            lens_um: [design.lens.radius_um(), design.lens.focal_length_um],
            elements: &elements,
            camera: &unexposed,
            model: &model_text,
            basis: &basis,
            spec: &spec,
            // JSON knows no infinity.
            scene_distance_um: scene.view.distance_um.min(f64::MAX),
        };
        let inputs = serde_json::to_vec(&inputs).map_err(|e| Error::invalid(e.to_string(), "report this"))?;
        let field = format!("{}x{} {}", scene.view.rows, scene.view.columns, scene.view.field_deg);
        let veil_inputs = [&inputs[..], field.as_bytes()].concat();
        let folder = cache_folder();
        let bank = folder.as_deref().and_then(|f| cache::kept_bank(f, &inputs));
        let veil = folder.as_deref().and_then(|f| cache::kept_veil(f, &veil_inputs));
        let from_cache = [bank.is_some(), veil.is_some()];
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
                        models = cell_models(design, &[Fidelity::Rigorous])?;
                        SimulationCase::Cell(models[0].as_ref())
                    }
                };
                let chip = ChipInLight::new(design, &extraction, case, camera, scene.view.distance_um, progress)?;
                let bank = match bank {
                    Some(bank) => bank,
                    None => {
                        let bank = KernelBank::build(&chip, &basis, spec, progress)?;
                        if let Some(folder) = &folder {
                            cache::keep_bank(folder, &inputs, &bank)?;
                        }
                        bank
                    }
                };
                let veil = Veil::build(&chip, &bank, &basis, &camera.sensor, &scene.view, progress)?;
                if let Some(folder) = &folder {
                    cache::keep_veil(folder, &veil_inputs, &veil)?;
                }
                (bank, veil)
            }
        };
        check_windows(&veil, bank.bases, &channels, &bank.spec)?;
        let studio = Self {
            design: design.clone(),
            camera: camera.clone(),
            bank,
            veil,
            elements,
            colours: ChannelColours::of(&channels),
            channels,
            basis,
            scene_spectra: scene.basis.len(),
            primaries,
            view: scene.view,
            gain: Vec::new(),
            from_cache,
            assumed: Assumed::default(),
            prior: LearnedDenoiser::shipped()?,
        };
        studio.exposed()
    }

    /// With the gain of each channel that the exposure of the camera asks for.
    pub(crate) fn exposed(mut self) -> Result<Self> {
        let operator = self.restoration();
        let ones = vec![Array2::<f32>::ones((self.view.rows, self.view.columns)); operator.inputs()];
        let white = operator.apply(&ones);
        drop(operator);
        self.gain = gains(&self.camera, &sensitivity(&self.camera, &self.channels), &white)?;
        Ok(self)
    }

    /// The way from the planes of a scene to a frame.
    pub fn operator(&self, detail: Detail) -> FrameOperator<'_> {
        self.operator_in(&SceneSpace::flat(&self.view), detail)
    }

    fn operator_in(&self, space: &SceneSpace, detail: Detail) -> FrameOperator<'_> {
        let detail = Detail {
            assumed: self.assumed,
            ..detail
        };
        FrameOperator::new(&self.bank, &self.veil, &self.elements, &self.camera, space, detail)
    }

    /// The way from flat scenes to frames, as finely as it is known: what is taken for the truth.
    pub fn simulation(&self) -> FrameOperator<'_> {
        self.operator(Detail::simulation(self.scene_spectra))
    }

    /// The same for one scene, with the distances of its pixels if it has them.
    pub fn simulation_of(&self, scene: &SceneImage) -> FrameOperator<'_> {
        let space = match &scene.depth_um {
            Some(depth) => SceneSpace::with_depth(&self.view, depth),
            None => SceneSpace::flat(&self.view),
        };
        self.operator_in(&space, Detail::simulation(self.scene_spectra))
    }

    /// What a restoration knows of the same way: to it, colours of a scene are sums of three primaries. A camera that
    /// tells no colours apart sees grey.
    pub fn restoration(&self) -> FrameOperator<'_> {
        let primaries = self.primaries();
        let inputs = match self.colours.has_colours() {
            true => SceneInputs::Spectra(primaries),
            false => SceneInputs::Channels(primaries),
        };
        self.operator(Detail {
            statistics: self.colours.has_colours().then(|| SceneStatistics::colours().mixing()),
            ..Detail::restoration(ScenePoints::OneASquare, inputs)
        })
    }

    /// Which spectra of the bank are the primaries of a restoration: red, green and blue.
    pub fn primaries(&self) -> std::ops::Range<usize> {
        self.primaries..self.primaries + rgb_basis().len()
    }

    /// The frame that the sensor records of a scene, noise drawn from a seed.
    ///
    /// # Errors
    /// If the scene has other spectra or another field than this was opened for.
    pub fn record(&self, operator: &FrameOperator<'_>, scene: &SceneImage, seed: u64) -> Result<Frame> {
        if scene.view != self.view || scene.basis.len() != self.scene_spectra {
            return Err(Error::invalid(
                format!(
                    "the scene `{}` has another size, field or spectra than the first",
                    scene.name
                ),
                "give scenes of one size and field at a time",
            ));
        }
        let light = operator.apply(&scene.planes);
        Ok(expose(&self.camera, &self.gain, &light, seed))
    }

    /// The picture restored from a frame, linear sRGB `[row, column, colour]`.
    ///
    /// # Errors
    /// If the frame is of another camera, or the user stopped it.
    pub fn restore(
        &self,
        operator: &FrameOperator<'_>,
        error: &[f64],
        frame: &Frame,
        method: RestorationMethod,
        joint: bool,
        progress: &dyn Progress,
    ) -> Result<Array3<f64>> {
        let known = self.known(operator, error, frame)?;
        let recorded = self.recorded(operator, &known);
        let planes = match joint {
            true => restore_joint(&recorded, method, progress)?,
            false => restore_separate(&recorded, method, progress)?,
        };
        Ok(self.picture(operator, &planes))
    }

    /// Pictures that a frame may be of, one for each seed, linear sRGB `[row, column, colour]`.
    ///
    /// # Errors
    /// If the frame is of another camera, or the user stopped it.
    pub fn samples(
        &self,
        operator: &FrameOperator<'_>,
        error: &[f64],
        frame: &Frame,
        seeds: std::ops::Range<u64>,
        progress: &dyn Progress,
    ) -> Result<Vec<Array3<f64>>> {
        let known = self.known(operator, error, frame)?;
        let recorded = self.recorded(operator, &known);
        let drawn = restore_samples(&recorded, seeds, progress)?;
        Ok(drawn.iter().map(|planes| self.picture(operator, planes)).collect())
    }

    fn recorded<'a>(
        &'a self,
        operator: &'a FrameOperator<'a>,
        [light, trust]: &'a [Vec<Array2<f32>>; 2],
    ) -> Recorded<'a> {
        Recorded {
            operator,
            light,
            trust,
            prior: &self.prior,
        }
    }

    /// What a frame says: its light, and how far each pixel is to be trusted.
    fn known(&self, operator: &FrameOperator<'_>, error: &[f64], frame: &Frame) -> Result<[Vec<Array2<f32>>; 2]> {
        frame.is_of(operator.frame(), self.gain.len())?;
        Ok(frame.light(&self.camera, error).into())
    }

    /// Planes of a restoration in linear sRGB `[row, column, colour]`.
    fn picture(&self, operator: &FrameOperator<'_>, planes: &[Array2<f32>]) -> Array3<f64> {
        match operator.sees_colours() {
            true => Array3::from_shape_fn((self.view.rows, self.view.columns, 3), |(y, x, c)| {
                f64::from(planes[c][[y, x]])
            }),
            false => self.colours.rgb(planes),
        }
    }

    /// A frame as a picture without any restoration, linear sRGB `[row, column, colour]`: pixels where they look, over those
    /// of a white scene.
    pub fn unrestored(&self, operator: &FrameOperator<'_>, frame: &Frame) -> Array3<f64> {
        let (light, trust) = frame.light(&self.camera, &vec![0.0; self.gain.len()]);
        self.colours.rgb(&operator.unrestored(&light, &trust))
    }

    /// What a perfect camera with these channels would give of a scene: the truth that pictures are held to.
    pub fn truth(&self, scene: &SceneImage) -> Array3<f64> {
        self.colours.rgb(&ChannelColours::ideal(&self.channels, scene))
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
