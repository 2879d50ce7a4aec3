//! Mean statistics of photographs.

use super::bands::{Bands, ZONES};

/// Statistics of a zone of the field.
pub(crate) struct NaturalZone {
    /// Mean light, white being one.
    pub light: f64,
    /// Powers of the planes that vary independently: grey, red against blue, and green against both.
    pub planes: [Bands; 3],
}

/// The mean of 25 photographs of 576 x 576 pixels (GB82 image dataset, CC0), by `examples/scene_power`. Frequencies are those of a
/// photograph's own pixels: one of other pixels has other powers next to the finest that they hold.
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
