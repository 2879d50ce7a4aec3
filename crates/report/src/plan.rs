//! Shapes of a layout, to scale.

use svg::node::element::{Circle, Group};

use super::axis::Axis;
use super::colour::SERIES;
use super::figure::{Anchor, Figure, Frame, line, rectangle, scale_bar, strokes, text};
use super::number::short;
use metalith_core::cross_corners;

/// A layer of a [`Plan`], made by [`Plan::layer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanLayer(usize);

/// Shapes of a layout to scale, y upwards, in um.
#[derive(Clone, Debug)]
pub struct Plan {
    title: String,
    layers: Vec<(String, Fill)>,
    shapes: Vec<(usize, PlanShape)>,
    labels: Vec<(f64, f64, String)>,
    reached: Vec<(f64, f64)>,
    width: f64,
}

#[derive(Clone, Copy, Debug)]
enum Fill {
    Area,
    Outline,
    Solid,
}

#[derive(Clone, Debug)]
enum PlanShape {
    Circle([f64; 3]),
    Polygon(Vec<(f64, f64)>),
}

impl Plan {
    /// An empty plan.
    pub fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            layers: Vec::new(),
            shapes: Vec::new(),
            labels: Vec::new(),
            reached: Vec::new(),
            width: 620.0,
        }
    }

    fn add_layer(&mut self, name: impl Into<String>, fill: Fill) -> PlanLayer {
        self.layers.push((name.into(), fill));
        PlanLayer(self.layers.len() - 1)
    }

    /// A layer drawn as tinted areas.
    pub fn layer(&mut self, name: impl Into<String>) -> PlanLayer {
        self.add_layer(name, Fill::Area)
    }

    /// A layer drawn as lines only: outlines, fields, keep-outs.
    pub fn outlines(&mut self, name: impl Into<String>) -> PlanLayer {
        self.add_layer(name, Fill::Outline)
    }

    /// A layer drawn in full colour: marks and small things.
    pub fn solid(&mut self, name: impl Into<String>) -> PlanLayer {
        self.add_layer(name, Fill::Solid)
    }

    /// A disc: centre and radius (um).
    pub fn circle(&mut self, layer: PlanLayer, x_um: f64, y_um: f64, radius_um: f64) -> &mut Self {
        self.shapes.push((layer.0, PlanShape::Circle([x_um, y_um, radius_um])));
        self
    }

    /// A closed polygon of `(x, y)` (um).
    pub fn polygon(&mut self, layer: PlanLayer, points_um: impl IntoIterator<Item = (f64, f64)>) -> &mut Self {
        self.shapes
            .push((layer.0, PlanShape::Polygon(points_um.into_iter().collect())));
        self
    }

    /// A rectangle between two corners (um).
    pub fn rectangle(&mut self, layer: PlanLayer, (x0, y0): (f64, f64), (x1, y1): (f64, f64)) -> &mut Self {
        self.polygon(layer, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    }

    /// An upright cross: centre, length and width of its arms (um).
    pub fn cross(&mut self, layer: PlanLayer, (x, y): (f64, f64), length_um: f64, width_um: f64) -> &mut Self {
        let corners = cross_corners(length_um / 2.0, width_um / 2.0);
        self.polygon(layer, corners.map(|(a, b)| (x + a, y + b)))
    }

    /// A few words in the middle of a place (um).
    pub fn label(&mut self, x_um: f64, y_um: f64, words: impl Into<String>) -> &mut Self {
        self.labels.push((x_um, y_um, words.into()));
        self
    }

    /// Make the frame reach to a place where nothing is drawn (um), such as that of a label.
    pub fn reach(&mut self, x_um: f64, y_um: f64) -> &mut Self {
        self.reached.push((x_um, y_um));
        self
    }

    /// Width of the drawing; 620 else.
    #[must_use]
    pub fn width(mut self, width: f64) -> Self {
        self.width = width.max(240.0);
        self
    }

    /// Bounding box of all shapes (um), with a little air.
    fn extent(&self) -> [f64; 4] {
        let mut e = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let mut take = |x: f64, y: f64| {
            if x.is_finite() && y.is_finite() {
                e = [e[0].min(x), e[1].min(y), e[2].max(x), e[3].max(y)];
            }
        };
        for (_, shape) in &self.shapes {
            match shape {
                PlanShape::Circle([x, y, r]) => {
                    take(x - r, y - r);
                    take(x + r, y + r);
                }
                PlanShape::Polygon(points) => points.iter().for_each(|&(x, y)| take(x, y)),
            }
        }
        self.reached.iter().for_each(|&(x, y)| take(x, y));
        if e[0] > e[2] {
            e = [0.0, 0.0, 1.0, 1.0];
        }
        let air = 0.03 * (e[2] - e[0]).max(e[3] - e[1]).max(1e-3);
        [e[0] - air, e[1] - air, e[2] + air, e[3] + air]
    }
}

