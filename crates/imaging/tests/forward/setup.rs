//! Small chips before a small sensor.

use metalith_cell::CellModel;
use metalith_core::Silent;
use metalith_design::array::PillarArray;
use metalith_design::{Design, cell_models};
use metalith_gds::extract::Extraction;
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{BankSpec, ChipInLight, KernelBank, StrayLight};
use metalith_layout::{read_pillars, write_pillars};
use metalith_optics::SimulationCase;
use metalith_sensor::{Camera, Channel, Illuminant, Response, Sensor};
use ndarray::Array3;

/// The middle element, and its neighbour below and to the left.
pub(crate) const MIDDLE: usize = 4;
pub(crate) const BELOW: usize = 1;
pub(crate) const LEFT: usize = 3;

/// Elements with individual lenses: a hexagon of 80 um with a shorter focal length, which looks aside, and a cubic
/// phase.
pub(crate) const HEXAGON: usize = 2;
pub(crate) const CUBIC: usize = 3;

/// Pixels of 2 um an axis: the middle element and two of its neighbours, or two lenses of their own.
pub(crate) const ROWS: u32 = 120;

fn camera(bands: &[[f64; 2]], offset_um: [f64; 2]) -> Camera {
    let plain = Camera::three_bands(2.0);
    Camera {
        sensor: Sensor {
            columns: ROWS,
            rows: ROWS,
            offset_um,
            ..plain.sensor
        },
        channels: bands
            .iter()
            .map(|band| Channel {
                name: format!("{}", band[0]),
                response: Response::Band {
                    band_nm: *band,
                    efficiency: 1.0,
                },
            })
            .collect(),
        illuminant: Illuminant::EqualEnergy,
        ..plain
    }
}

pub(crate) struct Setup {
    pub design: Design,
    pub camera: Camera,
    extraction: Extraction,
    cells: Vec<Box<dyn CellModel>>,
    pub scene: SceneImage,
}

impl Setup {
    pub(crate) fn chip(&self) -> ChipInLight<'_> {
        let case = SimulationCase::from(self.cells[0].as_ref());
        ChipInLight::new(
            &self.design,
            &self.extraction,
            case,
            &self.camera,
            f64::INFINITY,
            &Silent,
        )
        .unwrap()
    }

    pub(crate) fn stray_light(&self, chip: &ChipInLight<'_>, bank: &KernelBank) -> StrayLight {
        let (sensor, scene) = (&self.camera.sensor, &self.scene);
        StrayLight::build(chip, bank, &scene.basis, sensor, &scene.view, &Silent).unwrap()
    }
}

/// Nine elements of one lens.
pub(crate) fn setup(bands: &[[f64; 2]], size: usize) -> Setup {
    setup_of("mini_3x3", camera(bands, [-75.0, -75.0]), size)
}

/// Four lenses of their own kinds, of which the sensor sees the two below.
pub(crate) fn mixed(bands: &[[f64; 2]], size: usize) -> Setup {
    setup_of("mixed_lenses", camera(bands, [0.0, -75.0]), size)
}

fn setup_of(name: &str, camera: Camera, size: usize) -> Setup {
    let design = Design::read(format!("../../designs/{name}.toml").as_ref()).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let layout = folder.path().join("pillars.gds");
    write_pillars(&design, &array, design.layout.hierarchy, &layout, &Silent).unwrap();
    let extraction = read_pillars(&design, &layout, &Silent).unwrap();
    let cells = cell_models(&design, &[metalith_cell::Fidelity::Published]).unwrap();
    let scene = waves(size, [0.0; 2]);
    Setup {
        design,
        camera,
        extraction,
        cells,
        scene,
    }
}

/// Radians of the waves over tangents: some 40 um from crest to crest behind a lens of 144 um.
const WAVES: [f64; 2] = [17.3, 14.8];

/// Waves of three colours within four degrees of a direction (degrees), fading towards there.
pub(crate) fn waves(size: usize, about_deg: [f64; 2]) -> SceneImage {
    let empty = SceneImage::of_rgb("", &Array3::zeros((size, size, 3)), 44.0, f64::INFINITY);
    let rgb = Array3::from_shape_fn((size, size, 3), |(y, x, c)| {
        let t = empty.view.tangents(y as f64, x as f64);
        let off = [0, 1].map(|a| (t[a].atan().to_degrees() - about_deg[a]) / 4.0);
        let fade = 0.5 + 0.5 * (std::f64::consts::PI * off[0].hypot(off[1]).min(1.0)).cos();
        let (u, v) = (WAVES[0] * t[0], WAVES[1] * t[1]);
        fade * (0.5 + 0.4 * (u + c as f64).sin() * (v - c as f64).cos())
    });
    SceneImage::of_rgb("waves", &rgb, 44.0, f64::INFINITY)
}

pub(crate) fn spec(window: usize, nodes: usize) -> BankSpec {
    BankSpec {
        pixel_um: 2.0,
        window,
        nodes,
        reach_um: 26.0,
        accurate: true,
    }
}
