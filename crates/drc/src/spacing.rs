//! Distances between shapes: gaps, overlaps, and the same shape twice.

use super::deck::Context;
use super::found::Found;
use super::pairs::{Body, near, place};
use super::rule::{Rule, Status};
use super::scene::Scene;
use metalith_core::document::{Limits, Section};
use metalith_gds::LayerNumber;

#[derive(Clone, Copy, PartialEq)]
enum Want {
    /// Least distance [nm].
    Gap {
        nm: f64,
        height_nm: Option<f64>,
    },
    NoOverlap,
    NoDuplicate,
}

struct Spacing {
    layer: LayerNumber,
    want: Want,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let want = match check {
        "gap_min" => Want::Gap {
            nm: s.float("nm", Limits::new(0.0..=1e6, "nm")),
            height_nm: None,
        },
        "gap_aspect_max" => Want::Gap {
            nm: context.height_nm / s.float("ratio", Limits::new(0.01..=1000.0, "")),
            height_nm: Some(context.height_nm),
        },
        "overlap" => Want::NoOverlap,
        "duplicate" => Want::NoDuplicate,
        _ => return None,
    };
    Some(Box::new(Spacing {
        layer: context.layer(s, "layer"),
        want,
    }))
}

impl Rule for Spacing {
    fn words(&self) -> String {
        match self.want {
            Want::Gap { nm, height_nm: None } => format!("gaps of at least {nm} nm, in any direction"),
            Want::Gap { nm, height_nm: Some(h) } => format!("gaps at most {:.4} times as deep as wide", h / nm),
            Want::NoOverlap => "no two shapes share area".into(),
            Want::NoDuplicate => "no shape is there twice".into(),
        }
    }

    fn judge(&mut self, scene: &Scene<'_>, found: &mut Found) -> Status {
        let limit = match self.want {
            Want::Gap { nm, .. } => scene.units(nm) - 1e-9,
            _ => 0.0,
        };
        if let (Want::Gap { nm, height_nm }, true) = (self.want, self.layer == scene.pillars)
            && let Err(why) = on_lattices(scene, nm, height_nm, found)
        {
            return Status::Failed(why);
        }
        let want = self.want;
        let judged = near(scene, self.layer, limit.ceil() as i64, |a, b| match want {
            Want::Gap { height_nm, .. } => {
                let gap = a.gap(&b);
                if gap < limit && !a.overlaps(&b) {
                    report_gap(scene, &a, &b, gap, height_nm, found);
                }
            }
            Want::NoOverlap => {
                if !a.equals(&b) && a.overlaps(&b) {
                    found.rect(&place(&a.bounds(), &b.bounds()), || "two shapes share area".into());
                }
            }
            Want::NoDuplicate => {
                if a.equals(&b) {
                    found.at(&a.ring(), || "the same shape twice".into());
                }
            }
        });
        judged.map_or_else(Status::Failed, |()| Status::Run)
    }
}

fn report_gap(scene: &Scene<'_>, a: &Body<'_>, b: &Body<'_>, gap: f64, height_nm: Option<f64>, found: &mut Found) {
    let nm = gap * scene.unit_nm;
    found.rect(&place(&a.bounds(), &b.bounds()), || match height_nm {
        None => format!("a gap of {nm:.2} nm"),
        Some(h) => format!("a gap of {nm:.2} nm and {h} nm deep, 1 : {:.2}", h / nm),
    });
}

/// Gaps between pillars on one lattice: neighbours along the axes and diagonals. Pillars are at most a
/// pitch wide, so farther ones are at least a pitch apart.
fn on_lattices(scene: &Scene<'_>, nm: f64, height_nm: Option<f64>, found: &mut Found) -> Result<(), String> {
    for (k, e) in scene.elements.iter().enumerate() {
        let pitch = f64::from(e.site.lattice.pitch_nm());
        if nm > pitch {
            return Err(format!(
                "a gap of {nm} nm is beyond the pitch of {pitch} nm of {}",
                e.site.name
            ));
        }
        let widest = e.widths.histogram().len().saturating_sub(1) as f64;
        if pitch - widest >= nm {
            continue;
        }
        let w = &e.widths.width_nm;
        let n = e.site.lattice.sites();
        for ((row, column), &own) in w.indexed_iter().filter(|(_, w)| **w != 0) {
            for (up, right) in [(0, 1), (1, 0), (1, 1), (1, -1)] {
                let (r, c) = (row + up, column as i64 + right);
                if r >= n || c < 0 || c >= n as i64 {
                    continue;
                }
                let other = w[[r, c as usize]];
                let along = pitch - (f64::from(own) + f64::from(other)) / 2.0;
                let gap = if up == 1 && right != 0 {
                    along * std::f64::consts::SQRT_2
                } else {
                    along
                };
                if other != 0 && gap < nm - 1e-9 {
                    let body = |row, column| Body::Rect(scene.pillar(k, row, column));
                    let (a, b) = (body(row, column), body(r, c as usize));
                    report_gap(scene, &a, &b, gap / scene.unit_nm, height_nm, found);
                }
            }
        }
    }
    Ok(())
}
