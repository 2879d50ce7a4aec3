//! Check that a session of a design can be planned: it compares the design with what a measured set may say, before any
//! work is spent.

use metalith_core::document::Limits;
use metalith_core::{Error, Result};
use metalith_design::Design;

use crate::bench_file::BenchFile;
use crate::candidates::{chosen_elements, distances_um, lens_diameter_um};
use metalith_calibrate::set_format as read;

/// Succeeds if a set of the design can be planned and read: pillars that are squares or circles, elements that are
/// round, and all within what a set may say.
///
/// # Errors
/// What stands against it, with the limit and what to do.
pub fn check_plannable(design: &Design, bench: &BenchFile) -> Result<()> {
    if !design.cell.shape.has_width() {
        return Err(Error::refused(
            "plan/rectangles-unsupported",
            format!("the pillars of {} are rectangles", design.path.display()),
            "plan sessions of squares or circles: measured sets have no other pillars",
        ));
    }
    let cell = design.cell_stack()?;
    let middle_um = bench.leds.iter().map(|l| l.centre_nm * 1e-3).next().unwrap_or(1.0);
    let ambient = cell.ambient.index(middle_um)?.re;
    let of_cell = vec![
        ("the pitch", cell.pitch_nm, read::PITCH_NM),
        ("the height of the pillars", cell.height_nm, read::HEIGHT_NM),
        ("the index between the pillars", ambient, read::AMBIENT_INDEX),
    ];
    check(design, of_cell, "plan a session of another cell")?;
    let diameter_um = lens_diameter_um(design);
    let mut of_lenses = vec![("the diameter of the lenses", diameter_um, read::LENS_DIAMETER_UM)];
    for element in &chosen_elements(design, bench)? {
        let focal_um = design.lens_of(element).focal_length_um;
        let opening_um = 2.0 * design.aperture_radius_of_um(element);
        of_lenses.push(("the diameter of an opening", opening_um, read::APERTURE_DIAMETER_UM));
        of_lenses.push(("the focal length", focal_um, read::FOCAL_LENGTH_UM));
        let distances = distances_um(bench, focal_um).into_iter();
        of_lenses.extend(distances.map(|d| ("the distance of a measurement", d, read::DISTANCE_UM)));
    }
    check(
        design,
        of_lenses,
        "plan a session of a design of smaller lenses with the same cell: what film and etch do is the same there",
    )?;
    let beyond = bench
        .leds
        .iter()
        .find_map(|led| Some((led, read::beyond_tables(led, &cell)?)));
    beyond.map_or(Ok(()), |(led, (what, hint))| {
        Err(Error::refused(
            "plan/led-out-of-range",
            format!("the LED of {} nm: {what}", led.name()),
            hint,
        ))
    })
}

/// Refuse the first of some numbers of a design that a measured set may not say.
fn check(design: &Design, numbers: Vec<(&str, f64, Limits)>, hint: &str) -> Result<()> {
    let is_beyond = |(_, value, limits): &(&str, f64, Limits)| !limits.range.contains(value);
    let Some((what, value, Limits { range, unit })) = numbers.into_iter().find(is_beyond) else {
        return Ok(());
    };
    let (low, high) = range.into_inner();
    let path = design.path.display();
    Err(Error::refused(
        "plan/out-of-range",
        format!("{what} of {path} is {value} {unit}: a measured set may say {low} to {high} {unit}"),
        hint,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench_file::tests::small_bench;

    fn checked(name: &str) -> Result<()> {
        let path = metalith_testing::root().join(format!("designs/{name}.toml"));
        let design = Design::read(&path).unwrap();
        check_plannable(&design, &small_bench(""))
    }

    #[test]
    fn what_a_set_cannot_say_is_refused_before_it_is_simulated() {
        for (name, id) in [
            ("lens_10mm", "plan/out-of-range"),
            ("geometric_phase_532", "plan/rectangles-unsupported"),
            ("birefringent_532", "plan/rectangles-unsupported"),
        ] {
            assert_eq!(checked(name).unwrap_err().id(), id, "{name}");
        }
        assert!(checked("mini_3x3").is_ok());
    }
}
