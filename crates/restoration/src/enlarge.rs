//! Pictures with more pixels over the same field.

use ndarray::Array2;

/// Pixels of the smaller picture along one axis that a pixel of the larger one follows from, with their weights.
type Taps = [(usize, f32); 4];

/// The cubic polynomial of Keys (IEEE Trans. Acoust. Speech Signal Process. 29, 1153 (1981)) through four pixels.
fn weights(t: f64) -> [f64; 4] {
    [
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    ]
}

/// Taps of `n` pixels of which each is `step` of the `from` smaller ones, both about the same middle. Beyond its border a picture is as
/// it is there.
fn taps(n: usize, from: usize, step: f64) -> Vec<Taps> {
    let one = |i: usize| {
        let place = (i as f64 - 0.5 * (n as f64 - 1.0)) * step + 0.5 * (from as f64 - 1.0);
        let low = place.floor();
        let weights = weights(place - low);
        std::array::from_fn(|k| {
            let at = (low as i64 + k as i64 - 1).clamp(0, from as i64 - 1);
            (at as usize, weights[k] as f32)
        })
    };
    (0..n).map(one).collect()
}

/// A picture in so many rows and columns; its columns fill the same field.
pub(crate) fn enlarged(picture: &Array2<f32>, (rows, columns): (usize, usize)) -> Array2<f32> {
    let step = picture.ncols() as f64 / columns as f64;
    let down = taps(rows, picture.nrows(), step);
    let across = taps(columns, picture.ncols(), step);
    let lines = Array2::from_shape_fn((rows, picture.ncols()), |(y, x)| {
        down[y].iter().map(|(at, w)| w * picture[[*at, x]]).sum::<f32>()
    });
    Array2::from_shape_fn((rows, columns), |(y, x)| {
        across[x].iter().map(|(at, w)| w * lines[[y, *at]]).sum::<f32>()
    })
}
