//! Rules of how outlines are drawn: squares, right angles, no crossings, no needless or doubled vertices.

use super::context::Context;
use super::drawn_outline::DrawnOutline;
use super::findings::Findings;
use super::rule::Rule;
use super::tolerance::ROUNDING_DEG;
use metalith_core::document::{Limits, Section};
use metalith_gds::{LayerNumber, are_of_square, circle_of, grid_step, tilted_rectangle_of};
use metalith_report::exact;

#[derive(Clone, Copy, PartialEq)]
enum OutlineCheck {
    Square,
    Circle,
    /// Rectangle at any angle.
    Rectangle,
    Manhattan,
    /// Sharpest angle (degrees).
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

struct OutlineRule {
    layers: Vec<LayerNumber>,
    form: OutlineCheck,
    /// True, for each of the layers, if a more serious rule of the deck checks it too: crossing, acute, area.
    more_serious: Vec<[bool; 3]>,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, context: &Context) -> Option<Box<dyn Rule>> {
    let form = match check {
        "square" => OutlineCheck::Square,
        "circle" => OutlineCheck::Circle,
        "rectangle" => OutlineCheck::Rectangle,
        "manhattan" => OutlineCheck::Manhattan,
        "acute_angle" => OutlineCheck::Angle(s.float("min_deg", Limits::new(1.0..=179.0, "degrees"))),
        "self_crossing" => OutlineCheck::NoCrossing,
        "doubled_vertex" => OutlineCheck::NoDoubled,
        "collinear_vertex" => OutlineCheck::NoCollinear,
        "zero_area" => OutlineCheck::Area,
        "winding" => {
            OutlineCheck::Winding(s.choice("direction", &[("counter_clockwise", true), ("clockwise", false)], None))
        }
        "vertices_max" => OutlineCheck::Vertices(s.integer("count", 4..=8191, "vertices")),
        "closed" => OutlineCheck::Closed,
        _ => return None,
    };
    let layers = context.some_layers(s);
    let more_serious = layers
        .iter()
        .map(|&l| ["self_crossing", "acute_angle", "zero_area"].map(|c| context.covers(c, l)))
        .collect();
    Some(Box::new(OutlineRule {
        layers,
        form,
        more_serious,
    }))
}

impl OutlineRule {
    /// True if a more serious rule reports this outline: each defect has one name. The rule that says that pillars are
    /// squares reports every outline that is not a square, whatever else is wrong with it.
    fn reported_elsewhere(&self, outline: &DrawnOutline<'_>) -> bool {
        let k = self.layers.iter().position(|&l| l == outline.layer).unwrap_or(0);
        let [crossing, acute, area] = self.more_serious[k];
        if area && self.form != OutlineCheck::Area && outline.twice_area() == 0 {
            return true;
        }
        let shape = matches!(
            self.form,
            OutlineCheck::Manhattan | OutlineCheck::Angle(_) | OutlineCheck::Winding(_)
        );
        if crossing && shape && outline.crosses_itself() {
            return true;
        }
        acute && self.form == OutlineCheck::Manhattan && outline.sharpest_deg() < 90.0 - ROUNDING_DEG
    }

