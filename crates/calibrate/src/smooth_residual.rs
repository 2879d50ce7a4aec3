//! Residual of the effects, as smooth shapes that belong to no effect: a path, a transmission, a blur.

use ndarray::Array2;

use crate::simulator::Simulator;
use crate::smooth_shape::{PATH_TERMS, TRANSMISSION_TERMS};
use crate::statistics::{Fit, FitProblem, covariance, minimise};
use metalith_optics::legendre;
use metalith_optics::zernike;

/// Pairs of axes of the smooth blur.
const BLURS: [[usize; 2]; 3] = [[0, 0], [0, 1], [1, 1]];

/// Samples along each edge of the map of the path.
const SIDE: usize = 96;

/// Points of each curve of transmission.
const CURVE_POINTS: u32 = 41;

/// Smooth shapes fitted to the residual; everything found and every nuisance is projected out.
pub(crate) struct SmoothResidual {
    /// Optical path over the lens (nm), common to colours and elements; NaN outside. Shape `[SIDE, SIDE]`, row
    /// index along +y.
    pub path_nm: Array2<f64>,
    /// Root mean square over the lens (nm), and that of its noise.
    pub path_rms_nm: (f64, f64),
    /// Half the edge of the map (um).
    pub radius_um: f64,
    /// Relative change of amplitude over width (nm), for each LED.
    pub transmission: Vec<Vec<(f64, f64)>>,
    /// Covariance of a blur common to all measurements, xx, xy and yy, with standard deviations (um^2).
    pub blur_um2: [(f64, f64); 3],
    /// Reduced chi-square per pixel without and with the shapes.
    pub chi2: (f64, f64),
    /// The path's coefficients by Noll's index (nm), with their standard deviations.
    pub coefficients_nm: Vec<(u32, f64, f64)>,
}

impl SmoothResidual {
    /// Fit the shapes to what a fit leaves; none if the surrogate has no smooth terms.
    pub(crate) fn new(simulator: &Simulator<'_>, problem: &FitProblem<'_>, fit: &Fit) -> Option<Self> {
        let leds = problem.data.leds;
        let surrogate = &problem.surrogate;
        let simulated = surrogate.smooth_terms();
        if simulated < PATH_TERMS + TRANSMISSION_TERMS * leds {
            return None;
        }
        let equations = problem.equations_with(fit, |c, image| {
            let terms = (0..simulated).map(|t| surrogate.smooth_term(t, c, image));
            terms.chain(BLURS.map(|axes| image.blur(axes))).collect()
        });
        let total = problem.total(&equations, &fit.nuisances);
        let first = equations.size() - 1 - simulated - BLURS.len();
        let all: Vec<usize> = (0..equations.size() - 1).collect();
        let (_, without) = minimise(&total, &(0..first).collect::<Vec<_>>());
        let (x, with) = minimise(&total, &all);
        let pixels = problem.points();
        let covariance = covariance(&total, &all);
        let sigma = |k: usize| (covariance[(first + k, first + k)] * (with / pixels).max(1.0)).sqrt();
        let paths: Vec<f64> = (0..PATH_TERMS).map(|k| x[first + k]).collect();
        let rms = |v: &mut dyn Iterator<Item = f64>| v.map(|c| c * c).sum::<f64>().sqrt();
        let transmission = (0..leds)
            .map(|led| {
                let own = (0..TRANSMISSION_TERMS).map(|k| x[first + PATH_TERMS + k * leds + led]);
                transmission_curve(&own.collect::<Vec<_>>(), simulator.bench.widths_nm())
            })
            .collect();
        let element = simulator.bench.set().elements.first()?;
        Some(Self {
            path_rms_nm: (rms(&mut paths.iter().copied()), rms(&mut (0..PATH_TERMS).map(sigma))),
            coefficients_nm: (0..PATH_TERMS)
                .map(|k| (zernike::FIRST + k as u32, paths[k], sigma(k)))
                .collect(),
            blur_um2: [0, 1, 2].map(|k| (x[first + simulated + k], sigma(simulated + k))),
            path_nm: path_map(&paths),
            radius_um: 0.5 * element.aperture_diameter_um,
            transmission,
            chi2: (without / pixels, with / pixels),
        })
    }
}

fn path_map(coefficients_nm: &[f64]) -> Array2<f64> {
    let at = |i: usize| (i as f64 + 0.5) / SIDE as f64 * 2.0 - 1.0;
    Array2::from_shape_fn((SIDE, SIDE), |(iy, ix)| {
        let (px, py) = (at(ix), at(iy));
        if px * px + py * py > 1.0 {
            return f64::NAN;
        }
        let terms = coefficients_nm.iter().zip(zernike::FIRST..);
        terms.map(|(c, j)| c * zernike::value(j, px, py)).sum()
    })
}

/// Relative change of amplitude from the narrowest to the widest pillar.
fn transmission_curve(coefficients: &[f64], (narrow, wide): (f64, f64)) -> Vec<(f64, f64)> {
    (0..CURVE_POINTS)
        .map(|i| {
            let place = 2.0 * f64::from(i) / f64::from(CURVE_POINTS - 1) - 1.0;
            (
                0.5 * (narrow + wide) + 0.5 * place * (wide - narrow),
                legendre(coefficients, place),
            )
        })
        .collect()
}
