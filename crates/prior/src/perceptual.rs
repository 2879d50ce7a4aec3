//! Perceptual distance of two pictures as they look (LPIPS, learned), for a user who has its weights.
//!
//! Zhang, Isola, Efros, Shechtman and Wang, "The unreasonable effectiveness of deep features as a perceptual metric", CVPR
//! 2018: both pictures go through the five convolutions of AlexNet; what each of them finds at a place is made a vector of
//! length one; the squared differences of both pictures, weighed by feature, are averaged over the places and summed
//! over the convolutions. No weights come with the program: those of the authors are theirs to give.

use std::path::Path;

use half::f16;
use metalith_core::file::read_at_most;
use metalith_core::{Error, Result};
use ndarray::{Array3, ArrayView3, Axis};
use rayon::prelude::*;
use safetensors::tensor::{Dtype, SafeTensors};

/// A convolution of AlexNet.
struct Stage {
    /// Name of its tensors in the file.
    name: &'static str,
    /// Features that it takes and gives.
    features: [usize; 2],
    /// Taps an axis.
    taps: usize,
    stride: usize,
    /// Zeros on each side.
    margin: usize,
    /// True if the greatest of three by three is taken before it, every second place.
    pooled: bool,
}

const fn stage(name: &'static str, features: [usize; 2], [taps, stride, margin]: [usize; 3], pooled: bool) -> Stage {
    Stage {
        name,
        features,
        taps,
        stride,
        margin,
        pooled,
    }
}

/// Stages with the names that the authors' package gives them (`lpips.LPIPS(net="alex").state_dict()`).
const STAGES: [Stage; 5] = [
    stage("net.slice1.0", [3, 64], [11, 4, 2], false),
    stage("net.slice2.3", [64, 192], [5, 1, 2], true),
    stage("net.slice3.6", [192, 384], [3, 1, 1], true),
    stage("net.slice4.8", [384, 256], [3, 1, 1], false),
    stage("net.slice5.10", [256, 256], [3, 1, 1], false),
];

/// Mean of each colour of sRGB from -1 to 1 that the network was trained to expect; its deviation follows.
const MEAN: [f32; 3] = [-0.030, -0.088, -0.188];
const DEVIATION: [f32; 3] = [0.458, 0.448, 0.450];
/// Least length of a vector of features.
const LENGTH: f32 = 1e-10;
/// Pixels an axis below which nothing is left for the last convolution.
const LEAST_PIXELS: usize = 35;
/// Longest file of weights (bytes): ten times what they need in single precision.
const LONGEST: u64 = 100 << 20;

/// The weights of the distance.
pub struct PerceptualDistance {
    layers: Vec<Layer>,
}

struct Layer {
    /// `[feature, feature before, row, column]`.
    weights: Vec<f32>,
    bias: Vec<f32>,
    /// Weight of a squared difference of each feature.
    counts: Vec<f32>,
}

impl PerceptualDistance {
    /// Distance by the weights of a file of safetensors, in half or single precision.
    ///
    /// # Errors
    /// If it cannot be read, or a tensor is missing or of another shape: all of them at once.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = read_at_most(path, LONGEST, "a file of weights")?;
        let fault = |what: String| {
            let hint = "write `{k: v.clone() for k, v in lpips.LPIPS(net=\"alex\").state_dict().items()}` of the authors' package by `safetensors.torch.save_file`";
            Error::table(path, None, what, hint)
        };
        let file = SafeTensors::deserialize(&bytes).map_err(|e| fault(format!("it is no file of safetensors: {e}")))?;
        let mut faults = Vec::new();
        let mut tensor = |name: String, shape: &[usize]| match values(&file, &name, shape) {
            Ok(values) => values,
            Err(what) => {
                faults.push(what);
                Vec::new()
            }
        };
        let layers = STAGES
            .iter()
            .enumerate()
            .map(|(k, stage)| {
                let [from, to] = stage.features;
                Layer {
                    weights: tensor(format!("{}.weight", stage.name), &[to, from, stage.taps, stage.taps]),
                    bias: tensor(format!("{}.bias", stage.name), &[to]),
                    counts: tensor(format!("lin{k}.model.1.weight"), &[1, to, 1, 1]),
                }
            })
            .collect();
        if faults.is_empty() {
            Ok(Self { layers })
        } else {
            Err(fault(faults.join("; ")))
        }
    }

    /// Distance of two pictures, sRGB from 0 to 1 `[row, column, colour]`: 0 of equal ones, rarely above 1.
    ///
    /// # Errors
    /// If they differ in shape, are no colours, or are smaller than the network sees.
    pub fn between(&self, a: ArrayView3<'_, f64>, b: ArrayView3<'_, f64>) -> Result<f64> {
        let (rows, columns, colours) = a.dim();
        if a.dim() != b.dim() || colours != 3 || rows.min(columns) < LEAST_PIXELS {
            return Err(Error::refused(
                "score/sizes-differ",
                format!(
                    "pictures of {:?} and {:?} have no perceptual distance",
                    a.shape(),
                    b.shape()
                ),
                format!("give two of the same shape, three colours, at least {LEAST_PIXELS} x {LEAST_PIXELS} pixels"),
            ));
        }
        let mut both = [a, b].map(normalised);
        let mut sum = 0.0;
        for (layer, stage) in self.layers.iter().zip(&STAGES) {
            both = both.map(|features| layer.features(stage, features));
            sum += layer.distance(&both);
        }
        Ok(sum)
    }
}

