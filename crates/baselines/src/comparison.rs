//! The cameras of a comparison, from their files.

use std::path::{Path, PathBuf};

use metalith_core::{Error, Progress, Result, part};
use metalith_design::Design;
use metalith_imaging::scene::{SceneImage, read_far_scene};
use metalith_imaging::{ApproximationSet, ImagingSystem, KernelCache, SceneView, check_scored, simulated_view};
use metalith_prior::PerceptualDistance;
use metalith_restoration::RestorationMethod;
use metalith_sensor::{Camera, StatedExposure};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::compare::{ComparedCamera, ComparisonResult, compare};
use crate::lensless::of_one_wavelength;
use crate::post_processing::Stage;
use crate::table::unequal_times;
use crate::{ArrayCamera, BaselineCamera, DiffuserCam, DiffuserSpec, FlatCam, MaskSpec};

/// Comparison: designs, cameras without a lens, photographs, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Comparison {
    /// Sensor, light, exposure and noise of all cameras that name no other.
    pub camera: PathBuf,
    pub designs: Vec<ListedDesign>,
    pub lensless: Vec<Lensless>,
    /// Names of the ways to restore the frames of designs.
    pub methods: Vec<String>,
    /// True for pictures by each element of an array alone too.
    pub separate: bool,
    /// Each design also as the paper assumes such cameras to be, and those without a lens with one wavelength a colour.
    pub paper: bool,
    /// Angle from the left to the right edge of a photograph (degrees).
    pub field_deg: f64,
    /// Seed of the noise.
    pub seed: u64,
    pub photographs: Vec<PathBuf>,
    /// Photographs are cut to the square of so many pixels in their middle.
    #[serde(default)]
    pub pixels: Option<usize>,
    /// Weights of learnt last stages, each behind the cameras that it was trained for.
    #[serde(default)]
    pub learnt: Vec<PathBuf>,
    /// Weights of the learned perceptual distance, if pictures are judged by it.
    #[serde(default)]
    pub lpips: Option<PathBuf>,
    /// Light and time of all cameras, in place of what their files state.
    #[serde(default, skip_serializing_if = "StatedExposure::is_none")]
    pub exposure: StatedExposure,
    /// Illuminances in which the first photograph is also taken (lux).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curve_lux: Vec<f64>,
    /// Times of the exposures that no one states.
    #[serde(default)]
    pub times: ExposureTimes,
}

/// Times of exposures that a camera file leaves to the program (`auto`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ExposureTimes {
    /// One time for all cameras: the shortest after which a white pixel of one of them is bright. No pixel of a white scene is saturated.
    #[default]
    Equal,
    /// Each camera is exposed until a white pixel is bright.
    Own,
}

impl Comparison {
    /// All files that it names: what no result replaces.
    pub fn inputs(&self) -> Vec<PathBuf> {
        let of_designs = self
            .designs
            .iter()
            .flat_map(|d| [&d.design, &d.layout].into_iter().chain(&d.camera));
        let weights = self.learnt.iter().chain(&self.lpips);
        let all = of_designs.chain(&self.photographs).chain(weights).chain([&self.camera]);
        all.cloned().collect()
    }
}

/// A design that is compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ListedDesign {
    /// Name; the name of the design if left out.
    pub name: Option<String>,
    pub design: PathBuf,
    pub layout: PathBuf,
    /// A separate camera.
    pub camera: Option<PathBuf>,
    /// The field that a photograph fills, if it is another.
    pub field_deg: Option<f64>,
}

/// A camera without a lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Lensless {
    /// A mask that is a product of two sequences.
    FlatCam(MaskSpec),
    /// A rough surface.
    DiffuserCam(DiffuserSpec),
}

/// A comparison whose files were read.
pub struct OpenComparison<'a> {
    pub(crate) of: &'a Comparison,
    pub(crate) camera: Camera,
    methods: Vec<RestorationMethod>,
    /// Designs with the camera of each.
    pub(crate) designs: Vec<(Design, Camera)>,
    /// Photographs in the pixels that all cameras are simulated in.
    pub(crate) photographs: Vec<SceneImage>,
    /// View of the photographs as they were given.
    given: SceneView,
    pub(crate) stages: Vec<Stage>,
    /// Perceptual distance that pictures are also scored by.
    perceptual: Option<PerceptualDistance>,
}

