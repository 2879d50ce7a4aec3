//! Limits on the cost of a layout: bytes, shapes, writing time.

use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::rule::{Needs, Rule, RuleOutcome};
use metalith_core::document::{Limits, Section};
use metalith_gds::LayerNumber;
use metalith_pillars::{PillarId, PillarRows};
use metalith_report::exact;

enum BudgetRule {
    FileSize(f64),
    Shapes(f64),
    WriteTime(Writing),
}

/// Contributions to the writing time.
struct Writing {
    layers: Vec<LayerNumber>,
    dose_uc_cm2: f64,
    current_na: f64,
    shape_ns: f64,
    field_um: f64,
    field_s: f64,
    most_h: f64,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let positive = |unit| Limits::new(0.0..=f64::MAX, unit);
    Some(Box::new(match check {
        "file_size" => BudgetRule::FileSize(s.float("mb", positive("MB"))),
        "shape_count" => BudgetRule::Shapes(s.float("count", positive("shapes"))),
        "write_time" => BudgetRule::WriteTime(Writing {
            layers: context.some_layers(s),
            dose_uc_cm2: s.float("dose_uc_cm2", Limits::new(0.001..=1e6, "uC/cm2")),
            current_na: s.float("current_na", Limits::new(0.001..=1e6, "nA")),
            shape_ns: s.float("shape_ns", positive("ns")),
            field_um: s.float("field_um", Limits::new(1.0..=1e5, "um")),
            field_s: s.float("field_s", positive("s")),
            most_h: s.float("hours", positive("h")),
        }),
        _ => return None,
    }))
}

impl Rule for BudgetRule {
    fn words(&self) -> String {
        match self {
            Self::FileSize(mb) => format!("a file of at most {mb} MB"),
            Self::Shapes(count) => format!("at most {count} shapes, references followed"),
            Self::WriteTime(w) => format!(
                "at most {} h of writing at {} uC/cm2, {} nA, {} ns a shape, {} s a field",
                w.most_h, w.dose_uc_cm2, w.current_na, w.shape_ns, w.field_s
            ),
        }
    }

    fn needs(&self) -> Needs {
        if matches!(self, Self::WriteTime(_)) {
            Needs::Geometry
        } else {
            Needs::Numbers
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let (value, most, unit) = match self {
            Self::FileSize(mb) => (flat.layout.bytes() as f64 * 1e-6, *mb, "MB"),
            Self::Shapes(count) => (flat.layout.flat_shapes() as f64, *count, "shapes"),
            Self::WriteTime(w) => (w.hours(flat, found), w.most_h, "h"),
        };
        found.facts.push((unit.to_owned(), value));
        if value > most {
            found.plain(unit, || format!("{} {unit}, at most {}", exact(value), exact(most)));
        }
        Ok(())
    }
}

impl Writing {
    /// Dose x area / current, and the overheads of shapes and fields.
    fn hours(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> f64 {
        let (mut area_nm2, mut shapes) = (0.0, 0.0);
        let unit2 = flat.unit_nm * flat.unit_nm;
        for layer in &self.layers {
            if *layer == flat.pillars {
                for e in &flat.elements {
                    for (w, &count) in e.widths.histogram().iter().enumerate().skip(1) {
                        area_nm2 += count as f64 * flat.shape.area_nm2(PillarId(w as u16));
                        shapes += count as f64;
                    }
                }
            }
            let Some(loose) = flat.loose(*layer) else { continue };
            for k in 0..loose.rects.len() {
                let r = loose.rect(k);
                area_nm2 += r.width() as f64 * r.height() as f64 * unit2;
                shapes += 1.0;
            }
            for p in &loose.polygons {
                area_nm2 += super::polygon::twice_area(p).unsigned_abs() as f64 / 2.0 * unit2;
                shapes += 1.0;
            }
        }
        // 1 nm2 = 1e-14 cm2; uC / nA = 1000 s.
        let exposure_s = self.dose_uc_cm2 * area_nm2 * 1e-14 / self.current_na * 1e3;
        let fields: f64 = flat
            .elements
            .iter()
            .map(|e| {
                (e.site.lattice.sites() as f64 * (e.site.lattice.steps_nm()[0] * 1e-3) / self.field_um)
                    .ceil()
                    .powi(2)
            })
            .sum();
        found.facts.push(("exposed area [mm2]".into(), area_nm2 * 1e-12));
        found.facts.push(("exposure [s]".into(), exposure_s));
        (exposure_s + shapes * self.shape_ns * 1e-9 + fields * self.field_s) / 3600.0
    }
}
