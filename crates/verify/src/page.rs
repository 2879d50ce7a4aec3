//! The report of a run: what was designed, what was written, and what the written file does.

use metalith_core::part;
use std::path::Path;

use ndarray::Array2;

use super::{DistinctElement, PsfResult, Sense, Verification, assumptions, white_page};
use metalith_cell::Fidelity;
use metalith_core::{Lattice, Result, WidthMap, WidthRows};
use metalith_design::array::PillarArray;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{CellIncidence, Design};
use metalith_report::{
    Axis, Cell, Chart, Column, Figure, ImageGrid, Page, PillarZoom, Plan, Table, Verdict, count, exact, sig, write_json,
};
use metalith_wave::psf::HALF_NYQUIST_LP_MM;

/// Decades of a PSF that are shown: below lies what a camera's noise hides.
const PSF_DECADES: f64 = 4.0;
/// Edge of the part of a PSF that is shown (um): some ten sensor pixels.
const PSF_SHOWN_UM: f64 = 60.0;

/// Pillars that the picture of the middle shows along an axis.
const ZOOMED_PITCHES: f64 = 34.0;

/// Write `report.html` and `report.json` into a folder; the page shows the picture that a camera of the chip will take, if
/// there is one.
///
/// # Errors
/// If they cannot be written.
pub fn write_report(
    design: &Design,
    array: &PillarArray,
    found: &Verification,
    picture: Option<Figure>,
    folder: &Path,
) -> Result<()> {
    write_json(&folder.join("report.json"), "verification", found)?;
    page(design, array, found, picture).write(&folder.join("report.html"))
}

fn page(design: &Design, array: &PillarArray, found: &Verification, picture: Option<Figure>) -> Page {
    let mut page = Page::new(
        &design.title,
        format!("{}, computed from the bytes of {}", design.name, found.layout.file),
    );
    if let Some(why) = &found.not_simulated {
        page.paragraph(format!("Every pillar was compared; nothing was simulated: {why}."));
    }
    let failed = found.checks.iter().filter(|c| !c.passed()).count();
    let words = match failed {
        0 => format!(
            "What was written is what was designed: all {} limits hold.",
            found.checks.len()
        ),
        _ => format!("{failed} of {} limits do not hold.", found.checks.len()),
    };
    page.verdict(Verdict::of(failed == 0), words);
    page.facts(&[
        ("Pillars", count(found.layout.pillars)),
        ("Elements", found.elements.len().to_string()),
        ("of them distinct", found.distinct.len().to_string()),
        ("Strehl ratio, least to greatest", strehl(found)),
        ("MTF at 42.7 lp/mm, one wavelength", contrast(found)),
        ("a whole channel from one direction", white_contrast(found)),
        ("File", format!("{} MB", sig(found.layout.bytes as f64 * 1e-6, 3))),
    ]);
    if let Some(picture) = picture {
        page.figure(picture);
    }
    limits(&mut page, found);
    assumptions::write(&mut page, design, found);
    designed(&mut page, design, array);
    written(&mut page, design, found);
    // From the middle outwards: the plainest element first.
    let mut elements = found.distinct.iter().collect::<Vec<_>>();
    elements.sort_by_key(|e| e.element.index.0.abs() + e.element.index.1.abs());
    for element in elements {
        simulated(&mut page, found, element);
    }
    method(&mut page, design, found);
    page
}

/// Range of the Strehl ratios of the case that judges.
fn strehl(found: &Verification) -> String {
    range(found, |psf| psf.metrics.strehl)
}

/// Range of its contrast at half the frequency of the sensor, pixel included.
fn contrast(found: &Verification) -> String {
    range(found, |psf| psf.mtf()[0])
}

/// The same in the light of each channel of the camera, along both axes.
fn white_contrast(found: &Verification) -> String {
    let channels = found.distinct.iter().flat_map(|d| &d.white);
    let contrasts = channels.flat_map(|channel| &channel.contrast);
    between(contrasts.filter(|c| c.lp_mm == HALF_NYQUIST_LP_MM).flat_map(|c| c.mtf))
}

