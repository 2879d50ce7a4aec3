//! The cameras of a comparison, from their files.

use std::path::{Path, PathBuf};

use metalith_camera::Camera;
use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result, Silent, part};
use metalith_design::Design;
use metalith_picture::restore::RestorationMethod;
use metalith_picture::scene::{SceneImage, read_far_scene};
use metalith_picture::{Assumed, KeptKernels, SceneView, Studio};
use metalith_prior::{Stack, Taught};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use crate::compare::{ComparedCamera, Comparison, compare};
use crate::contender::no_stage;
use crate::stage::{Stage, StageKind, camera_digest, encoded};
use crate::{ArrayCamera, Contender, DiffuserCam, DiffuserSpec, FlatCam, MaskSpec};

/// What is compared: designs, cameras without a lens, photographs, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lineup {
    /// Sensor, light, exposure and noise of all cameras that name no other.
    pub camera: PathBuf,
    pub designs: Vec<ListedDesign>,
    pub lensless: Vec<Lensless>,
    /// Names of the ways to restore the frames of designs.
    pub methods: Vec<String>,
    /// By each element of an array alone too.
    pub separate: bool,
    /// Each design also as the paper assumes such cameras to be.
    pub paper: bool,
    /// Angle from the left to the right edge of a photograph (degrees).
    pub field_deg: f64,
    /// Of the noise.
    pub seed: u64,
    pub photographs: Vec<PathBuf>,
    /// Photographs are cut to the square of so many pixels in their middle.
    #[serde(default)]
    pub pixels: Option<usize>,
    /// Weights of learnt last stages, each behind the cameras that it was taught for.
    #[serde(default)]
    pub learnt: Vec<PathBuf>,
}

/// A design that is compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ListedDesign {
    /// That of the design if left out.
    pub name: Option<String>,
    pub design: PathBuf,
    pub layout: PathBuf,
    /// A camera of its own.
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

/// A lineup whose files were read.
pub struct OpenLineup<'a> {
    of: &'a Lineup,
    camera: Camera,
    methods: Vec<RestorationMethod>,
    /// With the camera of each.
    designs: Vec<(Design, Camera)>,
    photographs: Vec<SceneImage>,
    stages: Vec<Stage>,
}

/// What is done with a camera that is ready: it, its name and words in the table, its photographs.
type Ready<'f> = dyn FnMut(&dyn Contender, (&str, &str), &[SceneImage]) -> Result<()> + 'f;

impl Lineup {
    /// Read all files: mistakes before any work.
    ///
    /// # Errors
    /// If nothing is compared, a file cannot be read, or photographs are not of one size.
    pub fn open(&self) -> Result<OpenLineup<'_>> {
        if self.designs.is_empty() && self.lensless.is_empty() {
            return Err(Error::invalid(
                "no camera to compare",
                "give --design, --rivals or both",
            ));
        }
        let methods = self.methods.iter().map(|m| m.parse()).collect::<Result<_>>()?;
        let camera = Camera::read(&self.camera)?;
        let photographs: Vec<SceneImage> = self
            .photographs
            .iter()
            .map(|p| self.photograph(p))
            .collect::<Result<_>>()?;
        let Some(first) = photographs.first().map(|p| p.view) else {
            return Err(Error::invalid("no photographs", "give at least one"));
        };
        if let Some(other) = photographs.iter().find(|p| p.view != first) {
            return Err(Error::invalid(
                format!(
                    "`{}` has {} x {} pixels, the first photograph {} x {}",
                    other.name, other.view.columns, other.view.rows, first.columns, first.rows
                ),
                "give photographs of one size",
            ));
        }
        let own = |listed: &ListedDesign| {
            let own = listed.camera.as_deref().map(Camera::read).transpose()?;
            Ok((Design::read(&listed.design)?, own.unwrap_or_else(|| camera.clone())))
        };
        let designs = self.designs.iter().map(own).collect::<Result<_>>()?;
        let open = OpenLineup {
            of: self,
            camera,
            methods,
            designs,
            photographs,
            stages: self.learnt.iter().map(|p| Stage::read(p)).collect::<Result<_>>()?,
        };
        open.stages_have_cameras()?;
        Ok(open)
    }

    fn photograph(&self, path: &Path) -> Result<SceneImage> {
        let scene = read_far_scene(path, self.field_deg)?;
        match self.pixels {
            Some(pixels) => middle(scene, pixels),
            None => Ok(scene),
        }
    }

    /// Rows of the table: of each design one, or two with the assumptions of the paper, then those without a lens.
    pub fn count(&self) -> usize {
        self.designs.len() * self.kinds() + self.lensless.len()
    }

    fn kinds(&self) -> usize {
        1 + usize::from(self.paper)
    }
}

