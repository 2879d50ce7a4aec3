//! One element: its place, its diameter and its phase.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// Powers of x and y of the terms of a phase, but for the radial ones: all of degree 2, 3 and 4.
pub const POWERS: [(u32, u32); 12] = [
    (2, 0),
    (1, 1),
    (0, 2),
    (3, 0),
    (2, 1),
    (1, 2),
    (0, 3),
    (4, 0),
    (3, 1),
    (2, 2),
    (1, 3),
    (0, 4),
];

/// Exponents n of the radial terms r^(2 n).
pub const RADIAL: [u32; 2] = [3, 4];

/// Terms of a phase.
pub const TERMS: usize = POWERS.len() + RADIAL.len();

/// An element before the sensor. Its phase is that of a hyperbola, terms of x / R and y / R, with R half its diameter, and a wedge.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraElement {
    /// Middle on the chip (um).
    pub centre_um: [f64; 2],
    pub diameter_um: f64,
    /// Sines of the angles by which its wedge steers, at the wavelength of wedges.
    pub wedge: [f64; 2],
    /// Wavelength and focal length of the hyperbola (um).
    pub hyperbola_um: [f64; 2],
    /// Coefficients of [`POWERS`] and [`RADIAL`] (rad).
    pub terms_rad: [f64; TERMS],
}

impl CameraElement {
    /// Half the diameter (um).
    pub fn radius_um(&self) -> f64 {
        0.5 * self.diameter_um
    }

    /// Phase without the wedge (rad) at a place from the middle (um).
    pub fn phase_rad(&self, r: [f64; 2]) -> f64 {
        let [wavelength, focal] = self.hyperbola_um;
        let r2 = r[0] * r[0] + r[1] * r[1];
        // sqrt(r^2 + f^2) - f, without a difference of nearly equal numbers.
        let longer = r2 / ((r2 + focal * focal).sqrt() + focal);
        let values = terms(r.map(|v| v / self.radius_um()));
        let sum: f64 = values.iter().zip(&self.terms_rad).map(|(v, c)| v * c).sum();
        sum - TAU / wavelength * longer
    }
}

/// Values of all terms at a place in units of the radius.
pub(super) fn terms([x, y]: [f64; 2]) -> [f64; TERMS] {
    let (x2, y2) = (x * x, y * y);
    let r2 = x2 + y2;
    let r6 = r2 * r2 * r2;
    [
        x2,
        x * y,
        y2,
        x2 * x,
        x2 * y,
        x * y2,
        y2 * y,
        x2 * x2,
        x2 * x * y,
        x2 * y2,
        x * y2 * y,
        y2 * y2,
        r6,
        r6 * r2,
    ]
}

/// Signs by which the terms change when x, y or both are mirrored.
pub(super) fn mirrored_signs(mirror: [bool; 2]) -> [f64; TERMS] {
    std::array::from_fn(|k| {
        let (px, py) = POWERS.get(k).copied().unwrap_or((0, 0));
        let odd = (mirror[0] && px % 2 == 1) != (mirror[1] && py % 2 == 1);
        if odd { -1.0 } else { 1.0 }
    })
}

/// Coefficients of the terms that come nearest to a phase over the disc, by least squares at rings of points; a linear and a constant
/// term are fitted too and left out, since the wedge has the first and nothing depends on the second.
pub(super) fn fitted(phase: impl Fn([f64; 2]) -> f64) -> [f64; TERMS] {
    const RINGS: usize = 12;
    const SPOKES: usize = 24;
    const ALL: usize = TERMS + 3;
    let mut normal = [[0.0; ALL + 1]; ALL];
    for ring in 0..RINGS {
        let r = ((ring as f64 + 0.5) / RINGS as f64).sqrt();
        for spoke in 0..SPOKES {
            let (sin, cos) = (TAU * (spoke as f64 + 0.5 * (ring % 2) as f64) / SPOKES as f64).sin_cos();
            let place = [r * cos, r * sin];
            let own = terms(place);
            let row: [f64; ALL] = std::array::from_fn(|k| match k {
                k if k < TERMS => own[k],
                k if k < TERMS + 2 => place[k - TERMS],
                _ => 1.0,
            });
            let value = phase(place);
            for (i, line) in normal.iter_mut().enumerate() {
                for (j, v) in row.iter().enumerate() {
                    line[j] += row[i] * v;
                }
                line[ALL] += row[i] * value;
            }
        }
    }
    solved(&mut normal)[..TERMS].try_into().expect("the terms come first")
}

/// Solution of a small system of normal equations, whose last column is the right side.
fn solved<const N: usize, const M: usize>(rows: &mut [[f64; M]; N]) -> [f64; N] {
    for k in 0..N {
        let best = (k..N).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs()));
        rows.swap(k, best.unwrap_or(k));
        let pivot = rows[k];
        for row in rows.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(&pivot).for_each(|(v, p)| *v -= factor * p);
        }
    }
    let mut x = [0.0; N];
    for k in (0..N).rev() {
        let known: f64 = (k + 1..N).map(|j| rows[k][j] * x[j]).sum();
        x[k] = (rows[k][N] - known) / rows[k][k];
    }
    x
}
