//! The free term: what is left over, as smooth shapes that go by no name.

use ndarray::Array2;

use super::atlas::{FREE_PHASES, FREE_TRANSMISSIONS};
use super::attribute::Finding;
use super::placebo::forms_with;
use super::quadratic::{covariance, minimise};
use super::session::Session;
use metalith_made::{legendre, zernike};

/// Pairs of axes of the free blur.
const BLURS: [[usize; 2]; 3] = [[0, 0], [0, 1], [1, 1]];

/// Shapes fitted to what is left, everything found and every nuisance projected out.
pub struct FreeTerm {
    /// Optical path over the lens [nm], common to colours and elements; not a number outside. Row index along
    /// +y.
    pub path_nm: Array2<f64>,
    /// Its root mean square over the lens [nm], and that of its noise.
    pub path_rms_nm: (f64, f64),
    /// Half the edge of the map [um].
    pub radius_um: f64,
    /// Relative change of amplitude over width [nm], for each LED.
    pub transmission: Vec<Vec<(f64, f64)>>,
    /// Covariance of a blur common to all captures, xx, xy and yy, with standard deviations [um^2].
    pub blur_um2: [(f64, f64); 3],
    /// Chi-square a pixel without and with it.
    pub chi2: (f64, f64),
    /// The path's coefficients by Noll's number [nm], with their standard deviations.
    pub coefficients_nm: Vec<(u32, f64, f64)>,
}

impl FreeTerm {
    /// Fit it to what a finding leaves; none if the atlas has no free terms.
    pub fn new(session: &Session<'_>, finding: &Finding) -> Option<Self> {
        let leds = session.set().leds.len();
        let atlas = &finding.atlas;
        if atlas.free.len() < FREE_PHASES + FREE_TRANSMISSIONS * leds {
            return None;
        }
        let problem = session.problem_of(finding);
        let simulated = atlas.free.len();
        let forms = forms_with(&problem, &finding.after, |c, grid| {
            let terms = (0..simulated).map(|t| atlas.free_term(t, c, grid));
            terms.chain(BLURS.map(|axes| grid.blur(axes))).collect()
        });
        let size = forms[0].nrows();
        let total = problem.total(&forms, &finding.after.nuisances);
        let first = size - 1 - simulated - BLURS.len();
        let all: Vec<usize> = (0..size - 1).collect();
        let (_, without) = minimise(&total, &(0..first).collect::<Vec<_>>());
        let (x, with) = minimise(&total, &all);
        let pixels = problem.pixels();
        let sigma = covariance(&total, &all);
        let sigma = |k: usize| (sigma[(first + k, first + k)] * (with / pixels).max(1.0)).sqrt();
        let phases: Vec<f64> = (0..FREE_PHASES).map(|k| x[first + k]).collect();
        let element = &session.set().elements[0];
        let radius_um = 0.5 * element.aperture_diameter_um;
        let side = 96;
        let at = |i: usize| (i as f64 + 0.5) / side as f64 * 2.0 - 1.0;
        let path_nm = Array2::from_shape_fn((side, side), |(iy, ix)| {
            let (px, py) = (at(ix), at(iy));
            if px * px + py * py > 1.0 {
                return f64::NAN;
            }
            phases
                .iter()
                .zip(zernike::FIRST..)
                .map(|(c, j)| c * zernike::value(j, px, py))
                .sum()
        });
        let rms = |v: &mut dyn Iterator<Item = f64>| v.map(|c| c * c).sum::<f64>().sqrt();
        let (narrow, wide) = session.simulator.bench.widths_nm();
        let transmission = (0..leds)
            .map(|led| {
                let own: Vec<f64> = (0..FREE_TRANSMISSIONS)
                    .map(|k| x[first + FREE_PHASES + k * leds + led])
                    .collect();
                (0..=40)
                    .map(|i| {
                        let place = f64::from(i) / 20.0 - 1.0;
                        (
                            0.5 * (narrow + wide) + 0.5 * place * (wide - narrow),
                            legendre(&own, place),
                        )
                    })
                    .collect()
            })
            .collect();
        Some(Self {
            path_rms_nm: (rms(&mut phases.iter().copied()), rms(&mut (0..FREE_PHASES).map(sigma))),
            coefficients_nm: (0..FREE_PHASES)
                .map(|k| (zernike::FIRST + k as u32, phases[k], sigma(k)))
                .collect(),
            blur_um2: [0, 1, 2].map(|k| (x[first + simulated + k], sigma(simulated + k))),
            path_nm,
            radius_um,
            transmission,
            chi2: (without / pixels, with / pixels),
        })
    }
}
