//! Detail of an operator: how finely it samples the scene, and what it knows.

use nalgebra::DMatrix;

use super::kernel_interpolation::BetweenNodes;
use crate::approximation_set::ApproximationSet;

/// Planes of the scene that go into an operator, out of the spectra of its bank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SceneInputs {
    /// One plane for each of these spectra; every channel sees all of them.
    Spectra(std::ops::Range<usize>),
    /// One plane for each channel: the light that it counts, spread as that of a surface whose spectrum is the sum of
    /// these.
    Channels(std::ops::Range<usize>),
}

/// Number of points at which the scene is sampled for the pixels of the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScenePoints {
    FourAPixel,
    OneAPixel,
    /// One for a square of two by two pixels, of a scene without what is finer; with a colour filter array light is then
    /// found for the pixels alone that count a channel.
    OneASquare,
    /// One for a block of four by four pixels, of a scene without what is finer; the frame holds the mean of a block's pixels
    /// that count a channel.
    OneABlock,
}

impl ScenePoints {
    /// Pixels an axis of a cell: what shares its points.
    pub fn cell(self) -> usize {
        match self {
            Self::FourAPixel | Self::OneAPixel => 1,
            Self::OneASquare => 2,
            Self::OneABlock => 4,
        }
    }

    /// Pixels an axis that are one value of the frame.
    pub fn value(self) -> usize {
        match self {
            Self::FourAPixel | Self::OneAPixel | Self::OneASquare => 1,
            Self::OneABlock => self.cell(),
        }
    }

    /// Values of the frame from one cell to the next.
    pub(crate) fn frame_step(self) -> usize {
        self.cell() / self.value()
    }

    /// Points of a cell from its middle along x and y (pixels).
    pub fn offsets(self) -> &'static [[f64; 2]] {
        match self {
            Self::FourAPixel => &[[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]],
            Self::OneAPixel | Self::OneASquare | Self::OneABlock => &[[0.0; 2]],
        }
    }
}

/// Detail of an operator: how finely it samples the scene, and which kernels it knows.
#[derive(Clone, Debug, PartialEq)]
pub struct Detail {
    pub points: ScenePoints,
    /// Every how many-th node of the bank along each axis is used; it divides the steps between the nodes.
    pub node_step: usize,
    /// Rule for the kernels between these nodes.
    pub between: BetweenNodes,
    pub inputs: SceneInputs,
    pub assumed: ApproximationSet,
    /// Variation of the inputs with one another: planes (rows) from independent ones (columns). With it the stored
    /// kernels are as few mixtures as see the same to 0.5 % of the light.
    pub statistics: Option<DMatrix<f64>>,
}

impl Detail {
    /// Every node and the scene at four points a pixel: what is taken for the truth.
    pub fn simulation(spectra: usize) -> Self {
        Self {
            points: ScenePoints::FourAPixel,
            node_step: 1,
            between: BetweenNodes::Linear,
            inputs: SceneInputs::Spectra(0..spectra),
            assumed: ApproximationSet::default(),
            statistics: None,
        }
    }

    /// Detail of a restoration: kernels on a coarser grid over the field, and no more of the scene than they pass.
    pub fn restoration(points: ScenePoints, inputs: SceneInputs) -> Self {
        Self {
            points,
            node_step: 2,
            between: BetweenNodes::Linear,
            inputs,
            assumed: ApproximationSet::default(),
            statistics: None,
        }
    }
}
