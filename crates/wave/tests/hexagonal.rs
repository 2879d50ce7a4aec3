//! Light from a hexagonal lattice: the field of a smooth aperture is that of any lattice that samples it, and what is fast
//! gives the direct sum.

mod adjoint;

use metalith_pillars::{DatabaseUnit, Lattice, LatticeKind};
use metalith_wave::propagation::{LandingGrid, LocalAngularSpectrum, SensorIrradiance, Steepness};
use metalith_wave::{
    Accuracy, Aperture, Direct, FoldedPropagator, Hankel, IdealPsf, PhaseFunction, PillarFunction, PlaneWave,
    Propagator, Psf, Scratch, Window,
};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use std::f64::consts::{PI, TAU};

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
                let value = Complex64::from_polar((-r2 / 9.0).exp(), -TAU * path / WAVELENGTH_UM);
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
    assert!((area / (PI * 400.0) - 1.0).abs() < RIM, "{area}");
}

/// A lens of 40 um, f = 50 um at 550 nm on a lattice of 360 nm, steered by these sines.
fn small(steered: [f64; 2]) -> PhaseFunction<impl Fn(f64, f64) -> f64 + Sync> {
    PhaseFunction {
        lattice: hexagonal(360, 41_000),
        radius_um: 20.0,
        amplitude: 1.2,
        phase_rad: move |x: f64, y: f64| {
            let path = (x * x + y * y + 2500.0).sqrt() - 50.0;
            TAU / 0.55 * (steered[0] * x + steered[1] * y - path)
        },
    }
}

fn largest_difference(a: &Array2<Complex32>, b: &Array2<Complex32>) -> f64 {
    f64::from(a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f32::max))
}

/// The largest difference between both ways to a field about a place.
fn fold_from_direct(aperture: &dyn Aperture, wave: &PlaneWave, window: Window, accuracy: Accuracy) -> f64 {
    let (lattice, um) = (aperture.lattice(), wave.wavelength_um);
    let fold = FoldedPropagator::plan(lattice, aperture.radius_um(), um, window, accuracy).unwrap();
    let direct = Direct::plan(lattice, um, window).unwrap();
    let scratch = &mut Scratch::default();
    let [a, b]: [&dyn Propagator; 2] = [&fold, &direct];
    let [a, b] = [a, b].map(|p| p.field(aperture, wave, scratch).unwrap().values);
    println!("{:?}", fold.fade());
    largest_difference(&a, &b)
}

#[test]
fn fold_agrees_with_the_direct_sum_wherever_a_lens_looks() {
    // In units of the peak in matched light, as on a square lattice: twice the accuracy asked for, and that of sweeps.
    const ACCURATE: f64 = 2e-5;
    const FAST: f64 = 1e-3;
    for (steered, sines, um) in [
        ([0.0; 2], [0.0; 2], 0.55),
        ([0.2, 0.0], [-0.1, 0.07], 0.45),
        ([0.0, -0.45], [0.05, 0.0], 0.63),
        ([0.4, 0.3], [0.1, -0.05], 0.45),
    ] {
        let lens = small(steered);
        let wave = PlaneWave {
            wavelength_um: um,
            sin_x: sines[0],
            sin_y: sines[1],
        };
        let [x, y] = [0, 1].map(|a| sines[a] + steered[a] * um / 0.55);
        let centre = [x, y].map(|s| 50.0 * s / (1.0 - x * x - y * y).sqrt());
        let window = Window {
            centre_um: centre.map(|c| c + 1.3),
            step_um: 0.6,
            samples: 21,
            distance_um: 50.0,
        };
        let matched = 1.2 * PI * 400.0 / (um * 50.0);
        for (accuracy, limit) in [(Accuracy::Accurate, ACCURATE), (Accuracy::Fast, FAST)] {
            let error = fold_from_direct(&lens, &wave, window, accuracy) / matched;
            println!("steered {steered:?}, light {sines:?}, {um} um, {accuracy:?}: {error:.1e}");
            assert!(error < limit, "{error}");
        }
    }
}

#[test]
fn the_adjoint_of_a_folded_field_is_one() {
    let lens = small([0.3, 0.1]);
    let lattice = lens.lattice;
    let wave = PlaneWave {
        wavelength_um: 0.5,
        sin_x: -0.2,
        sin_y: 0.1,
    };
    let window = Window::about([6.0, 4.0], 0.7, 12, 50.0);
    let planned = FoldedPropagator::plan(lattice, 20.0, 0.5, window, Accuracy::Accurate).unwrap();
    // A period shorter than the lattice along both axes, so that sites are folded onto one another.
    let folded = FoldedPropagator::with_fade(lattice, 0.5, window, [180, 96], [12.0, 15.0]).unwrap();
    for fold in [planned, folded] {
        let back = adjoint::checked(&fold, &lens, &wave);
        let beside = back.indexed_iter().filter(|((iy, ix), _)| !lattice.has(*ix, *iy));
        assert!(beside.map(|(_, b)| b.norm()).all(|norm| norm == 0.0));
    }
}

