//! Pictures that a last stage is trained by.

use std::path::Path;

use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Progress, Result, Silent};
use metalith_imaging::KernelCache;
use metalith_prior::{PictureFit, Provenance};
use metalith_training::Stack;

use crate::baseline_camera::no_stage;
use crate::comparison::OpenComparison;
use crate::post_processing::{StageKind, encoded};
use crate::provenance::PrecedingCamera;

/// Pictures of all photographs for a last stage, each with its scene.
pub struct TrainingStacks<'a> {
    pub stacks: Vec<Stack>,
    /// Fit to the frame of each; empty for stages that are trained without.
    pub fits: Vec<Box<dyn PictureFit + 'a>>,
    /// Provenance of the network that is trained by them.
    pub provenance: Provenance,
}

/// Last stage that is trained for a camera of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct TrainedStage {
    pub kind: StageKind,
    /// True for the camera with the assumptions of the paper.
    pub assumed: bool,
    /// Fits to the frame between passes of the network.
    pub refits: usize,
}

impl OpenComparison<'_> {
    /// Make the pictures of all photographs by camera `k` for a last stage, and use them. Each is kept in a file of a folder, and taken
    /// from there if it is of the same camera, photograph and noise. Camera `k` is counted without assumptions.
    ///
    /// # Errors
    /// If the camera has no such stage or cannot be made ready, a file cannot be written, or the user stopped it.
    pub fn with_training_stacks(
        &self,
        k: usize,
        stage: TrainedStage,
        folder: &Path,
        cache: &KernelCache,
        progress: &dyn Progress,
        then: &mut dyn FnMut(TrainingStacks<'_>) -> Result<()>,
    ) -> Result<()> {
        let TrainedStage { kind, assumed, refits } = stage;
        let PrecedingCamera { camera, optics, kinds } = self.followed(k, assumed)?;
        if !kinds.contains(&kind) {
            return no_stage(kind, "this camera");
        }
        let index = k * self.of.kinds() + usize::from(assumed);
        self.ready(index, cache, progress, &mut |ready, _, photographs| {
            progress.begin("pictures to learn from", photographs.len() as u64);
            let (mut stacks, mut fits) = (Vec::new(), Vec::new());
            for (i, (scene, path)) in photographs.iter().zip(&self.of.photographs).enumerate() {
                progress.check_stopped()?;
                let seed = self.of.seed.wrapping_add(i as u64);
                let light = optics.as_deref().unwrap_or_default();
                let of = format!("{} {camera} {light} {} {seed}", kind.name(), hex(&file_digest(path)?));
                let file = folder.join(format!("{i:06}.safetensors"));
                let kept = Stack::kept(&file, &of);
                if kept.is_none() || refits > 0 {
                    let frame = ready.record(scene, seed)?;
                    if kept.is_none() {
                        let made = ready.pictures(&frame, kind, &Silent)?;
                        let shown: Vec<_> = made.iter().map(encoded).collect();
                        let stack = Stack::new(&shown, &encoded(&ready.truth(scene)))?;
                        stack.write(&file, &of)?;
                        stacks.push(stack);
                    }
                    if refits > 0 {
                        fits.push(ready.fit(&frame)?);
                    }
                }
                stacks.extend(kept);
                progress.advance(1);
            }
            let provenance = Provenance {
                kind: kind.name().into(),
                camera: camera.clone(),
                pictures: stacks.first().map_or(0, Stack::pictures),
                optics: optics.clone(),
                refits,
            };
            then(TrainingStacks {
                stacks,
                fits,
                provenance,
            })
        })
    }
}
