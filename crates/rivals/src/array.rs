//! The chip of a design before its sensor, as a contender.

use metalith_core::{Progress, Result};
use metalith_picture::restore::{Recorded, RestorationMethod, restore_each};
use metalith_picture::scene::SceneImage;
use metalith_picture::{Frame, FrameOperator, OperatorError, Rehearsal, Studio};
use ndarray::{Array2, Array3};

use crate::contender::{Contender, Way, no_stage};
use crate::stage::{Stage, StageKind};
use crate::wiener;

/// A chip that is open for scenes of one field, and the ways of restoring its frames.
pub struct ArrayCamera<'a> {
    studio: &'a Studio,
    simulation: FrameOperator<'a>,
    restoration: FrameOperator<'a>,
    error: OperatorError,
    ways: Vec<(RestorationMethod, bool)>,
    stages: Vec<Stage>,
}

/// An element is shown alone where it has at least this share of its most trusted place; elsewhere the blend stands in its picture.
const LEAST_TRUST: f32 = 0.02;

impl<'a> ArrayCamera<'a> {
    /// For a studio and these methods, by all elements at once and, if asked for, by each alone.
    pub fn new(studio: &'a Studio, methods: &[RestorationMethod], separate: bool) -> Self {
        let restoration = studio.restoration();
        let error = Rehearsal::new(studio, &restoration).operator_error;
        let alone = separate && restoration.elements() > 1;
        let ways = methods.iter().flat_map(|m| {
            let kinds: &[bool] = if alone { &[true, false] } else { &[true] };
            kinds.iter().map(move |joint| (*m, *joint))
        });
        Self {
            simulation: studio.simulation(),
            restoration,
            error,
            ways: ways.collect(),
            stages: Vec::new(),
            studio,
        }
    }

    /// With learnt last stages, each a further way.
    #[must_use]
    pub fn with_stages(mut self, stages: Vec<Stage>) -> Self {
        self.stages = stages;
        self
    }

    /// The blend of all elements, then the picture of each alone.
    fn blend_and_elements(&self, recorded: &Recorded<'_>, progress: &dyn Progress) -> Result<Vec<Vec<Array2<f32>>>> {
        let mut alone = Vec::new();
        restore_each(
            recorded,
            RestorationMethod::Tikhonov,
            progress,
            &mut |picture, trust| {
                alone.push((picture.to_vec(), mean(trust)));
            },
        )?;
        let shape = (self.studio.view.rows, self.studio.view.columns);
        let planes = self.restoration.inputs();
        let mut blend = vec![Array2::<f32>::zeros(shape); planes];
        let mut all = Array2::<f32>::zeros(shape);
        for (picture, trust) in &alone {
            blend.iter_mut().zip(picture).for_each(|(b, p)| *b += &(p * trust));
            all += trust;
        }
        all.mapv_inplace(|t| if t > 0.0 { t.recip() } else { 0.0 });
        blend.iter_mut().for_each(|b| *b *= &all);
        for (picture, trust) in &mut alone {
            let least = LEAST_TRUST * trust.iter().copied().fold(0.0, f32::max);
            for (plane, blend) in picture.iter_mut().zip(&blend) {
                ndarray::Zip::from(plane)
                    .and(blend)
                    .and(&*trust)
                    .for_each(|p, b, t| *p = if *t > least { *p } else { *b });
            }
        }
        // Elements that see nothing of the scene have no picture of their own.
        alone.resize(self.restoration.elements(), (blend.clone(), Array2::zeros(shape)));
        Ok([blend].into_iter().chain(alone.into_iter().map(|(p, _)| p)).collect())
    }

    /// Planes of the restoration in linear sRGB `[row, column, colour]`.
    fn picture(&self, planes: &[Array2<f32>]) -> Array3<f64> {
        match self.restoration.sees_colours() {
            true => Array3::from_shape_fn((self.studio.view.rows, self.studio.view.columns, 3), |(y, x, c)| {
                f64::from(planes[c][[y, x]])
            }),
            false => self.studio.colours.rgb(planes),
        }
    }
}

/// Mean of planes.
fn mean(planes: &[Array2<f32>]) -> Array2<f32> {
    let mut sum = Array2::zeros(planes[0].dim());
    planes.iter().for_each(|p| sum.scaled_add(1.0 / planes.len() as f32, p));
    sum
}

impl Contender for ArrayCamera<'_> {
    fn ways(&self) -> Vec<Way> {
        let several = self.restoration.elements() > 1;
        let way = |(method, joint): &(RestorationMethod, bool)| Way {
            method: method.name().to_owned(),
            joint: several.then_some(*joint),
        };
        let learnt = |stage: &Stage| Way {
            method: stage.kind.words().to_owned(),
            joint: None,
        };
        let learnt = self.stages.iter().map(learnt);
        self.ways.iter().map(way).chain(learnt).collect()
    }

    fn channel_names(&self) -> Vec<String> {
        self.studio.channels.iter().map(|c| c.name.clone()).collect()
    }

    fn record(&self, scene: &SceneImage, seed: u64) -> Result<Frame> {
        self.studio.record(&self.simulation, scene, seed)
    }

    fn truth(&self, scene: &SceneImage) -> Array3<f64> {
        self.studio.truth(scene)
    }

    fn unrestored(&self, frame: &Frame) -> Option<Array3<f64>> {
        Some(self.studio.unrestored(&self.restoration, frame))
    }

    fn restore(&self, frame: &Frame, way: usize, progress: &dyn Progress) -> Result<Array3<f64>> {
        match way.checked_sub(self.ways.len()) {
            Some(k) => {
                let stage = &self.stages[k];
                stage.finish(&self.pictures(frame, stage.kind, progress)?)
            }
            None => {
                let (method, joint) = self.ways[way];
                self.studio
                    .restore(&self.restoration, &self.error, frame, method, joint, progress)
            }
        }
    }

    fn pictures(&self, frame: &Frame, kind: StageKind, progress: &dyn Progress) -> Result<Vec<Array3<f64>>> {
        frame.is_of(self.restoration.frame(), self.studio.gain.len())?;
        let (light, trust) = frame.light(&self.studio.camera, &self.error);
        let recorded = Recorded {
            operator: &self.restoration,
            light: &light,
            trust: &trust,
            prior: &self.studio.prior,
        };
        match kind {
            StageKind::MultiWiener => {
                let all = wiener::pictures(self.studio, &recorded, progress)?;
                Ok(all.iter().map(|planes| self.studio.colours.rgb(planes)).collect())
            }
            StageKind::Blending => {
                let all = self.blend_and_elements(&recorded, progress)?;
                Ok(all.iter().map(|planes| self.picture(planes)).collect())
            }
            _ => no_stage(kind, "an array"),
        }
    }
}
