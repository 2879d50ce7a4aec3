//! The model of a whole camera against closed forms and difference quotients.

use std::f64::consts::PI;
use std::path::Path;

use metalith_core::Silent;
use metalith_sensor::{Camera, Walls};
use num_complex::{Complex32, Complex64};

use super::element::{CameraElement, TERMS};
use super::light::{CameraLight, Efficiency};
use super::model::{CameraModel, ModelSettings, WINDOW_UM};
use super::pupil::{Transform, View};
use super::scene::NaturalScene;
use super::search::{Arrangement, CameraStart};
use super::task::{CameraFindings, CameraTask};
use super::tried_cameras::TriedCameras;

const FIELD_DEG: f64 = 80.0;

fn light(lux: f64, time_s: f64, step_nm: f64) -> CameraLight {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cameras/gt1930.toml");
    let share = |_| {
        Ok(Efficiency {
            focused: 0.65,
            stray: 0.25,
        })
    };
    CameraLight::new(
        &Camera::read(&path).unwrap(),
        lux,
        time_s,
        [400.0, 700.0],
        step_nm,
        &share,
    )
    .unwrap()
}

fn settings() -> ModelSettings {
    ModelSettings {
        scene: NaturalScene::new(FIELD_DEG, 400),
        field_deg: FIELD_DEG,
        wedge_um: 0.55,
        walls: Walls::None,
        window_um: WINDOW_UM,
    }
}

fn edge() -> f64 {
    (0.5 * FIELD_DEG).to_radians().tan()
}

fn grid(count: [usize; 2], distance_um: f64, diameter_um: f64, steering_deg: f64) -> Arrangement {
    Arrangement {
        count,
        distance_um,
        diameter_um,
        wedge_share: 0.0,
        steering_deg,
    }
}

fn element(distance_um: f64, diameter_um: f64) -> CameraElement {
    CameraElement {
        centre_um: [0.0; 2],
        diameter_um,
        wedge: [0.0; 2],
        hyperbola_um: [0.53, distance_um],
        terms_rad: [0.0; TERMS],
    }
}

fn view(sines: [f64; 2], wavelength_um: f64, distance_um: f64) -> View {
    View {
        sines,
        wavelength_um,
        wedge_um: 0.55,
        chief_um: wavelength_um,
        distance_um,
        step: 1.0 / 200.0,
        steps: 12,
        perfect: false,
    }
}

fn transfer(view: &View, element: &CameraElement) -> Vec<Complex64> {
    let transform = Transform::new(view.samples(element).unwrap());
    let side = 2 * view.steps + 1;
    let mut sum = vec![Complex64::ZERO; side * side];
    let mut buffers: [Vec<Complex32>; 2] = Default::default();
    view.add_transfer(element, &transform, &mut buffers, &mut [(1.0, &mut sum)]);
    sum
}

/// A hyperbola on its axis at its wavelength has the transfer function of a circle, 2/pi (acos v - v sqrt(1 - v^2)).
#[test]
fn a_perfect_lens_has_the_transfer_function_of_a_circle() {
    /// Rim of the circle on samples of a fiftieth of its diameter, over one of which it opens.
    const RIM: f64 = 0.012;
    let (distance, diameter) = (1440.0, 200.0);
    let view = view([0.0; 2], 0.53, distance);
    let found = transfer(&view, &element(distance, diameter));
    let side = 2 * view.steps + 1;
    for (at, h) in found.iter().enumerate() {
        let u = [at % side, at / side].map(|k| (k as f64 - view.steps as f64) * view.step);
        let v = u[0].hypot(u[1]) * 0.53 * distance / diameter;
        let want = if v < 1.0 {
            2.0 / PI * (v.acos() - v * (1.0 - v * v).sqrt())
        } else {
            0.0
        };
        assert!((h - want).norm() < RIM, "{u:?}: {h} {want}");
    }
}