/// A lattice so coarse that orders of it travel: they land where the reciprocal lattice has them, as strong as the others but
/// for their slant, and the fold shows each of them where it looks.
#[test]
fn orders_of_a_coarse_lattice_land_where_the_reciprocal_lattice_has_them() {
    // As for a lens.
    const ACCURATE: f64 = 2e-5;
    let (pitch_nm, um, z) = (1000, 0.6, 120.0);
    let lattice = hexagonal(pitch_nm, 32_000);
    let disc = PhaseFunction {
        lattice,
        radius_um: 15.0,
        amplitude: 1.0,
        phase_rad: |x: f64, y: f64| -TAU / 0.6 * ((x * x + y * y + 120.0 * 120.0).sqrt() - 120.0),
    };
    let wave = PlaneWave::normal(um);
    let matched = PI * 225.0 / (um * z);
    let row_um = LatticeKind::Hexagonal.row_nm(pitch_nm.into(), DatabaseUnit::Nanometre) * 1e-3;
    // The six nearest orders, and one that only the grid of the lattice has.
    let nearest = [
        [1.0, 0.5],
        [1.0, -0.5],
        [-1.0, 0.5],
        [-1.0, -0.5],
        [0.0, 1.0],
        [0.0, -1.0],
    ];
    for (order, is_one) in nearest.map(|o| (o, true)).into_iter().chain([([1.0, 0.0], false)]) {
        let [x, y] = [order[0] * um, order[1] * um / row_um];
        let centre = [x, y].map(|s| z * s / (1.0 - x * x - y * y).sqrt());
        // Sharp the order is not: a lens is blurred by a slant of 44 degrees.
        let window = Window::about(centre, 1.5, 31, z);
        let error = fold_from_direct(&disc, &wave, window, Accuracy::Accurate) / matched;
        assert!(error < ACCURATE, "{order:?}: {error}");
        let fold = FoldedPropagator::plan(lattice, 15.0, um, window, Accuracy::Accurate).unwrap();
        let field = fold.field(&disc, &wave, &mut Scratch::default()).unwrap();
        let share = Psf::of(&field).energy_um2() / (PI * 225.0);
        // Of point samples each order has all power once, but for the rim of the disc and what lands beside the window.
        const BESIDE: f64 = 0.15;
        const NOTHING: f64 = 0.01;
        println!("{order:?}: {share:.3}");
        assert!(
            if is_one {
                (share - 1.0).abs() < BESIDE
            } else {
                share < NOTHING
            },
            "{order:?}: {share}"
        );
    }
}

