//! Tests of the box about an aperture: what maps of phases have to cover, and how near elements may stand.

use metalith_core::{Error, Result};
use metalith_design::Design;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_pillars::Lattice;
use metalith_testing::{changed, design as path};

/// A map of phases in rad, rows along x.
fn npy(columns: usize, rows: usize, rad: impl Fn(usize, usize) -> f64) -> Vec<u8> {
    let places = (0..rows * columns).map(|k| (k / columns, k % columns));
    let numbers = places.flat_map(|(iy, ix)| rad(ix, iy).to_le_bytes());
    metalith_testing::npy("<f8", &format!("({rows}, {columns})"), numbers)
}

/// The text of an error in a shipped design that was changed.
fn words(error: &Error) -> String {
    metalith_testing::without_folder(error, path("hologram").parent().unwrap())
}

/// Distance of the places of the map (um).
const MAP_PITCH_UM: f64 = 0.5;

/// Turns from row to row of the map; from column to column it is one, so that each phase tells its place.
const TURNS_A_ROW: usize = 1000;

/// The shipped hologram with a map of so many places, as changed.
fn hologram([columns, rows]: [usize; 2], changes: &[(&str, &str)]) -> Result<Design> {
    let folder = tempfile::tempdir().unwrap();
    let turns = |ix: usize, iy: usize| (ix + TURNS_A_ROW * iy) as f64 * std::f64::consts::TAU;
    std::fs::write(folder.path().join("map.npy"), npy(columns, rows, turns)).unwrap();
    let own = [
        ("phases/four_spots.npy", "map.npy"),
        ("pitch_um = 0.35", "pitch_um = 0.5"),
        ("source = \"hyperbola\"\nwavelength_nm = 532", "source = \"flat\""),
    ];
    let text = changed("hologram", &[&own, changes].concat());
    Design::parse(&folder.path().join("own.toml"), &text)
}

const RECTANGLE: (&str, &str) = ("diameter_um = 60", "aperture = \"rectangle\"\naperture_um = [60, 24]");

/// A map of 72 x 27 um for an aperture of 60 x 24 um, as it stands and turned: the map turns with the aperture.
#[test]
fn a_map_covers_the_box_about_its_aperture() {
    /// Distance from a place to the nearest entry (entries), and rounding of a rotation.
    const NEAREST: f64 = 0.5 + 1e-6;
    /// Half a pitch along the rim, by the area.
    const RIM: f64 = 0.35 / 2.0 * 2.0 * (60.0 + 24.0) / (60.0 * 24.0);
    for deg in [0, 90, -30] {
        let rotated = format!("x_um = 60\nrotation_deg = {deg}");
        let design = hologram([144, 54], &[RECTANGLE, ("x_um = 60", &rotated)]).unwrap();
        let lens = LensPhase::of(&design);
        let phase = ElementPhase::of(&lens, &design.elements()[1]);
        let outline = design.outline_of(&design.elements()[1]).unwrap();
        let (lattice, mut inside) = (phase.lattice(), 0);
        let n = lattice.sites();
        let (sin, cos) = f64::from(deg).to_radians().sin_cos();
        for (iy, ix) in (0..n * n).map(|k| (k / n, k % n)) {
            let [x, y] = [lattice.place_um(0, ix), lattice.place_um(1, iy)];
            let Some(turns) = phase.turns(ix, iy) else {
                assert!(!outline.holds(lattice.whole_nm(0, ix), lattice.whole_nm(1, iy)));
                continue;
            };
            inside += 1;
            let (before_x, before_y) = (cos * x + sin * y, cos * y - sin * x);
            let place = |um: f64, places: f64| um / MAP_PITCH_UM + 0.5 * (places - 1.0);
            let number = turns.round() as usize;
            let (column, row) = ((number % TURNS_A_ROW) as f64, (number / TURNS_A_ROW) as f64);
            assert!((column - place(before_x, 144.0)).abs() < NEAREST, "{x} {y}");
            assert!((row - place(before_y, 54.0)).abs() < NEAREST, "{x} {y}");
        }
        let wanted = 60.0 * 24.0 / lattice.cell_um2();
        assert!((f64::from(inside) / wanted - 1.0).abs() < RIM, "{inside} {wanted}");
    }
}

