//! Mean statistics of photographs, by how far they are reduced.

use std::f64::consts::PI;

use metalith_restoration::PHOTOGRAPH_PIXELS;
use serde::{Deserialize, Serialize};

use super::bands::{BANDS, Bands, ZONES};
use crate::geometry::SceneView;

/// Radius (cycles a pixel) of the disc that holds as much power of a spectrum 1 / f^2 as the square of all frequencies.
const SQUARE: f64 = 0.565;

/// Statistics of a zone of the field.
pub(crate) struct NaturalZone {
    /// Mean light, white being one.
    pub light: f64,
    /// Powers of the planes that vary independently: grey, red against blue, and green against both.
    pub planes: [Bands; 3],
}

/// Relation between the pixels of a scene and those of a photograph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sampling {
    /// A whole photograph, reduced to the pixels of the scene.
    Whole,
    /// A piece from the middle of a photograph, at the photograph's own pixels.
    Piece,
}

/// Photographs of one sampling.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NaturalScenes {
    pub sampling: Sampling,
    /// Pixels of a photograph, along an axis, that a pixel of the simulated scene averages.
    pub reduction: f64,
    /// Pixels of the simulated scene over its field.
    pub pixels_per_degree: f64,
}

/// Forecast for the photographs of one sampling: PSNR of linear light (dB) in all zones ([`crate::Zone::ALL`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NaturalForecast {
    #[serde(flatten)]
    pub scenes: NaturalScenes,
    /// Forecast for the mean power of the photographs, which is near their median.
    pub psnr_linear_db: Vec<f64>,
    /// One photograph in ten has less.
    pub low_db: Vec<f64>,
    /// One photograph in ten has more.
    pub high_db: Vec<f64>,
}

impl NaturalScenes {
    /// Samplings that a scene of so many pixels along its longer side may have, the likeliest first. A scene with fewer pixels than the
    /// photographs of the statistics is a reduced photograph or a piece of one.
    pub(crate) fn of(given: &SceneView, simulated: &SceneView) -> Vec<Self> {
        let [given_pixels, pixels] = [given, simulated].map(|view| view.rows.max(view.columns) as f64);
        let of = |sampling, photograph: f64| Self {
            sampling,
            reduction: photograph / pixels,
            pixels_per_degree: simulated.columns as f64 / simulated.field_deg,
        };
        let photograph = PHOTOGRAPH_PIXELS as f64;
        let whole = of(Sampling::Whole, given_pixels.max(photograph));
        if given_pixels < photograph {
            vec![whole, of(Sampling::Piece, given_pixels)]
        } else {
            vec![whole]
        }
    }

    /// Half of the range (dB) that holds eight of ten photographs.
    pub(super) fn spread_db(&self) -> f64 {
        /// Deviations of the forecasts of twelve photographs (of the 24 in `docs/method/restoration.md`), 96 x 96 pixels.
        const DEVIATIONS_DB: [f64; 2] = [3.7, 4.8];
        /// Half of the interval that holds the thirteenth of normal numbers with probability 0.8, in deviations of the twelve
        /// (Student's t of 11 degrees of freedom, times the root of 1 + 1/12).
        const OF_DEVIATION: f64 = 1.42;
        OF_DEVIATION
            * match self.sampling {
                Sampling::Whole => DEVIATIONS_DB[0],
                Sampling::Piece => DEVIATIONS_DB[1],
            }
    }

    /// The sampling in words.
    pub fn words(&self) -> String {
        let each = format!("{:.3} pixels a degree", self.pixels_per_degree);
        match self.sampling {
            Sampling::Whole if self.reduction > 1.0 => {
                format!("whole photographs reduced {:.1} times, {each}", self.reduction)
            }
            Sampling::Whole => format!("photographs at their own pixels, {each}"),
            Sampling::Piece => format!("pieces of photographs at their own pixels, {each}"),
        }
    }
}

/// Powers of a photograph that is reduced by a factor. A band of the reduced photograph holds the power of lower frequencies of the
/// photograph itself, attenuated by the average over a pixel, and their alias.
pub(super) fn reduced(native: &Bands, factor: f64) -> Bands {
    let (mut lower, mut below) = (0.0, 0.0);
    std::array::from_fn(|band| {
        let upper = BANDS[band].min(SQUARE);
        let up_to_here = up_to(native, upper / factor);
        let passed = averaged((f64::max(lower, 0.5 * upper) * upper).sqrt(), factor);
        let power = passed * (up_to_here - below);
        (lower, below) = (upper, up_to_here);
        power
    })
}

