//! One made chip: each effect that a calibration knows does the same to a PSF in every command.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::calibrate::{Bench, BenchSampling, MeasuredSet, Stage, all_effects};
use metalith::compensate::{compensate, compensation_cases};
use metalith::design::CellIncidence;
use metalith::extract::PillarsAt;
use metalith::optics::{AsBuiltChip, CalibratedModel, Perturbation};
use metalith::verify::{Lighting, SimulationCase, single_psfs};
use metalith::wave::{Scratch, Window};
use metalith::{
    Accuracy, Design, ExtractionPlan, Layout, PillarArray, Silent, SimulationCases, extract, verify, write_pillars,
};
use metalith_testing::session::small_set;
use ndarray::Array2;

/// Share of the peak by which PSFs of one made chip may differ between commands: they share one chip and one
/// propagator, and what is left is that some keep their PSF in single precision.
const OF_THE_PEAK: f64 = 1e-6;

/// Share of the peak by which an effect must change a PSF to count as applied: a hundred times what commands may
/// differ by.
const APPLIED: f64 = 1e-4;

const UM: f64 = 0.53;

/// A design with few widths, so that cells are solved in no time, and one wavelength in the middle of the field.
fn design(folder: &Path) -> Design {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(root.join("designs/mini_3x3.toml")).unwrap();
    let text = text
        .replace("width_step_nm = 2 ", "width_step_nm = 20 ")
        .replace("wavelengths_nm = [455, 530, 660]", "wavelengths_nm = [530]")
        .replace("field_x_deg = [0, 15]", "field_x_deg = [0]")
        .replace("field_y_deg = [0, 0]", "field_y_deg = [0]");
    let path = folder.join("few.toml");
    fs::write(&path, text).unwrap();
    let design = Design::read(&path).unwrap();
    assert_eq!(
        (design.verify.wavelengths_um.len(), design.verify.field_angles.len()),
        (1, 1)
    );
    assert_eq!(design.cell.width_step_nm, 20);
    design
}

/// The files that all commands start from.
struct Files {
    design: Design,
    array: PillarArray,
    layout: PathBuf,
    set: MeasuredSet,
}

impl Files {
    fn write(folder: &Path) -> Self {
        let design = design(folder);
        let array = PillarArray::build(&design, &Silent).unwrap();
        let layout = folder.join("few.gds");
        write_pillars(&design, &array, design.layout.hierarchy, &layout, &Silent).unwrap();
        small_set(folder);
        let mut set = MeasuredSet::read(folder, &PillarsAt::STATED, &Silent).unwrap();
        // The same chip on a bench: pillars of this layout, openings as the design has them.
        let found = metalith::layout::read_pillars(&design, &layout, &Silent).unwrap();
        for element in &mut set.elements {
            let index = (element.index[0] as i32, element.index[1] as i32);
            let at = array.placed.iter().position(|p| p.element.index == index);
            element.pillars = found.elements[at.unwrap()].widths.clone();
            element.aperture_diameter_um = 2.0 * design.aperture_radius_um();
        }
        Self {
            design,
            array,
            layout,
            set,
        }
    }

    fn window(&self) -> Window {
        Window::about(
            [0.0, 0.0],
            self.array.lattice.pitch_um(),
            self.design.verify.window_samples,
            self.design.lens.focal_length_um,
        )
    }

    fn chip(&self, perturbation: &Perturbation) -> AsBuiltChip {
        let model = CalibratedModel::new("set".into(), "finding".into(), perturbation.clone());
        AsBuiltChip::new(&self.design.cell_stack().unwrap(), &model).unwrap()
    }