#[test]
fn an_ideal_lens_is_sharp_where_it_is_designed_to_be() {
    // In phase, moduli add: both are the same sum, in single and in double precision.
    const SAME_SUM: f64 = 1e-4;
    const LP_MM: [f64; 3] = [100.0, 400.0, 900.0];
    let lens = small([0.0; 2]);
    let (radius2, um) = (400.0, 0.55);
    let wave = PlaneWave::normal(um);
    let matched = IdealPsf::of(&lens, [0.0, 0.0, 50.0], um, 1.2);
    let psf = |z: f64| {
        let window = Window::about([0.0; 2], 0.18, 128, z);
        let fold = FoldedPropagator::plan(lens.lattice, 20.0, um, window, Accuracy::Accurate).unwrap();
        Psf::formed(&fold, &lens, &wave, &LP_MM, &mut Scratch::default()).unwrap()
    };
    let peak = |psf: &Psf| psf.values.iter().copied().fold(0.0, f64::max);
    let focused = psf(50.0);
    let strehl = peak(&focused) / matched.peak;
    assert!((strehl - 1.0).abs() < SAME_SUM, "{strehl}");
    // Sites at the rim count as a whole or not at all.
    const RIM: f64 = 0.01;
    let area = matched.power_um2 / (1.2 * 1.2 * PI * radius2);
    assert!((area - 1.0).abs() < RIM, "{area}");
    // The depth of focus of this lens is wavelength / sine^2, 4 um: the peak falls to either side alike, and the middle of the
    // two is where the lens was designed for but for the nearness of the waist to a fast lens.
    let values: Vec<f64> = [48.0, 49.0, 50.0, 51.0, 52.0].map(|z| peak(&psf(z))).into();
    assert!(values.iter().all(|v| *v <= values[2]), "{values:?}");
    // Power: what the transfer function counts is what the sites pass, and the window holds what an Airy pattern does within
    // its circle of 11.5 um, which is 16 dark rings or 99 %.
    let otf = focused.otf.as_ref().unwrap();
    const SUM: f64 = 1e-5;
    assert!((otf.power_um2 / matched.power_um2 - 1.0).abs() < SUM);
    const HELD: std::ops::Range<f64> = 0.98..1.0;
    let held = focused.energy_um2() / otf.power_um2;
    assert!(HELD.contains(&held), "{held}");
    // The contrast is that of the same lens on a square lattice, whose rim has other sites.
    const OTHER_RIM: f64 = 0.003;
    let square = PhaseFunction {
        lattice: Lattice::covering(41_000, 300).unwrap(),
        ..lens
    };
    let window = Window::about([0.0; 2], 0.18, 128, 50.0);
    let fold = FoldedPropagator::plan(square.lattice, 20.0, um, window, Accuracy::Accurate).unwrap();
    let square = Psf::formed(&fold, &square, &wave, &LP_MM, &mut Scratch::default()).unwrap();
    let square = square.otf.unwrap();
    for (i, lp_mm) in LP_MM.into_iter().enumerate() {
        for (a, b) in otf.contrast(i).into_iter().zip(square.contrast(i)) {
            println!("{lp_mm} lp/mm: {a:.4}, {b:.4}");
            assert!((a - b).abs() < OTHER_RIM, "{lp_mm}: {a}, not {b}");
        }
    }
}

/// Rings of a hexagonal lattice are the same sum on the axis.
#[test]
fn rings_agree_with_the_lattice_on_the_axis() {
    const SAME_SUM: f64 = 1e-6;
    let lens = small([0.0; 2]);
    let rings = Hankel::of_lattice(0.55, 50.0, &lens.lattice, 20.0).unwrap();
    let transmission: Vec<Complex64> = rings
        .radii_um()
        .iter()
        .map(|&r| Complex64::from_polar(1.2, (lens.phase_rad)(r, 0.0)))
        .collect();
    let field = rings.field(&transmission, &[0.0]).unwrap();
    let direct = Direct::at(&lens, &PlaneWave::normal(0.55), &[[0.0, 0.0, 50.0]]);
    assert!((field[0] - direct[0]).norm() < SAME_SUM * direct[0].norm());
}

/// The stray light by rays: all power of a steered lens goes where it is steered, once, and squares hold what wave optics brings
/// there.
#[test]
fn rays_land_where_wave_optics_has_them() {
    // Powers of a few hundred thousand single-precision amplitudes.
    const ROUNDING: f64 = 1e-4;
    // Of the power in the brightest square: rays leave out interference between tiles.
    const RAYS: f64 = 0.1;
    // Of all power, what lands in a neighbouring square for being moved by the middle of a block.
    const BLOCKS: f64 = 0.2;
    let (z, um, cell) = (336.0, 0.53, 42.0);
    let steered = [0.25, -0.3];
    let lens = PhaseFunction {
        lattice: hexagonal(360, 141_000),
        radius_um: 70.0,
        amplitude: 1.0,
        phase_rad: move |x: f64, y: f64| {
            let turns = (steered[0] * x + steered[1] * y - ((x * x + y * y + z * z).sqrt() - z)) / um;
            // Two levels, which send light to several orders.
            if turns.rem_euclid(1.0) < 0.5 { 0.0 } else { PI }
        },
    };
    let wave = PlaneWave::normal(um);
    let grid = LandingGrid {
        cell_um: cell,
        cells: 11,
        distance_um: z,
    };
    let map = SensorIrradiance::of(&lens, &wave, steered, grid).unwrap();
    let power = IdealPsf::of(&lens, [0.0, 0.0, z], um, 1.0).power_um2;
    let all = map.travelling_um2() + map.evanescent_um2;
    assert!((all / power - 1.0).abs() < ROUNDING, "{}", all / power);
    let departing = LocalAngularSpectrum::of(&lens, um, z, 8)
        .landing([0.0; 2], steered, grid)
        .unwrap();
    let moved: f64 = departing
        .power_um2
        .iter()
        .zip(&map.power_um2)
        .map(|(a, b)| (a - b).abs())
        .sum();
    assert!(moved < BLOCKS * all, "{}", moved / all);
    // The squares about where the lens looks; a window of them all would hold other orders of the lattice too.
    let landing = steered.map(|s| z * s / (1.0 - steered[0].powi(2) - steered[1].powi(2)).sqrt());
    let [cx, cy] = landing.map(|l| (l / cell + 5.5).floor() as usize);
    let per_cell = (cell / 0.35).round() as usize;
    let middle = |c: usize| (c as f64 + 0.5 - 5.5) * cell;
    let window = Window {
        centre_um: [middle(cx), middle(cy)],
        step_um: 0.35,
        samples: 3 * per_cell,
        distance_um: z,
    };
    let fold = FoldedPropagator::plan(lens.lattice, 70.0, um, window, Accuracy::Accurate).unwrap();
    let field = fold.field(&lens, &wave, &mut Scratch::default()).unwrap();
    let exact = |iy: usize, ix: usize| {
        let part = metalith_core::part(
            field.values.view(),
            iy * per_cell..(iy + 1) * per_cell,
            ix * per_cell..(ix + 1) * per_cell,
        );
        part.iter().map(|e| f64::from(e.norm_sqr())).sum::<f64>() * 0.35 * 0.35
    };
    let largest = map.power_um2.iter().copied().fold(0.0, f64::max);
    for (iy, ix) in (0..9).map(|k| (k / 3, k % 3)) {
        let (rays, waves) = (map.power_um2[[cy + iy - 1, cx + ix - 1]], exact(iy, ix));
        assert!((rays - waves).abs() < RAYS * largest, "{iy} {ix}: {rays} {waves}");
    }
}