fn range(found: &Verification, of: impl Fn(&PsfResult) -> f64) -> String {
    between(found.distinct.iter().flat_map(|d| &d.spots).map(|s| of(s.judged())))
}

/// Least and greatest in words.
fn between(values: impl Iterator<Item = f64>) -> String {
    let ends = values.fold(None, |ends: Option<(f64, f64)>, v| {
        Some(ends.map_or((v, v), |(a, b)| (a.min(v), b.max(v))))
    });
    ends.map_or_else(
        || "none".into(),
        |(least, most)| format!("{} to {}", sig(least, 2), sig(most, 2)),
    )
}

fn limits(page: &mut Page, found: &Verification) {
    page.section("Limits");
    let mut table = Table::new([
        Column::text("What, and where it is worst"),
        Column::number("Reached", ""),
        Column::number("Limit", ""),
        Column::verdict(),
    ]);
    for check in &found.checks {
        let sign = match check.sense {
            Sense::AtMost => "≤",
            Sense::AtLeast => "≥",
        };
        table.row([
            Cell::from(check.what.as_str()),
            Cell::sig(check.reached, 4),
            Cell::from(format!("{sign} {}", exact(check.limit))),
            Cell::from(Verdict::of(check.passed())),
        ]);
    }
    page.table(table.caption(
        "From `[verify.limits]` of the design file; limits that it does not set have their default, or none.",
    ));
}

fn designed(page: &mut Page, design: &Design, array: &PillarArray) {
    page.section("What was designed");
    let elements = match design.array.spacing_words() {
        Some(apart) => format!(
            "{} x {} elements of {} um, f = {} um, {apart} apart, steered by {}° a step",
            design.array.count.0,
            design.array.count.1,
            exact(f64::from(design.lens.diameter_nm) * 1e-3),
            exact(design.lens.focal_length_um),
            design.array.steering_deg,
        ),
        None => format!(
            "{} elements of {} um, f = {} um, placed and steered one by one,",
            array.placed.len(),
            exact(f64::from(design.lens.diameter_nm) * 1e-3),
            exact(design.lens.focal_length_um),
        ),
    };
    let plural = design.cell.shape.plural();
    page.paragraph(format!(
        "{elements} at {} nm; pillars, {plural}, on a lattice of {} nm.",
        exact(design.array.wedge_wavelength_um * 1e3),
        design.cell.pitch_nm,
    ));
    let centre = array.central();
    let rows = array.rows(centre);
    let zoomed = middle(rows.as_ref());
    let span_um = ZOOMED_PITCHES * array.lattice.pitch_um();
    page.row([
        chip(design).caption("The chip from above: openings, pillars, marks and outline as they are written."),
        PillarZoom::new(
            "Pillars in the middle of the centre element",
            &zoomed,
            (0.0, 0.0),
            span_um,
        )
        .shape(design.cell.shape)
        .caption("Pillars as they are written, to scale."),
    ]);
    let lens = LensPhase::of(design);
    let phase = ElementPhase::of(&lens, &centre.element);
    let n = array.lattice.sites();
    let along = |value: &dyn Fn(usize) -> Option<f64>| {
        let radius = |ix| array.lattice.coordinate_um(ix);
        (n / 2..n)
            .filter_map(|ix| Some((radius(ix), value(ix)?)))
            .collect::<Vec<_>>()
    };
    let mut turns = Chart::new(
        "Phase along a radius",
        Axis::linear("radius", "um"),
        Axis::linear("phase", "turns"),
    )
    .size(420.0, 260.0);
    turns.line("unwrapped", along(&|ix| phase.turns(ix, n / 2)));
    let mut widths = Chart::new(
        "Width along a radius",
        Axis::linear("radius", "um"),
        Axis::linear("width", "nm"),
    )
    .size(420.0, 260.0);
    let last = along(&|ix| phase.turns(ix, n / 2)).len();
    let shown = along(&|ix| Some(f64::from(rows.width(ix, n / 2))).filter(|w| *w > 0.0));
    widths.points("as written", shown.into_iter().take(last.min(RADIUS_POINTS)));
    page.row([
        turns.caption("Centre element, before the modulo."),
        widths.caption(format!(
            "Centre element, the first {} sites from the middle.",
            last.min(RADIUS_POINTS)
        )),
    ]);
}

