//! Page of the design: the chip, the pillars in the middle, phase and width along a radius.

use metalith_design::array::PillarArray;
use metalith_design::phase::{ElementPhase, LensPhase, RadialPhase};
use metalith_design::{Design, LensSpec};
use metalith_pillars::{PillarId, PillarMap, PillarRows, PolarisationBasis};
use metalith_report::{Axis, Cell, Chart, Column, Page, PillarZoom, Plan, Table, exact};

/// Pillars that the picture of the middle shows along an axis.
const ZOOMED_PITCHES: f64 = 34.0;
/// Sites along a radius that can be distinguished in a figure.
const RADIUS_POINTS: usize = 600;

/// The section of the design.
pub(super) fn write(page: &mut Page, design: &Design, array: &PillarArray) {
    page.section("The design");
    let pillars = design.cell.shape.description()
        + match design.cell.shape.basis() {
            None => "",
            Some(PolarisationBasis::Circular) => ", by half of the phase",
            Some(PolarisationBasis::Linear) => ", chosen by a phase for light along x and one for light along y",
        };
    page.paragraph(format!(
        "{}; pillars, {pillars}, on a {}lattice of {} nm.",
        elements(design),
        if array.lattice.is_square() { "" } else { "hexagonal " },
        design.cell.pitch_nm,
    ));
    let centre = array.central();
    let rows = array.rows(centre);
    let zoomed = middle(rows.as_ref());
    let span_um = ZOOMED_PITCHES * array.lattice.pitch_um();
    page.row([
        chip(design).caption("The chip from above: openings, pillars, marks and outline as written."),
        PillarZoom::new(
            "Pillars in the middle of the centre element",
            &zoomed,
            (0.0, 0.0),
            span_um,
        )
        .shape(design.cell.shape)
        .caption("Pillars as written, to scale."),
    ]);
    if design.array.has_own_lenses() {
        page.table(own_lenses(design));
    }
    let lens = LensPhase::of(design);
    let along_y = design.along_y().map(|y| LensPhase::of(&y));
    let phase = ElementPhase::of(&lens, &centre.element);
    let n = array.lattice.sites();
    let along = |value: &dyn Fn(usize) -> Option<f64>| {
        let radius = |ix| array.lattice.place_um(0, ix);
        (n / 2..n)
            .filter_map(|ix| Some((radius(ix), value(ix)?)))
            .collect::<Vec<_>>()
    };
    let mut turns = Chart::new(
        "Phase over the radius",
        Axis::linear("radius", "um"),
        Axis::linear("phase", "waves"),
    )
    .size(420.0, 260.0);
    match &along_y {
        None => turns.line("unwrapped", along(&|ix| phase.turns(ix, n / 2))),
        Some(lens) => {
            let other = ElementPhase::of(lens, &centre.element);
            turns.line("light along x", along(&|ix| phase.turns(ix, n / 2)));
            turns.line("light along y", along(&|ix| other.turns(ix, n / 2)))
        }
    };
    let (title, axis) = numbers(design);
    let mut widths =
        Chart::new(format!("{title} over the radius"), Axis::linear("radius", "um"), axis).size(420.0, 260.0);
    let last = along(&|ix| phase.turns(ix, n / 2)).len();
    let shown = along(&|ix| {
        Some(rows.number(ix, n / 2))
            .filter(|w| *w > 0)
            .map(|w| shown_number(design, w))
    });
    widths.points("as written", shown.into_iter().take(last.min(RADIUS_POINTS)));
    page.row([
        turns.caption("Phase of the centre element, unwrapped."),
        widths.caption(format!(
            "Centre element, the first {} sites from the middle.",
            last.min(RADIUS_POINTS)
        )),
    ]);
}

/// The elements in words: a focal length with the wavelength that it is for, where the phase says one, and steering with that of the
/// wedges.
fn elements(design: &Design) -> String {
    let at = |um: f64| format!(" at {} nm", exact(um * 1e3));
    let across = match design.lens.outline {
        Some(_) => format!(" ({})", aperture(&design.lens)),
        None => String::new(),
    };
    let lens = format!(
        "{} um{across}, f = {} um{}",
        exact(f64::from(design.lens.diameter_nm) * 1e-3),
        exact(design.lens.focal_length_um),
        design.lens.focused_um().map_or_else(String::new, at),
    );
    let all = design.elements();
    let is_steered = all.iter().any(|e| e.wedge.sin_x != 0.0 || e.wedge.sin_y != 0.0);
    let steered = |how: String| {
        if is_steered {
            how + &at(design.array.wedge_wavelength_um)
        } else {
            String::new()
        }
    };
    let one_by_one = || format!("placed one by one{}", steered(", steered".into()));
    match (all.len(), design.array.spacing_words()) {
        (1, _) => format!("One element of {lens}{}", steered(", steered".into())),
        (_, Some(apart)) => format!(
            "{} x {} elements of {lens}, {apart} apart{}",
            design.array.count.0,
            design.array.count.1,
            steered(format!(", steered by {}° a step", design.array.steering_deg)),
        ),
        (count, None) if design.array.has_own_lenses() => format!(
            "{count} elements with individual lenses where the table states one, {}",
            one_by_one()
        ),
        (count, None) => format!("{count} elements of {lens}, {}", one_by_one()),
    }
}

/// Words of figures for the widths or numbers of pillars, and their axis.
pub(super) fn numbers(design: &Design) -> (&'static str, Axis) {
    let quantity = design.cell.shape.quantity();
    (quantity.title, Axis::linear(quantity.label, quantity.unit))
}