/// The transfer function at 30 degrees against the Fourier transform of the intensity by the Rayleigh and Sommerfeld sum over all
/// places of the element, for an element that is corrected for another direction.
#[test]
fn oblique_images_are_those_of_the_direct_sum() {
    /// The phase that the Fraunhofer form leaves out over the window (0.1 rad at its edge, where next to no light is), the rim of the circle
    /// in both sums.
    const TOLERANCE: f64 = 0.03;
    let (distance, diameter, wavelength) = (600.0, 60.0, 0.55);
    let mut element = element(distance, diameter);
    element.terms_rad[..4].copy_from_slice(&[2.0, 1.0, 1.5, 0.7]);
    let sines = [0.45, 0.2];
    let view = View {
        step: 1.0 / 160.0,
        steps: 10,
        ..view(sines, wavelength, distance)
    };
    let found = transfer(&view, &element);
    let cos = (1.0_f64 - sines[0] * sines[0] - sines[1] * sines[1]).sqrt();
    let rho = sines.map(|s| distance * s / cos);
    let k = 2.0 * PI / wavelength;
    // Places a wavelength or so apart, of the aliases of which none falls into the window.
    let (pupil, image) = (60, 64);
    let (dr, dx) = (diameter / f64::from(pupil), 160.0 / f64::from(image));
    let mut intensity = Vec::new();
    for iy in 0..image {
        for ix in 0..image {
            let at = [ix, iy].map(|i| (f64::from(i - image / 2)) * dx);
            let mut field = Complex64::ZERO;
            for jy in 0..pupil {
                for jx in 0..pupil {
                    let r = [jx, jy].map(|j| (f64::from(j) + 0.5) * dr - 0.5 * diameter);
                    if r[0].hypot(r[1]) > 0.5 * diameter {
                        continue;
                    }
                    let d = [0, 1].map(|a| rho[a] + at[a] - r[a]);
                    let path = (d[0] * d[0] + d[1] * d[1] + distance * distance).sqrt();
                    let phase = element.phase_rad(r) + k * (sines[0] * r[0] + sines[1] * r[1] + path);
                    field += Complex64::cis(phase);
                }
            }
            intensity.push((at, field.norm_sqr()));
        }
    }
    let total: f64 = intensity.iter().map(|(_, v)| v).sum();
    let side = 2 * view.steps + 1;
    for (at, h) in found.iter().enumerate().step_by(7) {
        let u = [at % side, at / side].map(|k| (k as f64 - view.steps as f64) * view.step);
        let want: Complex64 = intensity
            .iter()
            .map(|(x, v)| Complex64::cis(-2.0 * PI * (u[0] * x[0] + u[1] * x[1])) * v / total)
            .sum();
        assert!((h - want).norm() < TOLERANCE, "{u:?}: {h} {want}");
    }
}

#[test]
fn slopes_are_difference_quotients() {
    /// Single precision of the transforms over a step of 0.02 rad.
    const TOLERANCE: f64 = 2e-3;
    const STEP_RAD: f64 = 0.02;
    let arrangement = grid([2, 1], 1440.0, 150.0, 0.0);
    let light = light(500.0, 0.01, 50.0);
    let model = CameraModel::new(light.clone(), &settings(), 1440.0, 1);
    let mut elements = arrangement.elements(&light.lattice(), edge(), CameraStart::Parts, 1);
    for (i, element) in elements.iter_mut().enumerate() {
        for (k, term) in element.terms_rad.iter_mut().enumerate() {
            *term += ((i * 7 + k * 3) % 5) as f64 * 0.4 - 0.8;
        }
    }
    let found = model.judge(&elements, true);
    let largest = found.slopes[0].iter().fold(0.0, |a: f64, s| a.max(s.abs()));
    for term in 0..TERMS {
        let error = |by: f64| {
            let mut moved = elements.clone();
            moved[0].terms_rad[term] += by;
            model.judge(&moved, false).error
        };
        let quotient = (error(STEP_RAD) - error(-STEP_RAD)) / (2.0 * STEP_RAD);
        let slope = found.slopes[0][term];
        assert!(
            (slope - quotient).abs() < TOLERANCE * largest,
            "{term}: {slope} {quotient}"
        );
    }
}

/// Light of a perfect lens in a scene without detail: the electrons of the camera equation.
#[test]
fn white_has_the_electrons_of_the_camera_equation() {
    const ROUNDING: f64 = 1e-9;
    let light = light(500.0, 0.01, 25.0);
    let arrangement = grid([1, 1], 4000.0, 200.0, 0.0);
    let elements = arrangement.elements(&light.lattice(), edge(), CameraStart::Identical, 1);
    let found = CameraModel::new(light.clone(), &settings(), 4000.0, 1).judge(&elements, false);
    for (white, channel) in found.white_e.iter().zip(&light.channels) {
        let f_number = 4000.0 / 200.0;
        let want = channel.focused_e_s * PI / 4.0 * (light.pixel_um / f_number).powi(2) * 0.01;
        assert!((white / want - 1.0).abs() < ROUNDING, "{white} {want}");
    }
}

/// Lattices at other phases tell frequencies apart that one mistakes: four elements at the same phase are worse than at four.
#[test]
fn elements_at_other_phases_of_the_lattice_resolve_more() {
    let light = light(5e4, 0.01, 50.0);
    let arrangement = grid([2, 2], 1000.0, 150.0, 0.0);
    let model = CameraModel::new(light.clone(), &settings(), 1000.0, 1).perfect();
    let apart = arrangement.elements(&light.lattice(), edge(), CameraStart::Identical, 1);
    let mut same = apart.clone();
    for element in &mut same {
        element.centre_um = element.centre_um.map(|c| (c / light.pitch_um).round() * light.pitch_um);
    }
    let [apart, same] = [apart, same].map(|e| model.judge(&e, false).psnr_db());
    assert!(apart > same + 0.5, "{apart} {same}");
}

