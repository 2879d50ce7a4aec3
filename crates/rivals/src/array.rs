//! The chip of a design before its sensor, as a contender.

use metalith_core::{Progress, Result};
use metalith_picture::restore::RestorationMethod;
use metalith_picture::scene::SceneImage;
use metalith_picture::{Frame, FrameOperator, OperatorError, Rehearsal, Studio};
use ndarray::Array3;

use crate::contender::{Contender, Way};

/// A chip that is open for scenes of one field, and the ways of restoring its frames.
pub struct ArrayCamera<'a> {
    studio: &'a Studio,
    simulation: FrameOperator<'a>,
    restoration: FrameOperator<'a>,
    error: OperatorError,
    ways: Vec<(RestorationMethod, bool)>,
}

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
            studio,
        }
    }
}

impl Contender for ArrayCamera<'_> {
    fn ways(&self) -> Vec<Way> {
        let several = self.restoration.elements() > 1;
        let way = |(method, joint): &(RestorationMethod, bool)| Way {
            method: method.name().to_owned(),
            joint: several.then_some(*joint),
        };
        self.ways.iter().map(way).collect()
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
        let (method, joint) = self.ways[way];
        self.studio
            .restore(&self.restoration, &self.error, frame, method, joint, progress)
    }
}