/// Callback for a camera that is ready: it, its name and words in the table, its photographs.
pub(crate) type Ready<'f> = dyn FnMut(&dyn BaselineCamera, (&str, &str), &[SceneImage]) -> Result<()> + 'f;

impl Comparison {
    /// Read all files: mistakes before any work.
    ///
    /// # Errors
    /// If nothing is compared, a file cannot be read, or photographs are not of one size.
    pub fn open(&self, progress: &dyn Progress) -> Result<OpenComparison<'_>> {
        if self.designs.is_empty() && self.lensless.is_empty() {
            return Err(Error::refused(
                "compare/no-camera",
                "no camera to compare",
                "give --design, --baselines or both",
            ));
        }
        let methods = self.methods.iter().map(|m| m.parse()).collect::<Result<_>>()?;
        let camera = self.read_camera(&self.camera)?;
        let photographs: Vec<SceneImage> = self
            .photographs
            .iter()
            .map(|p| self.photograph(p))
            .collect::<Result<_>>()?;
        let Some(first) = photographs.first().map(|p| p.view) else {
            return Err(Error::refused(
                "compare/no-photographs",
                "there are no photographs",
                "give at least one photograph",
            ));
        };
        if let Some(other) = photographs.iter().find(|p| p.view != first) {
            return Err(Error::refused(
                "compare/photographs-differ-in-size",
                format!(
                    "`{}` has {} x {} pixels, the first photograph {} x {}",
                    other.name, other.view.columns, other.view.rows, first.columns, first.rows
                ),
                "give photographs of one size",
            ));
        }
        let own = |listed: &ListedDesign| {
            let own = listed.camera.as_deref().map(|p| self.read_camera(p)).transpose()?;
            Ok((
                Design::read_with(&listed.design, progress)?,
                own.unwrap_or_else(|| camera.clone()),
            ))
        };
        let designs: Vec<(Design, Camera)> = self.designs.iter().map(own).collect::<Result<_>>()?;
        let view = self.simulated_view(&designs, first);
        let averaged = |photograph: SceneImage| {
            if view == first {
                photograph
            } else {
                photograph.averaged(&view)
            }
        };
        let open = OpenComparison {
            of: self,
            camera,
            methods,
            designs,
            photographs: photographs.into_iter().map(averaged).collect(),
            given: first,
            stages: self.learnt.iter().map(|p| Stage::read(p)).collect::<Result<_>>()?,
            perceptual: self.lpips.as_deref().map(PerceptualDistance::read).transpose()?,
        };
        open.stages_have_cameras()?;
        if view != first {
            let of_several = if open.designs.len() > 1 {
                ": scores of finer cameras differ from those that they have alone"
            } else {
                ""
            };
            progress.warn(&format!(
                "all photographs are averaged from {} x {} to {} x {} pixels, as finely as the coarsest camera is simulated{of_several}",
                first.columns, first.rows, view.columns, view.rows
            ));
        }
        Ok(open)
    }

    /// The coarsest of the views that designs are simulated in: all cameras take the same photographs.
    fn simulated_view(&self, designs: &[(Design, Camera)], given: SceneView) -> SceneView {
        let own = self.designs.iter().zip(designs).map(|(listed, (design, camera))| {
            let field_deg = listed.field_deg.unwrap_or(given.field_deg);
            simulated_view(design, camera, &SceneView { field_deg, ..given })
        });
        own.min_by_key(|view| view.columns).map_or(given, |view| SceneView {
            field_deg: given.field_deg,
            ..view
        })
    }

    /// Camera of a file, in the light and for the time that all cameras have.
    fn read_camera(&self, path: &Path) -> Result<Camera> {
        Camera::read(path)?.stated(&self.exposure)
    }

    fn photograph(&self, path: &Path) -> Result<SceneImage> {
        let scene = read_far_scene(path, self.field_deg)?;
        match self.pixels {
            Some(pixels) => middle(scene, pixels),
            None => Ok(scene),
        }
    }

    /// Cameras of the table: designs, then those without a lens, each once, or twice with the assumptions of the paper.
    pub fn count(&self) -> usize {
        (self.designs.len() + self.lensless.len()) * self.kinds()
    }

    /// Cameras of the table for each that is listed: with the assumptions of the paper, one more.
    pub(crate) fn kinds(&self) -> usize {
        1 + usize::from(self.paper)
    }
}

