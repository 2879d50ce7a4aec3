//! The operator against a direct sum over points of the scene and wavelengths, and against its adjoint.

mod parts;
mod setup;

use metalith_core::Silent;
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{
    ApproximationSet, BetweenNodes, Detail, ElementInLight, FrameOperator, KernelBank, SceneInputs, ScenePoints,
    SceneSpace, StrayLight, element_views,
};
use metalith_restoration::{FrameModel, SceneStatistics};
use metalith_sensor::{Camera, Sensor};
use metalith_wave::{Accuracy, Scratch, Window};
use ndarray::Array2;
use rayon::prelude::*;

use setup::{BELOW, CUBIC, HEXAGON, LEFT, MIDDLE, ROWS, Setup, mixed, setup, spec, waves};

/// A plane at a place between the middles of its pixels.
fn value(plane: &Array2<f32>, row: f64, column: f64) -> f64 {
    let (rows, columns) = plane.dim();
    let (y, x) = (
        row.clamp(0.0, rows as f64 - 1.0),
        column.clamp(0.0, columns as f64 - 1.0),
    );
    let (iy, ix) = ((y as usize).min(rows - 2), (x as usize).min(columns - 2));
    let (sy, sx) = (y - iy as f64, x - ix as f64);
    let v = |a: usize, b: usize| f64::from(plane[[iy + a, ix + b]]);
    (v(0, 0) * (1.0 - sx) + v(0, 1) * sx) * (1.0 - sy) + (v(1, 0) * (1.0 - sx) + v(1, 1) * sx) * sy
}

/// Each point of the scene at each wavelength, through each element, onto every pixel of the sensor.
fn direct_sum(setup: &Setup, scene: &SceneImage, elements: &[usize], points: usize, nm: &[f64]) -> Array2<f64> {
    let camera = &setup.camera;
    let chip = setup.chip();
    let every: Vec<usize> = (0..chip.sampling.wavelengths_nm.len()).collect();
    let lights: Vec<ElementInLight<'_>> = (0..chip.distinct.len())
        .map(|k| chip.in_light(k, &every, &Silent).unwrap())
        .collect();
    let (view, sensor) = (&scene.view, &camera.sensor);
    let views = element_views(&setup.design, camera);
    let weights: Vec<f64> = nm
        .iter()
        .map(|nm| camera.channels[0].weight(&camera.illuminant, *nm))
        .collect();
    let all: f64 = weights.iter().sum();
    let n = view.rows * points;
    let mut jobs = Vec::new();
    for e in elements {
        for i in 0..n * n {
            jobs.push((*e, i));
        }
    }
    let middle = [0, 1].map(|a| sensor.offset_um[a]);
    let frames: Vec<Array2<f64>> = jobs
        .par_chunks(256)
        .map(|chunk| {
            let mut scratch = Scratch::default();
            let mut frame = Array2::zeros((ROWS as usize, ROWS as usize));
            for (e, i) in chunk {
                let at = |k: usize| (k as f64 + 0.5) / points as f64 - 0.5;
                let (row, column) = (at(i / n), at(i % n));
                let sines = views[*e].sines(view.tangents(row, column), view.distance_um);
                let [tx, ty] = view.tangents(row, column);
                let solid = (view.pixel() / points as f64 / (1.0 + tx * tx + ty * ty)).powi(2);
                if scene.planes.iter().all(|p| value(p, row, column) == 0.0) {
                    continue;
                }
                for (nm, weight) in nm.iter().zip(&weights) {
                    let light: f64 = scene
                        .basis
                        .iter()
                        .zip(&scene.planes)
                        .map(|(b, p)| b.at(*nm) * value(p, row, column))
                        .sum();
                    let (distinct, _) = chip.copies[*e];
                    assert_eq!(
                        chip.distinct[distinct].view.centre_um, views[*e].centre_um,
                        "an element of its own"
                    );
                    let index = chip.sampling.wavelengths_nm.iter().position(|w| w == nm).unwrap();
                    let lit = lights[distinct].lit(index, sines);
                    let window = Window {
                        centre_um: [0, 1].map(|a| middle[a] - views[*e].centre_um[a]),
                        step_um: 0.5,
                        samples: 480,
                        distance_um: views[*e].sensor_um,
                    };
                    let psf = lit.psf(window, Accuracy::Accurate, &[], &mut scratch).unwrap();
                    let share =
                        light * solid * weight / all * 0.25 / lights[distinct].arriving_um2(index) * views[*e].area;
                    for ((iy, ix), v) in psf.values.indexed_iter() {
                        frame[[iy / 4, ix / 4]] += share * v;
                    }
                }
            }
            frame
        })
        .collect();
    frames
        .into_iter()
        .fold(Array2::zeros((ROWS as usize, ROWS as usize)), |a, b| a + b)
}

