//! The operator of a part of a sensor, and on any number of threads.

use metalith_core::{Silent, part};
use metalith_imaging::{
    Detail, FrameOperator, KernelBank, SceneInputs, ScenePoints, SceneSpace, StrayLight, element_views,
};
use metalith_restoration::{FrameModel, SceneStatistics};
use metalith_sensor::{AngularResponse, Camera, Walls};
use ndarray::Array2;

use crate::setup::{ROWS, Setup, setup, spec};
use crate::sixfold;

/// First row and column of the part, and how many of each. The image behind the middle element is at rows and columns 84 to 110,
/// and kernels reach 12 pixels: some of it is in the part, some reaches it, some does not, and its neighbours are beside it.
const FIRST: [usize; 2] = [104, 84];
const SIZE: [usize; 2] = [14, 27];

/// A camera that has a part of another's sensor.
fn part_of(camera: &Camera) -> Camera {
    let mut part = camera.clone();
    let sensor = &mut part.sensor;
    (sensor.rows, sensor.columns) = (SIZE[0] as u32, SIZE[1] as u32);
    for (axis, offset) in sensor.offset_um.iter_mut().enumerate() {
        // Columns run along x.
        let (first, size) = (FIRST[1 - axis], SIZE[1 - axis]);
        *offset += sensor.pixel_um * (first as f64 + 0.5 * size as f64 - 0.5 * f64::from(ROWS));
    }
    part
}

fn details() -> [Detail; 4] {
    let restoration = |points| Detail::restoration(points, SceneInputs::Spectra(0..3));
    [
        Detail::simulation(3),
        sixfold(),
        restoration(ScenePoints::OneAPixel),
        Detail {
            statistics: Some(SceneStatistics::colours().mixing()),
            ..restoration(ScenePoints::OneASquare)
        },
    ]
}

fn bank(setup: &Setup) -> KernelBank {
    KernelBank::build(&setup.chip(), &setup.scene.basis, spec(24, 5), &Silent).unwrap()
}

/// Parts of a sensor: what it does not see is not computed, and what it sees is equal: its frame, and what goes back
/// from it.
#[test]
fn a_part_of_a_sensor_sees_what_the_whole_sees_there() {
    /// Single precision of transforms of other sizes, of the range.
    const SINGLE: f32 = 1e-5;
    let setup = setup(&[[520.0, 560.0]], 40);
    let bank = bank(&setup);
    let views = element_views(&setup.design, &setup.camera);
    let space = SceneSpace::flat(&setup.scene.view);
    let cameras = [setup.camera.clone(), part_of(&setup.camera)];
    let stray_lights = [0, 1].map(|k| StrayLight::none(&cameras[k].sensor, 1, 3));
    let near = |a: &Array2<f32>, b: &Array2<f32>, what: &str| {
        let range = b.iter().fold(0.0f32, |range, v| range.max(v.abs()));
        let off = (a - b).iter().fold(0.0f32, |off, v| off.max(v.abs()));
        println!("{what}: {off:e} of {range:e}");
        assert!(range > 0.0 && off < SINGLE * range, "{what}: {off} {range}");
    };
    let inside = |frame: &Array2<f32>| {
        let [rows, columns] = [0, 1].map(|a| FIRST[a]..FIRST[a] + SIZE[a]);
        part(frame.view(), rows, columns).to_owned()
    };
    // Waves of the setup are ahead; a scene that all elements see.
    let planes: Vec<Array2<f32>> = (0..3)
        .map(|c| Array2::from_shape_fn((40, 40), |(y, x)| 0.5 + 0.1 * ((y * 3 + x * 5 + c) % 5) as f32))
        .collect();
    for detail in details() {
        let what = format!("{:?}", detail.points);
        let [whole, own] =
            [0, 1].map(|k| FrameOperator::new(&bank, &stray_lights[k], &views, &cameras[k], &space, detail.clone()));
        let frame = inside(&whole.apply(&planes)[0]);
        near(&own.apply(&planes)[0], &frame, &what);
        let light = Array2::from_shape_fn((ROWS as usize, ROWS as usize), |(y, x)| {
            let at = y.checked_sub(FIRST[0]).zip(x.checked_sub(FIRST[1]));
            at.and_then(|(y, x)| frame.get([y, x])).copied().unwrap_or(0.0)
        });
        for (a, b) in own
            .adjoint(&[frame])
            .iter()
            .zip(&whole.adjoint(std::slice::from_ref(&light)))
        {
            near(a, b, &what);
        }
        if detail.points != ScenePoints::FourAPixel {
            // Where there is next to no light, rounding is divided by rounding.
            let least = 0.1 * light.iter().copied().fold(0.0, f32::max);
            let known = light.mapv(|v| f32::from(u8::from(v > least)));
            let [own_light, own_known] = [&light, &known].map(inside);
            let laid = own.unrestored(&[own_light], &[own_known]);
            near(&laid[0], &whole.unrestored(&[light], &[known])[0], &what);
        }
    }
}

