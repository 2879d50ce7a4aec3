//! Widths of pillars: between limits, in proportion to their height, and of the cell library.

use super::context::Context;
use super::drawn_outline::DrawnOutline;
use super::findings::Findings;
use super::rule::Rule;
use super::tolerance::{EQUAL_NM, ROUNDING};
use metalith_core::document::{Limits, Section};
use metalith_gds::{LayerNumber, circle_of, tilted_rectangle_of};
use metalith_report::exact;

/// Limit on the smaller and the larger side of a pillar (nm).
enum WidthLimit {
    Min(f64),
    Max(f64),
    /// Height over width.
    Aspect {
        height_nm: f64,
        most: f64,
    },
    /// Widths from first to last in steps, but for forbidden ranges.
    Library {
        first: f64,
        last: f64,
        step: f64,
        forbidden: Vec<(f64, f64)>,
    },
}

struct WidthBound {
    layers: Vec<LayerNumber>,
    want: WidthLimit,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let nm = || Limits::new(0.0..=1e9, "nm");
    let want = match check {
        "width_min" => WidthLimit::Min(s.float("nm", nm())),
        "width_max" => WidthLimit::Max(s.float("nm", nm())),
        "aspect_max" => WidthLimit::Aspect {
            height_nm: context.height_nm,
            most: s.float("ratio", Limits::new(0.01..=1000.0, "")),
        },
        "width_library" => {
            let [first, last] = s.array("range_nm", nm());
            let forbidden = s.floats("forbidden_nm", nm());
            if forbidden.len() % 2 == 1 {
                s.fault(
                    "forbidden_nm",
                    "a range without an end",
                    "give first and last width of each range",
                );
            }
            WidthLimit::Library {
                first,
                last,
                step: s.float("step_nm", Limits::new(0.001..=1e6, "nm")),
                forbidden: forbidden.chunks_exact(2).map(|r| (r[0], r[1])).collect(),
            }
        }
        _ => return None,
    };
    Some(Box::new(WidthBound {
        layers: context.some_layers(s),
        want,
    }))
}

impl WidthBound {
    fn wrong(&self, small: f64, large: f64) -> Option<String> {
        match &self.want {
            WidthLimit::Min(nm) if small < nm - EQUAL_NM => Some(format!("{} nm wide, at least {nm} nm", exact(small))),
            WidthLimit::Max(nm) if large > nm + EQUAL_NM => Some(format!("{} nm wide, at most {nm} nm", exact(large))),
            WidthLimit::Aspect { height_nm, most } if height_nm / small > most * (1.0 + ROUNDING) => Some(format!(
                "{} nm wide and {height_nm} nm high, 1 : {:.2}, at most 1 : {most}",
                exact(small),
                height_nm / small
            )),
            WidthLimit::Library {
                first,
                last,
                step,
                forbidden,
            } if small >= *first && small <= *last => {
                let steps = (small - first) / step;
                if (steps - steps.round()).abs() * step > EQUAL_NM {
                    return Some(format!(
                        "{} nm wide, the library has {first} nm and steps of {step} nm",
                        exact(small)
                    ));
                }
                let range = forbidden
                    .iter()
                    .find(|(a, b)| small >= a - EQUAL_NM && small <= b + EQUAL_NM)?;
                Some(format!(
                    "{} nm wide, {} to {} nm are forbidden",
                    exact(small),
                    range.0,
                    range.1
                ))
            }
            _ => None,
        }
    }
}

impl WidthBound {
    /// Variant for sides that are known to `off`.
    fn wrong_within(&self, small: f64, large: f64, off: f64) -> Option<String> {
        match &self.want {
            WidthLimit::Max(_) => self.wrong(small, large - off),
            WidthLimit::Library { .. } if off > 0.0 => self.wrong(small.round(), large),
            _ => self.wrong(small + off, large),
        }
    }
}

impl Rule for WidthBound {
    fn words(&self) -> String {
        match &self.want {
            WidthLimit::Min(nm) => format!("pillars at least {nm} nm wide"),
            WidthLimit::Max(nm) => format!("pillars at most {nm} nm wide"),
            WidthLimit::Aspect { most, .. } => format!("pillars at most {most} times as high as wide"),
            WidthLimit::Library {
                first,
                last,
                step,
                forbidden,
            } => {
                let but: Vec<String> = forbidden.iter().map(|(a, b)| format!(", not {a} to {b} nm")).collect();
                format!(
                    "widths of the cell library: {first} to {last} nm in steps of {step} nm{}",
                    but.concat()
                )
            }
        }
    }

    fn outlines(&self) -> &[LayerNumber] {
        &self.layers
    }

    fn passes_square(&self, width_nm: f64, _clockwise: bool) -> bool {
        self.wrong(width_nm, width_nm).is_none()
    }

    fn outline(&self, outline: &DrawnOutline<'_>, found: &mut Findings) {
        let bounds = outline.bounds();
        let mut sides = [bounds.width(), bounds.height()].map(|v| v as f64 * outline.unit_nm);
        // Corners of a rotated rectangle are on the grid, hence its edges known but for that: it is judged by
        // the best that they can be.
        let mut off = 0.0;
        if outline.rectangle().is_none()
            && let Some(tilted) = tilted_rectangle_of(outline.points, outline.unit_nm).filter(|t| !t.is_square())
        {
            sides = tilted.edges.map(|e| e * outline.unit_nm);
            off = tilted.edges_off() * outline.unit_nm;
        } else if let Some(circle) = circle_of(outline.points, outline.unit_nm) {
            // Corners of an odd number do not reach as far to both sides as the circle that they are on.
            sides = [circle.width() as f64 * outline.unit_nm; 2];
        }
        let [a, b] = sides;
        // Without area there is no width; that has its own rule.
        if outline.twice_area() == 0 {
            return;
        }
        if let Some(words) = self.wrong_within(a.min(b), a.max(b), off) {
            found.copies(outline.points, outline.placements, || words.clone());
        }
    }
}
