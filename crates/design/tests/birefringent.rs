//! Upright rectangles: what a design of two phases says, and which pillars it has.

use std::path::PathBuf;

use metalith_cell::{FocusedLight, Polarisation, PolarisationAxis};
use metalith_core::{Result, Silent};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, PillarArray};
use metalith_pillars::PillarRows;

const NAME: &str = "birefringent_532";

fn path() -> PathBuf {
    metalith_testing::design(NAME)
}

fn text() -> String {
    std::fs::read_to_string(path()).unwrap()
}

/// The design with parts of its text replaced, each of which it has.
fn changed(pairs: &[(&str, &str)]) -> Result<Design> {
    Design::parse(&path(), &metalith_testing::changed(NAME, pairs))
}

/// Each site has the pillar of the library for the phase of light along x and that of light along y at that site.
#[test]
fn pillars_are_chosen_by_both_phases() {
    let design = Design::read(&path()).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let library = design.mapping.pillar_library.as_ref().unwrap();
    let seen = design.along_y().unwrap();
    let lenses = [&design, &seen].map(LensPhase::of);
    let element = array.central().element;
    let phases = lenses.each_ref().map(|lens| ElementPhase::of(lens, &element));
    let (map, n) = (array.widths(array.central()), array.lattice.sites());
    let mut unlike = 0;
    for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
        let wanted = phases.each_ref().map(|phase| phase.wrapped(ix, iy));
        let number = match wanted {
            [Some(x), Some(y)] => library.number([x, y]),
            _ => 0,
        };
        assert_eq!(map.number[[iy, ix]], number, "{ix} {iy}");
        unlike += u32::from(number > 0 && wanted[0] != wanted[1]);
    }
    assert!(unlike > 30_000, "{unlike}");
    // An element that is too large to be held is made row by row, with the same pillars.
    let computed = PillarArray::build_within(&design, 1, &Silent).unwrap();
    let rows = computed.rows(computed.central());
    let mut room = Vec::new();
    for iy in 0..n {
        assert_eq!(rows.row(iy, 0..n, &mut room), map.number.row(iy).as_slice().unwrap());
    }
}

/// Two of the lens are copies, held or not; half a turn and mirrors about both axes leave a lens whose both phases are round as it is.
#[test]
fn equal_lenses_are_copies_however_they_are_made() {
    let two = [
        ("elements = [1, 1]", "elements = [2, 1]"),
        ("size_um = [200, 200]", "size_um = [400, 200]"),
    ];
    let design = changed(&two).unwrap();
    let round = text()
        .replace("centre_um = [8, 0]", "centre_um = [0, 0]")
        .replace("centre_um = [-8, 0]", "centre_um = [0, 0]");
    let (head, tail) = round.split_once("[phase]").unwrap();
    let (_, tail) = tail.split_once("[array]").unwrap();
    let phases = "[phase]\nsource = \"hyperbola\"\nwavelength_nm = 532\n\n[phase.y]\nsource = \"hyperbola\"\nwavelength_nm = 532\nfocal_length_um = 90\n\n";
    let round = two
        .iter()
        .fold(format!("{head}{phases}[array]{tail}"), |text, (from, to)| {
            text.replacen(from, to, 1)
        });
    let round = Design::parse(&path(), &round).unwrap();
    for (most_held, classes) in [(u64::MAX, 1), (1, 1)] {
        let array = PillarArray::build_within(&round, most_held, &Silent).unwrap();
        assert_eq!((array.placed.len(), array.classes.len()), (2, classes), "{most_held}");
        assert_eq!(array.classes[0].group.members().len(), 4, "{most_held}");
    }
    // Of phases over the plane nothing is known but what is held.
    let array = PillarArray::build(&design, &Silent).unwrap();
    assert_eq!(array.classes.len(), 1);
    // Both foci are on the x axis, and a mirror about it leaves each pillar.
    let of_lens = array.classes[0].group.members();
    assert_eq!(
        of_lens
            .iter()
            .map(|s| (s.mirrored, s.quarter_turns))
            .collect::<Vec<_>>(),
        [(false, 0), (true, 0)]
    );
}

