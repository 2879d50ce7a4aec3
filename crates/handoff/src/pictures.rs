//! Pictures of a hand-off: the chip, the tone of both steps in cross-section, the dose matrix, the tests.

use super::dose_matrix::DoseBlock;
use super::drawing::RectNm;
use super::pad::PadPillar;
use super::process::{Method, Process, Tone};
use super::structures::Structure;
use metalith_design::Design;
use metalith_report::{Figure, Plan, PlanLayer};

fn corners(r: RectNm) -> ((f64, f64), (f64, f64)) {
    (
        (r.x0 as f64 * 1e-3, r.y0 as f64 * 1e-3),
        (r.x1 as f64 * 1e-3, r.y1 as f64 * 1e-3),
    )
}

/// The chip with its origin and orientation.
pub(super) fn chip(design: &Design) -> Figure {
    let mut plan = Plan::new(format!("Chip of {}", design.name)).width(640.0);
    let outline = plan.outlines("chip edge");
    let openings = plan.layer("openings in the metal");
    let lenses = plan.layer("pillars");
    let marks = plan.solid("marks of both steps");
    let axes = plan.solid("origin and axes");
    let (w, h) = design.layout.chip.size_nm;
    let (a, b) = corners(RectNm::new(-w / 2, -h / 2, w / 2, h / 2));
    plan.rectangle(outline, a, b);
    let margin = design.layout.apertures.margin_nm as f64 * 1e-3;
    for element in design.elements() {
        let radius = design.lens_of(&element).radius_um();
        let (x, y) = (element.centre_nm.0 as f64 * 1e-3, element.centre_nm.1 as f64 * 1e-3);
        let shifted = |&(dx, dy): &(i64, i64)| (x + dx as f64 * 1e-3, y + dy as f64 * 1e-3);
        if let Some(outline) = design.outline_of(&element) {
            let opening = outline.grown(design.layout.apertures.margin_nm);
            plan.polygon(openings, opening.iter().map(shifted));
            plan.polygon(lenses, outline.corners_nm().iter().map(shifted));
        } else {
            plan.circle(openings, x, y, radius + margin);
            plan.circle(lenses, x, y, radius);
        }
        plan.label(x, y - radius - margin - 0.022e-3 * h as f64, element.label());
    }
    for set in &design.layout.marks {
        for &(x, y) in &set.centres_nm {
            let centre = (x as f64 * 1e-3, y as f64 * 1e-3);
            plan.cross(marks, centre, set.length_nm as f64 * 1e-3, set.width_nm as f64 * 1e-3);
        }
    }
    // From the origin to half way between the elements.
    let reach = if design.array.count.0 > 1 {
        0.5e-3 * design.array.spacing_nm as f64
    } else {
        0.3e-3 * w.min(h) as f64
    };
    arrow(&mut plan, axes, reach, false);
    arrow(&mut plan, axes, reach, true);
    let beside = 0.02e-3 * w.min(h) as f64;
    plan.label(reach, -beside, "+x").label(1.4 * beside, reach, "+y");
    plan.label(
        -0.5e-3 * w as f64 + 0.2e-3 * w as f64,
        -0.5e-3 * h as f64 + 0.04e-3 * h as f64,
        "label is at this corner",
    );
    plan.caption(
        "The chip seen from the side of the pillars. The origin (0, 0) is its middle, x to the right, y up; elements are \
         named (m, n) along x and y. The text label stands at the lower left: if it is elsewhere or mirrored, the layout was turned.",
    )
}

fn arrow(plan: &mut Plan, layer: PlanLayer, reach: f64, upright: bool) {
    let (t, head) = (reach * 0.012, reach * 0.06);
    let points = [
        (0.0, -t),
        (reach - head, -t),
        (reach - head, -head / 2.0),
        (reach, 0.0),
        (reach - head, head / 2.0),
        (reach - head, t),
        (0.0, t),
    ];
    plan.polygon(layer, points.map(|(x, y)| if upright { (y, x) } else { (x, y) }));
}

/// Height of pillars that distances in the cross-section are chosen for (um).
const DRAWN_HEIGHT_UM: f64 = 0.7;

