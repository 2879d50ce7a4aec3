//! The wave that arrives at a chip.

use num_complex::Complex32;

use super::PathChange;
use metalith_cell::Illumination;
use metalith_core::turned_sine;
use metalith_pillars::{Lattice, LatticeKind};
use metalith_wave::PlaneWave;
use metalith_wave::kernels::cis;

/// A plane or spherical wave of unit amplitude on the axis of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArrivingLight {
    /// Direction at the axis, the tilt of the chip counted in.
    pub plane: PlaneWave,
    /// One over the distance of the source (1/m); zero for a plane wave.
    pub source_per_m: f64,
}

/// The plane wave that arrives.
pub(crate) fn wave_of(light: &Illumination<'_>) -> PlaneWave {
    PlaneWave {
        wavelength_um: light.wavelength_um,
        sin_x: light.sines[0],
        sin_y: light.sines[1],
    }
}

impl ArrivingLight {
    /// Light of a stated wave on a path with a change: the angle in each plane of incidence is larger by the tilt.
    /// Where that is a right angle or more its sine is one: a wave along the chip, which
    /// [`Propagator`](metalith_wave::Propagator)s refuse.
    pub fn new(stated: &PlaneWave, path: &PathChange) -> Self {
        let turn = |sine: f64, mrad: f64| {
            if mrad == 0.0 {
                sine
            } else {
                turned_sine(sine, mrad * 1e-3).unwrap_or(1.0_f64.copysign(mrad))
            }
        };
        Self {
            plane: PlaneWave {
                wavelength_um: stated.wavelength_um,
                sin_x: turn(stated.sin_x, path.tilt_mrad[0]),
                sin_y: turn(stated.sin_y, path.tilt_mrad[1]),
            },
            source_per_m: path.source_per_m,
        }
    }

    /// Path that the sphere adds at a distance from the axis (um), along either axis: x^2 / 2R. The next term of
    /// the sphere, x^4 / 8R^3, is 1 nm at the rim of a 1 mm lens for a source at 20 mm.
    fn sag_um(&self, x_um: f64) -> f64 {
        // 1/m is 1e-6/um.
        0.5e-6 * self.source_per_m * x_um * x_um
    }

    /// The wave along one axis of a lattice (0 for x, 1 for y), site by site: that of a site of the plane is the
    /// product of both.
    pub fn along(&self, lattice: Lattice, axis: usize) -> Vec<Complex32> {
        let sine = [self.plane.sin_x, self.plane.sin_y][axis];
        (0..lattice.sites())
            .map(|i| {
                let x = lattice.place_um(axis, i);
                cis((x * sine + self.sag_um(x)) / self.plane.wavelength_um)
            })
            .collect()
    }

    /// Factors of the curvature along x and along y; `None` for a plane wave.
    pub fn sphere(&self, lattice: Lattice) -> Option<[Vec<Complex32>; 2]> {
        let turns = |axis, i| self.sag_um(lattice.place_um(axis, i)) / self.plane.wavelength_um;
        let along = |axis| (0..lattice.sites()).map(|i| cis(turns(axis, i))).collect();
        (self.source_per_m != 0.0).then(|| [0, 1].map(along))
    }
}

/// Directions closer than this see the same cell (sine): a thousandth of the angle over which a resonance passes.
const SAME_DIRECTION: f64 = 1e-5;

/// The direction that a cell of such a lattice cannot tell from one with these sines: both positive, and on a square lattice
/// the larger along x.
pub fn cell_direction(sines: [f64; 2], lattice: LatticeKind) -> [f64; 2] {
    let [x, y] = sines.map(|s| (s.abs() / SAME_DIRECTION).round() * SAME_DIRECTION);
    match lattice {
        LatticeKind::Square => [x.max(y), x.min(y)],
        LatticeKind::Hexagonal => [x, y],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilt_beyond_a_right_angle_is_no_other_direction() {
        /// Rounding of a sine.
        const ROUNDING: f64 = 1e-15;
        let stated = PlaneWave {
            wavelength_um: 0.55,
            sin_x: 1.2_f64.sin(),
            sin_y: -0.3_f64.sin(),
        };
        let tilted = |tilt_mrad| {
            let path = PathChange {
                tilt_mrad,
                ..PathChange::default()
            };
            let plane = ArrivingLight::new(&stated, &path).plane;
            [plane.sin_x, plane.sin_y]
        };
        assert_eq!(tilted([0.0; 2]), [stated.sin_x, stated.sin_y]);
        let [x, y] = tilted([200.0, -400.0]);
        assert!((x - 1.4_f64.sin()).abs() < ROUNDING && (y + 0.7_f64.sin()).abs() < ROUNDING);
        assert_eq!(tilted([700.0, 0.0])[0], 1.0);
        let from_behind = [0.0, -1300.0];
        assert_eq!(tilted(from_behind)[1], -1.0);
    }
}