/// Both foci are mirror images, and so are the lenses: light along y sees what light along x sees from the other side.
#[test]
fn the_phase_of_light_along_y_is_that_of_its_section() {
    let design = Design::read(&path()).unwrap();
    let seen = design.along_y().unwrap();
    let [x, y] = [&design, &seen].map(LensPhase::of);
    let element = design.elements()[0];
    let (x, y) = (ElementPhase::of(&x, &element), ElementPhase::of(&y, &element));
    let n = design.lattice().sites();
    for ix in 0..n {
        assert_eq!(x.turns(ix, n / 2), y.turns(n - 1 - ix, n / 2));
    }
    assert!(seen.along_y().is_none());
    // Without a separate section, light along y has the phase of light along x.
    let from = text().find("[phase.y]").unwrap();
    let to = text().find("[array]").unwrap();
    let alike = Design::parse(&path(), &(text()[..from].to_owned() + &text()[to..])).unwrap();
    assert!(alike.along_y().is_none());
    let array = PillarArray::build(&alike, &Silent).unwrap();
    let pillars = alike.cell.shape.upright().unwrap();
    let counts = array.classes[0].widths.histogram();
    let library = alike.mapping.pillar_library.as_ref().unwrap();
    for (number, _) in counts.iter().enumerate().skip(1).filter(|(_, n)| **n > 0) {
        let [along_x, along_y] = PolarisationAxis::ALL.map(|axis| library.turns(number as u16, axis).unwrap());
        let apart = along_x - along_y;
        // The largest error of the library along both axes (turns).
        assert!(
            (apart - apart.round()).abs() < 0.25,
            "{:?}",
            pillars.edges_nm(number as u16)
        );
    }
}

#[test]
fn light_says_which_phase_is_judged() {
    for (line, axis, arriving) in [
        ("", PolarisationAxis::X, None),
        ("polarisation = \"x\"", PolarisationAxis::X, None),
        (
            "polarisation = \"y\"",
            PolarisationAxis::Y,
            Some(Polarisation::Linear(90.0)),
        ),
        (
            "polarisation = 30",
            PolarisationAxis::X,
            Some(Polarisation::Linear(30.0)),
        ),
        (
            "polarisation = \"unpolarised\"",
            PolarisationAxis::X,
            Some(Polarisation::Unpolarised),
        ),
    ] {
        let design = changed(&[("fidelity = \"rigorous\"", &format!("fidelity = \"rigorous\"\n{line}"))]).unwrap();
        assert_eq!(design.focused(), Some(FocusedLight::Linear(axis)), "{line}");
        assert_eq!(design.verify.light().arriving, arriving, "{line}");
        let judged = design.as_verified();
        assert_eq!(
            judged.lens.terms[0].centre_um[0] > 0.0,
            axis == PolarisationAxis::X,
            "{line}"
        );
    }
}

/// Words of the design and those in their place, and the mistakes that are made.
const MISTAKES: &str = r#"
library = "phases/birefringent_532.csv" |  | mapping.library/missing
birefringent_532.csv | nowhere.csv | mapping.library/no-file
width_step_nm = 10 | width_step_nm = 2 | cell.width_step_nm/inconsistent
width_max_nm = 280 | width_max_nm = 270 | mapping.library/unusable-file
width_max_nm = 280 | width_max_nm = 400 | cell.width_max_nm/out-of-range
[mapping]  | [mapping]\ncoefficients = [0.2, 0.5]\n# | mapping.coefficients/inconsistent
fidelity = "rigorous" | fidelity = "published" | verify.fidelity/inconsistent
fidelity = "rigorous" | fidelity = "rigorous"\nanalyser = "circular" | verify.analyser/inconsistent
shape = "upright_rectangle" | shape = "square" | phase.y/inconsistent mapping.coefficients/missing mapping.library/unknown mapping.library/inconsistent
"#;

#[test]
fn what_cannot_be_is_told_with_its_place() {
    let cases = metalith_testing::rows::<3>(MISTAKES);
    let errors: Vec<_> = cases
        .iter()
        .map(|[from, to, _]| changed(&[(from.as_str(), to.as_str())]).unwrap_err())
        .collect();
    let words = |error| metalith_testing::without_folder(error, path().parent().unwrap());
    insta::assert_snapshot!(errors.iter().map(words).collect::<Vec<_>>().join("\n"));
    for (error, [.., ids]) in errors.iter().zip(&cases) {
        assert_eq!(error.ids().join(" "), *ids);
    }
    // Whoever makes the library needs none, and takes none of other sizes.
    let missing = text().replace("birefringent_532.csv", "nowhere.csv");
    assert!(
        Design::parse_without_library(&path(), &missing)
            .unwrap()
            .mapping
            .pillar_library
            .is_none()
    );
    let other = text().replace("width_max_nm = 280", "width_max_nm = 270");
    assert!(
        Design::parse_without_library(&path(), &other)
            .unwrap()
            .mapping
            .pillar_library
            .is_none()
    );
}