#[test]
fn a_map_that_ends_within_its_aperture_is_refused() {
    // The words are the lengths that decide.
    let said = |size, changes: &[(&str, &str)]| match hologram(size, changes).unwrap_err() {
        Error::Text(faults) => {
            let fault = &faults.faults()[0];
            assert_eq!(fault.id(), "phase.term#0.file/unusable-file");
            fault.what.split_once("map.npy: ").unwrap().1.to_owned()
        }
        other => panic!("{other:?}"),
    };
    let short = said([116, 54], &[RECTANGLE]);
    insta::assert_snapshot!(short, @"116 by 54 places of 0.5 um reach to 29 and 13.5 um, the lens to 30 and 12 um");
    let shifted = ("pitch_um = 0.5", "pitch_um = 0.5\ncentre_um = [0, -2]");
    let low = said([144, 54], &[RECTANGLE, shifted]);
    insta::assert_snapshot!(low, @"144 by 54 places of 0.5 um reach to 36 and 13.5 um, the lens to 30 and 14 um");
    assert!(hologram([144, 56], &[RECTANGLE, shifted]).is_ok());
    // It is a mistake of its key, among the others of the design.
    let others = [
        ("[cell]\n", "[cell]\npillar_material = \"film.csv\"\n"),
        ("[verify]", "[verify]\nwrong = 1"),
    ];
    let all = hologram([116, 54], &[&[RECTANGLE], &others[..]].concat()).unwrap_err();
    let wanted = [
        "cell.pillar_material/no-file",
        "phase.term#0.file/unusable-file",
        "verify.wrong/unknown",
    ];
    assert_eq!(all.ids(), wanted, "{all}");
    // A polygon beside its middle needs more to one side.
    let beside = "aperture = \"polygon\"\ncorners_x_um = [-5, 30, 30, -5]\ncorners_y_um = [-8, -8, 8, 8]";
    assert!(hologram([120, 32], &[("diameter_um = 60", beside)]).is_ok());
    let round = said([144, 54], &[]);
    insta::assert_snapshot!(round, @"144 by 54 places of 0.5 um reach to 36 and 13.5 um, the lens to 30 and 30 um");
}

/// A map of an element that has a separate aperture need not cover the lens that the others share.
#[test]
fn a_map_covers_the_lenses_of_its_elements_alone() {
    let own = (
        "x_um = 60",
        "x_um = 60\naperture = \"rectangle\"\naperture_um = [60, 24]",
    );
    assert!(hologram([144, 54], &[own]).is_ok());
    let both = (
        "elements_m = [2]              # the second element alone\nelements_n = [0]",
        "",
    );
    assert!(hologram([144, 54], &[own, both]).is_err());
}

/// A design of these elements in place of those of the shipped hologram.
fn placed(elements: &str) -> Result<Design> {
    let text = std::fs::read_to_string(path("hologram")).unwrap();
    let (head, rest) = text.split_once("[[phase.term]]").unwrap();
    let (_, tail) = rest.split_once("[mapping]").unwrap();
    let tail = tail
        .replacen("size_um = [300, 200]", "size_um = [2000, 2000]", 1)
        .replacen("chord_error_nm = 10", "chord_error_nm = 100", 1);
    Design::parse(
        &path("hologram"),
        &format!("{head}[array]\n{elements}\n[mapping]{tail}"),
    )
}

fn element(x_um: f64, y_um: f64, lens: &str) -> String {
    format!("[[element]]\nx_um = {x_um}\ny_um = {y_um}\n{lens}\n")
}

const STRIP: &str = "aperture = \"rectangle\"\naperture_um = [100, 20]";

