//! Learnt last stages in a comparison: which camera each was trained for.

use std::collections::HashSet;

use metalith_core::file::file_digest;
use metalith_core::text::hex;
use metalith_core::{Error, Result};
use metalith_imaging::SceneView;
use metalith_prior::Provenance;

use crate::comparison::{Lensless, OpenComparison};
use crate::post_processing::{Stage, StageKind, camera_digest};

/// A camera of the table that a last stage can follow.
pub(crate) struct PrecedingCamera {
    /// Digest of what decides its frames: layout, sensor, light, field.
    pub camera: String,
    /// Digest of what its layout does to light, if it has one.
    pub optics: Option<String>,
    pub kinds: Vec<StageKind>,
}

impl PrecedingCamera {
    /// True if a last stage was trained for it. One that does not say what the layout did to light is taken at its
    /// word.
    fn is_of(&self, kind: StageKind, provenance: &Provenance) -> bool {
        self.is_like(kind, provenance) && (provenance.optics.is_none() || provenance.optics == self.optics)
    }

    /// True if a last stage was trained for it, whatever the layout does to light.
    fn is_like(&self, kind: StageKind, provenance: &Provenance) -> bool {
        self.kinds.contains(&kind) && self.camera == provenance.camera
    }
}

impl OpenComparison<'_> {
    /// Requirement on the training of a last stage to follow camera `k` of the table, counted without cameras that have the assumptions
    /// of the paper; `assumed` is the same design with these. No stage follows a camera without a lens that has them.
    pub(crate) fn followed(&self, k: usize, assumed: bool) -> Result<PrecedingCamera> {
        let first = self.photographs[0].view;
        if let Some(k) = k.checked_sub(self.designs.len()) {
            let spec = &self.of.lensless[k];
            let kind = match spec {
                Lensless::FlatCam(_) => StageKind::FlatNet,
                Lensless::DiffuserCam(_) => StageKind::UnrolledDiffuser,
            };
            return Ok(PrecedingCamera {
                camera: camera_digest(spec, &self.camera, &first)?,
                optics: None,
                kinds: if assumed { Vec::new() } else { vec![kind] },
            });
        }
        let (listed, (design, camera)) = (&self.of.designs[k], &self.designs[k]);
        let field_deg = listed.field_deg.unwrap_or(first.field_deg);
        let view = SceneView { field_deg, ..first };
        let optics = (design.digest(), hex(&file_digest(&listed.layout)?));
        Ok(PrecedingCamera {
            camera: if assumed {
                camera_digest(&("assumptions of the paper", optics), camera, &view)?
            } else {
                camera_digest(&optics, camera, &view)?
            },
            optics: Some(design.simulation_digest()?),
            kinds: StageKind::ALL.into_iter().filter(|k| k.is_of_design()).collect(),
        })
    }

    /// Refuse weights that none of the cameras can use, and two of one kind for one camera.
    pub(crate) fn stages_have_cameras(&self) -> Result<()> {
        if self.stages.is_empty() {
            return Ok(());
        }
        let assumptions = if self.of.paper {
            [false, true].as_slice()
        } else {
            &[false]
        };
        let cameras = 0..self.designs.len() + self.of.lensless.len();
        let followed: Vec<PrecedingCamera> = cameras
            .flat_map(|k| assumptions.iter().map(move |assumed| self.followed(k, *assumed)))
            .collect::<Result<_>>()?;
        let mut seen = HashSet::new();
        for (stage, path) in self.stages.iter().zip(&self.of.learnt) {
            let refused = |what: String, hint: &str| {
                Err(Error::refused(
                    "compare/stage-without-camera",
                    format!("{}: {what}", path.display()),
                    hint,
                ))
            };
            let kind = stage.kind.name();
            if !seen.insert((kind, &stage.provenance().camera)) {
                return refused(
                    format!("a second last stage `{kind}` for one camera"),
                    "compare them one after the other",
                );
            }
            if followed.iter().any(|f| f.is_of(stage.kind, stage.provenance())) {
                continue;
            }
            let why = if followed.iter().any(|f| f.is_like(stage.kind, stage.provenance())) {
                "for this layout with other materials, another cell, polarisation, analyser or wavelengths of its design"
            } else {
                "for none of these cameras at this size and field of photographs"
            };
            return refused(
                format!("the last stage `{kind}` was trained {why}"),
                "compare the camera that it was trained for, or train it by `metalith train --stage`",
            );
        }
        Ok(())
    }

    /// Notes on the last stages that are used: on stages of arrays whose weights do not say what the layout did to
    /// light.
    pub fn notes(&self) -> Vec<String> {
        let silent = |stage: &Stage| stage.kind.is_of_design() && stage.provenance().optics.is_none();
        let all = self.stages.iter().zip(&self.of.learnt);
        all.filter(|(stage, _)| silent(stage))
            .map(|(_, path)| {
                format!(
                    "{}: trained before the digest of the design's materials and cell was kept; these are taken to be as they were",
                    path.display()
                )
            })
            .collect()
    }

    /// The stages that were trained for camera `k`, with the assumptions of the paper or without.
    pub(crate) fn stages_of(&self, k: usize, assumed: bool) -> Result<Vec<Stage>> {
        if self.stages.is_empty() {
            return Ok(Vec::new());
        }
        let followed = self.followed(k, assumed)?;
        let fits = |stage: &&Stage| followed.is_of(stage.kind, stage.provenance());
        Ok(self.stages.iter().filter(fits).cloned().collect())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Weights are of the camera whose layout does to light what they were trained with; those that came before this was kept, such
    /// as the shipped ones, go by the layout alone.
    #[test]
    fn last_stages_know_what_their_layout_does_to_light() {
        let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("weights/multi-wiener.safetensors");
        let shipped = Stage::read(&weights).unwrap();
        let before = shipped.provenance();
        assert_eq!(before.optics, None);
        let camera = PrecedingCamera {
            camera: before.camera.clone(),
            optics: Some("nitride".into()),
            kinds: vec![StageKind::MultiWiener],
        };
        let provenance = |optics: &str| Provenance {
            optics: Some(optics.into()),
            ..before.clone()
        };
        assert!(camera.is_of(shipped.kind, before) && camera.is_of(shipped.kind, &provenance("nitride")));
        assert!(
            !camera.is_of(shipped.kind, &provenance("oxide")) && camera.is_like(shipped.kind, &provenance("oxide"))
        );
        assert!(!camera.is_like(StageKind::Blending, before));
    }
}
