//! Operator from a scene to the frame, and its adjoint: both matrix-free, for whole frames.
//!
//! Each element samples the scene on the pixels of its sub-image. Each node of its kernels takes its share of that, by
//! weights over the field, and spreads it by its kernel, through transforms of small squares. Sub-images add up where they
//! overlap; light that no kernel holds is laid over the frame by the stray light.
//!
//! | question | file |
//! | --- | --- |
//! | which place of the scene a pixel looks at | `warp` |
//! | which kernels are in force between nodes | `kernel_interpolation` |
//! | how finely it samples the scene, and what it knows | `detail` |
//! | kernels on the pixels of a grid | `source` |
//! | an element: its warps, kernels of its nodes as spectra | `element` |
//! | light through an element, and back | `element_pass` |
//! | its pixels on the frame | `sub_image` |
//! | the innermost loops | `inner_loops` |
//! | fewer of them than inputs | `low_rank_kernels` |
//! | a scene without what its grid cannot hold | `smooth` |

mod detail;
mod element;
mod element_pass;
mod inner_loops;
mod kernel_interpolation;
mod low_rank_kernels;
mod smooth;
mod source;
mod sub_image;
mod warp;

use std::borrow::Cow;
use std::sync::OnceLock;

use metalith_restoration::{FrameModel, Planes, sums_of_blocks};
use metalith_sensor::Camera;
use metalith_wave::kernels::{FftScratch, box_sums};
use ndarray::Array2;
use rayon::prelude::*;

use crate::acceptance::Acceptance;
use crate::geometry::{ElementView, SceneSpace, SceneView};
use crate::kernels::KernelBank;
use crate::stray_light::{self, StrayLight};

pub use detail::{Detail, SceneInputs, ScenePoints};
use element::ElementOperator;
pub use kernel_interpolation::BetweenNodes;
use smooth::Smoothing;
use source::KernelSource;

/// The way from planes of the scene to the frame of each channel.
pub struct FrameOperator<'a> {
    view: SceneView,
    frame: [usize; 2],
    channels: usize,
    inputs: SceneInputs,
    elements: Vec<ElementOperator<'a>>,
    stray_light: Cow<'a, StrayLight>,
    smoothing: Smoothing,
    /// Pixels an axis that are one value of the frame.
    value: usize,
    coarse: Option<CoarseOperator<'a>>,
}

/// Coarse [`FrameOperator`], which is made when it is asked for.
struct CoarseOperator<'a> {
    made: OnceLock<Box<FrameOperator<'a>>>,
    bank: &'a KernelBank,
    stray_light: &'a StrayLight,
    elements: Vec<ElementView>,
    camera: Camera,
    space: SceneSpace,
    detail: Detail,
}

/// Pixels of the scene from square to square that a coarse operator is for: with fewer its picture lacks detail that the frame has, and
/// few steps do not bring it back. Pictures of 800 x 800 over 80 and 90 degrees behind `cameras/gt1930.toml` have 2.3 and 2.0.
const LEAST_STEP: f64 = 1.5;

impl<'a> CoarseOperator<'a> {
    /// The operator with blocks in place of squares, and pictures of half as many rows and columns. None for other grids,
    /// where squares are less than [`LEAST_STEP`] pixels of the scene apart, and where one kernel is taken for a field.
    fn of(
        (bank, stray_light): (&'a KernelBank, &'a StrayLight),
        elements: &[ElementView],
        camera: &Camera,
        space: &SceneSpace,
        detail: &Detail,
        step: f64,
    ) -> Option<Self> {
        let view = &space.view;
        let columns = view.columns.div_ceil(2);
        let view = SceneView {
            rows: (view.rows * columns).div_ceil(view.columns),
            columns,
            ..*view
        };
        let frame_limits = step >= LEAST_STEP && !detail.assumed.fixed_kernels;
        (detail.points == ScenePoints::OneASquare && space.is_flat() && frame_limits).then(|| Self {
            made: OnceLock::new(),
            bank,
            stray_light,
            elements: elements.to_vec(),
            camera: camera.clone(),
            space: SceneSpace::flat(&view),
            detail: Detail {
                points: ScenePoints::OneABlock,
                ..detail.clone()
            },
        })
    }

    fn operator(&self) -> &FrameOperator<'a> {
        self.made.get_or_init(|| {
            Box::new(FrameOperator::new(
                self.bank,
                self.stray_light,
                &self.elements,
                &self.camera,
                &self.space,
                self.detail.clone(),
            ))
        })
    }
}