/// Pixels an axis of the scene, 0.7 um behind the lens: the scene is straight between them, and what bends at pixels of
/// 1.5 um is sampled too coarsely by points 1 um apart (1.1e-3 and 1.4e-3).
const SIZE: usize = 160;

/// Places an axis, 4.3 um apart as in the program's own kernels for such light and lenses (41 over 166 um).
const NODES: usize = 13;

/// Error of the image behind an element against the direct sum, relative to its range: root mean square and at any one
/// pixel; `about`: where the scene is (degrees).
fn off_direct_sum(setup: &Setup, bank: &KernelBank, element: usize, about: [f64; 2]) -> [f64; 2] {
    /// Pixels of the image of the scene: a disc of four degrees on both sides.
    const IMAGE: f64 = 100.0;
    let nm = setup.chip().sampling.wavelengths_nm.clone();
    assert_eq!(nm.len(), 2, "all wavelengths are simulated");
    let stray_light = StrayLight::none(&setup.camera.sensor, 1, 3);
    let views = element_views(&setup.design, &setup.camera);
    let scene = waves(SIZE, about);
    let space = SceneSpace::flat(&scene.view);
    let operator = FrameOperator::new(bank, &stray_light, &views, &setup.camera, &space, sixfold());
    let got = operator.apply_elements(&scene.planes, &[element], false).remove(0);
    // An even number: between points the scene is straight, so that their sum is the integral.
    let want = direct_sum(setup, &scene, &[element], 2, &nm);
    let range = want.iter().copied().fold(0.0, f64::max);
    let off = got.iter().zip(&want).map(|(a, b)| (f64::from(*a) - b).abs() / range);
    let (worst, squares) = off.fold((0.0, 0.0), |(worst, sum), d| (f64::max(worst, d), sum + d * d));
    let rms = f64::sqrt(squares / IMAGE);
    println!("element {element}: worst {worst:.2e}, rms {rms:.2e} of the range");
    [rms, worst]
}

/// Overlapping patches, kernels between nodes as in light of narrow bands, spectra of the scene and of the channel, against some
/// thousand fields over the whole sensor.
#[test]
#[ignore = "second tier: some minutes of CPU time, in scripts/slow_tests.sh"]
fn a_frame_is_the_direct_sum_over_points_and_wavelengths() {
    /// Root mean square over the image of the scene, of the range: 2.5e-4 is reached behind the middle element and 5.6e-4
    /// behind one that steers.
    const RMS: f64 = 1e-3;
    /// Any one pixel, of the range: 6.1e-4 behind the middle element. Behind the one that steers it is 1.8e-3, in one pixel where the
    /// rim of the scene falls on its middle: four points are few for what bends there.
    const WORST: f64 = 2e-3;
    // Two wavelengths, both simulated.
    let setup = setup(&[[550.0, 551.0]], SIZE);
    let bank = KernelBank::build(&setup.chip(), &setup.scene.basis, spec(96, NODES), &Silent).unwrap();
    // The neighbour below looks up.
    for (element, about) in [(MIDDLE, [0.0, 0.0]), (BELOW, [0.0, 15.0])] {
        let [rms, worst] = off_direct_sum(&setup, &bank, element, about);
        assert!(rms < RMS && worst < WORST, "{element}: {rms} {worst}");
    }
}