/// Sites along a radius that can be told apart in a figure.
const RADIUS_POINTS: usize = 600;

/// The sites about the middle of an element that figures show.
fn middle(rows: &impl WidthRows) -> WidthMap {
    let lattice = rows.lattice();
    let n = lattice.sites();
    let beside = n.saturating_sub(2 * RADIUS_POINTS) / 2;
    let shown = Lattice::new(lattice.pitch_nm(), n - 2 * beside).expect("a part of a lattice is one");
    let mut map = WidthMap::empty(shown);
    for ((iy, ix), width) in map.width_nm.indexed_iter_mut() {
        *width = rows.width(ix + beside, iy + beside);
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
        let radius = design.lens.radius_um();
        plan.circle(openings, cx, cy, radius + um(layout.apertures.margin_nm));
        plan.circle(pillars, cx, cy, radius);
        plan.label(cx, cy, element.label());
    }
    for set in &layout.marks {
        for &(cx, cy) in &set.centres_nm {
            plan.cross(marks, (um(cx), um(cy)), um(set.length_nm), um(set.width_nm));
        }
    }
    plan
}

fn written(page: &mut Page, design: &Design, found: &Verification) {
    page.section("What was written");
    let mut table = Table::new([
        Column::text("Element (m, n)"),
        Column::number("Pillars", ""),
        Column::number("Wrong width", ""),
        Column::number("Missing", ""),
        Column::number("Extra", ""),
        Column::text("Simulated as"),
    ]);
    for check in &found.elements {
        let copy = check.copy_of.and_then(|k| found.distinct.get(k));
        table.row([
            Cell::from(check.element.label()),
            Cell::from(count(check.widths.pillars)),
            Cell::from(count(check.widths.wrong)),
            Cell::from(count(check.widths.missing)),
            Cell::from(count(check.widths.extra)),
            Cell::from(copy.map_or_else(|| "itself".into(), |d| d.element.label())),
        ]);
    }
    page.table(table.caption("Every site of every element, compared with the width that the design asks for."));
    let mut layers = Table::new([
        Column::text("Layer"),
        Column::number("Shapes", ""),
        Column::number("Texts", ""),
        Column::text("Purpose"),
    ]);
    for layer in &found.layout.survey.layers {
        let known = design.layout.layers.all();
        let purpose = known.iter().find(|(_, l)| l.number() == layer.layer);
        layers.row([
            Cell::code(format!("{}/{}", layer.layer.layer, layer.layer.datatype)),
            Cell::from(count(layer.shapes)),
            Cell::from(count(layer.texts)),
            Cell::from(purpose.map_or("not a layer of the design", |(_, l)| l.purpose.as_str())),
        ]);
    }
    page.table(layers.caption(format!(
        "Layers of {}, all references followed: {} cells, {} deep, top cell `{}`.",
        found.layout.file, found.layout.cells, found.layout.depth, found.layout.top_cell
    )));
    for oddity in found.foreign.listed.iter().take(MOST_ODDITIES) {
        page.note(format!(
            "{} at ({}, {}) um, {} x {} nm",
            oddity.why.words(),
            sig(oddity.centre_nm[0] * 1e-3, 9),
            sig(oddity.centre_nm[1] * 1e-3, 9),
            sig(oddity.size_nm[0], 6),
            sig(oddity.size_nm[1], 6)
        ));
    }
    let mut widths = Chart::new(
        "Widths of all pillars",
        Axis::linear("width", "nm"),
        Axis::linear("pillars", ""),
    );
    let mut histogram = Vec::new();
    for element in &found.distinct {
        for (w, c) in element.histogram.iter().enumerate().skip(1) {
            histogram.resize(histogram.len().max(w + 1), 0);
            histogram[w] += c * element.copies as u64;
        }
    }
    let step = f64::from(design.cell.width_step_nm) / 2.0;
    let bars = histogram.iter().enumerate().filter(|(_, c)| **c > 0);
    widths.bars(
        "pillars",
        bars.map(|(w, &c)| (w as f64 - step, w as f64 + step, c as f64)),
    );
    page.figure(widths.caption("Number of pillars of each width, as read back."));
}