#[test]
fn small_lenses_stand_near_one_another_beside_a_large_one() {
    let three = |apart_um: f64| {
        let small = |x| element(x, 0.0, "diameter_um = 30");
        placed(&(element(0.0, 500.0, "diameter_um = 400") + &small(0.0) + &small(apart_um)))
    };
    let design = three(50.0).unwrap();
    // The lattice of all is that of the large one, and of each small one its own pillars.
    assert_eq!(design.lattice(), Lattice::covering(400_000, 350).unwrap());
    let within: Vec<_> = design.sites().iter().map(|site| site.within_nm).collect();
    let small = Some([[-14_875, 14_875]; 2]);
    assert_eq!(within, [None, small, small]);
    // 86 columns of each, and none between.
    assert!(three(30.1).is_ok());
    let error = three(30.0).unwrap_err();
    insta::assert_snapshot!(words(&error), @"
        hologram.toml:32:8: this lens overlaps that of element (2, 0), or the upright boxes about their pillars do
          help: place them at least 30.1 um apart along x, or 30.1 um along y: the boxes and a pitch between them
        ");
    assert_eq!(error.ids(), ["element#2.x_um/inconsistent"]);
}

#[test]
fn strips_stand_side_by_side_whichever_way_they_are_turned() {
    let two = |y_um: f64, deg: i32| {
        let turned = format!("{STRIP}\nrotation_deg = {deg}");
        placed(&(element(0.0, 0.0, &turned) + &element(0.0, y_um, &turned)))
    };
    assert!(two(30.0, 0).is_ok() && two(20.3, 0).is_ok());
    insta::assert_snapshot!(words(&two(20.0, 0).unwrap_err()), @"
        hologram.toml:30:8: this lens overlaps that of element (1, 0), or the upright boxes about their pillars do
          help: place them at least 100.1 um apart along x, or 20.3 um along y: the boxes and a pitch between them
        ");
    insta::assert_snapshot!(words(&two(30.0, 90).unwrap_err()), @"
        hologram.toml:30:8: this lens overlaps that of element (1, 0), or the upright boxes about their pillars do
          help: place them at least 20.3 um apart along x, or 100.1 um along y: the boxes and a pitch between them
        ");
    let design = two(30.0, 180).unwrap();
    assert_eq!(design.sites()[1].within_nm, Some([[-49_875, 49_875], [-9_975, 9_975]]));
    assert_eq!(design.sites_of(&design.elements()[1..]), design.sites()[1..]);
    // Round lenses beside one another need no more than before, and all of their lattices are their own.
    let far = placed(&(element(-60.0, 0.0, "") + &element(60.0, 0.0, ""))).unwrap();
    assert!(far.sites().iter().all(|site| site.within_nm.is_none()));
}

/// A column of strips on a grid: the pitch of the grid is that of their short edges.
#[test]
fn grids_of_strips_are_as_dense_as_the_strips() {
    let grid = |spacing_um: f64| {
        let text = std::fs::read_to_string(path("array_2x4")).unwrap();
        let text = text
            .replacen("diameter_um = 60", STRIP, 1)
            .replacen("elements = [2, 4]", "elements = [1, 4]", 1)
            .replacen("[150, 120]", &format!("[150, {spacing_um}]"), 1);
        Design::parse(&path("array_2x4"), &text)
    };
    let design = grid(30.0).unwrap();
    assert!(
        design
            .sites()
            .iter()
            .all(|site| site.within_nm == Some([[-49_875, 49_875], [-9_975, 9_975]]))
    );
    let error = grid(20.0).unwrap_err();
    insta::assert_snapshot!(words(&error), @"
        array_2x4.toml:24:14: neighbouring lenses overlap, or the boxes about their pillars do
          help: use at least [100.1, 20.3] um: the lens with its lattice
        ");
    assert_eq!(error.ids(), ["array.spacing_um/inconsistent"]);
    let shipped = Design::read(&path("array_2x4")).unwrap();
    assert!(shipped.sites().iter().all(|site| site.within_nm.is_none()));
}