/// Power of a photograph up to a frequency (cycles of its pixels): within a band each octave has the same, as of a spectrum 1 / f^2.
fn up_to(native: &Bands, frequency: f64) -> f64 {
    let ends = BANDS.map(|end| end.min(SQUARE));
    let octaves = |from: f64, to: f64| (to / from).log2();
    let band = ends.iter().position(|end| frequency <= *end).unwrap_or(BANDS.len() - 1);
    let below: f64 = native[..band].iter().sum();
    match band {
        // The mean of the light is in it: the octaves below its end have the power of the next band's.
        0 => native[0] - native[1] * octaves(frequency, ends[0]) / octaves(ends[0], ends[1]),
        _ => below + native[band] * octaves(ends[band - 1], frequency) / octaves(ends[band - 1], ends[band]),
    }
}

/// Power of a frequency (cycles a pixel of the reduced photograph) after averaging, over that before, with the frequency that it is
/// mistaken for.
fn averaged(frequency: f64, factor: f64) -> f64 {
    let box_of = |f: f64| (PI * f).sin() / (PI * f);
    // The pixels of the photograph itself have averaged already.
    let passed = |f: f64| (box_of(f) / box_of(f / factor)).powi(2);
    let mistaken = 1.0 - frequency;
    let alias = if mistaken / factor < 0.5 {
        passed(mistaken) * (frequency / mistaken).powi(2)
    } else {
        0.0
    };
    passed(frequency) + alias
}