/// Frame behind a hexagon that is larger than the shared lens, steers and is out of focus, and behind a rotated cubic
/// phase.
#[test]
#[ignore = "second tier: some minutes of CPU time, in scripts/slow_tests.sh"]
fn a_frame_of_lenses_of_their_own_is_the_direct_sum() {
    /// Root mean square as above, 7.6e-4 and 2.7e-4, and any one pixel, 3.0e-4 and 3.8e-4, of the range: an image out of focus has more
    /// pixels than the scene that the root mean square is over.
    const OFF: f64 = 1e-3;
    let setup = mixed(&[[550.0, 551.0]], SIZE);
    let bank = KernelBank::build(&setup.chip(), &setup.scene.basis, spec(96, NODES), &Silent).unwrap();
    // A wedge of eight degrees along x looks the other way.
    for (element, about) in [(HEXAGON, [-8.0, 0.0]), (CUBIC, [0.0, 0.0])] {
        let [rms, worst] = off_direct_sum(&setup, &bank, element, about);
        assert!(rms < OFF && worst < OFF, "{element}: {rms} {worst}");
    }
}

/// The neighbour to the left is a copy of the one below, mirrored at the diagonal.
#[test]
fn copies_are_what_symmetry_makes_of_them() {
    /// Single precision, of the range.
    const SINGLE: f64 = 1e-5;
    let setup = setup(&[[520.0, 560.0]], 40);
    let chip = setup.chip();
    let bank = KernelBank::build(&chip, &setup.scene.basis, spec(24, 5), &Silent).unwrap();
    let stray_light = StrayLight::none(&setup.camera.sensor, 1, 3);
    let views = element_views(&setup.design, &setup.camera);
    // The neighbour below looks up.
    let scene = waves(40, [0.0, 15.0]);
    let planes: Vec<Array2<f32>> = scene.planes.iter().map(|p| p.t().to_owned()).collect();
    for between in [BetweenNodes::Linear, BetweenNodes::Sixfold] {
        let detail = Detail {
            between,
            ..Detail::simulation(3)
        };
        let space = SceneSpace::flat(&scene.view);
        let operator = FrameOperator::new(&bank, &stray_light, &views, &setup.camera, &space, detail);
        let below = operator.apply_elements(&scene.planes, &[BELOW], false).remove(0);
        let left = operator.apply_elements(&planes, &[LEFT], false).remove(0);
        let range = f64::from(below.iter().copied().fold(0.0, f32::max));
        assert!(range > 0.0);
        let turned = left.t();
        let off = turned.iter().zip(&below).map(|(a, b)| f64::from((a - b).abs()));
        assert!(off.fold(0.0, f64::max) < SINGLE * range, "{between:?}");
    }
}

/// One point for four pixels, as a restoration samples a scene, against four points for each.
#[test]
fn a_coarse_grid_of_points_sees_the_same() {
    /// Waves of eight pixels are four points of the coarse grid long, and its borders are blurred: of the range, root mean
    /// square; 5.6e-3 for one point a pixel, 1.1e-2 for one a square.
    const COARSE: f64 = 0.015;
    /// They are two points of the grid of blocks long, which halves their height; 4.4e-2.
    const BLOCK: f64 = 0.06;
    let setup = setup(&[[550.0, 551.0]], 40);
    let chip = setup.chip();
    let bank = KernelBank::build(&chip, &setup.scene.basis, spec(24, 5), &Silent).unwrap();
    let stray_light = StrayLight::none(&setup.camera.sensor, 1, 3);
    let views = element_views(&setup.design, &setup.camera);
    let space = SceneSpace::flat(&setup.scene.view);
    let frame = |points: ScenePoints| {
        let detail = Detail {
            points,
            ..Detail::simulation(3)
        };
        let operator = FrameOperator::new(&bank, &stray_light, &views, &setup.camera, &space, detail);
        operator
            .apply_elements(&setup.scene.planes, &[MIDDLE, BELOW], false)
            .remove(0)
    };
    let fine = frame(ScenePoints::FourAPixel);
    let range = f64::from(fine.iter().copied().fold(0.0, f32::max));
    assert!(range > 0.0);
    for (points, most) in [
        (ScenePoints::OneAPixel, COARSE),
        (ScenePoints::OneASquare, COARSE),
        (ScenePoints::OneABlock, BLOCK),
    ] {
        let coarse = frame(points);
        let side = points.value();
        let fine = Array2::from_shape_fn(coarse.dim(), |(y, x)| {
            let block = (0..side * side).map(|k| fine[[y * side + k / side, x * side + k % side]]);
            block.sum::<f32>() / (side * side) as f32
        });
        let lit = fine.iter().zip(&coarse).filter(|(a, _)| f64::from(**a) > 0.01 * range);
        let (count, sum) = lit.fold((0.0, 0.0), |(n, s), (a, b)| (n + 1.0, s + f64::from(a - b).powi(2)));
        let rms = f64::sqrt(sum / count) / range;
        println!("{points:?}: {rms:.1e} of the range");
        assert!(rms < most, "{points:?}: {rms}");
    }
}

