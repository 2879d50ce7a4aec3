//! Openings in the metal against the lenses under them.

use super::body::Body;
use super::context::Context;
use super::findings::Findings;
use super::flat_layout::{FlatLayout, LooseShapes};
use super::polygon::{point_segment, ring_of};
use super::rule::{NotRun, Rule, RuleOutcome};
use super::tolerance::EQUAL_NM;
use super::work::Stop;
use metalith_core::document::{Limits, Section};
use metalith_gds::{LayerNumber, Point, Rect};
use metalith_pillars::PillarRows;

struct ApertureRule {
    layer: LayerNumber,
    want: OpeningRule,
}

#[derive(PartialEq)]
enum OpeningRule {
    /// Distance from the pillars of a lens to the metal (nm).
    Margin(f64),
    NoMetalOnPillars,
    /// One opening a lens, and no other.
    OneEach,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let want = match check {
        "aperture_margin" => OpeningRule::Margin(s.float("nm", Limits::new(0.0..=1e9, "nm"))),
        "metal_on_pillars" => OpeningRule::NoMetalOnPillars,
        "aperture_each" => OpeningRule::OneEach,
        _ => return None,
    };
    Some(Box::new(ApertureRule {
        layer: context.layer(s, "layer"),
        want,
    }))
}

/// Corners of the outermost pillars of each row and each column: their hull is that of the lens.
fn rim(flat: &FlatLayout<'_>, element: usize) -> Vec<Point> {
    let widths = &flat.elements[element].widths;
    let n = widths.lattice().sites();
    let mut at_ends = Vec::new();
    let mut of_columns: Vec<Option<(usize, usize)>> = vec![None; n];
    let mut room = Vec::new();
    for row in 0..n {
        let line = widths.row(row, 0..n, &mut room);
        let ends = [line.iter().position(|&w| w != 0), line.iter().rposition(|&w| w != 0)];
        at_ends.extend(ends.into_iter().flatten().map(|column| (row, column)));
        for (ends, _) in of_columns.iter_mut().zip(line).filter(|(_, w)| **w != 0) {
            ends.get_or_insert((row, row)).1 = row;
        }
    }
    for (column, (first, last)) in of_columns
        .iter()
        .enumerate()
        .filter_map(|(k, ends)| Some((k, (*ends)?)))
    {
        at_ends.extend([(first, column), (last, column)]);
    }
    at_ends
        .into_iter()
        .flat_map(|(row, column)| {
            let [a, b, c, d, _] = match flat.body(element, row, column) {
                Body::Tilted(ring) => ring,
                other => ring_of(&other.bounds()),
            };
            [a, b, c, d]
        })
        .collect()
}

impl Rule for ApertureRule {
    fn words(&self) -> String {
        match self.want {
            OpeningRule::Margin(nm) => format!("metal at least {nm} nm from the pillars of a lens"),
            OpeningRule::NoMetalOnPillars => "every pillar stands in an opening of the metal".into(),
            OpeningRule::OneEach => "one opening for each lens, and no other".into(),
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let Some(openings) = flat.loose(self.layer) else {
            return Err(NotRun::Skipped(format!(
                "no opening on layer {}: give its file with --with",
                self.layer
            )));
        };
        if flat.elements.is_empty() {
            return Err(NotRun::Skipped(format!(
                "{}: give the file of the pillars with --with",
                flat.no_elements
            )));
        }
        let mut uses = vec![0u32; openings.len() as usize];
        for element in 0..flat.elements.len() {
            let over = over_centre(flat, openings, element)?;
            over.iter().for_each(|&k| uses[k] += 1);
            self.judge_element(flat, openings, element, &over, found)?;
        }
        match self.want {
            OpeningRule::NoMetalOnPillars => metal_on_others(flat, openings, found),
            OpeningRule::OneEach => {
                for (opening, _) in openings.bodies().zip(&uses).filter(|(_, uses)| **uses == 0) {
                    found.at(&opening.ring(), || "an opening over no lens".into());
                }
                Ok(())
            }
            OpeningRule::Margin(_) => Ok(()),
        }
    }
}

/// Openings that the centre of an element lies in.
fn over_centre(flat: &FlatLayout<'_>, openings: &LooseShapes, element: usize) -> Result<Vec<usize>, Stop> {
    let [x, y] = flat.elements[element]
        .site
        .centre_nm
        .map(|c| flat.units(c as f64).round() as i64);
    let mut over = Vec::new();
    for (k, opening) in openings.bodies().enumerate() {
        flat.work.spend(1 + opening.sides())?;
        if opening.holds(Point::new(x, y)) {
            over.push(k);
        }
    }
    Ok(over)
}

impl ApertureRule {
    fn judge_element(
        &self,
        flat: &FlatLayout<'_>,
        openings: &LooseShapes,
        element: usize,
        over: &[usize],
        found: &mut Findings,
    ) -> RuleOutcome {
        let rim = rim(flat, element);
        let round = Rect::around(&rim);
        let name = &flat.elements[element].site.name;
        if self.want == OpeningRule::OneEach {
            if over.len() > 1 {
                found.rect(&round, || format!("{} openings over {name}", over.len()));
            }
            return Ok(());
        }
        let sides: u64 = over.iter().map(|&k| openings.body(k).sides()).sum();
        flat.work.spend((rim.len() as u64).saturating_mul(sides))?;
        let covered = |&&p: &&Point| !over.iter().any(|&k| openings.body(k).holds(p));
        let outside = rim.iter().filter(covered).count();
        match self.want {
            OpeningRule::NoMetalOnPillars if outside > 0 => {
                found.rect(&round, || format!("metal on the pillars of {name}"));
            }
            // Where metal is on pillars, that rule says so.
            OpeningRule::Margin(nm) if outside == 0 && !over.is_empty() => {
                let mut nearest = f64::INFINITY;
                for opening in over.iter().map(|&k| openings.body(k).ring()) {
                    for (s, &p) in opening.windows(2).flat_map(|s| rim.iter().map(move |p| (s, p))) {
                        nearest = nearest.min(point_segment(p, s[0], s[1]));
                    }
                }
                let nearest = nearest * flat.unit_nm;
                if nearest < nm - EQUAL_NM {
                    found.rect(&round, || format!("metal {nearest:.0} nm from the pillars of {name}"));
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Metal on shapes of the pillar layer that belong to no element.
fn metal_on_others(flat: &FlatLayout<'_>, openings: &LooseShapes, found: &mut Findings) -> RuleOutcome {
    for r in flat.loose(flat.pillars).iter().flat_map(|l| l.bounds()) {
        let mut open = false;
        for opening in openings.bodies() {
            flat.work.spend(1 + opening.sides())?;
            if ring_of(&r).iter().all(|&p| opening.holds(p)) {
                open = true;
                break;
            }
        }
        if !open {
            found.rect(&r, || "metal on a shape of the pillar layer".into());
        }
    }
    Ok(())
}
