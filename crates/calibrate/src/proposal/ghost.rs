//! A second image: a share of all light again, displaced by the same distance and blurred alike in every measurement.

use ndarray::Array2;
use rayon::prelude::*;

use crate::effects::{DeclaredEffect, DeclaredParameter};
use crate::statistics::{Fit, FitProblem, Measurements};
use metalith_core::{Progress, Result};
use metalith_optics::{DeclaredQuantity, blur};
use metalith_wave::kernels::sum_of_products;

/// Part of a frame's edge that displacements go to: light from farther is not in the frame.
const REACH: f64 = 0.25;

/// Farthest displacement along an axis (pixels): work goes with its square times the pixels of all measurements.
const MOST_REACH: i32 = 32;

/// Largest typical size of a proposed ghost's share, so that some multiples of it lie within its range.
const MOST_TYPICAL: f64 = 0.2;

/// Nearest displacement (pixels): what is nearer is a blur.
const NEAREST: i32 = 2;

/// Blurs that are tried, standard deviations in pixels: none first.
const BLURS: [f64; 9] = [0.0, 0.35, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6];

/// Largest blur of a proposed ghost (pixels): beyond, it is a veil.
const MOST_BLUR_PIXELS: f64 = 8.0;

/// Error of a blur, as a share of its variance, and at the least (pixels^2): the step between those that are
/// tried, and the one from none.
const BLUR_OFF: f64 = 0.6;
const LEAST_BLUR_OFF: f64 = 0.12;

/// Standard deviation of the spot that stands for a point (pixels): of what a pixel resolves it takes 3 % or less.
const POINT_PIXELS: f64 = 0.15;

/// Largest share of a ghost: beyond, it is the image.
const MOST_SHARE: f64 = 0.5;

/// Error of the place of a proposed ghost (pixels).
const ROOM_PIXELS: i32 = 4;

/// The displaced copy that removes most of the residual.
pub(super) struct Ghost {
    /// Light over that of the image.
    share: f64,
    /// Displacement along x and y (pixels).
    at: [i32; 2],
    /// Blur over that of the image: standard deviation (pixels).
    blur: f64,
    /// Decrease of chi-square.
    pub removed: f64,
}

/// Whitened pixels of one measurement, with what nuisances explain taken out of the residual.
#[derive(Clone)]
struct Frame {
    /// The image as predicted, in DN, with the blur that is tried.
    model: Array2<f32>,
    weight: Array2<f32>,
    residual: Vec<f32>,
    /// Orthonormal: flux, black level, registration along x and y.
    nuisances: Vec<Vec<f32>>,
}

impl Frame {
    fn new(model: Array2<f32>, weight: &Array2<f32>, residual: &Array2<f32>) -> Self {
        let (rows, cols) = model.dim();
        let at = |y: usize, x: usize| model[[y.min(rows - 1), x.min(cols - 1)]];
        let slope = |along: [usize; 2]| {
            Array2::from_shape_fn((rows, cols), |(y, x)| {
                at(y + along[1], x + along[0]) - at(y.saturating_sub(along[1]), x.saturating_sub(along[0]))
            })
        };
        let columns = [
            model.clone(),
            Array2::from_elem((rows, cols), 1.0),
            slope([1, 0]),
            slope([0, 1]),
        ];
        let mut nuisances: Vec<Vec<f32>> = Vec::new();
        for column in columns {
            let mut own: Vec<f32> = column.iter().zip(weight).map(|(v, w)| v * w).collect();
            take_out(&mut own, &nuisances);
            let norm = sum_of_products(&own, &own).sqrt();
            if norm > 0.0 {
                own.iter_mut().for_each(|v| *v = (f64::from(*v) / norm) as f32);
                nuisances.push(own);
            }
        }
        let mut residual: Vec<f32> = residual.iter().copied().collect();
        take_out(&mut residual, &nuisances);
        Self {
            model,
            weight: weight.clone(),
            residual,
            nuisances,
        }
    }

    /// Ghost with its image blurred.
    fn blurred(&self, pixels: f64) -> Self {
        let mut image = self.model.mapv(f64::from);
        blur(&mut image, pixels);
        Self {
            model: image.mapv(|v| v as f32),
            ..self.clone()
        }
    }

    /// Product of the displaced image with the residual, and with itself, nuisances taken out.
    fn products(&self, [dx, dy]: [i32; 2]) -> [f64; 2] {
        let (rows, cols) = self.model.dim();
        let from = |place: usize, by: i32, size: usize| {
            let place = place as i64 - i64::from(by);
            usize::try_from(place).ok().filter(|p| *p < size)
        };
        let displaced = Array2::from_shape_fn((rows, cols), |(y, x)| {
            let source = from(y, dy, rows).zip(from(x, dx, cols));
            source.map_or(0.0, |(y, x)| self.model[[y, x]])
        });
        let column: Vec<f32> = displaced.iter().zip(&self.weight).map(|(v, w)| v * w).collect();
        let taken: f64 = self.nuisances.iter().map(|n| sum_of_products(n, &column).powi(2)).sum();
        [
            sum_of_products(&column, &self.residual),
            sum_of_products(&column, &column) - taken,
        ]
    }
}

