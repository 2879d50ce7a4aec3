//! Pictures of lenses that are no squares on a square lattice: where their light goes, against what their cells pass.

mod direct_psf;
mod one_wavelength;

use metalith_cell::{Analyser, CellModel, CellResponse, Illumination, PolarisedTables};
use metalith_core::Silent;
use metalith_design::{Design, cell_models};
use metalith_gds::extract::Extraction;
use metalith_imaging::scene::SceneImage;
use metalith_imaging::{BankSpec, ChipInLight, KernelBank, StrayLight};
use metalith_layout::read_pillars;
use metalith_optics::SimulationCase;
use metalith_wave::{Pillars, Window};
use ndarray::Array3;

use direct_psf::direct_psf;
use one_wavelength::camera;

/// Degrees of the scene from side to side.
const FIELD_DEG: f64 = 16.0;

/// A smaller lens of a shipped design, by lines of it that are changed.
fn lens(name: &str, changed: &[(&str, &str)]) -> (Design, Extraction) {
    let text = metalith_testing::accepting(&metalith_testing::changed(name, changed));
    let design = Design::parse(&metalith_testing::design(name), &text).unwrap();
    let (design, _, folder) = metalith_testing::layouts::written(design);
    let extraction = read_pillars(&design, &folder.path().join("lens.gds"), &Silent).unwrap();
    (design, extraction)
}

struct Taken<'a> {
    chip: ChipInLight<'a>,
    bank: KernelBank,
    stray_light: StrayLight,
}

fn taken<'a>(design: &Design, extraction: &'a Extraction, cell: &'a dyn CellModel, nm: f64) -> Taken<'a> {
    let camera = camera(nm);
    let scene = SceneImage::of_rgb("white", &Array3::from_elem((20, 20, 3), 1.0), FIELD_DEG, f64::INFINITY);
    let case = SimulationCase::from(cell);
    let chip = ChipInLight::new(design, extraction, case, &camera, f64::INFINITY, &Silent).unwrap();
    let spec = BankSpec {
        pixel_um: camera.sensor.pixel_um,
        window: 16,
        nodes: 3,
        reach_um: 15.0,
        accurate: true,
    };
    let bank = KernelBank::build(&chip, &scene.basis, spec, &Silent).unwrap();
    let stray_light = StrayLight::build(&chip, &bank, &scene.basis, &camera.sensor, &scene.view, &Silent).unwrap();
    Taken {
        chip,
        bank,
        stray_light,
    }
}

/// Share of the light that arrives at the pillars of the only element and leaves it as the tables of a cell say, mean over
/// wavelengths.
fn passed(
    extraction: &Extraction,
    nm: &[f64],
    cell: &dyn CellModel,
    table: impl Fn(f64) -> Vec<num_complex::Complex64>,
) -> f64 {
    let of = |nm: &f64| {
        let (table, full) = (table(nm * 1e-3), cell.full_transmission(nm * 1e-3).unwrap());
        let widths = extraction.elements[0].widths.number.iter().filter(|w| **w > 0);
        let (count, power) = widths.fold((0.0, 0.0), |(n, sum), w| {
            (n + 1.0, sum + table[usize::from(*w)].norm_sqr())
        });
        power / (count * full * full)
    };
    nm.iter().map(of).sum::<f64>() / nm.len() as f64
}

/// Answer of a cell for one wavelength (um) of a band.
fn in_band(cell: &dyn CellModel, um: f64, last: u16) -> CellResponse {
    cell.response(&Illumination::normal(um).in_band(), last, &Silent)
        .unwrap()
}

/// Image, veil and what is lost are all the light, and what is not passed is what the cells do not pass.
fn assert_all_light(taken: &Taken<'_>, wanted: f64) {
    /// Directions with next to no power are left out of blocks, tables are in single precision.
    const LIGHT: f64 = 2e-3;
    for shares in &taken.stray_light.budget {
        let travels = shares.in_kernels + shares.stray_light + shares.beyond + shares.evanescent;
        let all = travels + shares.not_passed;
        assert!((all / shares.arrives - 1.0).abs() < LIGHT, "{shares:?}");
        let found = 1.0 - shares.not_passed / shares.arrives;
        assert!((found - wanted).abs() < LIGHT, "{found} {wanted}");
    }
}