impl<'a> FrameOperator<'a> {
    /// Operator for the elements of a bank before the sensor of a camera. With one point a cell, spectra of kernels are
    /// kept in memory.
    pub fn new(
        bank: &'a KernelBank,
        stray_light: &'a StrayLight,
        elements: &[ElementView],
        camera: &Camera,
        space: &SceneSpace,
        detail: Detail,
    ) -> Self {
        let view = &space.view;
        let sensor = &camera.sensor;
        let names = camera.channel_names();
        let source = KernelSource::new(bank, &detail, sensor, &names);
        // Pixels of the scene from one point to the next, in the middle of the field.
        let step = match elements.first() {
            Some(element) if detail.points.cell() > 1 => {
                sensor.pixel_um * detail.points.cell() as f64 / (element.sensor_um * view.pixel())
            }
            _ => 0.0,
        };
        let coarse = CoarseOperator::of((bank, stray_light), elements, camera, space, &detail, step);
        let value = detail.points.value();
        let acceptance = Acceptance::new(elements, sensor);
        let accepted = |i: usize| acceptance.over_sensor(i).map(|shares| means_of_blocks(&shares, value));
        let elements = elements
            .par_iter()
            .enumerate()
            .map(|(i, e)| ElementOperator::new(i, e, &source, (sensor, accepted(i)), space))
            .collect();
        Self {
            view: *view,
            frame: [sensor.rows, sensor.columns].map(|n| (n as usize).div_ceil(value)),
            channels: bank.channel_um.len(),
            stray_light: match &detail.inputs {
                SceneInputs::Spectra(_) => Cow::Borrowed(stray_light),
                SceneInputs::Channels(spectra) => Cow::Owned(stray_light.grey(spectra.clone())),
            },
            inputs: detail.inputs,
            elements,
            smoothing: Smoothing::new(step),
            value,
            coarse,
        }
    }

    /// The scene.
    pub fn view(&self) -> &SceneView {
        &self.view
    }

    /// Rows and columns of the frame.
    pub fn frame(&self) -> [usize; 2] {
        self.frame
    }

    fn add_stray_light(&self, scene: &[Array2<f32>], frames: &mut [Array2<f32>]) {
        let gathered: Vec<Vec<f64>> = scene
            .par_iter()
            .map(|p| stray_light::gather(&self.view, p.view()))
            .collect();
        frames.par_iter_mut().enumerate().for_each(|(channel, frame)| {
            let mut cells = vec![0.0; self.stray_light.cells[0] * self.stray_light.cells[1]];
            for (input, light) in gathered.iter().enumerate() {
                if let Some(basis) = self.stray_light_basis(channel, input) {
                    let own = self.stray_light.apply(channel, basis, light);
                    cells.iter_mut().zip(own).for_each(|(c, v)| *c += v);
                }
            }
            stray_light::lay(&cells, self.stray_light.cells, self.value, frame);
        });
    }

    /// Spectrum of the stray light that takes an input to a channel.
    fn stray_light_basis(&self, channel: usize, input: usize) -> Option<usize> {
        match &self.inputs {
            SceneInputs::Spectra(spectra) => Some(spectra.start + input),
            SceneInputs::Channels(_) => (channel == input).then_some(0),
        }
    }

    /// Picture of the channels of a frame, unrestored: light of the pixels laid on the places that they look at, over
    /// that of a white scene. `weight` is zero for pixels that are not known. Needs an operator with one point a cell.
    pub fn unrestored(&self, light: &[Array2<f32>], weight: &[Array2<f32>]) -> Vec<Array2<f32>> {
        /// Pixels of the scene that a pixel of the sensor is laid over, on each side, twice: where they are far apart, none is
        /// left out.
        const LAID: usize = 1;
        let shape = (self.view.rows, self.view.columns);
        let white = self.apply(&self.white());
        let laid = |frames: &[Array2<f32>]| {
            let known = frames.iter().zip(weight).map(|(frame, weight)| {
                let own = ndarray::Zip::from(frame).and(weight);
                own.map_collect(|f, w| if *w > 0.0 { *f } else { 0.0 })
            });
            let known: Vec<Array2<f32>> = known.collect();
            let mut planes = vec![Array2::zeros(shape); self.channels];
            self.elements.iter().for_each(|e| e.lay_on_scene(&known, &mut planes));
            let smooth = |p: &Array2<f32>| {
                let twice = box_sums(&box_sums(&p.mapv(f64::from), LAID), LAID);
                twice.mapv(|v| v as f32)
            };
            planes.iter().map(smooth).collect::<Vec<_>>()
        };
        let (mut sums, whites) = (laid(light), laid(&white));
        for (sum, white) in sums.iter_mut().zip(&whites) {
            ndarray::Zip::from(sum)
                .and(white)
                .for_each(|s, w| *s = if *w > 0.0 { *s / w } else { 0.0 });
        }
        sums
    }
}