/// Time (ms) rounded down to three digits: what is printed is what holds, and no pixel is brighter for it.
fn as_printed(time_ms: f64) -> f64 {
    // Quotients and products of whole numbers print as short numbers.
    let [divided, times] = match 2 - time_ms.log10().floor() as i32 {
        places if places < 0 => [10f64.powi(-places), 1.0],
        places => [1.0, 10f64.powi(places)],
    };
    // A step of slack keeps times that are short numbers.
    let steps = (time_ms / divided * times * (1.0 + 1e-9)).floor();
    (steps * divided / times).max(*StatedExposure::TIMES_MS.start())
}

/// The square of so many pixels in the middle of a scene.
fn middle(mut scene: SceneImage, pixels: usize) -> Result<SceneImage> {
    let SceneView { rows, columns, .. } = scene.view;
    if rows.min(columns) < pixels {
        return Err(Error::refused(
            "compare/photograph-too-small",
            format!("`{}` has {columns} x {rows} pixels, fewer than {pixels}", scene.name),
            "give a smaller --pixels, or larger photographs",
        ));
    }
    let (top, left) = ((rows - pixels) / 2, (columns - pixels) / 2);
    let cut = |plane: &Array2<f32>| part(plane.view(), top..top + pixels, left..left + pixels).to_owned();
    scene.planes = scene.planes.iter().map(cut).collect();
    scene.depth_um = scene.depth_um.as_ref().map(cut);
    (scene.view.rows, scene.view.columns) = (pixels, pixels);
    Ok(scene)
}

