//! Designs beyond the grid of radial lenses: phases over the plane, elements placed one by one, other bands and materials.

use metalith_cell::{Fidelity, RotatedRectangle};
use metalith_core::Silent;
use metalith_rcwa::{Orders, circular};

use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, PillarArray};
use metalith_testing::design as path;

fn text(name: &str) -> String {
    std::fs::read_to_string(path(name)).unwrap()
}

/// The text of an error in a shipped design that was changed.
fn words(error: &metalith_core::Error) -> String {
    metalith_testing::without_folder(error, path("mini_3x3").parent().unwrap())
}

fn changed(name: &str, from: &str, to: &str) -> metalith_core::Result<Design> {
    Design::parse(&path(name), &metalith_testing::changed(name, &[(from, to)]))
}

#[test]
fn a_hologram_is_on_the_element_that_it_is_of() {
    let design = Design::read(&path("hologram")).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let centres: Vec<_> = array.placed.iter().map(|p| p.element.centre_nm).collect();
    assert_eq!(centres, [(-60_000, 0), (60_000, 20_000)]);
    assert_eq!(array.classes.len(), 2);
    // The lens has all symmetries of the square, the hologram none.
    let members: Vec<_> = array.classes.iter().map(|c| c.group.members().len()).collect();
    assert_eq!(members, [8, 1]);
    let lens = LensPhase::of(&design);
    let [plain, hologram] = [0, 1].map(|k| ElementPhase::of(&lens, &array.placed[k].element));
    let turns = |phase: &ElementPhase<'_>, ix, iy| phase.turns(ix, iy).unwrap();
    let apart = turns(&hologram, 90, 60) - turns(&plain, 90, 60);
    // The table is of float32, within half a turn.
    assert!(apart != 0.0 && apart.abs() <= 0.5 + 1e-6, "{apart}");
}

#[test]
fn two_by_four_elements_are_about_the_middle() {
    let design = Design::read(&path("array_2x4")).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    assert_eq!(array.placed.len(), 8);
    // Mirror images of two: those of the inner and of the outer rows.
    assert_eq!(array.classes.len(), 2);
    let sum = design
        .elements()
        .iter()
        .fold((0, 0), |s, e| (s.0 + e.centre_nm.0, s.1 + e.centre_nm.1));
    assert_eq!(sum, (0, 0));
}

#[test]
fn the_band_is_that_of_the_design() {
    let infrared = Design::read(&path("asi_940")).unwrap();
    let (short, long) = infrared.band_um().unwrap();
    assert!(
        short > 0.9 && short < 0.94 && long > 0.94 && long < 1.0,
        "{short} {long}"
    );
    let visible = Design::read(&path("mini_3x3")).unwrap();
    assert_eq!(visible.band_um().unwrap(), (0.4, 0.7));
    let own = changed("asi_940", "[cell]\n", "[cell]\nband_nm = [900, 1000]\n").unwrap();
    assert_eq!(own.band_um().unwrap(), (0.9, 1.0));
    assert_eq!(
        own.digest(),
        infrared.digest(),
        "the band decides nothing of the layout"
    );
    assert_ne!(own.optics_digest().unwrap(), infrared.optics_digest().unwrap());
}

