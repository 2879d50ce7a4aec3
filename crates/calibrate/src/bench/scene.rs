//! A bright spot of a scene, as pictures have it and as a bench has it: one window.

use std::path::Path;

use metalith_cell::PublishedCell;
use metalith_core::Silent;
use metalith_design::Design;
use metalith_gds::extract::PillarsAt;
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{
    BankSpec, BetweenNodes, ChipInLight, Detail, FrameOperator, KernelBank, SceneSpace, StrayLight, element_views,
};
use metalith_layout::read_pillars;
use metalith_optics::{Perturbation, SimulationCase};
use metalith_restoration::FrameModel;
use metalith_sensor::{Blend, Camera, Channel, Illuminant, Led, Response, Spectrum};
use metalith_testing::session::{PIXELS, middle_set, small_design, small_set};
use ndarray::{Array2, Array3};

use super::{Bench, BenchSampling};
use crate::cells::CellSource;
use crate::set::MeasuredSet;
use crate::simulator::Simulator;

/// Goal for the error as a share of the peak, for a point at a place of kernels and between places. Found behind lenses
/// of 60 um, at a place: 5.8e-4 and 1.3e-4 ahead, 9.3e-4 and 2.6e-4 steered (455, 530 nm). A spot of 0.1 um has 5e-4,
/// 3e-4, 9e-4 and 2e-4 by its size alone: a bench takes every part of a source for the same image, which coma changes
/// where 455 nm is out of focus. The bench is within 6e-5 of accurate fields 1 nm apart.
const OF_THE_PEAK: f64 = 1e-3;
/// Standard deviation of the spot on the sensor (um): nearly a point, and smooth between points a twelfth of a
/// micrometre apart.
const SPOT_UM: f64 = 0.07;
/// The lamps of the bench that measured chips of 140 um: middle and full width (nm).
const LAMPS: [[f64; 2]; 2] = [[455.0, 18.0], [530.0, 33.0]];
/// Pixels of the picture an axis of a pixel of the bench, so that a small spot is smooth between its points.
const FINER: usize = 3;
/// Distance from the axis to the next place of kernels (um), where they are blended linearly. With places 10.4 um
/// apart, as those of light of wide bands, this spot about one of them is wrong by 1.6e-3 and 1.9e-3 of the peak at 455
/// nm, and by 5e-2 and 6e-2 in the middle between four.
const PLACE_UM: f64 = 1.0;