/// Figure of tone: what happens to the film where the first step exposes, and to the metal where the second does.
pub(super) fn tone(design: &Design, process: &Process) -> Figure {
    let mut plan = Plan::new("Tone of both steps, in cross-section").width(900.0);
    let glass = plan.layer("substrate");
    let film = plan.solid("film");
    let resist = plan.layer("resist");
    let mask = plan.solid(format!("mask ({})", process.transfer.mask));
    let metal = plan.solid(process.apertures.metal.clone());
    let exposed = plan.outlines("exposed (what is drawn)");
    let pitch = f64::from(design.cell.pitch_nm) * 1e-3;
    let height = design.cell.pillar_height_nm * 1e-3;
    let (resist_um, mask_um) = (
        process.resist.thickness_nm * 1e-3,
        process.transfer.mask_thickness_nm * 1e-3,
    );
    // What a cut shows: from the narrowest to the widest pillar, of rectangles from edge to edge.
    let edges_nm = design.cell.shape.edge_range_nm();
    let (low, high) = edges_nm.unwrap_or(design.cell.width_range_nm);
    let widths = [low, (low + high) / 2, high].map(|w| f64::from(w) * 1e-3);
    // Thickness of the substrate and room for words grow with the pillars.
    let scale = height / DRAWN_HEIGHT_UM;
    let pillars: Vec<(f64, f64)> = widths
        .iter()
        .enumerate()
        .map(|(k, w)| ((k as f64 + 0.75) * pitch - w / 2.0, (k as f64 + 0.75) * pitch + w / 2.0))
        .collect();
    let end = 3.5 * pitch;
    let panel = end + 0.9 * pitch;
    let gaps = complement(&pillars, end);
    // Where the resist opens, and where the film is kept.
    let open = if process.resist.tone == Tone::Positive {
        &pillars
    } else {
        &gaps
    };
    let closed = if process.resist.tone == Tone::Positive {
        &gaps
    } else {
        &pillars
    };
    let kept = if process.transfer.method == Method::LiftOff {
        open
    } else {
        closed
    };
    let top = height + resist_um;
    for k in 0..4 {
        plan.rectangle(
            glass,
            (f64::from(k) * panel, -0.25 * scale),
            (f64::from(k) * panel + end, 0.0),
        );
    }
    plan.rectangle(film, (0.0, 0.0), (end, height));
    plan.rectangle(resist, (0.0, height), (end, top));
    for &(a, b) in &pillars {
        plan.rectangle(exposed, (a, height), (b, top + 0.12 * scale));
    }
    let at = panel;
    plan.rectangle(film, (at, 0.0), (at + end, height));
    if process.transfer.method == Method::LiftOff {
        for &(a, b) in open {
            plan.rectangle(mask, (at + a, height), (at + b, height + mask_um.max(0.02 * scale)));
        }
    } else {
        for &(a, b) in closed {
            plan.rectangle(resist, (at + a, height), (at + b, top));
        }
    }
    let at = 2.0 * panel;
    for &(a, b) in kept {
        plan.rectangle(film, (at + a, 0.0), (at + b, height));
    }
    let at = 3.0 * panel;
    let metal_um = process.apertures.metal_thickness_nm * 1e-3;
    let inside = (0.9 * pitch, end - 0.9 * pitch);
    for (a, b) in [(0.0, inside.0), (inside.1, end)] {
        plan.rectangle(metal, (at + a, 0.0), (at + b, metal_um));
    }
    let middle = end / 2.0;
    plan.rectangle(
        film,
        (at + middle - widths[1] / 2.0, 0.0),
        (at + middle + widths[1] / 2.0, height),
    );
    plan.rectangle(exposed, (at + inside.0, 0.0), (at + inside.1, metal_um + 0.12 * scale));
    let second = if process.transfer.method == Method::LiftOff {
        "2 mask lifted off"
    } else {
        "2 developed"
    };
    for (k, words) in ["1 exposed", second, "3 etched", "4 metal opened"].iter().enumerate() {
        plan.label(k as f64 * panel + middle, top + 0.28 * scale, *words);
    }
    plan.reach(0.0, top + 0.4 * scale);
    plan.caption(format!(
        "Heights to scale. Step 1, {} resist: {}. Step 2: {}. Middle pillar of the last panel stands for a whole lens.",
        match process.resist.tone {
            Tone::Positive => "positive",
            Tone::Negative => "negative",
        },
        process.exposed_becomes(),
        process.apertures.tone
    ))
}

/// Gaps between intervals, from zero to an end.
fn complement(intervals: &[(f64, f64)], end: f64) -> Vec<(f64, f64)> {
    let mut from = 0.0;
    let mut gaps = Vec::new();
    for &(a, b) in intervals {
        gaps.push((from, a));
        from = b;
    }
    gaps.push((from, end));
    gaps
}