/// The displacement whose copy removes most of the residual of a fit; none if no copy adds light.
///
/// # Errors
/// If the user stopped it.
pub(super) fn strongest(problem: &FitProblem<'_>, fit: &Fit, progress: &dyn Progress) -> Result<Option<Ghost>> {
    let data = problem.data;
    let frames: Vec<Frame> = data
        .indices()
        .filter(|&c| problem.used[c])
        .map(|c| {
            let pixels = problem.prediction(&fit.theta, c).pixels(fit.nuisances.shift_um[c]);
            let residual = fit.nuisances.whitened(data, c, &pixels);
            let dn = fit.nuisances.dn(data, c) as f32;
            Frame::new(pixels.mapv(|v| v * dn), &data.weight[c], &residual)
        })
        .collect();
    let Some(first) = frames.first() else { return Ok(None) };
    let (rows, cols) = first.model.dim();
    let [rows, cols] = [rows, cols].map(|edge| ((REACH * edge as f64) as i32).min(MOST_REACH));
    let all = |[y, x]: [i32; 2], [rows, cols]: [i32; 2]| {
        let places = (y - rows..=y + rows).flat_map(move |dy| (x - cols..=x + cols).map(move |dx| [dx, dy]));
        places
            .filter(|at| at.iter().any(|d| d.abs() >= NEAREST))
            .collect::<Vec<_>>()
    };
    let Some(mut best) = strongest_of(&frames, 0.0, &all([0; 2], [rows, cols]), progress)? else {
        return Ok(None);
    };
    // A blurred copy is centred where the sharp one that is most like it is, or close by.
    let [x, y] = best.at;
    let around = all([y, x], [ROOM_PIXELS; 2]);
    for pixels in BLURS.into_iter().filter(|b| *b > 0.0) {
        let blurred: Vec<Frame> = frames.iter().map(|f| f.blurred(pixels)).collect();
        match strongest_of(&blurred, pixels, &around, progress)? {
            Some(ghost) if ghost.removed > best.removed => best = ghost,
            _ => break,
        }
    }
    Ok(Some(best))
}

/// Copy that removes most, of copies that are blurred so much (pixels) and displaced to these places.
fn strongest_of(frames: &[Frame], blur: f64, places: &[[i32; 2]], progress: &dyn Progress) -> Result<Option<Ghost>> {
    progress.begin("looking for a second image", places.len() as u64);
    let tried: Vec<Option<Ghost>> = places
        .par_iter()
        .map(|&at| {
            progress.check_stopped()?;
            progress.advance(1);
            let sum = frames
                .iter()
                .map(|f| f.products(at))
                .fold([0.0; 2], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
            Ok((sum[0] > 0.0 && sum[1] > 0.0).then(|| Ghost {
                share: sum[0] / sum[1],
                at,
                blur,
                removed: sum[0] * sum[0] / sum[1],
            }))
        })
        .collect::<Result<_>>()?;
    let tried = tried.into_iter().flatten();
    Ok(tried.max_by(|a, b| a.removed.total_cmp(&b.removed)))
}

impl Ghost {
    /// Effect to be fitted: a copy with its own spot, a Gaussian whose variance may be zero. One form serves sharp
    /// and blurred copies, so that no two proposals compete for the same light.
    pub(crate) fn declared(&self, pixel_um: f64) -> DeclaredEffect {
        let place = |name: &str, at: i32| {
            let (start, room) = (f64::from(at) * pixel_um, f64::from(ROOM_PIXELS) * pixel_um);
            DeclaredParameter {
                name: name.into(),
                range: (start - room, start + room),
                prior: 0.5 * pixel_um,
                start,
            }
        };
        let share = DeclaredParameter {
            name: "a".into(),
            range: (-MOST_SHARE, MOST_SHARE),
            prior: self.share.clamp(1e-3, MOST_TYPICAL),
            start: 0.0,
        };
        let um2 = |pixels2: f64| pixels2 * pixel_um * pixel_um;
        let variance = DeclaredParameter {
            name: "variance".into(),
            range: (0.0, um2(MOST_BLUR_PIXELS.powi(2))),
            prior: um2((BLUR_OFF * self.blur.powi(2)).max(LEAST_BLUR_OFF)),
            start: um2(self.blur.powi(2)),
        };
        let spot = format!("max(variance, {:?})", um2(POINT_PIXELS.powi(2)));
        DeclaredEffect {
            name: "ghost".into(),
            unit: "fraction, um, um, um^2".into(),
            quantity: DeclaredQuantity::Kernel,
            expression: format!("a * exp(-((x - u)^2 + (y - v)^2) / (2 * {spot})) / (2 * pi * {spot})"),
            parameters: vec![share, place("u", self.at[0]), place("v", self.at[1]), variance],
        }
    }
}

fn take_out(column: &mut [f32], basis: &[Vec<f32>]) {
    for own in basis {
        let part = sum_of_products(own, column) as f32;
        column.iter_mut().zip(own).for_each(|(v, o)| *v -= part * o);
    }
}