#[test]
fn the_operator_depends_on_no_number_of_threads() {
    let setup = setup(&[[520.0, 560.0]], 20);
    let bank = bank(&setup);
    let views = element_views(&setup.design, &setup.camera);
    let space = SceneSpace::flat(&setup.scene.view);
    let stray_light = StrayLight::none(&setup.camera.sensor, 1, 3);
    let planes = vec![Array2::ones((20, 20)); 3];
    for detail in details() {
        let operator = FrameOperator::new(&bank, &stray_light, &views, &setup.camera, &space, detail);
        let both = || {
            let frames = operator.apply(&planes);
            let back = operator.adjoint(&frames);
            (frames, back)
        };
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(both)
        };
        let one = on(1);
        assert!(one.1.iter().flatten().any(|v| *v > 0.0));
        // Nine elements: in five, three and two rounds.
        for threads in [2, 4] {
            assert!(on(threads) == one, "{threads}");
        }
    }
}

/// Walls and the response by angle act on the light of each element alone, pixel by pixel, in both directions.
#[test]
fn pixels_count_an_element_by_angle_and_in_front_of_its_walls() {
    /// Products in single precision.
    const SINGLE: f32 = 1e-6;
    /// Sums of both signs over some ten thousand of them.
    const ADJOINT: f64 = 1e-6;
    let setup = setup(&[[520.0, 560.0]], 40);
    let bank = bank(&setup);
    let views = element_views(&setup.design, &setup.camera);
    let space = SceneSpace::flat(&setup.scene.view);
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("angles.csv");
    std::fs::write(&table, "deg,value\n0,1\n60,0.4\n").unwrap();
    let mut walled = setup.camera.clone();
    walled.sensor.walls = Walls::BetweenElements;
    walled.sensor.angular_response = AngularResponse::read_csv(&table).unwrap();
    let stray_light = StrayLight::none(&setup.camera.sensor, 1, 3);
    let planes: Vec<Array2<f32>> = (0..3)
        .map(|c| Array2::from_shape_fn((40, 40), |(y, x)| 0.5 + 0.1 * ((y * 3 + x * 5 + c) % 5) as f32))
        .collect();
    let away = |place: [f64; 2], k: usize| (place[0] - views[k].centre_um[0]).hypot(place[1] - views[k].centre_um[1]);
    for detail in details() {
        let [open, counted] = [&setup.camera, &walled]
            .map(|c| FrameOperator::new(&bank, &stray_light, &views, c, &space, detail.clone()));
        let mut lit = 0;
        for k in 0..views.len() {
            let [all, own] = [&open, &counted].map(|o| o.apply_elements(&planes, &[k], false).remove(0));
            let most = all.iter().copied().fold(0.0, f32::max);
            for ((at, all), own) in all.indexed_iter().zip(&own) {
                let place = walled.sensor.place_um(at.into());
                let own_way = away(place, k);
                let others = (0..views.len()).filter(|j| *j != k).map(|j| away(place, j));
                let nearest = others.fold(f64::MAX, f64::min);
                // Pixels that a wall cuts are tested beside the rule itself.
                if (nearest - own_way).abs() < 2.0 * walled.sensor.pixel_um {
                    continue;
                }
                let angle = (own_way / views[k].sensor_um).atan().to_degrees();
                let share = if nearest < own_way { 0.0 } else { 1.0 - 0.01 * angle };
                assert!(
                    (own - all * share as f32).abs() <= SINGLE * most,
                    "{k} {at:?}: {own} {all} {share}"
                );
                lit += usize::from(*own > 0.0);
            }
        }
        assert!(lit > 1000, "{lit} pixels are lit");
        let light = Array2::from_shape_fn((ROWS as usize, ROWS as usize), |(y, x)| {
            0.1 * ((y * 7 + x * 29) % 11) as f32
        });
        let dot = |a: &[Array2<f32>], b: &[Array2<f32>]| -> f64 {
            let pairs = a.iter().zip(b).flat_map(|(a, b)| a.iter().zip(b));
            pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let light = [light];
        let (a, b) = (
            dot(&counted.apply(&planes), &light),
            dot(&planes, &counted.adjoint(&light)),
        );
        assert!((a / b - 1.0).abs() < ADJOINT, "{a} {b}");
    }
}