    /// PSFs of the centre element by each command, the first by `run` and `verify`; in units of |E|^2 / |E_inc|^2.
    fn psfs(&self, perturbation: &Perturbation) -> Vec<(&'static str, Array2<f64>)> {
        let chip = self.chip(perturbation);
        let power = chip.full_transmission(UM).unwrap().powi(2);
        let cases = SimulationCases::judged_by(&chip);
        let found = verify(
            &self.design,
            &self.array,
            &self.layout,
            &cases,
            Accuracy::Accurate,
            &Silent,
        )
        .unwrap();
        let centre = found.distinct.iter().find(|d| d.element.index == (0, 0)).unwrap();
        let images = centre.spots[0].images().unwrap();
        let mut psfs = vec![("verify", images.extracted.mapv(|v| f64::from(v) * power))];

        let plan = ExtractionPlan::discover(self.design.layout.layers.pillars.number());
        let read = extract(&Layout::open(&self.layout).unwrap(), &plan, &Silent).unwrap();
        let at = read.elements.iter().position(|e| e.site.centre_nm == [0, 0]).unwrap();
        let read = metalith::Extraction {
            elements: vec![read.elements[at].clone()],
            ..read
        };
        let light = Lighting {
            polarised: Default::default(),
            wavelengths_um: vec![UM],
            incidence_sin: [0.0; 2],
            oblique_cells: self.design.verify.incidence == CellIncidence::Oblique,
            distance_um: self.design.lens.focal_length_um,
            at_um: [0.0; 2],
            samples: self.design.verify.window_samples,
            pixel_um: self.design.verify.pixel_um,
            aperture_radius_um: Some(self.design.aperture_radius_um()),
            accuracy: Accuracy::Accurate,
            through_focus: None,
        };
        let single = single_psfs(&read, SimulationCase::from(&chip), &light, &Silent)
            .unwrap()
            .remove(0);
        psfs.push(("psf", single.psf.values));

        let model = CalibratedModel::new("set".into(), "finding".into(), perturbation.clone());
        let compensated = compensate(&self.design, &self.array, &model, &Silent);
        // A width is chosen for its cell and not for its place: such a model is refused.
        let refused = perturbation.cell.rim_height_nm != 0.0;
        assert_eq!(compensated.is_err(), refused);
        if let Ok(compensated) = compensated {
            // The uncorrected layout stands for the corrected one: what is compared is the chip that is shown.
            let cases = compensation_cases(&self.design, &self.array, &compensated, &self.layout, &Silent).unwrap();
            let shown = cases
                .into_iter()
                .filter(|c| c.element == centre.element.label() && c.pillars != "intended");
            for case in shown {
                psfs.push((case.pillars, case.psf.values));
            }
        }

        // The forward model of a calibration, the first capture of which looks at the centre element along its axis.
        let bench = Bench::new(&self.set, BenchSampling::default());
        let element = bench.element_of(0.into(), perturbation).unwrap();
        let light = bench.direction_of(0.into(), perturbation, UM);
        let plane = light.plane;
        let sines = metalith::optics::cell_direction([plane.sin_x, plane.sin_y], metalith::LatticeKind::Square);
        let cells = metalith::cell::Illumination::from_direction(UM, sines);
        let cells = match self.design.verify.incidence {
            CellIncidence::Oblique => cells.oblique(),
            CellIncidence::Normal => cells,
        };
        let solved = chip.cells().solve(element.widths_nm(), &cells, &Silent).unwrap();
        let view = bench.view(0.into(), &element, perturbation, UM, &solved);
        let psf = view
            .psf(self.window(), Accuracy::Accurate, &[], &mut Scratch::default())
            .unwrap();
        psfs.push(("calibrate", psf.values));
        psfs
    }

    fn agree(&self, name: &str, perturbation: &Perturbation) -> Array2<f64> {
        let mut psfs = self.psfs(perturbation).into_iter();
        let (_, first) = psfs.next().unwrap();
        let peak = first.iter().copied().fold(0.0, f64::max);
        assert!(peak > 0.0);
        let mut others = 0;
        for (command, psf) in psfs {
            let worst = largest_difference(&psf, &first) / peak;
            println!("{name}, {command}: {worst:.1e}");
            assert!(worst < OF_THE_PEAK, "{name}, {command}: {worst:e}");
            others += 1;
        }
        // Two of them are pictures of a compensation, for what can be compensated.
        let compensated = if perturbation.cell.rim_height_nm == 0.0 { 2 } else { 0 };
        assert_eq!(others, 2 + compensated);
        first
    }
}