/// Odd shapes that are listed in the page; all are in `report.json` up to its own limit.
const MOST_ODDITIES: usize = 20;

fn simulated(page: &mut Page, found: &Verification, element: &DistinctElement) {
    page.section(format!("Element {}", element.element.label()));
    page.paragraph(format!(
        "Stands for {} of {} elements. Phase errors at the wavelength of the mapping: rounding {} rad rms, {} at most; mapping, by the `{}` cell, {} rad rms, {} at most. {}",
        element.copies,
        found.elements.len(),
        sig(element.phase.rounding.rms_rad, 3),
        sig(element.phase.rounding.largest_rad, 3),
        found.fidelity.of_width_alone(),
        sig(element.phase.mapping.rms_rad, 3),
        sig(element.phase.mapping.largest_rad, 3),
        steepness(element),
    ));
    page.table(spot_table(element));
    let shown: Vec<_> = element
        .spots
        .iter()
        .filter_map(|spot| Some((spot, spot.images()?)))
        .collect();
    // Designed above extracted, a column for each wavelength.
    let mut images = ImageGrid::new("PSF designed above extracted", shown.len())
        .values("|E|² / |E inc|²", "")
        .log(PSF_DECADES)
        .side((760.0 / shown.len().max(1) as f64).min(230.0));
    for (spot, seen) in &shown {
        images = images.pixel_um(seen.step_um);
        images.image(format!("designed, {}", spot.place()), cut(&seen.designed, seen.step_um));
    }
    for (spot, seen) in &shown {
        images.image(
            format!("extracted, {}", spot.place()),
            cut(&seen.extracted, seen.step_um),
        );
    }
    let mut chart = Chart::new(
        "MTF with the sensor's pixel",
        Axis::linear("spatial frequency", "1/mm"),
        Axis::linear("MTF", "").range(0.0, 1.0),
    );
    for (spot, _) in &shown {
        let colour = format!("{} nm", exact(spot.wavelength_um * 1e3));
        chart.line(format!("designed, {colour}"), spot.designed.mtf_curve.iter().copied());
        chart.line(format!("extracted, {colour}"), spot.judged().mtf_curve.iter().copied());
    }
    page.figure(images.caption(format!(
        "The middle {PSF_SHOWN_UM} um about the chief ray, {PSF_DECADES} decades; extracted by the `{}` cell.",
        found.fidelity
    )));
    page.figure(chart.caption("In the middle of the field, mean of x and y."));
    let mut orders = Table::new([
        Column::number("Wavelength", "nm"),
        Column::text("Cell"),
        Column::number("First order", "%"),
        Column::number("Zero order", "%"),
        Column::number("Second order", "%"),
        Column::number("All transmitted in the zero order of the lattice", "%"),
    ]);
    for entry in &element.orders {
        orders.row([
            Cell::exact(entry.wavelength_um * 1e3),
            Cell::from(entry.fidelity.name()),
            Cell::fixed(entry.first * 100.0, 1),
            Cell::fixed(entry.zero * 100.0, 1),
            Cell::fixed(entry.second * 100.0, 1),
            Cell::fixed(entry.transmitted * 100.0, 1),
        ]);
    }
    let whose = if found.fidelity == Fidelity::Neighbours {
        "the mapping's own account, for `neighbours` by that of the element's pillars"
    } else {
        "the mapping's own account"
    };
    page.table(orders.caption(format!(
        "Where light goes by {whose}: the first order is the image, the zero order passes the element as if it had no phase.",
    )));
    white_page::write(page, found, element);
}

fn steepness(element: &DistinctElement) -> String {
    let steep = &element.steepness;
    match steep.from_pitches {
        None => format!(
            "The design phase nowhere steps by more than pi a pitch ({} rad at most).",
            sig(steep.largest_step_rad, 3)
        ),
        Some(from) => format!(
            "The design phase steps by more than pi a pitch at {} % of the pillars, the first of them {} pitches from the middle.",
            sig(steep.steep_sites as f64 / steep.sites.max(1) as f64 * 100.0, 3),
            sig(from, 4),
        ),
    }
}

