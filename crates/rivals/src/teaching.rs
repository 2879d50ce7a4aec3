//! Learnt last stages in a lineup: which camera each was taught for, and what another is taught by.

use std::collections::HashSet;
use std::path::Path;

use metalith_camera::Camera;
use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, Progress, Result, Silent};
use metalith_design::Design;
use metalith_picture::{KeptKernels, SceneView};
use metalith_prior::{Stack, Taught};

use crate::contender::no_stage;
use crate::lineup::{Lensless, ListedDesign, OpenLineup};
use crate::stage::{Stage, StageKind, camera_digest, encoded};

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

    /// Refuse weights that none of the cameras can use, and two of one kind for one camera.
    pub(crate) fn stages_have_cameras(&self) -> Result<()> {
        if self.stages.is_empty() {
            return Ok(());
        }
        let digests = self.digests()?;
        let mut seen = HashSet::new();
        for (stage, path) in self.stages.iter().zip(&self.of.learnt) {
            if !seen.insert((stage.kind.name(), &stage.taught().camera)) {
                return Err(Error::invalid(
                    format!(
                        "{}: a second last stage `{}` for one camera",
                        path.display(),
                        stage.kind.name()
                    ),
                    "compare them one after the other",
                ));
            }
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
    pub(crate) fn stages_of(&self, k: usize) -> Result<Vec<Stage>> {
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
}