/// A band beyond what the materials are known for is refused before anything is written, with what they are known for.
#[test]
fn a_band_beyond_the_materials_is_refused() {
    let refused = |from: &str, to: &str| {
        let error = changed("asi_940", from, to).unwrap_err();
        assert_eq!(error.id(), "design/band-beyond-materials");
        words(&error)
    };
    let mut said = Vec::new();
    for section in ["[cell]", "[mapping]"] {
        let with = format!("{section}\nband_nm = [400, 1000]");
        said.push(refused(section, &with));
    }
    assert!(changed("asi_940", "[cell]", "[cell]\nband_nm = [420, 1000]").is_ok());
    let own = "[optimise]\nband_nm = [400, 700]\n\n[verify]";
    said.push(refused("[verify]", own));
    // The section is in the words.
    insta::assert_snapshot!(said.join("\n"), @"
        asi_940.toml: `band_nm` of [cell] is 400 to 1000 nm, and the materials of [cell] are known from 413.3 to 2066 nm
          help: give a band in that range, or other materials
        asi_940.toml: `band_nm` of [mapping] is 400 to 1000 nm, and the materials of [cell] are known from 413.3 to 2066 nm
          help: give a band in that range, or other materials
        asi_940.toml: `band_nm` of [optimise] is 400 to 700 nm, and the materials of [cell] are known from 413.3 to 2066 nm
          help: give a band in that range, or other materials
        ");
}

/// A table of a material that says something else is another chip in the light, and the same layout.
#[test]
fn the_contents_of_a_material_decide_the_optics() {
    let folder = tempfile::tempdir().unwrap();
    let table = |n: f64| {
        let rows = format!("wavelength_nm,n,k\n380,{n},0\n720,{n},0\n");
        std::fs::write(folder.path().join("film.csv"), rows).unwrap();
        let text = text("mini_3x3");
        let line = text
            .lines()
            .find(|l| l.starts_with("pillar_material"))
            .unwrap()
            .to_owned();
        let text = metalith_testing::accepting(&text.replacen(&line, "pillar_material = \"film.csv\"", 1));
        let design = Design::parse(&folder.path().join("own.toml"), &text).unwrap();
        (design.digest(), design.optics_digest().unwrap())
    };
    let (one, other) = (table(2.0), table(2.1));
    assert_eq!(one.0, other.0);
    assert_ne!(one.1, other.1);
    assert_eq!(other, table(2.1));
}

/// Light arrives through the substrate: one that absorbs is a mistake of the design, at once; a trace of loss is none.
#[test]
fn a_substrate_that_absorbs_is_refused_when_the_design_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let read = |k: f64, more: &str| {
        let rows = format!("wavelength_nm,n,k\n400,1.5,{k}\n500,1.5,0\n720,1.5,0\n");
        std::fs::write(folder.path().join("glass.csv"), rows).unwrap();
        let text = metalith_testing::accepting(&text("array_2x4"));
        let cell = format!("[cell]\nsubstrate_material = \"glass.csv\"\n{more}");
        Design::parse(&folder.path().join("own.toml"), &text.replacen("[cell]\n", &cell, 1))
    };
    assert!(read(0.0005, "").is_ok());
    // It is verified at 530 nm, but white light has 400 nm too, unless the design says otherwise.
    let error = read(0.02, "").unwrap_err();
    insta::assert_snapshot!(metalith_testing::without_folder(&error, folder.path()), @"
        the substrate glass.csv has k = 0.02 at 400.0 nm, where light arrives through it
          help: use a substrate with k of at most 0.001, or wavelengths and a band (`band_nm` in [cell]) at which it is clear: what absorbs on so thick a way passes no light
        ");
    assert_eq!(error.ids(), ["cell/absorbing-substrate"]);
    // The mapping is for 452 nm, where there is half of it.
    let error = read(0.02, "band_nm = [500, 600]\n").unwrap_err();
    insta::assert_snapshot!(metalith_testing::without_folder(&error, folder.path()), @"
        the substrate glass.csv has k = 0.007004159999999998 at 452.0 nm, where light arrives through it
          help: use a substrate with k of at most 0.001, or wavelengths and a band (`band_nm` in [cell]) at which it is clear: what absorbs on so thick a way passes no light
        ");
    assert_eq!(error.ids(), ["cell/absorbing-substrate"]);
}

/// Sums over pairs were compared with real rows of the cell of the paper alone.
#[test]
fn unlike_neighbours_judge_the_cell_of_the_paper_where_nothing_is_said() {
    let fidelity = |name: &str, from: &str, to: &str| {
        let text = metalith_testing::accepting(&text(name).replacen(from, to, 1));
        Design::parse(&path(name), &text).unwrap().verify.fidelity
    };
    let said = "fidelity = \"rigorous\"\n";
    assert_eq!(fidelity("array_2x4", said, ""), Fidelity::Neighbours);
    assert_eq!(fidelity("mini_3x3", "[verify]\n", "[verify]\n"), Fidelity::Neighbours);
    assert_eq!(fidelity("asi_940", said, ""), Fidelity::Rigorous);
    assert_eq!(
        fidelity("asi_940", "\"rigorous\"", "\"neighbours\""),
        Fidelity::Neighbours
    );
    assert_eq!(
        fidelity("mini_3x3", "pillar_height_nm = 700", "pillar_height_nm = 650"),
        Fidelity::Rigorous
    );
}

/// Design, words of it and those in their place, and the mistakes that are made.
const MISTAKES: &str = r#"
asi_940 | shape = "circle" | shape = "hexagon" | cell.shape/unknown-choice
asi_940 | [cell]\n | [cell]\nband_nm = [1000, 900]\n | cell.band_nm/inconsistent
asi_940 | [cell]\n | [cell]\nspacer_nm = 50\n | cell.spacer_nm/inconsistent
array_2x4 | spacing_um = [150, 120] | spacing_um = [150, 50] | array.spacing_um/inconsistent
# 1000 um across, with 2858 sites of 350 nm.
prototype_3x3 | spacing_um = 2420 | spacing_um = 1000 | array.spacing_um/inconsistent
hologram | wrapped = "yes" | wrapped = "yes"\nscale = 0.5 | phase.term#0.scale/inconsistent
hologram | elements_m = [2]  | elements_m = [3]  | phase.term#0.elements_m/inconsistent
hologram | elements_m = [2]              # the second element alone\nelements_n = [0] | elements_m = []\nelements_n = [] | phase.term#0.elements_m/inconsistent
array_2x4 | [array] | [[phase.term]]\nsource = "hyperbola"\nwavelength_nm = 500\nelements_m = [0]\nelements_n = [1]\n\n[array] | phase.term#0.elements_m/inconsistent
mixed_lenses | coefficients_rad = [12.0, 12.0] | coefficients_rad = [12.0, 12.0]\nelements_m = [3]\nelements_n = [0] | element#3.phase.term#0.elements_m/inconsistent
array_2x4 | elements = [2, 4] | elements = [2, 4.5] | array.elements/inconsistent
geometric_phase_532 | pillar_length_nm = 250 | pillar_length_nm = 100 | cell.pillar_length_nm/inconsistent
geometric_phase_532 | pillar_length_nm = 250 | pillar_length_nm = 350 | cell.pillar_length_nm/inconsistent
geometric_phase_532 | rotation_step_deg = 1 | rotation_step_deg = 7 | cell.rotation_step_deg/inconsistent
geometric_phase_532 | rotation_step_deg = 1 | rotation_step_deg = 0.5 | cell.rotation_step_deg/inconsistent
geometric_phase_532 | [mapping]   | [mapping]\ncoefficients = [0.3, 0.5]\n# | mapping.coefficients/inconsistent
geometric_phase_532 | pillar_height_nm = 600 | pillar_height_nm = 600\nwidth_min_nm = 100 | cell.width_min_nm/unknown
geometric_phase_532 | rotation_sines_deg = [ | rotation_sines_deg = [0, 0, 0, 0, 0, 0,  | mapping.rotation_sines_deg/inconsistent
tio2_532 | [mapping]   | [mapping]\nrotation_sines_deg = [0.1]\n# | mapping.rotation_sines_deg/inconsistent
hologram | x_um = 60 | x_um = -20 | element#1.x_um/inconsistent
hologram | [array]\n | [array]\nelements = [1, 1]\n | array.elements/inconsistent
hologram | pitch_um = 0.35 | pitch_um = 0.2 | phase.term#0.file/unusable-file
hologram | source = "map" | source = "maps" | phase.term#0.wavelength_nm/missing phase.term#0.source/unknown-choice phase.term#0.source/unknown-choice phase.term#0.file/unknown phase.term#0.pitch_um/unknown phase.term#0.interpolation/unknown phase.term#0.wrapped/unknown
array_2x4 | [array] | [[phase.term]]\nsource = "polynomial"\npowers_x = [1]\npowers_y = [0, 1]\ncoefficients_rad = [1.0]\n\n[array] | phase.term#0.powers_y/inconsistent
array_2x4 | [array] | [[phase.term]]\nsource = "zernike"\norder = "noll"\ncoefficients_waves = [1.0]\n\n[array] | phase.term#0.order/unknown-choice
"#;

#[test]
fn mistakes_are_said() {
    let cases = metalith_testing::rows::<4>(MISTAKES);
    let errors: Vec<_> = cases
        .iter()
        .map(|[name, from, to, _]| changed(name, from, to).unwrap_err())
        .collect();
    insta::assert_snapshot!(errors.iter().map(words).collect::<Vec<_>>().join("\n"));
    for (error, [.., ids]) in errors.iter().zip(&cases) {
        assert_eq!(error.ids().join(" "), *ids);
    }
}

fn zernike(order: &str, terms: usize) -> metalith_core::Result<Design> {
    let coefficients = vec!["0"; terms - 1].join(", ");
    let term = format!(
        "[[phase.term]]\nsource = \"zernike\"\norder = \"{order}\"\ncoefficients_waves = [{coefficients}, 1]\n\n[array]"
    );
    changed("array_2x4", "[array]", &term)
}

#[test]
fn the_fringe_order_has_37_polynomials() {
    let error = zernike("fringe", 38).unwrap_err();
    assert_eq!(error.ids(), ["phase.term#0.coefficients_waves/inconsistent"]);
    assert!(zernike("standard", 38).is_ok());
    // The last is one in the middle, and at the rim.
    let design = zernike("fringe", 37).unwrap();
    let last = &design.lens.terms[0];
    for x_um in [0.0, 30.0] {
        assert!((last.turns(x_um, 0.0) - 1.0).abs() < 1e-9, "{}", last.turns(x_um, 0.0));
    }
}

/// A table that never jumps may be scaled by any number.
#[test]
fn maps_that_are_not_wrapped_are_scaled_freely() {
    let design = changed("hologram", "wrapped = \"yes\"", "wrapped = \"no\"\nscale = 0.5").unwrap();
    assert_eq!(design.lens.terms[0].scale, 0.5);
    assert!(!design.lens.terms[0].is_wrapped());
    let turned = changed("hologram", "wrapped = \"yes\"", "wrapped = \"yes\"\nscale = -1").unwrap();
    assert!(turned.lens.terms[0].is_wrapped());
}

/// Squares of neighbours may touch: pillars on their rims are then a pitch apart, on lattices of either kind. The lens is a
/// hundred pitches wide, and pillars of the hexagonal one stand on its rim itself.
#[test]
fn the_least_spacing_of_a_grid_leaves_a_pitch() {
    for (name, pitch_um, least_um) in [("mini_3x3", 0.35, 35.0), ("hexagonal_1550", 0.7, 70.7)] {
        let read = |spacing_um: f64| {
            let changed = |line: &str| match line.split(' ').next() {
                Some("elements") => "elements = [2, 2]\n".into(),
                Some("spacing_um") => format!("spacing_um = {spacing_um}\n"),
                Some("diameter_um") => format!("diameter_um = {}\n", 100.0 * pitch_um),
                Some("size_um") => "size_um = [1000, 1000]\n".into(),
                _ => format!("{line}\n"),
            };
            Design::parse(&path(name), &text(name).lines().map(changed).collect::<String>())
        };
        let error = read(least_um - 0.001).unwrap_err();
        assert_eq!(error.ids(), ["array.spacing_um/inconsistent"], "{name}: {error}");
        let design = read(least_um).unwrap();
        let lattice = design.lattice();
        let outermost_nm = lattice.whole_nm(0, lattice.sites() - 1);
        let between_nm = design.array.spacing_nm - 2 * outermost_nm;
        assert_eq!(between_nm, design.cell.pitch_nm.nm() as i64, "{name}");
    }
}

/// Hyperbolas among the terms, that name no focal length, have that of the element, as the phase over the radius has.
#[test]
fn a_focal_length_of_an_element_is_that_of_its_hyperbolas() {
    let term = "[[phase.term]]\nsource = \"hyperbola\"\nwavelength_nm = 500\n";
    let named = format!("{term}focal_length_um = 200\n\n{term}\n[array]");
    let text = text("hologram");
    let (head, rest) = text.split_once("[[phase.term]]").unwrap();
    let text = format!("{head}{named}{}", rest.split_once("[array]").unwrap().1);
    let text = text.replacen("x_um = 60\n", "x_um = 60\nfocal_length_um = 90\n", 1);
    let design = Design::parse(&path("hologram"), &text).unwrap();
    let turns = |element: usize| -> Vec<f64> {
        let lens = design.lens_of(&design.elements()[element]);
        lens.terms.iter().map(|term| term.turns(30.0, 0.0)).collect()
    };
    let hyperbola = |focal_length_um: f64| -(30f64.hypot(focal_length_um) - focal_length_um) / 0.5;
    for (element, own_um) in [(0, 144.0), (1, 90.0)] {
        for (found, wanted) in turns(element).into_iter().zip([200.0, own_um].map(hyperbola)) {
            assert!((found - wanted).abs() < 1e-9, "{element}: {found} {wanted}");
        }
    }
}

#[test]
fn the_shipped_designs_are_read() {
    let folder = path("mini_3x3").with_file_name("");
    let mut read = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let file = file.unwrap().path();
        if file.extension().is_some_and(|e| e == "toml") {
            Design::read(&file).unwrap();
            read += 1;
        }
    }
    assert!(read >= 15, "{read}");
}

/// The phase of the converted light of pillars as drawn is that which the mapping of the shipped design has them for, by more orders
/// than the mapping was fitted with.
#[test]
fn a_geometric_phase_is_that_of_the_mapping() {
    /// Asked of the converted channel (rad).
    const GEOMETRIC: f64 = 0.01;
    const ORDERS: usize = 21;
    let design = Design::read(&path("geometric_phase_532")).unwrap();
    let pillars = design.cell.shape.rotated().unwrap();
    let stack = design.cell_stack().unwrap();
    let off = [180, 17, 40, 71].map(|number| {
        let rotation = pillars.drawn_rotation(number);
        let pillar = RotatedRectangle {
            width_nm: f64::from(pillars.width_nm),
            length_nm: f64::from(pillars.length_nm),
            rotation,
        };
        let orders = Orders::new(ORDERS).unwrap();
        let [_, [converted, _]] = circular(stack.jones(&pillar, 0.532, [0.0; 2], orders).unwrap());
        converted.arg() - design.mapping.rotation.phase(rotation)
    });
    for (k, one) in off.iter().enumerate() {
        let turns = (one - off[0]) / std::f64::consts::TAU;
        let apart = std::f64::consts::TAU * (turns - turns.round());
        println!("{k}: {apart} rad");
        assert!(apart.abs() < GEOMETRIC, "{k}: {apart} rad");
    }
}
