//! From a scene to the frame, and the adjoint: both matrix-free, for whole frames.
//!
//! Each element samples the scene on the pixels of its sub-image. Each node of its kernels takes its share of that, by a
//! hat over the field, and spreads it by its kernel, through transforms of small squares. Sub-images add up where they
//! overlap; light that no kernel holds is laid over the frame by the veil.
//!
//! | question | file |
//! | --- | --- |
//! | which place of the scene a pixel looks at | `warp` |
//! | kernels of a node as spectra | `node` |
//! | transforms | `fft2` |

mod fft2;
mod node;
mod warp;

use metalith_camera::Sensor;
use ndarray::Array2;
use rayon::prelude::*;

use crate::kernels::KernelBank;
use crate::veil::{self, Veil};
use crate::{ElementView, SceneView};

pub use fft2::{FftScratch, SquareFft};
use node::{ElementOperator, KernelSource};
pub use warp::{Warp, hat};

/// How finely an operator samples the scene, and which kernels it knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Every node and every spectrum, the scene at four points a pixel: what is taken for the truth.
    Simulation,
    /// The kernel of a grey surface for each channel, the scene at one point a pixel: what a restoration knows. Planes
    /// go in and out by channel.
    Restoration,
}

/// The way from planes of the scene to the frame of each channel.
pub struct FrameOperator<'a> {
    view: SceneView,
    frame: [usize; 2],
    channels: usize,
    inputs: usize,
    elements: Vec<ElementOperator<'a>>,
    veil: std::borrow::Cow<'a, Veil>,
}

impl<'a> FrameOperator<'a> {
    /// For the elements of a bank before a sensor. With `Detail::Restoration` spectra of kernels are kept in memory.
    pub fn new(
        bank: &'a KernelBank,
        veil: &'a Veil,
        elements: &[ElementView],
        sensor: &Sensor,
        view: &SceneView,
        detail: Detail,
    ) -> Self {
        let source = KernelSource::new(bank, detail);
        let elements = elements
            .par_iter()
            .enumerate()
            .map(|(i, e)| ElementOperator::new(i, e, &source, sensor, view))
            .collect();
        Self {
            view: *view,
            frame: [sensor.rows as usize, sensor.columns as usize],
            channels: bank.channel_um.len(),
            inputs: match detail {
                Detail::Simulation => bank.bases,
                Detail::Restoration => bank.channel_um.len(),
            },
            elements,
            veil: match detail {
                Detail::Simulation => std::borrow::Cow::Borrowed(veil),
                Detail::Restoration => std::borrow::Cow::Owned(veil.grey()),
            },
        }
    }

    /// Number of planes that go in.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of channels that come out.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The scene.
    pub fn view(&self) -> &SceneView {
        &self.view
    }

    /// Rows and columns of the frame.
    pub fn frame(&self) -> [usize; 2] {
        self.frame
    }

    /// Number of elements.
    pub fn elements(&self) -> usize {
        self.elements.len()
    }

    /// Light in each pixel, by channel: share of a channel's light that arrives at a lens from a unit of projected solid
    /// angle of a white surface.
    pub fn apply(&self, scene: &[Array2<f32>]) -> Vec<Array2<f32>> {
        let all: Vec<usize> = (0..self.elements.len()).collect();
        self.apply_elements(scene, &all, true)
    }

    /// The same of some of the elements, with or without the veil of all.
    pub fn apply_elements(&self, scene: &[Array2<f32>], elements: &[usize], veil: bool) -> Vec<Array2<f32>> {
        assert_eq!(scene.len(), self.inputs, "one plane for each spectrum of the scene");
        let images: Vec<_> = elements
            .par_iter()
            .map_init(FftScratch::default, |scratch, e| {
                self.elements[*e].apply(scene, scratch)
            })
            .collect();
        let mut frames = vec![Array2::zeros(self.frame); self.channels];
        for image in images.into_iter().flatten() {
            image.add_to(&mut frames);
        }
        if veil {
            self.add_veil(scene, &mut frames);
        }
        frames
    }

    fn add_veil(&self, scene: &[Array2<f32>], frames: &mut [Array2<f32>]) {
        let gathered: Vec<Vec<f64>> = scene.par_iter().map(|p| veil::gather(&self.view, p.view())).collect();
        frames.par_iter_mut().enumerate().for_each(|(channel, frame)| {
            let mut cells = vec![0.0; self.veil.cells[0] * self.veil.cells[1]];
            for (input, light) in gathered.iter().enumerate() {
                if let Some(basis) = self.veil_basis(channel, input) {
                    let own = self.veil.apply(channel, basis, light);
                    cells.iter_mut().zip(own).for_each(|(c, v)| *c += v);
                }
            }
            veil::lay(&cells, self.veil.cells, frame);
        });
    }

    /// Which spectrum of the veil takes an input to a channel.
    fn veil_basis(&self, channel: usize, input: usize) -> Option<usize> {
        if self.veil.bases == self.inputs && self.veil.bases > 1 || self.channels == 1 && self.inputs == 1 {
            Some(input)
        } else {
            (channel == input).then_some(0)
        }
    }

    /// The adjoint of [`FrameOperator::apply`]: from frames by channel to planes of the scene.
    pub fn adjoint(&self, frames: &[Array2<f32>]) -> Vec<Array2<f32>> {
        let all: Vec<usize> = (0..self.elements.len()).collect();
        self.adjoint_elements(frames, &all, true)
    }

    /// The same of some of the elements, with or without the veil of all.
    pub fn adjoint_elements(&self, frames: &[Array2<f32>], elements: &[usize], veil: bool) -> Vec<Array2<f32>> {
        assert_eq!(frames.len(), self.channels, "one frame for each channel");
        let shape = (self.view.rows, self.view.columns);
        let mut planes = vec![Array2::zeros(shape); self.inputs];
        let found: Vec<Vec<Array2<f32>>> = elements
            .par_iter()
            .map_init(FftScratch::default, |scratch, e| {
                self.elements[*e].adjoint(frames, shape, self.inputs, scratch)
            })
            .collect();
        for own in found {
            planes.iter_mut().zip(&own).for_each(|(p, o)| *p += o);
        }
        if veil {
            let lifted: Vec<Vec<f64>> = frames.par_iter().map(|f| veil::lift(f, self.veil.cells)).collect();
            planes.par_iter_mut().enumerate().for_each(|(input, plane)| {
                let mut cells = vec![0.0; veil::SCENE_CELLS * veil::SCENE_CELLS];
                for (channel, light) in lifted.iter().enumerate() {
                    if let Some(basis) = self.veil_basis(channel, input) {
                        let own = self.veil.adjoint(channel, basis, light);
                        cells.iter_mut().zip(own).for_each(|(c, v)| *c += v);
                    }
                }
                veil::spread(&self.view, &cells, plane);
            });
        }
        planes
    }
}