/// Values of a tensor of this shape, or what is wrong with it.
fn values(file: &SafeTensors<'_>, name: &str, shape: &[usize]) -> std::result::Result<Vec<f32>, String> {
    let tensor = file.tensor(name).map_err(|_| format!("`{name}` is missing"))?;
    if tensor.shape() != shape {
        return Err(format!("`{name}` is {:?} and not {shape:?}", tensor.shape()));
    }
    let values: Vec<f32> = match tensor.dtype() {
        Dtype::F32 => tensor
            .data()
            .as_chunks::<4>()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect(),
        Dtype::F16 => tensor
            .data()
            .as_chunks::<2>()
            .0
            .iter()
            .map(|b| f16::from_le_bytes(*b).to_f32())
            .collect(),
        other => return Err(format!("`{name}` is of {other:?}, neither F32 nor F16")),
    };
    if values.iter().all(|v| v.is_finite()) {
        Ok(values)
    } else {
        Err(format!("`{name}` has values that are no numbers"))
    }
}

/// Colours first, as the network expects them.
fn normalised(picture: ArrayView3<'_, f64>) -> Array3<f32> {
    let (rows, columns, _) = picture.dim();
    Array3::from_shape_fn((3, rows, columns), |(c, y, x)| {
        let value = 2.0 * picture[[y, x, c]].clamp(0.0, 1.0) as f32 - 1.0;
        (value - MEAN[c]) / DEVIATION[c]
    })
}

/// The greatest of three by three, every second place, all within.
fn pooled(features: &Array3<f32>) -> Array3<f32> {
    let (count, rows, columns) = features.dim();
    let after = |n: usize| (n - 3) / 2 + 1;
    Array3::from_shape_fn((count, after(rows), after(columns)), |(f, y, x)| {
        let near = (0..9).map(|k| features[[f, 2 * y + k / 3, 2 * x + k % 3]]);
        near.fold(f32::MIN, f32::max)
    })
}

impl Layer {
    /// Output of the convolution, nothing negative.
    fn features(&self, stage: &Stage, before: Array3<f32>) -> Array3<f32> {
        let before = if stage.pooled { pooled(&before) } else { before };
        let (from, rows, columns) = before.dim();
        let Stage {
            taps, stride, margin, ..
        } = *stage;
        let after = |n: usize| (n + 2 * margin - taps) / stride + 1;
        let (down, across) = (after(rows), after(columns));
        let mut out = Array3::<f32>::zeros((stage.features[1], down, across));
        let values = before.as_slice().expect("in standard order");
        let planes = out.as_slice_mut().expect("in standard order");
        planes
            .par_chunks_exact_mut(down * across)
            .enumerate()
            .for_each(|(feature, plane)| {
                plane.fill(self.bias[feature]);
                let weights = &self.weights[feature * from * taps * taps..][..from * taps * taps];
                for (tap, weight) in weights.iter().enumerate() {
                    let (plane_before, ky, kx) = (tap / (taps * taps), tap / taps % taps, tap % taps);
                    let source = &values[plane_before * rows * columns..][..rows * columns];
                    // Places whose tap is inside the picture.
                    let within = |k: usize, n: usize, last: usize| {
                        let first = margin.saturating_sub(k).div_ceil(stride);
                        let end = (n + margin).saturating_sub(k).div_ceil(stride).min(last);
                        first..end.max(first)
                    };
                    let xs = within(kx, columns, across);
                    for y in within(ky, rows, down) {
                        let line = &source[(y * stride + ky - margin) * columns..][..columns];
                        let to = &mut plane[y * across..][xs.clone()];
                        let begin = xs.start * stride + kx - margin;
                        if stride == 1 {
                            to.iter_mut().zip(&line[begin..]).for_each(|(o, v)| *o += weight * v);
                        } else {
                            let every = line[begin..].iter().step_by(stride);
                            to.iter_mut().zip(every).for_each(|(o, v)| *o += weight * v);
                        }
                    }
                }
                plane.iter_mut().for_each(|v| *v = v.max(0.0));
            });
        out
    }

