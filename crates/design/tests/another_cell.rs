//! Designs of other cells than the published one: nothing published is taken for them without a word.

use metalith_core::Error;
use metalith_core::document::Faults;
use metalith_design::Design;
use metalith_testing::design as path;

/// The text of a shipped design with other lines in `[mapping]`.
fn mapped(name: &str, lines: &str) -> String {
    let text = std::fs::read_to_string(path(name)).unwrap();
    let (head, rest) = text.split_once("[mapping]").unwrap();
    let (_, tail) = rest.split_once("[layout]").unwrap();
    format!("{head}[mapping]\n{lines}\n[layout]{tail}")
}

fn parse(name: &str, text: &str) -> metalith_core::Result<Design> {
    Design::parse(&path(name), text)
}

fn faults(name: &str, text: &str) -> Box<Faults> {
    match parse(name, text) {
        Err(Error::Text(faults)) => faults,
        other => panic!("faults, not {:?}", other.map(|design| design.name)),
    }
}

fn words(faults: &Faults) -> Vec<&str> {
    faults.faults().iter().map(|fault| fault.what.as_str()).collect()
}

const NO_WAVELENGTH: &str = "[mapping] lacks `wavelength_nm`";
const NO_COEFFICIENTS: &str = "[mapping] lacks `coefficients`";

#[test]
fn another_cell_needs_a_mapping_of_its_own() {
    for name in ["asi_940", "silicon_10600", "tio2_532", "hexagonal_1550"] {
        let text = mapped(name, "");
        let found = faults(name, &text);
        assert_eq!(words(&found), [NO_WAVELENGTH, NO_COEFFICIENTS], "{name}");
        let line = 1 + text.lines().position(|line| line == "[mapping]").unwrap();
        assert!(
            found.faults().iter().all(|f| found.line_column(f.span.start).0 == line),
            "{found}"
        );
        // What it says can be written.
        let hint = &found.faults()[1].hint;
        let (_, start) = hint.split_once("it can begin with `").unwrap();
        let (start, _) = start.split_once('`').unwrap();
        let nm = name.split_once('_').unwrap().1;
        let design = parse(name, &mapped(name, &format!("wavelength_nm = {nm}\n{start}"))).unwrap();
        let (narrow, wide) = design.cell.width_range_nm;
        let rule = metalith_design::PillarRule::of_element(&design, design.elements()[0].index);
        // A straight line from the narrowest pillar to the widest, to a step.
        assert_eq!(rule.width_nm(0.0), narrow);
        assert!(wide - rule.width_nm(0.9999) <= design.cell.width_step_nm);
    }
}

#[test]
fn each_missing_key_is_one_mistake() {
    let of = |lines: &str| faults("asi_940", &mapped("asi_940", lines));
    assert_eq!(words(&of("wavelength_nm = 940")), [NO_COEFFICIENTS]);
    assert_eq!(words(&of("coefficients = [0.3, 0.4]")), [NO_WAVELENGTH]);
    assert_eq!(
        words(&of("wavelength_nm = 940\ncoeficients = [0.3, 0.4]")),
        ["unknown key `coeficients` in [mapping]"]
    );
    // The phase of rectangles is twice their rotation at every wavelength, but what is added to it is of one.
    let rectangles = faults("geometric_phase_532", &mapped("geometric_phase_532", ""));
    assert_eq!(words(&rectangles), [NO_WAVELENGTH]);
    // Nothing is said of a cell that is not known.
    let text = mapped("asi_940", "").replacen("pitch_nm = 450", "pitch_nm = 451.02", 1);
    let wrong = "a pitch of 451.02 nm is no multiple of 0.05 nm";
    assert_eq!(words(&faults("asi_940", &text)), [wrong]);
}

#[test]
fn the_cell_of_the_paper_has_the_published_mapping_and_wedges() {
    let text = mapped("array_2x4", "").replacen("wedge_wavelength_nm = 550", "", 1);
    let design = parse("array_2x4", &text).unwrap();
    let shipped = Design::read(&path("array_2x4")).unwrap();
    assert_eq!((&design.mapping, &design.array), (&shipped.mapping, &shipped.array));
    assert_eq!(design.digest(), shipped.digest());
}

/// Wedges of another cell steer at the wavelength that the lens focuses; where its phase says none, at that of the mapping.
#[test]
fn wedges_go_by_the_wavelengths_of_the_design() {
    let lines = "wavelength_nm = 950\ncoefficients = [0.2829, 0.4]";
    let text = mapped("asi_940", lines)
        .replacen("elements = [1, 1]", "elements = [3, 1]\nsteering_deg = 15", 1)
        .replacen("size_um = [200, 200]", "size_um = [600, 200]", 1)
        .replacen("wedge_wavelength_nm = 940\n", "", 1);
    let wedge_nm = |text: &str| parse("asi_940", text).unwrap().array.wedge_wavelength_um * 1e3;
    let near = |nm: f64, wanted: f64| assert!((nm - wanted).abs() < 1e-6, "{nm}");
    near(wedge_nm(&text), 940.0);
    let hyperbola = "source = \"hyperbola\"\nwavelength_nm = 940\n";
    assert!(text.contains(hyperbola));
    let powers = text.replacen(hyperbola, "source = \"even_powers\"\ncoefficients_rad = [-200]\n", 1);
    near(wedge_nm(&powers), 950.0);
    near(
        wedge_nm(&text.replacen("[array]\n", "[array]\nwedge_wavelength_nm = 900\n", 1)),
        900.0,
    );
}