/// The simulation in light of narrow bands.
fn sixfold() -> Detail {
    Detail {
        between: BetweenNodes::Sixfold,
        ..Detail::simulation(3)
    }
}

/// One kernel for each element and channel, against the same kernel at every node.
#[test]
fn one_kernel_for_a_field_is_the_same_kernel_at_every_node() {
    /// Single precision of transforms of other sizes, of the range.
    const SINGLE: f64 = 1e-5;
    let setup = setup(&[[450.0, 470.0], [520.0, 560.0]], 20);
    let chip = setup.chip();
    let bank = KernelBank::build(&chip, &setup.scene.basis, spec(24, 5), &Silent).unwrap();
    let mut same = bank.clone();
    for element in &mut same.distinct {
        let middle = element.nodes[element.nodes.len() / 2];
        element.nodes.fill(middle);
    }
    let stray_light = StrayLight::none(&setup.camera.sensor, 2, 3);
    let views = element_views(&setup.design, &setup.camera);
    let space = SceneSpace::flat(&setup.scene.view);
    for plain in [
        Detail::simulation(3),
        sixfold(),
        Detail {
            statistics: Some(SceneStatistics::colours().mixing()),
            ..Detail::restoration(ScenePoints::OneASquare, SceneInputs::Spectra(0..3))
        },
    ] {
        let fixed = Detail {
            assumed: ApproximationSet {
                fixed_kernels: true,
                ..ApproximationSet::default()
            },
            ..plain.clone()
        };
        let frames = [(&bank, fixed), (&same, plain)].map(|(bank, detail)| {
            let operator = FrameOperator::new(bank, &stray_light, &views, &setup.camera, &space, detail);
            operator.apply(&setup.scene.planes)
        });
        let range = frames[1].iter().flatten().copied().fold(0.0f32, f32::max);
        let pairs = frames[0].iter().flatten().zip(frames[1].iter().flatten());
        let off = pairs.fold(0.0f32, |off, (a, b)| off.max((a - b).abs()));
        println!("{off:e} of {range:e}");
        assert!(
            range > 0.0 && f64::from(off) < SINGLE * f64::from(range),
            "{off} {range}"
        );
    }
}

