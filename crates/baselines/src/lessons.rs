//! Pictures that a last stage is taught by.

use std::path::Path;

use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result, Silent};
use metalith_imaging::KernelCache;
use metalith_prior::Provenance;
use metalith_training::Stack;

use crate::baseline_camera::no_stage;
use crate::comparison::OpenLineup;
use crate::stage::{StageKind, encoded};
use crate::taught_for::Followed;

impl OpenLineup<'_> {
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
        kept: &KernelCache,
        progress: &dyn Progress,
    ) -> Result<(Vec<Stack>, Provenance)> {
        let Followed { camera, optics, kinds } = self.followed(k)?;
        if !kinds.contains(&kind) {
            return no_stage(kind, "this camera");
        }
        let mut stacks = Vec::new();
        let mut pictures = 0;
        self.ready(k * self.of.kinds(), kept, progress, &mut |contender, _, photographs| {
            progress.begin("pictures to learn from", photographs.len() as u64);
            for (i, (scene, path)) in photographs.iter().zip(&self.of.photographs).enumerate() {
                if progress.stopped() {
                    return Err(Error::Interrupted);
                }
                let seed = self.of.seed.wrapping_add(i as u64);
                let light = optics.as_deref().unwrap_or_default();
                let of = format!("{} {camera} {light} {} {seed}", kind.name(), hex(&file_digest(path)?));
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
        let taught = Provenance {
            kind: kind.name().into(),
            camera,
            pictures,
            optics,
        };
        Ok((stacks, taught))
    }
}