/// Means over blocks of `side` values an axis.
fn means_of_blocks(values: &Array2<f32>, side: usize) -> Array2<f32> {
    let counts = sums_of_blocks(&Array2::ones(values.raw_dim()), side);
    sums_of_blocks(values, side) / counts
}

/// Light in each pixel, by channel: share of a channel's light that arrives at a lens from a unit of projected solid
/// angle of a white surface.
impl FrameModel for FrameOperator<'_> {
    fn inputs(&self) -> usize {
        match &self.inputs {
            SceneInputs::Spectra(spectra) => spectra.len(),
            SceneInputs::Channels(_) => self.channels,
        }
    }

    fn channels(&self) -> usize {
        self.channels
    }

    fn elements(&self) -> usize {
        self.elements.len()
    }

    fn picture_shape(&self) -> (usize, usize) {
        (self.view.rows, self.view.columns)
    }

    fn frame_shape(&self) -> (usize, usize) {
        self.frame.into()
    }

    fn sees_colours(&self) -> bool {
        matches!(&self.inputs, SceneInputs::Spectra(spectra) if spectra.len() == 3)
    }

    fn coarse(&self) -> Option<(usize, &dyn FrameModel)> {
        let operator = self.coarse.as_ref()?.operator();
        Some((operator.value, operator))
    }

    fn apply_elements(&self, scene: &[Array2<f32>], elements: &[usize], stray_light: bool) -> Planes {
        assert_eq!(scene.len(), self.inputs(), "one plane for each spectrum of the scene");
        let smooth: Vec<_> = scene.par_iter().map(|p| self.smoothing.apply(p)).collect();
        let images: Vec<_> = elements
            .par_iter()
            .map_init(FftScratch::default, |scratch, e| {
                self.elements[*e].apply(&smooth, scratch)
            })
            .collect();
        let mut frames = vec![Array2::zeros(self.frame); self.channels];
        for image in images.into_iter().flatten() {
            image.add_to(&mut frames);
        }
        if stray_light {
            self.add_stray_light(scene, &mut frames);
        }
        frames
    }

    fn adjoint_elements(&self, frames: &[Array2<f32>], elements: &[usize], stray_light: bool) -> Planes {
        assert_eq!(frames.len(), self.channels, "one frame for each channel");
        let shape = (self.view.rows, self.view.columns);
        let mut planes = vec![Array2::zeros(shape); self.inputs()];
        // Planes of a few elements are held at a time, and added in the order of elements: the sums do not depend on the threads.
        // Twice as many as these, so that who is done with one has another.
        for some in elements.chunks(2 * rayon::current_num_threads()) {
            let found: Vec<Vec<Array2<f32>>> = some
                .par_iter()
                .map_init(FftScratch::default, |scratch, e| {
                    self.elements[*e].adjoint(frames, shape, self.inputs(), scratch)
                })
                .collect();
            for own in found {
                planes.iter_mut().zip(&own).for_each(|(p, o)| *p += o);
            }
        }
        planes.par_iter_mut().for_each(|p| *p = self.smoothing.adjoint(p));
        if stray_light {
            let lifted: Vec<Vec<f64>> = frames
                .par_iter()
                .map(|f| stray_light::lift(f, self.stray_light.cells, self.value))
                .collect();
            planes.par_iter_mut().enumerate().for_each(|(input, plane)| {
                let mut cells = vec![0.0; stray_light::SCENE_CELLS * stray_light::SCENE_CELLS];
                for (channel, light) in lifted.iter().enumerate() {
                    if let Some(basis) = self.stray_light_basis(channel, input) {
                        let own = self.stray_light.adjoint(channel, basis, light);
                        cells.iter_mut().zip(own).for_each(|(c, v)| *c += v);
                    }
                }
                stray_light::spread(&self.view, &cells, plane);
            });
        }
        planes
    }
}
