//! Pictures as a network sees them, and what it makes of them.

use metalith_core::{Error, Result};
use ndarray::{Array2, Array3, Axis, Slice, concatenate};

use crate::features::Features;
use crate::network::{COLOURS, MULTIPLE, Network};

/// Sides of a network's input in the picture: two pixels a square, and halves of them.
pub const SIDE: usize = 2 * MULTIPLE;

/// Planes `[row, column, plane]` of pictures, four pixels of a square as channels, and maps of half as many rows and columns.
pub(crate) fn squares(pictures: &Array3<f32>, maps: &[Array2<f32>]) -> Features {
    let (rows, columns, count) = pictures.dim();
    let mut planes = Features::zero(count, rows, columns);
    for (c, plane) in pictures.axis_iter(Axis(2)).enumerate() {
        planes.set(c, plane);
    }
    let small = planes.unshuffled();
    let mut out = Features::zero(small.channels + maps.len(), small.rows, small.columns);
    out.values[..small.values.len()].copy_from_slice(&small.values);
    for (k, map) in maps.iter().enumerate() {
        out.set(small.channels + k, map.view());
    }
    out
}

/// A picture with what the network answers added to it.
pub(crate) fn corrected(network: &Network, input: Features, picture: Array3<f32>) -> Array3<f32> {
    with_answer(picture, &network.apply(input))
}

/// A picture with an answer of the network added to it; what the answer has beyond the picture is left out.
pub fn with_answer(mut picture: Array3<f32>, answer: &Features) -> Array3<f32> {
    let answer = answer.shuffled();
    for c in 0..COLOURS {
        let mut plane = picture.index_axis_mut(Axis(2), c);
        for (y, mut to) in plane.rows_mut().into_iter().enumerate() {
            to.iter_mut().zip(answer.row(c, y)).for_each(|(to, v)| *to += v);
        }
    }
    picture
}

/// Larger by its mirror image at the far sides.
pub fn mirrored(picture: &Array3<f32>, rows: usize, columns: usize) -> Array3<f32> {
    let (h, w, n) = picture.dim();
    Array3::from_shape_fn((rows, columns, n), |(y, x, c)| picture[[source(y, h), source(x, w), c]])
}

/// Place among `n` of which a place is the mirror image, or itself.
fn source(i: usize, n: usize) -> usize {
    if i < n { i } else { (2 * n - 1).saturating_sub(i) }
}

/// The adjoint of [`mirrored`]: sums of a gradient over a pixel and its mirror images.
pub fn folded(gradient: &Array3<f32>, rows: usize, columns: usize) -> Array3<f32> {
    let mut sums = Array3::zeros((rows, columns, gradient.dim().2));
    for ((y, x, c), g) in gradient.indexed_iter() {
        sums[[source(y, rows), source(x, columns), c]] += g;
    }
    sums
}

/// Pile after a pass of the network and a fit to the frame: the corrected picture in place of the first, the fitted one in place of the
/// second.
pub fn refitted(pile: &Array3<f32>, corrected: &Array3<f32>, fitted: &Array3<f32>) -> Array3<f32> {
    let mut pile = pile.clone();
    for (k, picture) in [corrected, fitted].into_iter().enumerate() {
        pile.slice_axis_mut(Axis(2), Slice::from(k * COLOURS..(k + 1) * COLOURS))
            .assign(picture);
    }
    pile
}

/// A piece of so many rows, columns and planes from a place on; the first planes alone.
pub fn cut<T: Copy>(planes: &Array3<T>, place: [usize; 2], size: [usize; 3]) -> Array3<T> {
    Array3::from_shape_fn(size, |(y, x, c)| planes[[place[0] + y, place[1] + x, c]])
}

/// Pictures behind one another: `[row, column, colour]`.
///
/// # Errors
/// If there is none, or if one is not in colour or not of this size.
pub fn piled(pictures: &[Array3<f32>], size: (usize, usize, usize)) -> Result<Array3<f32>> {
    if pictures.is_empty() || pictures.iter().any(|p| p.dim() != size) || size.2 != COLOURS {
        return Err(Error::refused(
            "stage/sizes-differ",
            "the pictures of one frame differ in size, or there are none",
            "give pictures in colour of the size of the scene",
        ));
    }
    let views: Vec<_> = pictures.iter().map(|p| p.view()).collect();
    Ok(concatenate(Axis(2), &views).expect("all are of one size"))
}

/// Input of the last stage for a piece of such pictures whose first pixel is at `place` of a whole of so many rows and
/// columns: the squared distance from its middle, a corner's being one, tells where it is.
pub fn seen(piece: &Array3<f32>, place: [usize; 2], whole: [usize; 2]) -> Features {
    let (rows, columns, _) = piece.dim();
    let from_middle = |i: usize, a: usize| {
        let half = 0.5 * whole[a] as f32;
        ((place[a] + 2 * i + 1) as f32 - half) / half
    };
    let map = Array2::from_shape_fn((rows / 2, columns / 2), |(y, x)| {
        0.5 * (from_middle(y, 0).powi(2) + from_middle(x, 1).powi(2))
    });
    squares(piece, &[map])
}