#[test]
fn the_adjoint_is_that_of_the_operator() {
    /// Single precision of sums over some ten thousand products of both signs.
    const ADJOINT: f64 = 1e-6;
    let setup = setup(&[[450.0, 470.0], [520.0, 560.0]], 20);
    let chip = setup.chip();
    let [bank, finer] =
        [5, 9].map(|nodes| KernelBank::build(&chip, &setup.scene.basis, spec(24, nodes), &Silent).unwrap());
    let stray_light = setup.stray_light(&chip, &bank);
    let views = element_views(&setup.design, &setup.camera);
    for detail in [
        Detail::simulation(3),
        sixfold(),
        Detail::restoration(ScenePoints::OneASquare, SceneInputs::Spectra(0..3)),
        Detail {
            statistics: Some(SceneStatistics::colours().mixing()),
            ..Detail::restoration(ScenePoints::OneASquare, SceneInputs::Spectra(0..3))
        },
        Detail::restoration(ScenePoints::OneABlock, SceneInputs::Spectra(0..3)),
        Detail::restoration(ScenePoints::OneAPixel, SceneInputs::Channels(0..3)),
        Detail {
            assumed: ApproximationSet::paper(),
            ..Detail::restoration(ScenePoints::OneASquare, SceneInputs::Spectra(0..3))
        },
    ] {
        let operator = FrameOperator::new(
            if detail.between == BetweenNodes::Sixfold {
                &finer
            } else {
                &bank
            },
            &stray_light,
            &views,
            &setup.camera,
            &SceneSpace::flat(&setup.scene.view),
            detail.clone(),
        );
        let x: Vec<Array2<f32>> = (0..operator.inputs())
            .map(|c| {
                Array2::from_shape_fn((20, 20), |(i, j)| {
                    (1.0 + ((i * 31 + j * 17 + c * 5) % 13) as f32) / 13.0
                })
            })
            .collect();
        let y: Vec<Array2<f32>> = (0..operator.channels())
            .map(|c| {
                Array2::from_shape_fn(operator.frame_shape(), |(i, j)| {
                    (1.0 + ((i * 7 + j * 29 + c * 3) % 11) as f32) / 11.0
                })
            })
            .collect();
        let dot = |a: &[Array2<f32>], b: &[Array2<f32>]| -> f64 {
            let pairs = a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
            pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let (forward, back) = (operator.apply(&x), operator.adjoint(&y));
        let (a, b) = (dot(&forward, &y), dot(&x, &back));
        println!("{detail:?}: {a} {b} {:.1e}", (a / b - 1.0).abs());
        assert!((a / b - 1.0).abs() < ADJOINT, "{detail:?}: {a} {b}");
    }
}

/// Kernels, stray light and what is lost are all the light, and the stray light's total is what kernels leave.
#[test]
fn all_light_is_accounted_for() {
    /// The target, of the light that arrives.
    const ACCOUNT: f64 = 0.01;
    let bands = [[450.0, 470.0], [520.0, 560.0]];
    for setup in [setup(&bands, 20), mixed(&bands, 20)] {
        let chip = setup.chip();
        let bank = KernelBank::build(&chip, &setup.scene.basis, spec(24, 5), &Silent).unwrap();
        let stray_light = setup.stray_light(&chip, &bank);
        for shares in stray_light.budget.chunks(3) {
            let all = metalith_imaging::LightShares::sum(shares);
            let found = all.in_kernels + all.stray_light + all.beyond + all.evanescent + all.not_passed;
            println!("{all:?}");
            assert!((found / all.arrives - 1.0).abs() < ACCOUNT);
            assert!(all.in_kernels > 0.1 * all.arrives && all.stray_light > 0.0 && all.beyond > 0.0);
        }
    }
}

/// Elements have the light of their own areas, and one sensor whatever their focal lengths.
#[test]
fn lenses_of_their_own_have_their_own_areas() {
    /// Sites along the rim, of the area of 60 and 80 um.
    const RIM: f64 = 0.01;
    let setup = mixed(&[[520.0, 560.0]], 20);
    let views = element_views(&setup.design, &setup.camera);
    let disc = std::f64::consts::PI * 30.0_f64.powi(2);
    // A disc of 60 um, a square of 56, a hexagon in a circle of 80, a disc of 60.
    let wanted = [
        1.0,
        56.0_f64.powi(2) / disc,
        1.5 * 3.0_f64.sqrt() * 40.0_f64.powi(2) / disc,
        1.0,
    ];
    for (view, wanted) in views.iter().zip(wanted) {
        assert!((view.area / wanted - 1.0).abs() < RIM, "{} {wanted}", view.area);
        assert_eq!(view.sensor_um, 144.0);
    }
    assert_eq!(setup.chip().distinct.len(), 4);
    let nearer = Camera {
        sensor: Sensor {
            distance_um: Some(110.0),
            ..setup.camera.sensor.clone()
        },
        ..setup.camera.clone()
    };
    assert!(
        element_views(&setup.design, &nearer)
            .iter()
            .all(|view| view.sensor_um == 110.0)
    );
}