impl OpenComparison<'_> {
    /// One time (ms) for all cameras, where it is for the program to choose: the shortest of the times after which a white pixel is bright.
    /// None, and times stay those of the camera files, if [`ExposureTimes::Own`] is asked for, a time or a longest one is stated, no
    /// camera leaves its time to the program, or a learnt stage was trained for the exposure of its camera.
    ///
    /// # Errors
    /// If a camera cannot be made ready, or the user stopped it.
    pub fn equal_time_ms(&self, cache: &KernelCache, progress: &dyn Progress) -> Result<Option<f64>> {
        let stated = self.of.exposure.time_ms.or(self.of.exposure.longest_ms).is_some();
        let own = self.of.times == ExposureTimes::Own || !self.of.learnt.is_empty();
        let cameras = self.designs.iter().map(|(_, camera)| camera);
        let lensless = self.of.lensless.iter().map(|_| &self.camera);
        let is_chosen = cameras.chain(lensless).any(|camera| camera.exposure.auto);
        if own || stated || !is_chosen || self.of.count() < 2 {
            return Ok(None);
        }
        let mut shortest = (f64::INFINITY, String::new());
        for k in 0..self.of.count() {
            self.ready(k, cache, progress, &mut |camera, (name, _), _| {
                let time_ms = camera.light().time_ms;
                if time_ms < shortest.0 {
                    shortest = (time_ms, name.to_owned());
                }
                Ok(())
            })?;
        }
        let time_ms = as_printed(shortest.0);
        progress.warn(&format!(
            "all cameras are exposed for {time_ms} ms, the time of {}; --own-times exposes each until a white pixel is bright",
            shortest.1
        ));
        Ok(Some(time_ms))
    }

    /// This comparison with all cameras exposed for a time (ms); as it is if there is none.
    ///
    /// # Errors
    /// If the time is out of its range.
    pub fn exposed_for(mut self, time_ms: Option<f64>) -> Result<Self> {
        let stated = StatedExposure {
            time_ms,
            ..StatedExposure::default()
        };
        self.camera = self.camera.stated(&stated)?;
        for (_, camera) in &mut self.designs {
            *camera = camera.clone().stated(&stated)?;
        }
        Ok(self)
    }

    /// Let camera `k` take all photographs.
    ///
    /// # Errors
    /// If photographs are too small to be scored, it cannot be made ready, or the user stopped it.
    pub fn take(&self, k: usize, cache: &KernelCache, progress: &dyn Progress) -> Result<ComparedCamera> {
        self.take_first(k, self.photographs.len(), cache, progress)
    }

    /// Takes the first so many photographs, or all if there are no more.
    ///
    /// # Errors
    /// As [`OpenComparison::take`].
    pub fn take_first(
        &self,
        k: usize,
        photographs: usize,
        cache: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<ComparedCamera> {
        check_scored(&self.photographs[0].view)?;
        let mut found = None;
        self.ready(k, cache, progress, &mut |camera, names, all| {
            let (all, perceptual) = (&all[..photographs.min(all.len())], self.perceptual.as_ref());
            found = Some(compare(
                camera,
                names,
                all,
                self.of.seed,
                perceptual,
                &self.of.curve_lux,
                progress,
            )?);
            Ok(())
        })?;
        Ok(found.expect("a camera that is ready takes photographs"))
    }

    /// Make the kernels of camera `k` where they are kept.
    ///
    /// # Errors
    /// As [`OpenComparison::take`].
    pub fn prepare(&self, k: usize, cache: &KernelCache, progress: &dyn Progress) -> Result<()> {
        if k < self.designs.len() * self.of.kinds() {
            self.ready(k, cache, progress, &mut |_, _, _| Ok(()))
        } else {
            Ok(())
        }
    }

    /// Rows and columns of all photographs, as cameras take them.
    pub fn size(&self) -> [usize; 2] {
        let view = self.photographs[0].view;
        [view.rows, view.columns]
    }

    /// The table of these cameras.
    pub fn comparison(&self, cameras: Vec<ComparedCamera>) -> ComparisonResult {
        let view = self.photographs[0].view;
        ComparisonResult {
            unequal_times: unequal_times(&cameras),
            photographs: self.photographs.iter().map(|p| p.name.clone()).collect(),
            size: self.size(),
            averaged_from: (view != self.given).then_some([self.given.rows, self.given.columns]),
            camera: self.camera.name.clone(),
            seed: self.of.seed,
            cameras,
        }
    }

    /// Make camera `k` ready and use it.
    pub(crate) fn ready(
        &self,
        k: usize,
        cache: &KernelCache,
        progress: &dyn Progress,
        then: &mut Ready<'_>,
    ) -> Result<()> {
        let kinds = self.of.kinds();
        match k.checked_sub(self.designs.len() * kinds) {
            None => self.ready_design(k / kinds, k % kinds == 1, cache, progress, then),
            Some(k) => self.ready_lensless(k / kinds, k % kinds == 1, progress, then),
        }
    }

    fn ready_design(
        &self,
        k: usize,
        as_the_paper: bool,
        cache: &KernelCache,
        progress: &dyn Progress,
        then: &mut Ready<'_>,
    ) -> Result<()> {
        let (listed, (design, camera)) = (&self.of.designs[k], &self.designs[k]);
        let name = listed.name.as_deref().unwrap_or(&design.name);
        let mut photographs = self.photographs.clone();
        if let Some(field_deg) = listed.field_deg {
            photographs.iter_mut().for_each(|p| p.view.field_deg = field_deg);
        }
        let first = &photographs[0];
        let system = ImagingSystem::open_cached(design, &listed.layout, camera, None, first, cache, progress)?;
        let note = system.pillars.as_ref().and_then(|pillars| pillars.note());
        let noted = note.map_or_else(String::new, |note| format!(" Warning: {note}."));
        if !as_the_paper {
            let elements = match design.elements().len() {
                1 => "one element".into(),
                n => format!("{n} elements"),
            };
            let words = format!(
                "the layout of `{}` behind `{}`, {elements}, pillars by the cell `{}`, stray light and dispersion included.{noted}",
                design.name, camera.name, design.verify.fidelity
            );
            let ready =
                ArrayCamera::new(&system, &self.methods, self.of.separate).with_stages(self.stages_of(k, false)?);
            return then(&ready, (name, &words), &photographs);
        }
        let narrow = system.open_without_dispersion(design, &listed.layout, None, first, cache, progress)?;
        drop(system);
        let system = narrow.assuming(ApproximationSet::paper())?;
        let words = format!(
            "`{}` as the paper assumes such cameras to be: one kernel for each element and colour, brightness by a Butterworth filter, one wavelength a colour, no stray light, patches of 420 x 420 pixels.{noted}",
            design.name
        );
        let ready = ArrayCamera::new(&system, &self.methods, self.of.separate).with_stages(self.stages_of(k, true)?);
        then(&ready, (&format!("{name}, paper's assumptions"), &words), &photographs)
    }

    fn ready_lensless(
        &self,
        k: usize,
        as_the_paper: bool,
        progress: &dyn Progress,
        then: &mut Ready<'_>,
    ) -> Result<()> {
        let view = self.photographs[0].view;
        let (camera, stage, [kind, light]) = if as_the_paper {
            // Last stages were trained with all light of a channel.
            (
                of_one_wavelength(&self.camera)?,
                None,
                [", no dispersion", ", one wavelength a colour"],
            )
        } else {
            (
                self.camera.clone(),
                self.stages_of(self.designs.len() + k, false)?.pop(),
                [""; 2],
            )
        };
        match &self.of.lensless[k] {
            Lensless::FlatCam(mask) => {
                let words = format!(
                    "a mask in place of a lens, the product of two sequences of maximum length (511 members of {} um), {} um before the sensor{light}; Tikhonov in closed form by singular values.",
                    mask.feature_um, mask.distance_um
                );
                let ready = FlatCam::new(mask, &camera, view, progress)?.with_stage(stage);
                then(&ready, (&format!("FlatCam, ours{kind}"), &words), &self.photographs)
            }
            Lensless::DiffuserCam(spec) => {
                let words = format!(
                    "a random smooth surface in place of a lens, numbers {} um apart, {} um before the sensor, its opening {} of the sensor along each axis{light}; caustic by rays; total variation with the crop (ADMM).",
                    spec.grain_um, spec.distance_um, spec.opening
                );
                let ready = DiffuserCam::new(spec, &camera, view, progress)?.with_stage(stage);
                then(&ready, (&format!("DiffuserCam, ours{kind}"), &words), &self.photographs)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use ndarray::Array3;

    #[test]
    fn times_are_rounded_down_to_what_is_printed() {
        for (time_ms, printed) in [
            (3.9486, 3.94),
            (19.0, 19.0),
            (240.77, 240.0),
            (0.394_99, 0.394),
            (1e-5, 1e-3),
            (240_770.0, 240_000.0),
        ] {
            assert!((as_printed(time_ms) - printed).abs() < 1e-12, "{time_ms}");
        }
    }

    /// Photographs that are finer than a design is simulated with are averaged, for all cameras alike, and the table says so.
    #[test]
    fn fine_photographs_are_averaged_for_all_cameras() {
        let folder = tempfile::tempdir().unwrap();
        let photograph = folder.path().join("fine.png");
        metalith_imaging::write_picture(&photograph, &Array3::from_elem((100, 1500, 3), 0.5)).unwrap();
        let comparison = Comparison {
            camera: "../../cameras/gt1930.toml".into(),
            designs: vec![ListedDesign {
                name: None,
                design: "../../designs/prototype_3x3.toml".into(),
                layout: folder.path().join("none.gds"),
                camera: None,
                field_deg: None,
            }],
            lensless: vec![Lensless::FlatCam(MaskSpec::standard())],
            methods: vec!["tikhonov".into()],
            separate: false,
            paper: false,
            field_deg: 80.0,
            seed: 1,
            photographs: vec![photograph],
            pixels: None,
            learnt: Vec::new(),
            lpips: None,
            exposure: StatedExposure::default(),
            curve_lux: Vec::new(),
            times: ExposureTimes::Equal,
        };
        let open = comparison.open(&Silent).unwrap();
        let found = open.comparison(Vec::new());
        assert_eq!((found.size, found.averaged_from), ([91, 1374], Some([100, 1500])));
        assert_eq!(open.photographs[0].planes[0].dim(), (91, 1374));
        assert!(found.markdown().contains("1374 x 91 pixels (averaged from 1500 x 100)"));
        let coarse = Comparison {
            designs: Vec::new(),
            ..comparison.clone()
        };
        assert_eq!(coarse.open(&Silent).unwrap().comparison(Vec::new()).averaged_from, None);
    }
}