/// The mean of 25 photographs of 576 x 576 pixels (GB82 image dataset, CC0), by `examples/scene_power`. Frequencies are those of a
/// photograph's own pixels.
pub(crate) const NATURAL: [NaturalZone; ZONES.len()] = [
    NaturalZone {
        light: 0.2110,
        planes: [
            [
                2.39e-1, 1.60e-2, 1.01e-2, 5.71e-3, 3.76e-3, 2.99e-3, 2.04e-3, 2.73e-3, 1.42e-3, 1.94e-3, 1.72e-3,
                7.28e-4, 9.54e-4, 4.54e-4,
            ],
            [
                2.00e-1, 1.72e-2, 1.01e-2, 7.15e-3, 4.66e-3, 3.63e-3, 2.33e-3, 2.93e-3, 1.45e-3, 1.95e-3, 1.39e-3,
                6.23e-4, 6.77e-4, 3.24e-4,
            ],
            [
                1.32e-1, 1.08e-2, 8.00e-3, 5.57e-3, 3.62e-3, 3.09e-3, 2.34e-3, 2.79e-3, 1.86e-3, 2.44e-3, 1.64e-3,
                8.20e-4, 8.41e-4, 3.83e-4,
            ],
        ],
    },
    NaturalZone {
        light: 0.2009,
        planes: [
            [
                2.66e-1, 1.14e-2, 7.08e-3, 4.26e-3, 2.96e-3, 2.27e-3, 1.62e-3, 1.72e-3, 1.17e-3, 1.70e-3, 1.12e-3,
                5.81e-4, 6.44e-4, 3.04e-4,
            ],
            [
                1.16e-1, 9.80e-3, 7.16e-3, 4.82e-3, 2.98e-3, 2.43e-3, 1.65e-3, 1.75e-3, 1.08e-3, 1.52e-3, 8.46e-4,
                4.44e-4, 4.47e-4, 2.14e-4,
            ],
            [
                8.62e-2, 6.33e-3, 5.09e-3, 3.75e-3, 2.46e-3, 2.77e-3, 2.05e-3, 1.56e-3, 1.05e-3, 1.35e-3, 7.81e-4,
                4.54e-4, 4.31e-4, 2.17e-4,
            ],
        ],
    },
    NaturalZone {
        light: 0.2045,
        planes: [
            [
                2.99e-1, 9.83e-3, 6.57e-3, 3.31e-3, 2.22e-3, 1.92e-3, 1.36e-3, 1.24e-3, 9.15e-4, 1.24e-3, 7.15e-4,
                4.30e-4, 4.50e-4, 2.07e-4,
            ],
            [
                6.89e-2, 7.92e-3, 6.40e-3, 3.49e-3, 2.09e-3, 1.53e-3, 1.05e-3, 1.09e-3, 8.21e-4, 1.06e-3, 5.36e-4,
                3.14e-4, 3.26e-4, 1.64e-4,
            ],
            [
                6.78e-2, 5.08e-3, 3.98e-3, 2.62e-3, 1.52e-3, 1.31e-3, 1.00e-3, 8.81e-4, 6.31e-4, 8.10e-4, 5.13e-4,
                3.19e-4, 3.24e-4, 1.71e-4,
            ],
        ],
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reduced_photograph_has_the_power_that_is_counted_in_it() {
        /// Ratio of a band's power: the spectrum of the mean is no straight line within a band, and few pictures have much of it.
        const OF_A_BAND: f64 = 1.5;
        /// Ratio of the sum of the bands finer than 0.1 cycles a pixel, which a camera loses in part.
        const OF_DETAIL: f64 = 1.15;
        // By `examples/scene_power` of the same photographs, averaged over 3 x 3 and 6 x 6 pixels: grey, middle and corner.
        const COUNTED: [(f64, usize, Bands); 4] = [
            (
                3.0,
                0,
                [
                    2.02e-1, 1.92e-2, 1.56e-2, 8.22e-3, 4.62e-3, 4.24e-3, 2.84e-3, 2.92e-3, 2.33e-3, 3.25e-3, 1.85e-3,
                    1.35e-3, 2.57e-3, 1.50e-3,
                ],
            ),
            (
                3.0,
                2,
                [
                    2.75e-1, 1.68e-2, 1.12e-2, 5.17e-3, 3.65e-3, 2.60e-3, 2.13e-3, 1.70e-3, 1.39e-3, 1.86e-3, 1.26e-3,
                    9.06e-4, 1.16e-3, 9.51e-4,
                ],
            ),
            (
                6.0,
                0,
                [
                    1.99e-1, 3.80e-2, 1.62e-2, 1.16e-2, 6.89e-3, 6.19e-3, 3.51e-3, 2.98e-3, 2.50e-3, 3.78e-3, 2.55e-3,
                    1.99e-3, 2.63e-3, 2.01e-3,
                ],
            ),
            (
                6.0,
                2,
                [
                    2.44e-1, 2.24e-2, 1.39e-2, 8.21e-3, 5.09e-3, 3.72e-3, 2.90e-3, 2.43e-3, 1.68e-3, 2.50e-3, 1.51e-3,
                    1.16e-3, 1.48e-3, 1.33e-3,
                ],
            ),
        ];
        for (factor, zone, counted) in COUNTED {
            let found = reduced(&NATURAL[zone].planes[0], factor);
            // A band of coarser waves than a few of the picture holds what its zone happens to have.
            for (a, b) in found.iter().zip(&counted).skip(3) {
                assert!(
                    (a / b).ln().abs() < OF_A_BAND.ln(),
                    "{factor} {zone}: {found:?} {counted:?}"
                );
            }
            let detail = |bands: &Bands| bands[7..].iter().sum::<f64>();
            let ratio = detail(&found) / detail(&counted);
            assert!(ratio.ln().abs() < OF_DETAIL.ln(), "{factor} {zone}: {ratio}");
        }
    }

    #[test]
    fn a_photograph_that_is_not_reduced_is_itself() {
        let native = &NATURAL[1].planes[2];
        for (a, b) in reduced(native, 1.0).iter().zip(native) {
            assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
        }
    }

    #[test]
    fn a_scene_of_few_pixels_is_a_reduced_photograph_or_a_piece_of_one() {
        let view = |pixels| SceneView {
            rows: pixels,
            columns: pixels,
            field_deg: 80.0,
            distance_um: f64::INFINITY,
        };
        let found = |given, simulated| -> Vec<(Sampling, f64, f64)> {
            let all = NaturalScenes::of(&view(given), &view(simulated));
            all.iter()
                .map(|s| (s.sampling, s.reduction, s.pixels_per_degree))
                .collect()
        };
        let small = [(Sampling::Whole, 6.0, 1.2), (Sampling::Piece, 1.0, 1.2)];
        assert_eq!(found(96, 96), small);
        assert_eq!(found(576, 576), [(Sampling::Whole, 1.0, 7.2)]);
        assert_eq!(found(2304, 768), [(Sampling::Whole, 3.0, 9.6)]);
    }
}