/// The square of so many pixels in the middle of a scene.
fn middle(mut scene: SceneImage, pixels: usize) -> Result<SceneImage> {
    let SceneView { rows, columns, .. } = scene.view;
    if rows.min(columns) < pixels {
        return Err(Error::invalid(
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

impl OpenLineup<'_> {
    /// What decides the frames of each camera of the table that a last stage can follow: its digest and the kinds of stages. Cameras
    /// with the assumptions of others have none.
    fn digests(&self) -> Result<Vec<(String, Vec<StageKind>)>> {
        let first = self.photographs[0].view;
        let design = |(listed, (design, camera)): (&ListedDesign, &(Design, Camera))| {
            let field_deg = listed.field_deg.unwrap_or(first.field_deg);
            let optics = (design.digest(), hex(&file_digest(&listed.layout)?));
            let digest = camera_digest(&optics, camera, &SceneView { field_deg, ..first })?;
            Ok((digest, vec![StageKind::MultiWiener, StageKind::Blending]))
        };
        let lensless = |spec: &Lensless| {
            let kind = match spec {
                Lensless::FlatCam(_) => StageKind::FlatNet,
                Lensless::DiffuserCam(_) => StageKind::UnrolledDiffuser,
            };
            Ok((camera_digest(spec, &self.camera, &first)?, vec![kind]))
        };
        let designs = self.of.designs.iter().zip(&self.designs).map(design);
        designs.chain(self.of.lensless.iter().map(lensless)).collect()
    }

    /// Refuse weights that none of the cameras can use.
    fn stages_have_cameras(&self) -> Result<()> {
        if self.stages.is_empty() {
            return Ok(());
        }
        let digests = self.digests()?;
        for (stage, path) in self.stages.iter().zip(&self.of.learnt) {
            let fits = |(digest, kinds): &(String, Vec<StageKind>)| {
                kinds.contains(&stage.kind) && *digest == stage.taught().camera
            };
            if !digests.iter().any(fits) {
                return Err(Error::invalid(
                    format!(
                        "{}: the last stage `{}` was taught for none of these cameras at this size and field of photographs",
                        path.display(),
                        stage.kind.name()
                    ),
                    "compare the camera that it was taught for, or teach it by `metalith train --stage`",
                ));
            }
        }
        Ok(())
    }

    /// The stages that were taught for camera `k`, of those without assumptions.
    fn stages_of(&self, k: usize) -> Result<Vec<Stage>> {
        if self.stages.is_empty() {
            return Ok(Vec::new());
        }
        let (digest, kinds) = self.digests()?.swap_remove(k);
        let fits = |stage: &&Stage| kinds.contains(&stage.kind) && stage.taught().camera == digest;
        Ok(self.stages.iter().filter(fits).cloned().collect())
    }

    /// Pictures of all photographs by camera `k` for a last stage, each with its scene, and what is taught by them. Each is kept in a file
    /// of a folder, and taken from there if it is of the same camera, photograph and noise. Camera `k` is counted without assumptions.
    ///
    /// # Errors
    /// If the camera has no such stage or cannot be made ready, a file cannot be written, or the user stopped it.
    pub fn lessons(
        &self,
        k: usize,
        kind: StageKind,
        folder: &Path,
        kept: &KeptKernels,
        progress: &dyn Progress,
    ) -> Result<(Vec<Stack>, Taught)> {
        let (camera, kinds) = self.digests()?.swap_remove(k);
        if !kinds.contains(&kind) {
            return no_stage(kind, "this camera");
        }
        let mut stacks = Vec::new();
        let mut pictures = 0;
        self.ready(k, kept, progress, &mut |contender, _, photographs| {
            progress.begin("pictures to learn from", photographs.len() as u64);
            for (i, (scene, path)) in photographs.iter().zip(&self.of.photographs).enumerate() {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let seed = self.of.seed + i as u64;
                let of = format!("{} {camera} {} {seed}", kind.name(), hex(&file_digest(path)?));
                let file = folder.join(format!("{i:06}.safetensors"));
                let stack = match Stack::kept(&file, &of) {
                    Some(stack) => stack,
                    None => {
                        let frame = contender.record(scene, seed)?;
                        let made = contender.pictures(&frame, kind, &Silent)?;
                        let shown: Vec<_> = made.iter().map(encoded).collect();
                        let stack = Stack::new(&shown, &encoded(&contender.truth(scene)))?;
                        stack.write(&file, &of)?;
                        stack
                    }
                };
                pictures = stack.pictures();
                stacks.push(stack);
                progress.advance(1);
            }
            Ok(())
        })?;
        let taught = Taught {
            kind: kind.name().into(),
            camera,
            pictures,
        };
        Ok((stacks, taught))
    }

    /// Let camera `k` take all photographs.
    ///
    /// # Errors
    /// If it cannot be made ready, or the user stopped it.
    pub fn take(&self, k: usize, kept: &KeptKernels, progress: &dyn Progress) -> Result<ComparedCamera> {
        self.take_first(k, self.photographs.len(), kept, progress)
    }

    /// The same of the first so many photographs.
    ///
    /// # Errors
    /// As [`OpenLineup::take`].
    pub fn take_first(
        &self,
        k: usize,
        photographs: usize,
        kept: &KeptKernels,
        progress: &dyn Progress,
    ) -> Result<ComparedCamera> {
        let mut found = None;
        self.ready(k, kept, progress, &mut |contender, names, all| {
            found = Some(compare(contender, names, &all[..photographs], self.of.seed, progress)?);
            Ok(())
        })?;
        Ok(found.expect("a camera that is ready takes photographs"))
    }

    /// Make the kernels of camera `k` where they are kept.
    ///
    /// # Errors
    /// As [`OpenLineup::take`].
    pub fn prepare(&self, k: usize, kept: &KeptKernels, progress: &dyn Progress) -> Result<()> {
        match k < self.designs.len() * self.of.kinds() {
            true => self.ready(k, kept, progress, &mut |_, _, _| Ok(())),
            false => Ok(()),
        }
    }

    /// The table of these cameras.
    pub fn comparison(&self, cameras: Vec<ComparedCamera>) -> Comparison {
        let view = self.photographs[0].view;
        Comparison {
            photographs: self.photographs.iter().map(|p| p.name.clone()).collect(),
            size: [view.rows, view.columns],
            camera: self.camera.name.clone(),
            seed: self.of.seed,
            cameras,
        }
    }

    fn ready(&self, k: usize, kept: &KeptKernels, progress: &dyn Progress, then: &mut Ready<'_>) -> Result<()> {
        let kinds = self.of.kinds();
        match k.checked_sub(self.designs.len() * kinds) {
            None => self.ready_design(k / kinds, k % kinds == 1, kept, progress, then),
            Some(k) => self.ready_lensless(k, progress, then),
        }
    }

    fn ready_design(
        &self,
        k: usize,
        as_the_paper: bool,
        kept: &KeptKernels,
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
        let studio = Studio::open_kept(design, &listed.layout, camera, None, first, kept, progress)?;
        if !as_the_paper {
            let words = format!(
                "the layout of `{}` behind `{}`, {} elements, pillars solved rigorously, veil and dispersion included.",
                design.name,
                camera.name,
                design.elements().len()
            );
            let ready = ArrayCamera::new(&studio, &self.methods, self.of.separate).with_stages(self.stages_of(k)?);
            return then(&ready, (name, &words), &photographs);
        }
        let narrow = studio.open_without_dispersion(design, &listed.layout, None, first, kept, progress)?;
        drop(studio);
        let studio = narrow.assuming(Assumed::paper())?;
        let words = format!(
            "`{}` as the paper assumes such cameras to be: one kernel for each element and colour, brightness by a Butterworth filter, one wavelength a colour, no veil, patches of 420 x 420 pixels.",
            design.name
        );
        let ready = ArrayCamera::new(&studio, &self.methods, self.of.separate);
        then(&ready, (&format!("{name}, paper's assumptions"), &words), &photographs)
    }

    fn ready_lensless(&self, k: usize, progress: &dyn Progress, then: &mut Ready<'_>) -> Result<()> {
        let view = self.photographs[0].view;
        let stage = self.stages_of(self.designs.len() + k)?.pop();
        match &self.of.lensless[k] {
            Lensless::FlatCam(mask) => {
                let words = format!(
                    "a mask in place of a lens, the product of two sequences of maximum length (511 members of {} um), {} um before the sensor; Tikhonov in closed form by singular values.",
                    mask.feature_um, mask.distance_um
                );
                let ready = FlatCam::new(mask, &self.camera, view, progress)?.with_stage(stage);
                then(&ready, ("FlatCam, ours", &words), &self.photographs)
            }
            Lensless::DiffuserCam(spec) => {
                let words = format!(
                    "a random smooth surface in place of a lens, numbers {} um apart, {} um before the sensor, its opening {} of the sensor along each axis; caustic by rays; total variation with the crop (ADMM).",
                    spec.grain_um, spec.distance_um, spec.opening
                );
                let ready = DiffuserCam::new(spec, &self.camera, view, progress)?.with_stage(stage);
                then(&ready, ("DiffuserCam, ours", &words), &self.photographs)
            }
        }
    }
}