    fn wrong(&self, outline: &DrawnOutline<'_>) -> Option<String> {
        let points = outline.points;
        match self.form {
            OutlineCheck::Square => {
                let nm = |v: i64| v as f64 * outline.unit_nm;
                match outline.rectangle() {
                    Some(r) if are_of_square([r.width(), r.height()], grid_step(outline.unit_nm)) => None,
                    Some(r) => Some(format!(
                        "{} by {} nm is not square",
                        exact(nm(r.width())),
                        exact(nm(r.height()))
                    )),
                    None => Some("not a square".into()),
                }
            }
            OutlineCheck::Circle => circle_of(points, outline.unit_nm)
                .is_none()
                .then(|| "not a circle".into()),
            OutlineCheck::Rectangle => tilted_rectangle_of(points, outline.unit_nm)
                .is_none()
                .then(|| "not a rectangle".into()),
            OutlineCheck::Manhattan => (!outline.is_manhattan()).then(|| "a side that is not along an axis".into()),
            OutlineCheck::Angle(min) => {
                let sharpest = outline.sharpest_deg();
                (sharpest < min - ROUNDING_DEG).then(|| format!("an angle of {sharpest:.2} degrees, at least {min}"))
            }
            OutlineCheck::NoCrossing => outline.crosses_itself().then(|| "the outline crosses itself".into()),
            OutlineCheck::NoDoubled => {
                let doubled = points.windows(2).filter(|w| w[0] == w[1]).count();
                (doubled > 0).then(|| format!("{} on the one before", vertices(doubled)))
            }
            OutlineCheck::NoCollinear => {
                let distinct = points.windows(2).filter(|w| w[0] != w[1]).count() + 1;
                let needless = distinct.saturating_sub(outline.corners().len());
                (needless > 0 && points.first() == points.last())
                    .then(|| format!("{} on a straight edge", vertices(needless)))
            }
            OutlineCheck::Area => (outline.twice_area() == 0).then(|| "no area".into()),
            OutlineCheck::Winding(counter_clockwise) => {
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
            OutlineCheck::Vertices(most) => {
                let count = points.len();
                (count as i64 > most).then(|| format!("{count} vertices, at most {most}"))
            }
            OutlineCheck::Closed => {
                (points.first() != points.last()).then(|| "the last vertex is not the first".into())
            }
        }
    }
}

impl Rule for OutlineRule {
    fn words(&self) -> String {
        match self.form {
            OutlineCheck::Square => "pillars are squares".into(),
            OutlineCheck::Circle => "pillars are circles".into(),
            OutlineCheck::Rectangle => "pillars are rectangles, at any angle".into(),
            OutlineCheck::Manhattan => "sides are along the axes".into(),
            OutlineCheck::Angle(min) => format!("no angle sharper than {min} degrees"),
            OutlineCheck::NoCrossing => "no outline crosses itself".into(),
            OutlineCheck::NoDoubled => "no vertex twice in a row".into(),
            OutlineCheck::NoCollinear => "no vertex between its neighbours".into(),
            OutlineCheck::Area => "every outline has area".into(),
            OutlineCheck::Winding(true) => "outlines are drawn counter-clockwise".into(),
            OutlineCheck::Winding(false) => "outlines are drawn clockwise".into(),
            OutlineCheck::Vertices(most) => format!("at most {most} vertices an outline"),
            OutlineCheck::Closed => "outlines end where they begin".into(),
        }
    }

    fn outlines(&self) -> &[LayerNumber] {
        &self.layers
    }

    fn passes_square(&self, _width_nm: f64, clockwise: bool) -> bool {
        match self.form {
            OutlineCheck::Winding(counter_clockwise) => clockwise != counter_clockwise,
            OutlineCheck::Vertices(most) => most >= 5,
            OutlineCheck::Circle => false,
            _ => true,
        }
    }

    fn outline(&self, outline: &DrawnOutline<'_>, found: &mut Findings) {
        // A path has no vertices of its own outline in the file.
        let path = outline.kind == metalith_gds::ShapeKind::Path;
        let of_file = matches!(
            self.form,
            OutlineCheck::NoDoubled
                | OutlineCheck::NoCollinear
                | OutlineCheck::Winding(_)
                | OutlineCheck::Vertices(_)
                | OutlineCheck::Closed
        );
        if (path && of_file) || self.reported_elsewhere(outline) {
            return;
        }
        if let Some(words) = self.wrong(outline) {
            found.copies(outline.points, outline.placements, || words.clone());
        }
    }
}

/// A number of vertices in words.
fn vertices(number: usize) -> String {
    match number {
        1 => "1 vertex".into(),
        _ => format!("{number} vertices"),
    }
}
