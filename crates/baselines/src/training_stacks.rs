//! Pictures that a last stage is trained by.

use std::path::Path;

use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Progress, Result, Silent};
use metalith_imaging::KernelCache;
use metalith_prior::Provenance;
use metalith_training::Stack;

use crate::baseline_camera::no_stage;
use crate::comparison::OpenComparison;
use crate::post_processing::{StageKind, encoded};
use crate::provenance::PrecedingCamera;

impl OpenComparison<'_> {
    /// Pictures of all photographs by camera `k` for a last stage, each with its scene, and what is trained by them. Each is kept in a file
    /// of a folder, and taken from there if it is of the same camera, photograph and noise. Camera `k` is counted without assumptions.
    ///
    /// # Errors
    /// If the camera has no such stage or cannot be made ready, a file cannot be written, or the user stopped it.
    pub fn training_stacks(
        &self,
        k: usize,
        kind: StageKind,
        folder: &Path,
        cache: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<(Vec<Stack>, Provenance)> {
        let PrecedingCamera { camera, optics, kinds } = self.followed(k)?;
        if !kinds.contains(&kind) {
            return no_stage(kind, "this camera");
        }
        let mut stacks = Vec::new();
        let mut pictures = 0;
        self.ready(k * self.of.kinds(), cache, progress, &mut |ready, _, photographs| {
            progress.begin("pictures to learn from", photographs.len() as u64);
            for (i, (scene, path)) in photographs.iter().zip(&self.of.photographs).enumerate() {
                progress.check_stopped()?;
                let seed = self.of.seed.wrapping_add(i as u64);
                let light = optics.as_deref().unwrap_or_default();
                let of = format!("{} {camera} {light} {} {seed}", kind.name(), hex(&file_digest(path)?));
                let file = folder.join(format!("{i:06}.safetensors"));
                let stack = if let Some(stack) = Stack::kept(&file, &of) {
                    stack
                } else {
                    let frame = ready.record(scene, seed)?;
                    let made = ready.pictures(&frame, kind, &Silent)?;
                    let shown: Vec<_> = made.iter().map(encoded).collect();
                    let stack = Stack::new(&shown, &encoded(&ready.truth(scene)))?;
                    stack.write(&file, &of)?;
                    stack
                };
                pictures = stack.pictures();
                stacks.push(stack);
                progress.advance(1);
            }
            Ok(())
        })?;
        let provenance = Provenance {
            kind: kind.name().into(),
            camera,
            pictures,
            optics,
        };
        Ok((stacks, provenance))
    }
}