/// The lenses that look at the spot.
struct Lenses {
    design: Design,
    /// Edge of a kernel (pixels of the bench): images out of focus are wide, and each wavelength lands elsewhere.
    window: usize,
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn a_spot_of_a_scene_is_what_a_bench_records_of_it() {
    let folder = tempfile::tempdir().unwrap();
    small_set(folder.path());
    let lenses = Lenses {
        design: small_design(),
        window: 48,
    };
    lenses.see_a_spot_as_the_bench(folder.path());
}

#[test]
#[ignore = "six CPU minutes: kernels of 56 um in pixels of 0.17 um"]
fn a_spot_is_the_same_behind_lenses_of_140_um() {
    let folder = tempfile::tempdir().unwrap();
    let lenses = Lenses {
        design: middle_set(folder.path()),
        window: 112,
    };
    lenses.see_a_spot_as_the_bench(folder.path());
}

impl Lenses {
    /// Compare the windows of a bench whose set is in a folder with those of a scene of a spot.
    fn see_a_spot_as_the_bench(&self, folder: &Path) {
        let focal_um = self.design.lens.focal_length_um;
        let mut set = MeasuredSet::read(folder, &PillarsAt::STATED, &Silent).unwrap();
        set.divergence_rad = 0.0;
        for (led, [centre_nm, fwhm_nm]) in set.leds.iter_mut().zip(LAMPS) {
            (led.centre_nm, led.fwhm_nm) = (centre_nm, fwhm_nm);
        }
        for measurement in &mut set.measurements {
            let nm = LAMPS[usize::from(measurement.led)][0];
            let arriving = measurement.aoi_rad[0].sin();
            let sine = if arriving == 0.0 {
                0.0
            } else {
                arriving - arriving * nm / 550.0
            };
            measurement.distance_um = focal_um;
            measurement.window_centre_um = [focal_um * sine / (1.0 - sine * sine).sqrt(), 0.0];
        }
        set.elements
            .iter_mut()
            .for_each(|e| e.aperture_diameter_um = 2.0 * self.design.aperture_radius_um());
        let mut bench = Bench::new(&set, BenchSampling::default());
        bench.follows = false;
        let published = || PublishedCell::new(set.stack.cell.pitch_nm as u32);
        let simulator = Simulator::new(bench, CellSource::Model(Box::new(published())), Vec::new());
        let mut perturbation = Perturbation::default();
        perturbation.camera.pixel_blur_um = SPOT_UM;
        let recorded = simulator.expose(&[perturbation], &Silent).unwrap().remove(0);

        let extraction = read_pillars(&self.design, &folder.join("layout.gds"), &Silent).unwrap();
        for (grid, measurement) in recorded.iter().zip(&set.measurements).step_by(2) {
            let [centre_nm, width_nm] = LAMPS[usize::from(measurement.led)];
            let want = grid.pixels([0.0; 2]).mapv(f64::from);
            let element = &set.elements[measurement.element];
            let window = [0, 1].map(|a| element.centre_um[a] + measurement.window_centre_um[a]);
            let camera = lamp(centre_nm, width_nm, window);
            let cell = published();
            let case = SimulationCase::from(&cell as &dyn metalith_cell::CellModel);
            let chip = ChipInLight::new(&self.design, &extraction, case, &camera, f64::INFINITY, &Silent).unwrap();
            let scene = spot(measurement.aoi_rad[0].sin(), focal_um);
            let views = element_views(&self.design, &camera);
            let veil = StrayLight::none(&camera.sensor, 1, 3);
            let space = SceneSpace::flat(&scene.view);
            let index = views
                .iter()
                .position(|v| (0..2).all(|a| (v.centre_um[a] - element.centre_um[a]).abs() < 1.0))
                .unwrap();
            let blend = chip.sampling.blend;
            assert_eq!(blend, Blend::Cubic);
            let standard = BankSpec::standard(&self.design, &camera).in_light(blend);
            let step_um = standard.node_um(1) - standard.node_um(0);
            // At one of three nodes an axis, and in the middle of six that are as far apart as those of a picture.
            let at_a_node = (3, PLACE_UM, BetweenNodes::Linear);
            let between_nodes = (6, 2.5 * step_um, standard.between_nodes(blend));
            for (nodes, reach_um, between) in [at_a_node, between_nodes] {
                let spec = BankSpec {
                    pixel_um: 0.5 / FINER as f64,
                    window: self.window * FINER,
                    nodes,
                    reach_um,
                    accurate: true,
                };
                let bank = KernelBank::build(&chip, &scene.basis, spec, &Silent).unwrap();
                let detail = Detail {
                    between,
                    ..Detail::simulation(3)
                };
                let operator = FrameOperator::new(&bank, &veil, &views, &camera, &space, detail);
                let fine = operator.apply_elements(&scene.planes, &[index], false).remove(0);
                let got = Array2::from_shape_fn((PIXELS, PIXELS), |(y, x)| {
                    let part = metalith_core::part(fine.view(), FINER * y..FINER * (y + 1), FINER * x..FINER * (x + 1));
                    part.iter().map(|v| f64::from(*v)).sum::<f64>()
                });
                let off = difference(&got, &want);
                println!(
                    "{centre_nm} nm, {:.1} degrees, {between:?}: {off:.2e} of the peak",
                    measurement.aoi_rad[0].to_degrees()
                );
                assert!(off < OF_THE_PEAK, "{centre_nm} nm, {between:?}: {off}");
            }
        }
    }
}

/// The largest difference over the peak, after the scale that fits best.
fn difference(got: &Array2<f64>, want: &Array2<f64>) -> f64 {
    let scale = (got * want).sum() / (got * got).sum();
    let peak = want.iter().copied().fold(0.0, f64::max);
    let off = got.iter().zip(want).map(|(a, b)| (scale * a - b).abs());
    off.fold(0.0, f64::max) / peak
}

/// The pixels of a measurement as a camera, in the light of one lamp.
fn lamp(centre_nm: f64, width_nm: f64, window_um: [f64; 2]) -> Camera {
    let plain = Camera::three_bands(0.5 / FINER as f64);
    // A bench weighs light by power, a channel counts photons.
    let power = Spectrum::new((350..=750).map(|nm| (f64::from(nm), 500.0 / f64::from(nm))).collect()).unwrap();
    Camera {
        sensor: metalith_sensor::Sensor {
            columns: (FINER * PIXELS) as u32,
            rows: (FINER * PIXELS) as u32,
            offset_um: window_um,
            ..plain.sensor
        },
        channels: vec![Channel {
            name: "lamp".into(),
            response: Response::Curve(power),
        }],
        illuminant: Illuminant::Leds(vec![Led {
            centre_nm,
            width_nm,
            power: 1.0,
        }]),
        ..plain
    }
}

/// A white spot of Gaussian light in sines about a direction.
fn spot(sine: f64, focal_um: f64) -> SceneImage {
    const FIELD_DEG: f64 = 33.0;
    const ROWS: usize = 128;
    // Pixels of a quarter of the spot: a scene is straight between their middles.
    let columns = (4.0 * focal_um * 2.0 * (0.5 * FIELD_DEG).to_radians().tan() / SPOT_UM).ceil() as usize;
    let size = (ROWS, columns, 3);
    let view = SceneImage::of_rgb("", &Array3::zeros(size), FIELD_DEG, f64::INFINITY).view;
    let light = Array3::from_shape_fn(size, |(y, x, _)| {
        let [tx, ty] = view.tangents(y as f64, x as f64);
        let length = (1.0 + tx * tx + ty * ty).sqrt();
        let (u, v) = (tx / length - sine, ty / length);
        (-0.5 * (u * u + v * v) * (focal_um / SPOT_UM).powi(2)).exp()
    });
    SceneImage::of_rgb("spot", &light, FIELD_DEG, f64::INFINITY)
}
