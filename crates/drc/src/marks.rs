//! Alignment marks: all there, and nothing near them.

use super::context::Context;
use super::findings::Findings;
use super::flat_layout::{FlatLayout, LooseShapes};
use super::rule::{NotRun, Rule, RuleOutcome};
use metalith_core::document::{Limits, Section};
use metalith_design::MarkSpec;
use metalith_gds::{LayerNumber, Point, Rect};
use metalith_pillars::PillarRows;

enum Marks {
    /// Rule that allows nothing on `others` within a distance of a mark (nm).
    KeepOut {
        marks: LayerNumber,
        others: Vec<LayerNumber>,
        nm: f64,
    },
    /// Required number of marks of each size (nm); from the design if one is given.
    Complete { marks: LayerNumber, sets: Vec<(f64, u64)> },
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    Some(Box::new(match check {
        "mark_keep_out" => Marks::KeepOut {
            marks: context.layer(s, "layer"),
            others: context.some_layers(s),
            nm: 1e3 * s.float("um", Limits::new(0.0..=1e5, "um")),
        },
        "marks_complete" => {
            let sizes = s.floats("length_um", Limits::new(0.001..=1e5, "um"));
            let counts = s.floats("count", Limits::new(1.0..=1000.0, "marks"));
            if sizes.len() != counts.len() || sizes.is_empty() {
                s.fault(
                    "count",
                    "as many counts as lengths are needed",
                    "give one count for each length",
                );
            }
            Marks::Complete {
                marks: context.layer(s, "layer"),
                sets: sizes
                    .iter()
                    .map(|l| l * 1e3)
                    .zip(counts.iter().map(|&c| c as u64))
                    .collect(),
            }
        }
        _ => return None,
    }))
}

impl Rule for Marks {
    fn words(&self) -> String {
        match self {
            Self::KeepOut { nm, .. } => format!("nothing within {} um of a mark", nm * 1e-3),
            Self::Complete { sets, .. } => {
                let set = |(nm, count): &(f64, u64)| format!("{count} of {} um", nm * 1e-3);
                format!(
                    "marks are complete: {}",
                    sets.iter().map(set).collect::<Vec<_>>().join(", ")
                )
            }
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        match self {
            Self::KeepOut { marks, others, nm } => keep_out(flat, *marks, others, *nm, found),
            Self::Complete { marks, sets } => {
                let of_design = flat.design.map(|design| {
                    let set = |m: &MarkSpec| (m.length_nm as f64, m.centres_nm.len() as u64);
                    design.layout.marks.iter().map(set).collect::<Vec<_>>()
                });
                complete(flat, *marks, of_design.as_ref().unwrap_or(sets), found)
            }
        }
    }
}

fn keep_out(
    flat: &FlatLayout<'_>,
    marks: LayerNumber,
    others: &[LayerNumber],
    nm: f64,
    found: &mut Findings,
) -> RuleOutcome {
    let Some(loose) = flat.loose(marks) else {
        // A design that asks for none has nothing to keep away from.
        return match flat.design {
            Some(design) if design.layout.marks.is_empty() => Ok(()),
            _ => Err(NotRun::Skipped(format!("no marks on layer {marks}"))),
        };
    };
    let reach = flat.units(nm).round() as i64;
    for mark in loose.bounds() {
        flat.work.spend(flat.elements.len() as u64)?;
        let zone = Rect {
            x0: mark.x0 - reach,
            y0: mark.y0 - reach,
            x1: mark.x1 + reach,
            y1: mark.y1 + reach,
        };
        let near = |r: &Rect| r.x0 < zone.x1 && zone.x0 < r.x1 && r.y0 < zone.y1 && zone.y0 < r.y1;
        for layer in others {
            flat.work.spend(flat.loose(*layer).map_or(0, LooseShapes::len))?;
            let shapes = flat.loose(*layer).into_iter().flat_map(|l| l.bounds());
            for r in shapes.filter(|r| near(r) && (*layer != marks || *r != mark)) {
                found.rect(&r, || format!("within {} um of a mark", nm * 1e-3));
            }
            if *layer == flat.pillars {
                pillars_near(flat, &zone, found)?;
            }
        }
    }
    Ok(())
}

fn pillars_near(flat: &FlatLayout<'_>, zone: &Rect, found: &mut Findings) -> RuleOutcome {
    for (k, e) in flat.elements.iter().enumerate() {
        let n = e.site.lattice.sites() - 1;
        let mut lens = flat.pillar(k, 0, 0);
        lens.unite(&flat.pillar(k, n, n));
        let margin = flat.units(f64::from(e.site.lattice.pitch_nm())).ceil() as i64;
        let apart = lens.x0 - margin > zone.x1
            || lens.x1 + margin < zone.x0
            || lens.y0 - margin > zone.y1
            || lens.y1 + margin < zone.y0;
        if apart {
            continue;
        }
        flat.work.spend((e.site.lattice.sites() as u64).pow(2))?;
        e.widths.each_pillar(|row, column, _| {
            let r = flat.pillar(k, row, column);
            if r.x0 < zone.x1 && zone.x0 < r.x1 && r.y0 < zone.y1 && zone.y0 < r.y1 {
                found.rect(&r, || "a pillar too near to a mark".into());
            }
        });
    }
    Ok(())
}

fn complete(flat: &FlatLayout<'_>, marks: LayerNumber, sets: &[(f64, u64)], found: &mut Findings) -> RuleOutcome {
    let bounds: Vec<Rect> = flat.loose(marks).into_iter().flat_map(|l| l.bounds()).collect();
    let mut known = vec![false; bounds.len()];
    for &(nm, count) in sets {
        flat.work.spend(bounds.len() as u64)?;
        let size = flat.units(nm);
        let mut there = 0;
        for (r, known) in bounds.iter().zip(&mut known) {
            if r.width() == r.height() && (r.width() as f64 - size).abs() < 0.5 {
                there += 1;
                *known = true;
            }
        }
        if there != count {
            let um = nm * 1e-3;
            found.plain(&format!("{um} {there}"), || {
                format!("{there} marks of {um} um, not {count}")
            });
        }
    }
    for (r, _) in bounds.iter().zip(&known).filter(|(_, known)| !**known) {
        let ring = [Point::new(r.x0, r.y0), Point::new(r.x1, r.y1)];
        found.at(&ring, || "a shape among the marks that is none".into());
    }
    Ok(())
}