/// A descent on any number of threads gives the same phases, to the last bit, and improves the camera.
#[test]
fn a_descent_is_the_same_on_any_number_of_threads() {
    let arrangement = grid([2, 2], 2120.0, 100.0, 0.0);
    let light = light(500.0, 0.01, 60.0);
    let model = CameraModel::new(light.clone(), &settings(), 2120.0, 2);
    let start = arrangement.elements(&light.lattice(), edge(), CameraStart::Parts, 1);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| arrangement.descend(&model, &start, 4, &Silent).unwrap())
    };
    let (one, two) = (on(1), on(2));
    assert_eq!(one.0, two.0);
    assert!(one.1.error < model.judge(&start, false).error);
    // Elements mirror one another.
    assert_eq!(one.0[0].terms_rad[3], -one.0[1].terms_rad[3]);
}

/// Table of issue 59 beside this model: `cargo test --release -p metalith-optimise --lib -- --ignored --nocapture the_table`.
#[test]
#[ignore = "a minute; prints a table"]
fn the_table_of_the_issue() {
    /// The estimate of the issue is good to 2 dB, and so is this.
    const BOTH_DB: f64 = 4.0;
    let light = light(500.0, 0.01, 12.5);
    let judged = |count, distance, diameter, steering, start, perfect: bool| {
        let arrangement = grid(count, distance, diameter, steering);
        let settings = ModelSettings {
            window_um: if steering > 0.0 {
                0.8 * diameter + 100.0
            } else {
                WINDOW_UM
            },
            ..settings()
        };
        let model = CameraModel::new(light.clone(), &settings, distance, 4);
        let model = if perfect { model.perfect() } else { model };
        model
            .judge(&arrangement.elements(&light.lattice(), edge(), start, 1), false)
            .psnr_db()
    };
    let identical = CameraStart::Identical;
    let rows = [
        (
            "nine of 1 mm, wedges of 15 degrees",
            22.7,
            judged([3, 3], 2400.0, 1000.0, 15.0, identical, false),
        ),
        (
            "nine of 250 um, wedges of 15 degrees",
            22.7,
            judged([3, 3], 2400.0, 250.0, 15.0, identical, false),
        ),
        (
            "one, D = 150 um",
            23.5,
            judged([1, 1], 4230.0, 150.0, 0.0, identical, false),
        ),
        (
            "one, D = 400 um",
            25.1,
            judged([1, 1], 4230.0, 400.0, 0.0, identical, false),
        ),
        (
            "nine, f = 2.4 mm, D = 200 um",
            25.1,
            judged([3, 3], 2400.0, 200.0, 0.0, CameraStart::Parts, false),
        ),
        (
            "nine, f = 1.44 mm, D = 200 um",
            25.6,
            judged([3, 3], 1440.0, 200.0, 0.0, CameraStart::Parts, false),
        ),
        (
            "bound, D = 150 um",
            23.7,
            judged([1, 1], 4230.0, 150.0, 0.0, identical, true),
        ),
        (
            "bound, D = 400 um",
            28.9,
            judged([1, 1], 4230.0, 400.0, 0.0, identical, true),
        ),
        (
            "bound, D = 1000 um",
            35.3,
            judged([1, 1], 4230.0, 1000.0, 0.0, identical, true),
        ),
    ];
    for (name, issue, model) in rows {
        println!("| {name} | {issue:.1} | {model:.1} |");
        assert!(
            (issue - model).abs() < BOTH_DB + f64::from(u8::from(name.starts_with("bound"))),
            "{name}"
        );
    }
}

/// Stops a search after a camera.
struct StopAfterOne(std::sync::atomic::AtomicU64);

impl metalith_core::Progress for StopAfterOne {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self, n: u64) {
        self.0.fetch_add(n, std::sync::atomic::Ordering::Relaxed);
    }
    fn stopped(&self) -> bool {
        self.0.load(std::sync::atomic::Ordering::Relaxed) >= 1
    }
}

/// Text of a design with a search of cameras, and its path: sections of the design `imaging_3x3`, without files that it names by
/// relative paths.
fn text_with(sections: &str) -> (String, std::path::PathBuf) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs/imaging_3x3.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let (head, _) = text.split_once("\n[optimise]").unwrap();
    let table = path.with_file_name("phases/imaging.csv").canonicalize().unwrap();
    let head = head.replace("\"phases/imaging.csv\"", &format!("\"{}\"", table.display()));
    (format!("{head}\n{sections}"), path)
}