/// Kernels on the axis and off it hold what a direct sum over all pillars finds in their windows, and the budget what cells pass.
#[test]
fn a_hexagonal_lens_takes_pictures() {
    /// Fields by folding are within 1e-4 of the peak; the window ends where light is.
    const WINDOW: f64 = 2e-3;
    let nm = 1550.0;
    let (design, extraction) = lens(
        "hexagonal_1550",
        &[
            ("diameter_um = 160", "diameter_um = 30"),
            ("focal_length_um = 240", "focal_length_um = 60"),
        ],
    );
    assert!(!design.cell.lattice.is_square());
    let cell = cell_models(&design, &[design.verify.fidelity]).unwrap().remove(0);
    let um = nm * 1e-3;
    let table = in_band(cell.as_ref(), um, design.cell.most()).focused().unwrap();
    let taken = taken(&design, &extraction, cell.as_ref(), nm);
    let of = |um| in_band(cell.as_ref(), um, design.cell.most()).focused().unwrap();
    let wanted = passed(&extraction, &taken.chip.sampling.wavelengths_nm, cell.as_ref(), of);
    assert_all_light(&taken, wanted);

    let pillars = Pillars::new(&extraction.elements[0].widths, &table).unwrap();
    let (spec, view) = (&taken.bank.spec, taken.chip.distinct[0].view);
    let nm_of_chip = &taken.chip.sampling.wavelengths_nm;
    let index = nm_of_chip.iter().position(|w| *w == nm).unwrap();
    for node in [[spec.nodes / 2; 2], [0, 0], [1, 2]] {
        let place = [spec.node_um(node[1]), spec.node_um(node[0])];
        let sines = view.sines_of_landing(place, um);
        let window = Window {
            centre_um: place,
            step_um: 0.25,
            samples: 96,
            distance_um: design.lens.focal_length_um,
        };
        let psf = direct_psf(&design, &pillars, um, sines, window);
        let wanted = psf.values.sum() * window.step_um.powi(2) / taken.chip.arriving_um2(0, index);
        let (unique, _) = taken.bank.distinct[0].nodes[node[0] * spec.nodes + node[1]];
        let found = f64::from(taken.bank.distinct[0].in_window[unique * nm_of_chip.len() + index]);
        println!("{place:?} um: {found:.5} {wanted:.5}");
        assert!(
            wanted > 0.5 && (found - wanted).abs() < WINDOW * wanted,
            "{place:?}: {found} {wanted}"
        );
    }
}

/// Light that rotated rectangles do not convert is in the picture, and behind an analyser it is not.
#[test]
fn light_that_is_not_converted_is_in_the_stray_light() {
    let nm = 532.0;
    let small = [
        ("diameter_um = 80", "diameter_um = 20"),
        ("focal_length_um = 80", "focal_length_um = 40"),
        // A pillar that is no half-wave plate, so that there is something to see.
        ("pillar_length_nm = 250", "pillar_length_nm = 180"),
    ];
    let analyser = [&small[..], &[("[verify]\n", "[verify]\nanalyser = \"circular\"\n")]].concat();
    let mut shares = Vec::new();
    for changed in [&small[..], &analyser] {
        let (design, extraction) = lens("geometric_phase_532", changed);
        let cell = cell_models(&design, &[design.verify.fidelity]).unwrap().remove(0);
        let taken = taken(&design, &extraction, cell.as_ref(), nm);
        let (most, nm) = (design.cell.most(), &taken.chip.sampling.wavelengths_nm);
        let converted = passed(&extraction, nm, cell.as_ref(), |um| {
            in_band(cell.as_ref(), um, most).focused().unwrap()
        });
        let other = passed(&extraction, nm, cell.as_ref(), |um| {
            match in_band(cell.as_ref(), um, most).polarised() {
                Some(PolarisedTables::Hands(hands)) => hands.unconverted[0].clone(),
                other => panic!("{other:?}"),
            }
        });
        assert!(other > 0.1, "{other}");
        let wanted = if design.verify.analyser == Some(Analyser::Circular) {
            converted
        } else {
            converted + other
        };
        println!("{converted} {other} {:?}", taken.stray_light.budget);
        assert_all_light(&taken, wanted);
        shares.push(taken.stray_light.budget[0].zero_order / taken.stray_light.budget[0].arrives);
    }
    // What is not converted leaves as one wave, for all pillars do alike what they do not convert.
    assert!(shares[0] > 0.1 && shares[1] < 0.02, "{shares:?}");
}