/// The nine blocks with their doses, each with a piece of this name and these pads.
pub(super) fn dose_matrix(
    process: &Process,
    (piece, pads): (&str, &[PadPillar]),
    blocks: &[DoseBlock],
    doses: &[super::dose::DoseRow],
) -> Figure {
    let spec = &process.dose_matrix;
    let mut plan = Plan::new("Dose matrix").width(560.0);
    let bounds = plan.outlines("block");
    let lens = plan.layer(piece);
    let pad = plan.layer("uniform pads");
    let field = plan.outlines("write field");
    for (block, dose) in blocks.iter().zip(doses) {
        let (a, b) = corners(block.bounds);
        plan.rectangle(bounds, a, b);
        let (middle, half) = (
            ((a.0 + b.0) / 2.0, (a.1 + b.1) / 2.0),
            process.writer.field_used_um / 2.0,
        );
        plan.rectangle(
            field,
            (middle.0 - half, middle.1 - half),
            (middle.0 + half, middle.1 + half),
        );
        let at = |(x, y): (i64, i64)| (x as f64 * 1e-3, y as f64 * 1e-3);
        let (x, y) = at(block.lens);
        plan.circle(lens, x, y, spec.lens_diameter_um / 2.0);
        let (px, py) = at(block.pads);
        let count = pads.len() as f64;
        for k in 0..pads.len() {
            let left = px + (k as f64 - (count - 1.0) / 2.0) * (spec.pad_um + 20.0) - spec.pad_um / 2.0;
            plan.rectangle(
                pad,
                (left, py - spec.pad_um / 2.0),
                (left + spec.pad_um, py + spec.pad_um / 2.0),
            );
        }
        plan.label(
            (a.0 + b.0) / 2.0,
            b.1 + 22.0,
            format!("{}: {:.0} uC/cm2", dose.number, dose.dose_uc_cm2),
        );
    }
    plan.caption(format!(
        "Block n is on layer {}, datatype n, and has its number beside its lens. Each stands in the middle of a field of \
         {} um, if a field is about the origin.{}",
        spec.layer,
        process.writer.field_used_um,
        if pads.is_empty() {
            String::new()
        } else {
            let words: Vec<_> = pads.iter().map(PadPillar::words).collect();
            format!(" Pads from the left: pillars of {}.", words.join(", "))
        }
    ))
}

/// Characters of a name that there is room for in a structure with a width: not those of lines.
const LONGEST_LABEL: usize = 7;

/// Figure of the place of each test structure.
pub(super) fn tests(structures: &[Structure], frame: RectNm, border: (i64, i64)) -> Figure {
    let mut plan = Plan::new("Test structures").width(1000.0);
    let edge = plan.outlines("frame");
    let kinds = ["D", "S", "CD", "ETCH", "FILM", "OVER", "FIELD", "CLEAVE"];
    let names = [
        "dense pads",
        "sparse pads",
        "CD lines",
        "etch depth",
        "film witness",
        "overlay verniers",
        "field verniers",
        "cleave line",
    ];
    let layers: Vec<PlanLayer> = names.iter().map(|n| plan.layer(*n)).collect();
    let lines = plan.outlines("field borders crossed");
    let (a, b) = corners(frame);
    plan.rectangle(edge, a, b);
    for s in structures {
        let kind = |k: &&str| {
            let rest = s.id.strip_prefix(*k);
            rest.is_some_and(|r| r.is_empty() || r.starts_with('_') || r.starts_with(|c: char| c.is_ascii_digit()))
        };
        let Some(k) = kinds.iter().position(kind) else {
            continue;
        };
        let (p, q) = corners(s.bounds);
        plan.rectangle(layers[k], p, q);
        if s.id.len() <= LONGEST_LABEL && s.drawn.is_some() || s.drawn.is_none() && s.id != "CLEAVE" {
            plan.label((p.0 + q.0) / 2.0, (p.1 + q.1) / 2.0, s.id.clone());
        }
    }
    let (x, y) = (border.0 as f64 * 1e-3, border.1 as f64 * 1e-3);
    plan.rectangle(lines, (x, a.1), (x, b.1));
    plan.rectangle(lines, (a.0, y), (b.0, y));
    plan.caption(
        "Origin at the lower left corner of the frame, where the fields must begin for the field verniers to lie on borders.",
    )
}