fn spot_table(element: &DistinctElement) -> Table {
    let mut table = Table::new([
        Column::text("Wavelength, field angle"),
        Column::text("Of"),
        Column::number("Strehl", ""),
        Column::number("Energy in 1 pixel", "%"),
        Column::number("in 2", "%"),
        Column::number("MTF 42.7/mm", ""),
        Column::number("85.3/mm", ""),
        Column::number("Centroid x", "um"),
        Column::number("y", "um"),
        Column::number("PSF difference", ""),
    ]);
    for spot in &element.spots {
        let mut row = |of: String, spot_of: &PsfResult, difference: Cell| {
            let (m, [half, nyquist]) = (&spot_of.metrics, spot_of.mtf());
            table.row([
                Cell::from(spot.place()),
                Cell::from(of),
                Cell::sig(m.strehl, 3),
                Cell::fixed(m.energy_1_pixel * 100.0, 2),
                Cell::fixed(m.energy_2_pixels * 100.0, 2),
                Cell::fixed(half, 3),
                Cell::fixed(nyquist, 3),
                Cell::fixed(m.centroid_um[0] - spot.chief_ray_um[0], 2),
                Cell::fixed(m.centroid_um[1] - spot.chief_ray_um[1], 2),
                difference,
            ]);
        };
        row("design phase".into(), &spot.designed, Cell::none());
        for (k, (fidelity, extracted)) in spot.extracted.iter().enumerate() {
            let difference = if k == 0 {
                Cell::sig(spot.psf_difference, 3)
            } else {
                Cell::none()
            };
            row(format!("layout, {fidelity}"), extracted, difference);
        }
    }
    table.caption("The unrounded design phase beside the pillars read back, by each cell. Energies are of the light that arrives at the element; the centroid counts from the chief ray.")
}

/// The middle of a PSF.
fn cut(values: &Array2<f32>, step_um: f64) -> Array2<f64> {
    let n = values.nrows();
    let keep = ((PSF_SHOWN_UM / step_um) as usize).clamp(1, n);
    let from = (n - keep) / 2;
    part(values.view(), from..from + keep, from..from + keep).mapv(f64::from)
}

fn method(page: &mut Page, design: &Design, found: &Verification) {
    page.section("How it was computed");
    if let Some(model) = &found.model {
        page.paragraph(format!(
            "Pillars, apertures, light and sensor are those of the calibrated model of {}: {}.",
            model.set, model.finding
        ));
        for quantity in &model.not_applied {
            page.note(quantity.to_string());
        }
    }
    let relabelled = found
        .distinct
        .iter()
        .flat_map(|d| &d.spots)
        .map(|s| s.relabelled)
        .max()
        .unwrap_or(0);
    page.paragraph(format!(
        "Design `{}`, digest `{}`. Everything about the layout is computed from the file that was read back. Fields: the lattice of point samples, each of weight pitch², folded ({} mode), frequencies weighed by where their rays land; at most {} frequency bins had to be relabelled towards the mean ray. PSF: |E|² over that of the incident wave. Strehl: against the same aperture passing all its power in the zero order with the perfect phase for the place where the chief ray lands. MTF: the transform of the PSF over all light that the element passes, of which what lands outside of the window is a veil. Field angles count from where an element looks at each wavelength.",
        found.design, found.design_digest, found.accuracy, count(relabelled),
    ));
    page.paragraph(format!(
        "The cell that judges is `{}`, lit {}; wavelengths {} nm; windows of {} x {} samples of one pitch about the chief ray; sensor pixels of {} um.",
        found.fidelity,
        match design.verify.incidence {
            CellIncidence::Normal if found.fidelity == Fidelity::Neighbours => {
                "from the middle of each element's field"
            }
            CellIncidence::Normal => "along the normal at all field angles",
            CellIncidence::AsLit => "at the angle that light arrives at, both polarisations",
        },
        design.verify.wavelengths_um.iter().map(|w| exact(w * 1e3)).collect::<Vec<_>>().join(", "),
        design.verify.window_samples,
        design.verify.window_samples,
        design.verify.pixel_um,
    ));
}