    /// Mean over the places of the weighed squared differences of vectors of length one.
    fn distance(&self, [a, b]: &[Array3<f32>; 2]) -> f64 {
        let (_, rows, columns) = a.dim();
        let place = |(y, x): (usize, usize)| -> f64 {
            let [u, v] = [a, b].map(|f| f.index_axis(Axis(2), x).index_axis_move(Axis(1), y));
            let [m, n] = [&u, &v].map(|f| f.iter().map(|v| v * v).sum::<f32>().sqrt() + LENGTH);
            let parts = u.iter().zip(&v).zip(&self.counts);
            parts
                .map(|((u, v), count)| f64::from(count * (u / m - v / n).powi(2)))
                .sum()
        };
        let all = (0..rows * columns).map(|i| place((i / columns, i % columns)));
        all.sum::<f64>() / (rows * columns) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::tensor::TensorView;

    /// Tolerance of single precision against the double precision of `scripts/lpips_reference.py`.
    const SINGLE: f64 = 2e-4;
    /// Number that the script prints.
    const REFERENCE: f64 = 0.320_873_53;

    /// Numbers that the script makes too.
    fn number(i: usize, layer: usize) -> f32 {
        (0.7 * i as f64 + layer as f64).sin() as f32
    }

    fn file(leave_out: &str) -> tempfile::NamedTempFile {
        let mut tensors: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
        let mut put = |name: String, shape: Vec<usize>, of: &dyn Fn(usize) -> f32| {
            let bytes = (0..shape.iter().product()).flat_map(|i| of(i).to_le_bytes()).collect();
            tensors.push((name, shape, bytes));
        };
        for (k, stage) in STAGES.iter().enumerate() {
            let [from, to] = stage.features;
            let size = ((from * stage.taps * stage.taps) as f32).sqrt();
            put(
                format!("{}.weight", stage.name),
                vec![to, from, stage.taps, stage.taps],
                &|i| number(i, k) * 2.0 / size,
            );
            put(format!("{}.bias", stage.name), vec![to], &|i| 0.1 * number(i, k + 10));
            put(format!("lin{k}.model.1.weight"), vec![1, to, 1, 1], &|i| {
                number(i, k + 20).abs()
            });
        }
        let views = tensors
            .iter()
            .filter(|(name, ..)| name != leave_out)
            .map(|(name, shape, bytes)| (name.clone(), TensorView::new(Dtype::F32, shape.clone(), bytes).unwrap()));
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), safetensors::serialize(views, None).unwrap()).unwrap();
        file
    }

    fn picture(frequency: f64) -> Array3<f64> {
        Array3::from_shape_fn((71, 83, 3), |(y, x, c)| {
            0.5 + 0.4 * (frequency * (y as f64 + 2.0 * x as f64) + c as f64).sin()
        })
    }

    #[test]
    fn agrees_with_another_account_of_the_same_network() {
        let distance = PerceptualDistance::read(file("").path()).unwrap();
        let (a, b) = (picture(0.11), picture(0.17));
        let found = distance.between(a.view(), b.view()).unwrap();
        assert!((found / REFERENCE - 1.0).abs() < SINGLE, "{found}");
        assert_eq!(distance.between(a.view(), a.view()).unwrap(), 0.0);
    }

    #[test]
    fn a_tensor_that_is_missing_and_a_small_picture_are_refused() {
        let refused = PerceptualDistance::read(file("lin3.model.1.weight").path())
            .err()
            .unwrap();
        assert!(
            refused.to_string().contains("`lin3.model.1.weight` is missing"),
            "{refused}"
        );
        let distance = PerceptualDistance::read(file("").path()).unwrap();
        let small = Array3::zeros((20, 40, 3));
        assert!(distance.between(small.view(), small.view()).is_err());
    }
}