/// Budget of the light of a small lens of pillars that are no half-wave plates, as shares of what arrives: in kernels,
/// in stray light and beyond, as one wave, not passed.
fn budget(light: &str) -> ([f64; 4], Vec<f32>) {
    let line = format!("[verify]\n{light}\n");
    let small = [
        ("diameter_um = 80", "diameter_um = 20"),
        ("focal_length_um = 80", "focal_length_um = 40"),
        ("pillar_length_nm = 250", "pillar_length_nm = 180"),
        ("[verify]\n", &line),
    ];
    let (design, extraction) = lens("geometric_phase_532", &small);
    let cell = cell_models(&design, &[design.verify.fidelity]).unwrap().remove(0);
    let taken = taken(&design, &extraction, cell.as_ref(), 532.0);
    let shares = taken.stray_light.budget[0];
    let rest = shares.stray_light + shares.beyond;
    let parts = [shares.in_kernels, rest, shares.zero_order, shares.not_passed].map(|v| v / shares.arrives);
    (parts, taken.bank.distinct[0].in_window.clone())
}

/// Behind two linear analysers that are crossed is all of the light, in kernels and beyond them.
#[test]
fn crossed_analysers_have_all_of_the_light() {
    /// Kernels are kept in single precision, and blocks of the stray light leave out directions with next to no power.
    const SUM: f64 = 1e-3;
    let [all, along, across] = ["", "analyser = 30", "analyser = -60"].map(|light| budget(light).0);
    println!("{all:.4?} {along:.4?} {across:.4?}");
    for k in 0..3 {
        assert!(
            (along[k] + across[k] - all[k]).abs() < SUM,
            "{k}: {along:?} {across:?} {all:?}"
        );
    }
    // What the analyser keeps out counts as not passed.
    assert!(
        (along[3] + across[3] - all[3] - 1.0).abs() < SUM,
        "{along:?} {across:?} {all:?}"
    );
    assert!(along[0] > 0.3 * all[0] && across[0] > 0.3 * all[0]);
}

/// Unpolarised light of a scene is the mean of light of both hands: what is in images, what leaves as one wave, what is not passed
/// and all the rest. (Where the rest lands is scaled by how much it is, and no mean.)
#[test]
fn unpolarised_scenes_are_the_mean_of_both_hands() {
    /// Kernels are kept in single precision, and blocks of the stray light leave out directions with next to no power.
    const MEAN: f64 = 5e-4;
    let of = |light: &str| budget(&format!("polarisation = \"{light}\""));
    let [left, right, mean] = ["left", "right", "unpolarised"].map(of);
    println!("{:.4?} {:.4?} {:.4?}", left.0, right.0, mean.0);
    let near = |found: f64, a: f64, b: f64| {
        assert!((found - 0.5 * (a + b)).abs() < MEAN, "{found} {a} {b}");
    };
    for k in 0..4 {
        near(mean.0[k], left.0[k], right.0[k]);
    }
    for (k, found) in mean.1.iter().enumerate() {
        near(f64::from(*found), f64::from(left.1[k]), f64::from(right.1[k]));
    }
    // What is converted of the other hand diverges: four tenths of it beyond the windows of kernels.
    assert!(right.0[0] < 0.7 * left.0[0]);
}