/// The width of a pillar (nm), that along x of an upright rectangle, or its rotation (degrees).
pub(super) fn shown_number(design: &Design, number: u16) -> f64 {
    design.cell.shape.value(PillarId(number))
}

/// Step from one of these numbers to the next.
pub(super) fn step(design: &Design) -> f64 {
    let own = design.cell.shape.step();
    own.unwrap_or(f64::from(design.cell.width_step_nm))
}

/// The sites about the middle of an element that figures show.
fn middle(rows: &impl PillarRows) -> PillarMap {
    let lattice = rows.lattice();
    let n = lattice.sites();
    let beside = n.saturating_sub(2 * RADIUS_POINTS) / 2;
    let shown = lattice.with_sites(n - 2 * beside).expect("a part of a lattice is one");
    let mut map = PillarMap::empty(shown);
    for ((iy, ix), width) in map.number.indexed_iter_mut() {
        *width = rows.number(ix + beside, iy + beside);
    }
    map
}

fn chip(design: &Design) -> Plan {
    let layout = &design.layout;
    let mut plan = Plan::new("The chip").width(460.0);
    let um = |nm: i64| nm as f64 * 1e-3;
    let outline = plan.outlines("chip outline");
    let openings = plan.layer("apertures");
    let pillars = plan.layer("pillars");
    let marks = plan.solid("marks");
    let (x, y) = (um(layout.chip.size_nm.0) / 2.0, um(layout.chip.size_nm.1) / 2.0);
    plan.rectangle(outline, (-x, -y), (x, y));
    for element in design.elements() {
        let (cx, cy) = (um(element.centre_nm.0), um(element.centre_nm.1));
        let radius = design.lens_of(&element).radius_um();
        let shifted = |(x, y): &(i64, i64)| (cx + um(*x), cy + um(*y));
        if let Some(outline) = design.outline_of(&element) {
            plan.polygon(openings, outline.grown(layout.apertures.margin_nm).iter().map(shifted));
            plan.polygon(pillars, outline.corners_nm().iter().map(shifted));
        } else {
            plan.circle(openings, cx, cy, radius + um(layout.apertures.margin_nm));
            plan.circle(pillars, cx, cy, radius);
        }
        plan.label(cx, cy, element.label());
    }
    for set in &layout.marks {
        for &(cx, cy) in &set.centres_nm {
            plan.cross(marks, (um(cx), um(cy)), um(set.length_nm), um(set.width_nm));
        }
    }
    plan
}

/// The aperture of a lens in words.
fn aperture(lens: &LensSpec) -> String {
    match &lens.outline {
        Some(outline) => format!("a polygon of {} corners", outline.corners_nm().len()),
        None => "a circle".into(),
    }
}

/// The phase of a lens in words.
fn phase(lens: &LensSpec) -> String {
    let radial = match &lens.phase {
        RadialPhase::Hyperbola {
            wavelength_um,
            focal_length_um,
        } => format!(
            "hyperbola, {} nm, {} um",
            exact(wavelength_um * 1e3),
            exact(*focal_length_um)
        ),
        RadialPhase::EvenPowers { .. } => "even powers".into(),
        RadialPhase::Table { .. } => "a table".into(),
        RadialPhase::Flat => "flat".into(),
    };
    match lens.terms.len() {
        0 => radial,
        1 => format!("{radial}, and a term"),
        more => format!("{radial}, and {more} terms"),
    }
}

/// Table of the elements that have individual lenses.
fn own_lenses(design: &Design) -> Table {
    let mut table = Table::new([
        Column::text("Element"),
        Column::number("x", "um"),
        Column::number("y", "um"),
        Column::number("Diameter", "um"),
        Column::text("Aperture"),
        Column::number("Focal length", "um"),
        Column::number("Rotation", "degrees"),
        Column::text("Phase"),
    ])
    .caption("The elements and their lenses");
    for element in design.elements() {
        let (lens, [x, y]) = (design.lens_of(&element), element.centre_um());
        let placed = design.array.placed(element.index);
        table.row([
            element.label().into(),
            Cell::fixed(x, 3),
            Cell::fixed(y, 3),
            exact(f64::from(lens.diameter_nm) * 1e-3).into(),
            aperture(lens).into(),
            exact(lens.focal_length_um).into(),
            exact(placed.map_or(0.0, |p| p.rotation_deg)).into(),
            phase(lens).into(),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words of a shipped design, with a part of its text replaced.
    fn words(name: &str, from: &str, to: &str) -> String {
        let text = metalith_testing::changed(name, &[(from, to)]);
        elements(&Design::parse(&metalith_testing::design(name), &text).unwrap())
    }

    #[test]
    fn a_focal_length_is_that_of_its_wavelength() {
        let wedge = "wedge_wavelength_nm = 940\n";
        let one = "One element of 100 um, f = 150 um at 940 nm";
        for other in [wedge, "", "wedge_wavelength_nm = 1550\n"] {
            assert_eq!(words("asi_940", wedge, other), one);
        }
        assert_eq!(
            words(
                "array_2x4",
                "wedge_wavelength_nm = 550\n",
                "wedge_wavelength_nm = 450\n"
            ),
            "2 x 4 elements of 60 um, f = 144 um at 550 nm, 150 by 120 um apart, steered by 8° a step at 450 nm"
        );
        // A table says no wavelength.
        assert_eq!(
            words("prototype_3x3", "[array]\n", "[array]\n"),
            "3 x 3 elements of 1,000 um, f = 2,400 um, 2420 um apart, steered by 15° a step at 550 nm"
        );
        assert_eq!(
            words("hologram", "[array]\n", "[array]\n"),
            "2 elements of 60 um, f = 144 um at 532 nm, placed one by one"
        );
    }
}
