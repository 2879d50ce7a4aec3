//! The network as a denoiser of pictures in sRGB.

use std::path::Path;

use metalith_core::{Error, Result};
use ndarray::{Array2, Array3, ArrayView2, Axis};

use crate::features::Features;
use crate::network::{COLOURS, Network, Plan, Size};
use crate::network_input::{SIDE, corrected, mirrored, squares};
use crate::weights::{read_weights, shipped_weights};

/// A network that takes noise out of pictures.
#[derive(Clone, Debug)]
pub struct NetworkDenoiser {
    network: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    Own(Network),
    #[cfg(feature = "onnx")]
    Onnx(std::sync::Arc<crate::onnx::OnnxNetwork>),
}

impl NetworkDenoiser {
    /// Denoiser with the weights that are shipped with the program.
    ///
    /// # Errors
    /// If they are damaged.
    pub fn shipped() -> Result<Self> {
        Ok(Self::of_weights(&shipped_weights()?))
    }

    /// Denoiser with the weights of a file that `metalith train` wrote, or a user's network in a file `*.onnx` (built
    /// with the feature `onnx`).
    ///
    /// # Errors
    /// If the file cannot be read or is of another network.
    pub fn read(path: &Path) -> Result<Self> {
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("onnx")) {
            Self::read_onnx(path)
        } else {
            Ok(Self::of_weights(&read_weights(path)?))
        }
    }

    #[cfg(feature = "onnx")]
    fn read_onnx(path: &Path) -> Result<Self> {
        let network = Kind::Onnx(std::sync::Arc::new(crate::onnx::OnnxNetwork::read(path)?));
        Ok(Self { network })
    }

    #[cfg(not(feature = "onnx"))]
    fn read_onnx(path: &Path) -> Result<Self> {
        let what = "it is a network in ONNX, which this program was built without";
        let hint = "build with `cargo build --release --features onnx`";
        Err(metalith_core::Error::table(path, None, what, hint))
    }

    fn of_weights(weights: &[f32]) -> Self {
        Self::of_network(Network::new(&Plan::new(Size::DENOISER), weights))
    }

    /// Denoiser of a network in memory.
    pub fn of_network(network: Network) -> Self {
        Self {
            network: Kind::Own(network),
        }
    }

    /// A picture without its noise: the expected picture, `[row, column, colour]` in sRGB values from 0 to 1, given one with
    /// normal noise that is independent from pixel to pixel. `deviation` is that of the noise, of the same shape, in the
    /// same unit.
    ///
    /// # Errors
    /// If the shapes are not two of (rows, columns, 3), or a network of the user's own cannot take a picture of this size; the own one
    /// takes any.
    pub fn denoise(&self, picture: &Array3<f32>, deviation: &Array3<f32>) -> Result<Array3<f32>> {
        let side = match &self.network {
            Kind::Own(_) => SIDE,
            #[cfg(feature = "onnx")]
            Kind::Onnx(_) => crate::onnx::SIDE,
        };
        let (rows, columns, colours) = picture.dim();
        if colours != COLOURS || rows == 0 || columns == 0 || deviation.dim() != picture.dim() {
            return Err(Error::refused(
                "denoise/sizes-differ",
                format!(
                    "the picture has the shape {:?}, the deviations of its noise have {:?}",
                    picture.dim(),
                    deviation.dim()
                ),
                "give both with shape (rows, columns, 3)",
            ));
        }
        let whole = |n: usize| n.next_multiple_of(side);
        let (picture, deviation) = (
            mirrored(picture, whole(rows), whole(columns)),
            mirrored(deviation, whole(rows), whole(columns)),
        );
        let clean = match &self.network {
            Kind::Own(network) => corrected(network, input(&picture, &deviation), picture),
            #[cfg(feature = "onnx")]
            Kind::Onnx(network) => network.denoise(&picture, &deviation)?,
        };
        Ok(Array3::from_shape_fn((rows, columns, COLOURS), |at| clean[at]))
    }

    /// Variant of [`NetworkDenoiser::denoise`] for noise of one deviation everywhere.
    ///
    /// # Errors
    /// As [`NetworkDenoiser::denoise`].
    pub fn denoise_even(&self, picture: &Array3<f32>, deviation: f32) -> Result<Array3<f32>> {
        self.denoise(picture, &Array3::from_elem(picture.dim(), deviation))
    }
}

/// Input of the network.
pub fn input(picture: &Array3<f32>, deviation: &Array3<f32>) -> Features {
    let means: Vec<Array2<f32>> = deviation.axis_iter(Axis(2)).map(over_squares).collect();
    squares(picture, &means)
}

/// Means over squares of 2 x 2.
pub fn over_squares(plane: ArrayView2<'_, f32>) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    Array2::from_shape_fn((rows / 2, columns / 2), |(y, x)| {
        let row = |y: usize| plane[[y, 2 * x]] + plane[[y, 2 * x + 1]];
        (row(2 * y) + row(2 * y + 1)) / 4.0
    })
}
