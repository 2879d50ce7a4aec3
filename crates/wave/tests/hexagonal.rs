//! The direct sum on a hexagonal lattice: the field of a smooth aperture is that of any lattice that samples it.

use metalith_core::{Lattice, LatticeKind};
use metalith_wave::{
    Accuracy, Aperture, Direct, Fold, PillarFunction, PlaneWave, Propagator, Scratch, WaveError, Window,
};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};

const WAVELENGTH_UM: f64 = 1.55;
const DISTANCE_UM: f64 = 18.0;
const NORMAL: PlaneWave = PlaneWave {
    wavelength_um: WAVELENGTH_UM,
    sin_x: 0.0,
    sin_y: 0.0,
};

/// A lens with an amplitude of exp(-r^2 / w^2), which no lattice here sees the end of.
struct Smooth(Lattice);

impl Aperture for Smooth {
    fn lattice(&self) -> Lattice {
        self.0
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        let y = self.0.place_um(1, iy);
        for (ix, t) in row.iter_mut().enumerate() {
            *t = Complex32::ZERO;
            if self.0.has(ix, iy) {
                let r2 = self.0.place_um(0, ix).powi(2) + y * y;
                let path = (r2 + DISTANCE_UM * DISTANCE_UM).sqrt() - DISTANCE_UM;
                let value = Complex64::from_polar((-r2 / 9.0).exp(), -std::f64::consts::TAU * path / WAVELENGTH_UM);
                *t = Complex32::new(value.re as f32, value.im as f32);
            }
        }
    }
}

fn hexagonal(pitch_nm: u32, diameter_nm: u32) -> Lattice {
    Lattice::of_kind_covering(LatticeKind::Hexagonal, diameter_nm, pitch_nm).unwrap()
}

#[test]
fn a_smooth_field_is_the_same_from_either_lattice() {
    // Transmissions have 24 bits; what the lattices leave out beyond their rims is below that.
    const SINGLE: f64 = 2e-6;
    let points = [[0.0, 0.0, 18.0], [0.7, -0.4, 18.0], [3.0, 1.0, 15.0], [-2.0, 5.0, 25.0]];
    for wave in [
        NORMAL,
        PlaneWave {
            sin_x: 0.2,
            sin_y: -0.1,
            ..NORMAL
        },
    ] {
        let field = |lattice: Lattice| Direct::at(&Smooth(lattice), &wave, &points);
        let fine = field(Lattice::covering(24_000, 100).unwrap());
        let peak = fine.iter().map(|e| e.norm()).fold(0.0, f64::max);
        for lattice in [
            hexagonal(350, 24_000),
            hexagonal(500, 24_000),
            Lattice::covering(24_000, 400).unwrap(),
        ] {
            for (a, b) in fine.iter().zip(field(lattice)) {
                assert!((a - b).norm() < SINGLE * peak, "{lattice:?}: {a} {b}");
            }
        }
    }
}

#[test]
fn the_adjoint_is_one() {
    // Sums of a thousand products in single precision.
    const SINGLE: f64 = 1e-5;
    let lattice = hexagonal(500, 6_000);
    let window = Window::about([0.3, -0.2], 0.4, 5, DISTANCE_UM);
    let direct = Direct::plan(lattice, WAVELENGTH_UM, window).unwrap();
    let scratch = &mut Scratch::default();
    let field = direct.field(&Smooth(lattice), &NORMAL, scratch).unwrap().values;
    let g = Array2::from_shape_fn((5, 5), |(iy, ix)| {
        Complex32::new(ix as f32 - 1.5, (iy * ix) as f32 * 0.2)
    });
    let back = direct.adjoint(&g, &NORMAL, scratch).unwrap();
    let double = |z: &Complex32| Complex64::new(z.re.into(), z.im.into());
    let left: Complex64 = g.iter().zip(&field).map(|(g, e)| double(g).conj() * double(e)).sum();
    let mut right = Complex64::ZERO;
    let mut row = vec![Complex32::ZERO; lattice.sites()];
    for (iy, back) in back.outer_iter().enumerate() {
        Smooth(lattice).fill_row(iy, &mut row);
        right += back
            .iter()
            .zip(&row)
            .map(|(b, t)| double(b).conj() * double(t))
            .sum::<Complex64>();
        let beside = back.iter().enumerate().filter(|(ix, _)| !lattice.has(*ix, iy));
        assert!(beside.map(|(_, b)| b.norm()).all(|norm| norm == 0.0));
    }
    assert!((left - right).norm() < SINGLE * left.norm(), "{left} {right}");
}

/// Pillars of one width in a disc: as many as its area has cells, and nothing between them.
#[test]
fn pillars_of_a_disc_fill_their_sites() {
    let lattice = hexagonal(500, 40_000);
    let disc = PillarFunction::new(lattice, 20.0, &[Complex64::ZERO, Complex64::ONE], |_, _| 1);
    let mut row = vec![Complex32::ZERO; lattice.sites()];
    let mut sites = 0;
    for iy in 0..lattice.sites() {
        disc.fill_row(iy, &mut row);
        sites += row.iter().filter(|t| **t != Complex32::ZERO).count();
    }
    let area = sites as f64 * lattice.cell_um2();
    // Cells at the rim count as a whole or not at all.
    const RIM: f64 = 0.003;
    assert!((area / (std::f64::consts::PI * 400.0) - 1.0).abs() < RIM, "{area}");
}

#[test]
fn what_knows_squares_alone_refuses_it() {
    let lattice = hexagonal(500, 6_000);
    let window = Window::about([0.0, 0.0], 0.4, 16, DISTANCE_UM);
    let fold = Fold::plan(lattice, 3.0, WAVELENGTH_UM, window, Accuracy::Accurate);
    assert!(matches!(fold.map(drop), Err(WaveError::Hexagonal { .. })));
}
