//! How outlines are drawn: squares, right angles, no crossings, no needless or doubled vertices.

use super::deck::Context;
use super::found::Found;
use super::polygon::Outline;
use super::rule::Rule;
use metalith_core::document::{Limits, Section};
use metalith_gds::LayerNumber;

#[derive(Clone, Copy, PartialEq)]
enum Want {
    Square,
    Manhattan,
    /// Sharpest angle [degrees].
    Angle(f64),
    NoCrossing,
    NoDoubled,
    NoCollinear,
    Area,
    /// Counter-clockwise, or clockwise.
    Winding(bool),
    /// Most vertices, the closing one counted.
    Vertices(i64),
    /// The last vertex repeats the first.
    Closed,
}

struct Drawn {
    layers: Vec<LayerNumber>,
    want: Want,
    /// Whether a graver rule of the deck looks at each of the layers too: crossing, acute, area, Manhattan.
    graver: Vec<[bool; 4]>,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let want = match check {
        "square" => Want::Square,
        "manhattan" => Want::Manhattan,
        "acute_angle" => Want::Angle(s.float("min_deg", Limits::new(1.0..=179.0, "degrees"))),
        "self_crossing" => Want::NoCrossing,
        "doubled_vertex" => Want::NoDoubled,
        "collinear_vertex" => Want::NoCollinear,
        "zero_area" => Want::Area,
        "winding" => Want::Winding(s.choice("direction", &[("counter_clockwise", true), ("clockwise", false)], None)),
        "vertices_max" => Want::Vertices(s.integer("count", 4..=8191, "vertices")),
        "closed" => Want::Closed,
        _ => return None,
    };
    let layers = context.some_layers(s);
    let graver = layers
        .iter()
        .map(|&l| ["self_crossing", "acute_angle", "zero_area", "manhattan"].map(|c| context.covers(c, l)))
        .collect();
    Some(Box::new(Drawn { layers, want, graver }))
}

impl Drawn {
    /// Whether a graver rule reports this outline: each defect has one name.
    fn reported_elsewhere(&self, outline: &Outline<'_>) -> bool {
        let k = self.layers.iter().position(|&l| l == outline.layer).unwrap_or(0);
        let [crossing, acute, area, manhattan] = self.graver[k];
        if area && self.want != Want::Area && outline.twice_area() == 0 {
            return true;
        }
        let shape = matches!(
            self.want,
            Want::Square | Want::Manhattan | Want::Angle(_) | Want::Winding(_)
        );
        if crossing && shape && outline.crosses_itself() {
            return true;
        }
        let angles = matches!(self.want, Want::Square | Want::Manhattan);
        if acute && angles && outline.sharpest_deg() < 90.0 - 1e-9 {
            return true;
        }
        manhattan && self.want == Want::Square && !outline.is_manhattan()
    }

    fn wrong(&self, outline: &Outline<'_>) -> Option<String> {
        let points = outline.points;
        match self.want {
            Want::Square => {
                let nm = |v: i64| v as f64 * outline.unit_nm;
                match outline.rectangle() {
                    Some(r) if r.width() == r.height() => None,
                    Some(r) => Some(format!("{} by {} nm is not square", nm(r.width()), nm(r.height()))),
                    None => Some("not a square".into()),
                }
            }
            Want::Manhattan => (!outline.is_manhattan()).then(|| "a side that is not along an axis".into()),
            Want::Angle(min) => {
                let sharpest = outline.sharpest_deg();
                (sharpest < min - 1e-9).then(|| format!("an angle of {sharpest:.2} degrees, at least {min}"))
            }
            Want::NoCrossing => outline.crosses_itself().then(|| "the outline crosses itself".into()),
            Want::NoDoubled => {
                let doubled = points.windows(2).filter(|w| w[0] == w[1]).count();
                (doubled > 0).then(|| format!("{doubled} vertices on the one before"))
            }
            Want::NoCollinear => {
                let distinct = points.windows(2).filter(|w| w[0] != w[1]).count() + 1;
                let needless = distinct.saturating_sub(outline.corners().len());
                (needless > 0 && points.first() == points.last())
                    .then(|| format!("{needless} vertices on the way between their neighbours"))
            }
            Want::Area => (outline.twice_area() == 0).then(|| "no area".into()),
            Want::Winding(counter_clockwise) => {
                let wrong = (outline.twice_area() > 0) != counter_clockwise;
                wrong.then(|| {
                    if counter_clockwise {
                        "drawn clockwise"
                    } else {
                        "drawn counter-clockwise"
                    }
                    .into()
                })
            }
            Want::Vertices(most) => {
                let count = points.len();
                (count as i64 > most).then(|| format!("{count} vertices, at most {most}"))
            }
            Want::Closed => (points.first() != points.last()).then(|| "the last vertex is not the first".into()),
        }
    }
}

impl Rule for Drawn {
    fn words(&self) -> String {
        match self.want {
            Want::Square => "pillars are squares".into(),
            Want::Manhattan => "sides are along the axes".into(),
            Want::Angle(min) => format!("no angle sharper than {min} degrees"),
            Want::NoCrossing => "no outline crosses itself".into(),
            Want::NoDoubled => "no vertex twice in a row".into(),
            Want::NoCollinear => "no vertex between its neighbours".into(),
            Want::Area => "every outline has area".into(),
            Want::Winding(true) => "outlines are drawn counter-clockwise".into(),
            Want::Winding(false) => "outlines are drawn clockwise".into(),
            Want::Vertices(most) => format!("at most {most} vertices an outline"),
            Want::Closed => "outlines end where they begin".into(),
        }
    }

    fn outlines(&self) -> &[LayerNumber] {
        &self.layers
    }

    fn passes_square(&self, _width_nm: f64, clockwise: bool) -> bool {
        match self.want {
            Want::Winding(counter_clockwise) => clockwise != counter_clockwise,
            Want::Vertices(most) => most >= 5,
            _ => true,
        }
    }

    fn outline(&mut self, outline: &Outline<'_>, found: &mut Found) {
        // A path has no vertices of its own outline in the file.
        let path = outline.kind == metalith_gds::ShapeKind::Path;
        let of_file = matches!(
            self.want,
            Want::NoDoubled | Want::NoCollinear | Want::Winding(_) | Want::Vertices(_) | Want::Closed
        );
        if (path && of_file) || self.reported_elsewhere(outline) {
            return;
        }
        if let Some(words) = self.wrong(outline) {
            found.copies(outline.points, outline.placements, || words.clone());
        }
    }
}