fn largest_difference(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
#[ignore = "second tier: a minute of CPU time, in scripts/slow_tests.sh"]
fn every_effect_is_the_same_in_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let files = Files::write(folder.path());
    let plain = files.agree("nothing", &Perturbation::default());
    let peak = plain.iter().copied().fold(0.0, f64::max);
    let mut all = Perturbation::default();
    for effect in all_effects(&files.set) {
        let typical: Vec<f64> = effect.parameters().iter().map(|p| p.typical).collect();
        let mut perturbation = Perturbation::default();
        effect.apply(&typical, &mut perturbation);
        effect.apply(&typical, &mut all);
        let name = effect.name();
        let psf = files.agree(&name, &perturbation);
        let change = largest_difference(&psf, &plain) / peak;
        let named = perturbation.not_applied();
        // Applied, or named with the reason: nothing is silent.
        if effect.stage() == Stage::Source {
            assert_eq!((change, named.len()), (0.0, 1), "{name}");
        } else {
            assert!(change > APPLIED && named.is_empty(), "{name}: {change:e}, {named:?}");
        }
    }
    files.agree("all of them", &all);
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn oblique_cells_are_the_same_in_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = Files::write(folder.path());
    let mut perturbation = Perturbation::default();
    perturbation.path.tilt_mrad = [20.0, -5.0];
    perturbation.geometry.missing_pillars = 0.05;
    let normal = files.agree("along the normal", &perturbation);
    files.design.verify.incidence = CellIncidence::Oblique;
    let lit = files.agree("as lit", &perturbation);
    let peak = normal.iter().copied().fold(0.0, f64::max);
    assert!(largest_difference(&lit, &normal) > APPLIED * peak);
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn the_program_applies_what_it_once_left_out_and_names_what_it_cannot() {
    let folder = tempfile::tempdir().unwrap();
    let files = Files::write(folder.path());
    let design = folder.path().join("few.toml");
    let judged = |name: &str, change: &dyn Fn(&mut Perturbation)| {
        let path = folder.path().join(format!("{name}.toml"));
        let mut perturbation = Perturbation::default();
        change(&mut perturbation);
        CalibratedModel::new("set".into(), "finding".into(), perturbation)
            .write(&path)
            .unwrap();
        let out = super::metalith()
            .args(["verify", "--fast", "--json"])
            .arg(&design)
            .arg(&files.layout)
            .arg("--model")
            .arg(&path)
            .arg("--out")
            .arg(folder.path().join(name))
            .output()
            .unwrap();
        serde_json::from_slice::<serde_json::Value>(&out.stdout).unwrap()
    };
    let strehl = |found: &serde_json::Value| {
        let spot = &found["distinct"][0]["spots"][0]["extracted"][0];
        assert_eq!(spot[0], "calibrated");
        spot[1]["strehl"].as_f64().unwrap()
    };
    let nothing = judged("nothing", &|_| ());
    assert_eq!(nothing["model"]["not_applied"].as_array().unwrap().len(), 0);
    // A model that judges is no model that the layout was compensated for.
    assert!(nothing["compensated"].is_null());
    let offset = judged("offset", &|p| p.geometry.aperture_offset_um = [15.0, 0.0]);
    let near = judged("near", &|p| p.path.source_per_m = 50.0);
    // Either perturbation costs more than a twentieth of the peak; a command that ignored it would cost nothing.
    const CHANGED: f64 = 0.95;
    for found in [&offset, &near] {
        assert!(
            strehl(found) < CHANGED * strehl(&nothing),
            "{} {}",
            strehl(found),
            strehl(&nothing)
        );
    }
    let lamps = judged("lamps", &|p| *p.light.shift_mut(0) = 2.0);
    assert_eq!(strehl(&lamps), strehl(&nothing));
    let named = &lamps["model"]["not_applied"][0];
    assert_eq!(named["quantity"], "light.led_shift_nm");
    assert!(named["because"].as_str().unwrap().contains("lamps"));
    let page = fs::read_to_string(folder.path().join("lamps/report.html")).unwrap();
    assert!(page.contains("not applied: "));
}