/// What would be found wrong after minutes of search is refused before: light beyond the band of the cell, and cameras that the chip of
/// the design does not hold, the largest of them by name.
#[test]
fn a_search_in_vain_is_refused_before() {
    let search = "[optimise.camera]\nfield_deg = 80\nmost_track_um = 2400\ncolumns = [2, 10]\nrows = [1, 1]\ndiameters_um = [60, 90]\n";
    let (text, path) = text_with(&format!("[optimise]\ncell = \"published\"\n\n{search}"));
    let camera = Camera::read(&path.with_file_name("../cameras/gt1930.toml")).unwrap();
    let refused = |text: &str| {
        let design = metalith_design::Design::parse(&path, text).unwrap();
        match CameraTask::of(&design, text, camera.clone()) {
            Err(metalith_core::Error::Text(faults)) => {
                let all = faults.faults().iter();
                all.map(|f| (f.id(), f.what.matches("10 by 1 elements of 90").count() == 1))
                    .collect::<Vec<_>>()
            }
            Err(other) => panic!("{other}"),
            Ok(_) => Vec::new(),
        }
    };
    assert_eq!(refused(&text), [("chip.size_um/inconsistent".to_owned(), true)]);
    let fits = text.replace("columns = [2, 10]", "columns = [2, 4]");
    assert_eq!(refused(&fits), []);
    let narrow = text_with(search)
        .0
        .replacen("[cell]\n", "[cell]\nband_nm = [455, 660]\n", 1);
    assert_eq!(refused(&narrow), [("cell.band_nm/inconsistent".to_owned(), false)]);
}

/// A search that was stopped goes on with the same cameras, and refined sizes are no worse than listed ones.
#[test]
fn a_stopped_search_goes_on_with_the_same_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let camera = Camera::read(Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../cameras/gt1930.toml"
    )))
    .unwrap();
    let task = |sizes: &str| {
        let sections = format!(
            "[optimise]\ncell = \"published\"\n\n[optimise.camera]\nfield_deg = 80\nscene_pixels = 64\nmost_track_um = 600\n\
             columns = [2]\nrows = [1]\ndiameters_um = [60, 90]\nstarts = 1\nsteps = 1\nfinal_steps = 1\nsizes = \"{sizes}\"\n"
        );
        let (text, _) = text_with(&sections);
        let path = folder.path().join(format!("{sizes}.toml"));
        std::fs::write(&path, &text).unwrap();
        let design = metalith_design::Design::read(&path).unwrap();
        let task = CameraTask::of(&design, &text, camera.clone()).unwrap();
        (design, task.decides(&text).unwrap(), task)
    };
    let (design, decides, refined) = task("refined");
    let cell = metalith_design::cell_models(&design, &[metalith_cell::Fidelity::Published])
        .unwrap()
        .remove(0);
    let file = folder.path().join("kept.json");
    let search = |progress: &dyn metalith_core::Progress| {
        let mut kept = TriedCameras::open(&file, &decides);
        let before = kept.count();
        (refined.search(&*cell, &mut kept, progress).unwrap(), before)
    };
    let (stopped, _) = search(&StopAfterOne(0.into()));
    assert!(stopped.interrupted && stopped.tried.len() == 1);
    let (whole, before) = search(&Silent);
    assert_eq!((before, whole.interrupted), (1, false));
    std::fs::remove_file(&file).unwrap();
    let (again, before) = search(&Silent);
    assert_eq!(before, 0);
    let of = |found: &CameraFindings| {
        let all = found.tried.iter().chain(&found.best);
        all.map(|c| (c.arrangement, c.judged.clone(), c.elements.clone()))
            .collect::<Vec<_>>()
    };
    assert_eq!(of(&whole), of(&again));
    // Damage and another task begin again.
    assert_eq!(TriedCameras::open(&file, "another").count(), 0);
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replacen("\"diameter_um\":60", "\"diameter_um\":61", 1)).unwrap();
    assert_eq!(TriedCameras::open(&file, &decides).count(), 0);
    let (_, decides, listed) = task("listed");
    let plain = listed
        .search(
            &*cell,
            &mut TriedCameras::open(&folder.path().join("listed.json"), &decides),
            &Silent,
        )
        .unwrap();
    let least = |found: &CameraFindings| found.tried.iter().map(|c| c.judged.error).fold(f64::MAX, f64::min);
    println!(
        "listed {} of {}, refined {} of {}",
        least(&plain),
        plain.tried.len(),
        least(&whole),
        whole.tried.len()
    );
    assert!(plain.tried.len() == 2 && whole.tried.len() > 2);
    assert!(least(&whole) < least(&plain));
}
