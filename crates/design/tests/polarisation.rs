//! `polarisation` of `[verify]`: what may stand there, and what a design says of it.

use metalith_cell::{Analyser, Handedness, Polarisation, PolarisedLight};
use metalith_core::Error;
use metalith_design::Design;
use metalith_testing::design as path;

/// The text of a shipped design with a further line in `[verify]`.
fn with(name: &str, line: &str) -> String {
    let text = std::fs::read_to_string(path(name)).unwrap();
    text.replacen("[verify]\n", &format!("[verify]\n{line}\n"), 1)
}

fn light(line: &str) -> PolarisedLight {
    let design = Design::parse(&path("geometric_phase_532"), &with("geometric_phase_532", line)).unwrap();
    design.verify.light()
}

/// The only fault of a design, and whether its line is stated.
fn fault(name: &str, line: &str) -> String {
    let text = with(name, line);
    let Err(Error::Text(faults)) = Design::parse(&path(name), &text) else {
        panic!("{line}: no fault");
    };
    let [fault] = faults.faults() else {
        panic!("{line}: {faults}");
    };
    let number = 1 + text.lines().position(|l| l == line).unwrap();
    assert_eq!(faults.line_column(fault.span.start).0, number, "{faults}");
    format!("{}; {}", fault.what, fault.hint)
}

#[test]
fn words_and_angles_name_light() {
    for (name, wanted) in Polarisation::CHOICES {
        let wanted = Some(wanted).filter(|w| *w != Polarisation::Circular(Handedness::Left));
        assert_eq!(light(&format!("polarisation = \"{name}\"")).arriving, wanted, "{name}");
    }
    for (line, deg) in [("polarisation = 30", 30.0), ("polarisation = -22.5", -22.5)] {
        assert_eq!(light(line).arriving, Some(Polarisation::Linear(deg)));
    }
    assert_eq!(light(""), PolarisedLight::default());
    for (line, wanted) in [
        ("analyser = \"none\"", None),
        ("analyser = \"circular\"", Some(Analyser::Circular)),
        ("analyser = \"y\"", Some(Analyser::Linear(90.0))),
        ("analyser = 22.5", Some(Analyser::Linear(22.5))),
    ] {
        assert_eq!(light(line).analyser, wanted, "{line}");
    }
}

#[test]
fn what_is_no_polarisation_is_refused_with_its_line() {
    let name = "geometric_phase_532";
    for (line, what) in [
        (
            "polarisation = \"diagonal\"",
            "`polarisation` cannot be \"diagonal\"; use one of: left, right, x, y, unpolarised, or a number from -180 to 180 degrees",
        ),
        (
            "polarisation = true",
            "`polarisation` is a boolean; it must be one of: left, right, x, y, unpolarised, or a number from -180 to 180 degrees",
        ),
        (
            "polarisation = 181",
            "`polarisation` cannot be 181; it must be a number from -180 to 180 degrees",
        ),
        (
            "polarisation = nan",
            "`polarisation` cannot be NaN; it must be a number from -180 to 180 degrees",
        ),
        (
            "analyser = \"left\"",
            "`analyser` cannot be \"left\"; use one of: none, circular, x, y, or a number from -180 to 180 degrees",
        ),
    ] {
        assert_eq!(fault(name, line), what);
    }
    let found = fault(name, "polarisation = \"unpolarized\"");
    assert!(found.ends_with("did you mean `unpolarised`?"), "{found}");
    for (name, plural) in [("tio2_532", "circles"), ("mini_3x3", "squares")] {
        let found = fault(name, "polarisation = \"x\"");
        assert!(
            found.starts_with(&format!("light of a polarisation for {plural}; leave it out")),
            "{found}"
        );
        let found = fault(name, "analyser = \"circular\"");
        assert!(
            found.starts_with(&format!("an analyser for {plural}; leave it out")),
            "{found}"
        );
    }
}

/// Another light is another simulation, and the same layout; the light that is focused is what it was.
#[test]
fn digests_tell_other_light_apart() {
    let of = |line: &str| {
        let name = "geometric_phase_532";
        let design = Design::parse(&path(name), &with(name, line)).unwrap();
        (design.optics_digest().unwrap(), design.simulation_digest().unwrap())
    };
    let (optics, usual) = of("");
    assert_eq!(of("polarisation = \"left\""), (optics.clone(), usual.clone()));
    let others = ["\"right\"", "\"x\"", "10", "\"unpolarised\""].map(|light| format!("polarisation = {light}"));
    let analysers = ["\"circular\"", "\"x\"", "10"].map(|what| format!("analyser = {what}"));
    let others: Vec<_> = others.iter().chain(&analysers).map(|line| of(line)).collect();
    for (k, (own, simulation)) in others.iter().enumerate() {
        assert_eq!(*own, optics);
        assert!(*simulation != usual && others[..k].iter().all(|o| o.1 != *simulation));
    }
}
