//! The network as a denoiser of pictures in sRGB.

use std::path::Path;

use metalith_core::Result;
use ndarray::{Array2, Array3, ArrayView2, Axis};

use crate::features::Features;
use crate::network::{COLOURS, INPUTS, MULTIPLE, Network, Plan};
use crate::weights::{read_weights, shipped_weights};

/// Sides of the network's input in the picture: two pixels a square, and halves of them.
const SIDE: usize = 2 * MULTIPLE;

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
    /// With the weights that come with the program.
    ///
    /// # Errors
    /// If they are damaged.
    pub fn shipped() -> Result<Self> {
        Ok(Self::of_weights(&shipped_weights()?))
    }

    /// With the weights of a file that `metalith train` wrote, or a network of one's own in a file `*.onnx` (built with the
    /// feature `onnx`).
    ///
    /// # Errors
    /// If the file cannot be read or is of another network.
    pub fn read(path: &Path) -> Result<Self> {
        match path.extension().is_some_and(|e| e.eq_ignore_ascii_case("onnx")) {
            true => Self::read_onnx(path),
            false => Ok(Self::of_weights(&read_weights(path)?)),
        }
    }

    #[cfg(feature = "onnx")]
    fn read_onnx(path: &Path) -> Result<Self> {
        let network = Kind::Onnx(std::sync::Arc::new(crate::onnx::OnnxNetwork::read(path)?));
        Ok(Self { network })
    }

    #[cfg(not(feature = "onnx"))]
    fn read_onnx(path: &Path) -> Result<Self> {
        Err(metalith_core::Error::Table {
            path: path.to_owned(),
            line: None,
            what: "it is a network in ONNX, which this program was built without".into(),
            hint: "build with `cargo build --release --features onnx`".into(),
        })
    }

    pub(crate) fn of_weights(weights: &[f32]) -> Self {
        Self {
            network: Kind::Own(Network::new(&Plan::new(), weights)),
        }
    }

    /// A picture without its noise: the expected picture, `[row, column, colour]` in sRGB values from 0 to 1, given one with
    /// normal noise that is independent from pixel to pixel. `deviation` is that of the noise, of the same shape, in the
    /// same unit.
    ///
    /// # Errors
    /// If a network of the user's own cannot take a picture of this size; the own one takes any.
    pub fn denoise(&self, picture: &Array3<f32>, deviation: &Array3<f32>) -> Result<Array3<f32>> {
        let side = match &self.network {
            Kind::Own(_) => SIDE,
            #[cfg(feature = "onnx")]
            Kind::Onnx(_) => crate::onnx::SIDE,
        };
        let (rows, columns, _) = picture.dim();
        let whole = |n: usize| n.next_multiple_of(side).max(side);
        let (picture, deviation) = (
            mirrored(picture, whole(rows), whole(columns)),
            mirrored(deviation, whole(rows), whole(columns)),
        );
        let clean = match &self.network {
            Kind::Own(network) => clean(network, picture, &deviation),
            #[cfg(feature = "onnx")]
            Kind::Onnx(network) => network.denoise(&picture, &deviation)?,
        };
        Ok(Array3::from_shape_fn((rows, columns, COLOURS), |at| clean[at]))
    }

    /// The same with noise of one deviation everywhere.
    ///
    /// # Errors
    /// As [`NetworkDenoiser::denoise`].
    pub fn denoise_even(&self, picture: &Array3<f32>, deviation: f32) -> Result<Array3<f32>> {
        self.denoise(picture, &Array3::from_elem(picture.dim(), deviation))
    }
}

/// By the own network, which answers with what is to be added.
fn clean(network: &Network, mut picture: Array3<f32>, deviation: &Array3<f32>) -> Array3<f32> {
    let answer = network.apply(input(&picture, deviation)).shuffled();
    for c in 0..COLOURS {
        let mut plane = picture.index_axis_mut(Axis(2), c);
        for (y, mut to) in plane.rows_mut().into_iter().enumerate() {
            to.iter_mut().zip(answer.row(c, y)).for_each(|(to, v)| *to += v);
        }
    }
    picture
}

/// Larger by its mirror image at the far sides.
fn mirrored(picture: &Array3<f32>, rows: usize, columns: usize) -> Array3<f32> {
    let (h, w, n) = picture.dim();
    let back = |i: usize, n: usize| if i < n { i } else { (2 * n - 1).saturating_sub(i) };
    Array3::from_shape_fn((rows, columns, n), |(y, x, c)| picture[[back(y, h), back(x, w), c]])
}

/// What the network sees.
pub(crate) fn input(picture: &Array3<f32>, deviation: &Array3<f32>) -> Features {
    let (rows, columns, _) = picture.dim();
    let mut planes = Features::zero(COLOURS, rows, columns);
    for c in 0..COLOURS {
        planes.set(c, picture.index_axis(Axis(2), c));
    }
    let squares = planes.unshuffled();
    let mut out = Features::zero(INPUTS, squares.rows, squares.columns);
    let n = squares.values.len();
    out.values[..n].copy_from_slice(&squares.values);
    for c in 0..COLOURS {
        let mean = over_squares(deviation.index_axis(Axis(2), c));
        out.set(4 * COLOURS + c, mean.view());
    }
    out
}

/// Means over squares of 2 x 2.
fn over_squares(plane: ArrayView2<'_, f32>) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    Array2::from_shape_fn((rows / 2, columns / 2), |(y, x)| {
        let row = |y: usize| plane[[y, 2 * x]] + plane[[y, 2 * x + 1]];
        (row(2 * y) + row(2 * y + 1)) / 4.0
    })
}