fn class(fill: Fill, layer: usize) -> String {
    let colour = layer % SERIES;
    match fill {
        Fill::Area => format!("area plain f{colour} c{colour}"),
        Fill::Outline => format!("outline c{colour}"),
        Fill::Solid => format!("solid plain f{colour} c{colour}"),
    }
}

impl From<Plan> for Figure {
    fn from(plan: Plan) -> Self {
        let [x0, y0, x1, y1] = plan.extent();
        let mut legend = Vec::new();
        let (mut left, mut row) = (66.0, 0.0);
        for (i, (name, _)) in plan.layers.iter().enumerate() {
            let need = 38.0 + 6.9 * name.chars().count() as f64;
            if left + need > plan.width && left > 66.0 {
                (left, row) = (66.0, row + 1.0);
            }
            legend.push((i, left, row));
            left += need;
        }
        let top = if legend.is_empty() { 12.0 } else { 30.0 + 19.0 * row };
        let across = plan.width - 66.0 - 14.0;
        let tall = (across * (y1 - y0) / (x1 - x0)).clamp(40.0, 900.0);
        // One scale for both axes: a tall plan is drawn narrower.
        let scale = (across / (x1 - x0)).min(tall / (y1 - y0));
        let frame = Frame {
            left: 66.0,
            top,
            right: 66.0 + scale * (x1 - x0),
            bottom: top + scale * (y1 - y0),
        };
        let x = Axis::linear("x", "um")
            .range(x0, x1)
            .fit([], frame.left, frame.right, false);
        let y = Axis::linear("y", "um")
            .range(y0, y1)
            .fit([], frame.bottom, frame.top, false);
        let at = |a: f64, b: f64| Some((x.place(a)?, y.place(b)?));
        let mut drawing = Group::new().add(frame.axes(&x, &y, false));
        for (layer, (_, fill)) in plan.layers.iter().enumerate() {
            for (_, shape) in plan.shapes.iter().filter(|s| s.0 == layer) {
                drawing = match shape {
                    PlanShape::Circle([cx, cy, r]) => {
                        let Some((px, py)) = at(*cx, *cy) else { continue };
                        let circle = Circle::new()
                            .set("cx", short(px))
                            .set("cy", short(py))
                            .set("r", short(r * scale));
                        drawing.add(circle.set("class", class(*fill, layer)))
                    }
                    PlanShape::Polygon(points) => {
                        let first = points.first().copied();
                        let closed = points.iter().copied().chain(first).map(|(a, b)| at(a, b));
                        drawing.add(strokes(closed, &class(*fill, layer)))
                    }
                };
            }
        }
        for (a, b, words) in &plan.labels {
            let Some((px, py)) = at(*a, *b) else { continue };
            drawing = drawing.add(text(px, py + 4.0, Anchor::Middle, words.as_str()).set("class", "halo"));
        }
        for (i, left, row) in legend {
            let (name, fill) = &plan.layers[i];
            let middle = 14.0 + 19.0 * row;
            drawing = drawing
                .add(rectangle(left, middle - 6.0, 20.0, 12.0, &class(*fill, i)))
                .add(text(left + 26.0, middle + 4.0, Anchor::Start, name.as_str()));
        }
        // Below the frame: inside it would hide what is drawn there.
        let bar = scale_bar(frame.left, frame.bottom + 46.0, frame.width() / 4.0, 1.0 / scale, "ink");
        let frame_line = line(frame.left, frame.bottom, frame.right, frame.bottom, "axis");
        let layers: Vec<_> = plan.layers.iter().map(|l| l.0.as_str()).collect();
        let words = format!(
            "{}, {}. Layers: {}. {} shapes.",
            x.words(),
            y.words(),
            layers.join(", "),
            super::count(plan.shapes.len() as u64)
        );
        let height = frame.bottom + 58.0;
        Figure::new(
            plan.width,
            height,
            &plan.title,
            &words,
            drawing.add(bar).add(frame_line),
        )
    }
}
