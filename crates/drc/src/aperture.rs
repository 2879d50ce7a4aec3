//! Openings in the metal against the lenses under them.

use ndarray::{ArrayView1, Axis};

use super::deck::Context;
use super::found::Found;
use super::polygon::{inside, point_segment, ring_of};
use super::rule::{Rule, Status};
use super::scene::Scene;
use metalith_core::document::{Limits, Section};
use metalith_gds::{LayerNumber, Point, Rect};

struct Aperture {
    layer: LayerNumber,
    want: Want,
}

#[derive(PartialEq)]
enum Want {
    /// Distance from the pillars of a lens to the metal [nm].
    Margin(f64),
    NoMetalOnPillars,
    /// One opening a lens, and no other.
    OneEach,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let want = match check {
        "aperture_margin" => Want::Margin(s.float("nm", Limits::new(0.0..=1e9, "nm"))),
        "metal_on_pillars" => Want::NoMetalOnPillars,
        "aperture_each" => Want::OneEach,
        _ => return None,
    };
    Some(Box::new(Aperture {
        layer: context.layer(s, "layer"),
        want,
    }))
}

/// Corners of the outermost pillars of each row and each column: their hull is that of the lens.
fn rim(scene: &Scene<'_>, element: usize) -> Vec<Point> {
    let widths = &scene.elements[element].widths.width_nm;
    let ends = |line: ArrayView1<'_, u16>| {
        let first = line.iter().position(|&w| w != 0);
        let last = line.iter().rposition(|&w| w != 0);
        first.into_iter().chain(last)
    };
    let rows = widths.outer_iter().enumerate();
    let columns = widths.axis_iter(Axis(1)).enumerate();
    let at_ends = rows
        .flat_map(|(row, line)| ends(line).map(move |column| (row, column)))
        .chain(columns.flat_map(|(column, line)| ends(line).map(move |row| (row, column))));
    at_ends
        .flat_map(|(row, column)| {
            let [a, b, c, d, _] = ring_of(&scene.pillar(element, row, column));
            [a, b, c, d]
        })
        .collect()
}

impl Rule for Aperture {
    fn words(&self) -> String {
        match self.want {
            Want::Margin(nm) => format!("metal at least {nm} nm from the pillars of a lens"),
            Want::NoMetalOnPillars => "every pillar stands in an opening of the metal".into(),
            Want::OneEach => "one opening for each lens, and no other".into(),
        }
    }

    fn judge(&mut self, scene: &Scene<'_>, found: &mut Found) -> Status {
        let openings: Vec<Vec<Point>> = match scene.loose(self.layer) {
            Some(loose) => {
                let rects = (0..loose.rects.len()).map(|k| ring_of(&loose.rect(k)).to_vec());
                rects.chain(loose.polygons.iter().map(|p| p.to_vec())).collect()
            }
            None => return Status::Skipped(format!("no opening on layer {}: give its file with --with", self.layer)),
        };
        if scene.elements.is_empty() {
            return Status::Skipped(format!(
                "{}: give the file of the pillars with --with",
                scene.no_elements
            ));
        }
        let mut uses = vec![0u32; openings.len()];
        for element in 0..scene.elements.len() {
            let rim = rim(scene, element);
            let centre = scene.elements[element]
                .site
                .centre_nm
                .map(|c| scene.units(c as f64).round() as i64);
            let round = Rect::around(&rim);
            let holds = |opening: &Vec<Point>| inside(opening, Point::new(centre[0], centre[1]));
            let mine: Vec<usize> = (0..openings.len()).filter(|&k| holds(&openings[k])).collect();
            mine.iter().for_each(|&k| uses[k] += 1);
            let name = &scene.elements[element].site.name;
            let covered = |&&p: &&Point| !mine.iter().any(|&k| inside(&openings[k], p));
            let outside = rim.iter().filter(covered).count();
            match self.want {
                Want::OneEach if mine.len() > 1 => {
                    found.rect(&round, || format!("{} openings over {name}", mine.len()));
                }
                Want::NoMetalOnPillars if outside > 0 => {
                    found.rect(&round, || format!("metal on the pillars of {name}"));
                }
                // Where metal is on pillars, that rule says so.
                Want::Margin(nm) if outside == 0 && !mine.is_empty() => {
                    let nearest = mine
                        .iter()
                        .flat_map(|&k| openings[k].windows(2))
                        .flat_map(|s| rim.iter().map(move |&p| point_segment(p, s[0], s[1])))
                        .fold(f64::INFINITY, f64::min)
                        * scene.unit_nm;
                    if nearest < nm - 1e-6 {
                        found.rect(&round, || format!("metal {nearest:.0} nm from the pillars of {name}"));
                    }
                }
                _ => {}
            }
        }
        if self.want == Want::NoMetalOnPillars {
            for r in scene.loose(scene.pillars).iter().flat_map(|l| l.bounds()) {
                let open = |opening: &Vec<Point>| ring_of(&r).iter().all(|&p| inside(opening, p));
                if !openings.iter().any(open) {
                    found.rect(&r, || "metal on a shape of the pillar layer".into());
                }
            }
        }
        if self.want == Want::OneEach {
            for (opening, _) in openings.iter().zip(&uses).filter(|(_, uses)| **uses == 0) {
                found.at(opening, || "an opening over no lens".into());
            }
        }
        Status::Run
    }
}