/// An aperture that is not asked for rows that its lattice does not reach.
struct WithinReach<'a>(&'a dyn Aperture);

impl Aperture for WithinReach<'_> {
    fn lattice(&self) -> Lattice {
        self.0.lattice()
    }

    fn radius_um(&self) -> f64 {
        self.0.radius_um()
    }

    fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
        assert!(self.lattice().reach()[1].contains(&iy), "row {iy}");
        self.0.fill_row(iy, row);
    }
}

#[test]
fn rows_out_of_reach_are_not_asked_for() {
    let (lens, wave, z) = (small([0.0; 2]), PlaneWave::normal(0.55), 50.0);
    let within = WithinReach(&lens);
    let grid = LandingGrid {
        cell_um: 5.0,
        cells: 8,
        distance_um: z,
    };
    let matched = |aperture: &dyn Aperture| IdealPsf::of(aperture, [0.0, 0.0, z], 0.55, 1.0);
    assert_eq!(matched(&within), matched(&lens));
    let landing = |aperture: &dyn Aperture| SensorIrradiance::of(aperture, &wave, [0.0; 2], grid).unwrap().power_um2;
    assert_eq!(landing(&within), landing(&lens));
    let departing = |aperture: &dyn Aperture| {
        let departure = LocalAngularSpectrum::of(aperture, 0.55, z, 4);
        departure.landing([0.0; 2], [0.0; 2], grid).unwrap().power_um2
    };
    assert_eq!(departing(&within), departing(&lens));
    let window = Window::about([0.0; 2], 0.5, 8, z);
    let fold = FoldedPropagator::plan(lens.lattice, 20.0, 0.55, window, Accuracy::Fast).unwrap();
    let direct = Direct::plan(lens.lattice, 0.55, window).unwrap();
    for way in [&fold as &dyn Propagator, &direct] {
        assert!(way.field(&within, &wave, &mut Scratch::default()).is_ok());
    }
}

/// A phase that steps by the same along each of the three directions of neighbours is as steep as it is made.
#[test]
fn steepness_counts_all_six_neighbours() {
    const ROUNDING: f64 = 1e-9;
    let lattice = hexagonal(500, 20_000);
    let along_y = |_: usize, iy: usize| Some(0.3 * iy as f64);
    let steep = Steepness::of(&lattice, along_y);
    assert!((steep.largest_step_rad - 0.3 * TAU).abs() < ROUNDING);
    assert_eq!(steep.steep_sites, 0);
    let [columns, rows] = lattice.reach();
    let sites = rows.clone().flat_map(|iy| columns.clone().map(move |ix| (ix, iy)));
    assert_eq!(
        steep.sites,
        sites.filter(|&(ix, iy)| lattice.has(ix, iy)).count() as u64
    );
    // Half a turn and more from one neighbour in a row to the next, two places away.
    let steep = Steepness::of(&lattice, |ix, _| Some(0.3 * ix as f64));
    assert!((steep.largest_step_rad - 0.6 * TAU).abs() < ROUNDING);
    assert!(steep.from_pitches == Some(0.0) && steep.steep_sites > 0);
}
