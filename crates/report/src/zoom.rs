//! Real pillars, seen from above.

use svg::node::element::{Group, Path, SVG};

use super::axis::Axis;
use super::figure::{Figure, Frame, scale_bar};
use metalith_pillars::{OutlineForm, PillarId, PillarMap, PillarShape};

/// More pillars an axis than this would be dust.
const MOST: f64 = 80.0;

/// A cut-out of an element, each pillar at its true place, in its true size.
#[derive(Clone, Debug)]
pub struct PillarZoom {
    title: String,
    /// Middle of each in the drawing (nm), and its width (nm) or number.
    pillars: Vec<([i64; 2], u16)>,
    shape: PillarShape,
    centre_um: (f64, f64),
    span_um: f64,
    side: f64,
}

impl PillarZoom {
    /// Pillars of `map` in a square of `span_um` about a place counted from the element's centre (um).
    /// The span is held to 80 pitches, so that pillars can be seen.
    pub fn new(title: impl Into<String>, map: &PillarMap, centre_um: (f64, f64), span_um: f64) -> Self {
        let lattice = map.lattice;
        let span_um = span_um.clamp(lattice.pitch_um(), MOST * lattice.pitch_um());
        let half = (span_um + lattice.pitch_um()) / 2.0;
        let near = |axis: usize, centre: f64| {
            (0..lattice.sites()).filter(move |&i| (lattice.place_um(axis, i) - centre).abs() <= half)
        };
        let mut pillars = Vec::new();
        let origin = (nm(centre_um.0), nm(centre_um.1));
        for iy in near(1, centre_um.1) {
            for ix in near(0, centre_um.0) {
                let width = map.number[[iy, ix]];
                if width == 0 {
                    continue;
                }
                // The drawing counts nanometres from its middle, y downwards.
                let (x, y) = (lattice.whole_nm(0, ix) - origin.0, origin.1 - lattice.whole_nm(1, iy));
                pillars.push(([x, y], width));
            }
        }
        Self {
            title: title.into(),
            pillars,
            shape: PillarShape::default(),
            centre_um,
            span_um,
            side: 380.0,
        }
    }

    /// Draw pillars of this shape; squares else.
    #[must_use]
    pub fn shape(mut self, shape: PillarShape) -> Self {
        self.shape = shape;
        self
    }

    /// The outlines of all pillars as one path.
    fn outlines(&self) -> String {
        let outline = |([cx, cy], number): &([i64; 2], u16)| {
            let (shape, PillarId(number)) = self.shape.of_pillar(PillarId(*number));
            let width = i64::from(number);
            let (x, y) = (cx - width / 2, cy - width / 2);
            match shape.outline() {
                OutlineForm::Square => format!("M{x} {y}h{width}v{width}h-{width}z"),
                OutlineForm::Circle => {
                    let (radius, middle) = (width as f64 / 2.0, y as f64 + width as f64 / 2.0);
                    format!("M{x} {middle}a{radius} {radius} 0 1 0 {width} 0a{radius} {radius} 0 1 0 -{width} 0z")
                }
                OutlineForm::Polygon | OutlineForm::Mixed => {
                    let corners = shape.corners(PillarId(number), 0.0).into_iter();
                    let corners = corners.map(|(x, y)| format!("{} {}", cx + x, cy - y));
                    format!("M{}z", corners.collect::<Vec<_>>().join("L"))
                }
            }
        };
        self.pillars.iter().map(outline).collect()
    }

    /// Width of the square in the drawing; 380 else.
    #[must_use]
    pub fn side(mut self, side: f64) -> Self {
        self.side = side.max(100.0);
        self
    }
}

fn nm(um: f64) -> i64 {
    (um * 1e3).round() as i64
}

impl From<PillarZoom> for Figure {
    fn from(zoom: PillarZoom) -> Self {
        let frame = Frame {
            left: 66.0,
            top: 12.0,
            right: 66.0 + zoom.side,
            bottom: 12.0 + zoom.side,
        };
        let half = zoom.span_um / 2.0;
        let (cx, cy) = zoom.centre_um;
        let x = Axis::linear("x", "um").range(cx - half, cx + half);
        let y = Axis::linear("y", "um").range(cy - half, cy + half);
        let x = x.fit([], frame.left, frame.right, false);
        let y = y.fit([], frame.bottom, frame.top, false);
        let span_nm = nm(zoom.span_um);
        let squares = SVG::new()
            .set("x", frame.left)
            .set("y", frame.top)
            .set("width", zoom.side)
            .set("height", zoom.side)
            .set("viewBox", (-span_nm / 2, -span_nm / 2, span_nm, span_nm))
            .add(Path::new().set("class", "pillar").set("d", zoom.outlines()));
        let um_per_unit = zoom.span_um / zoom.side;
        let bar = scale_bar(frame.left, frame.bottom + 46.0, zoom.side / 4.0, um_per_unit, "ink");
        let words = format!(
            "{} pillars to scale; {}, {}.",
            super::count(zoom.pillars.len() as u64),
            x.words(),
            y.words()
        );
        let drawing = Group::new().add(squares).add(frame.axes(&x, &y, false)).add(bar);
        Figure::new(zoom.side + 84.0, zoom.side + 70.0, &zoom.title, &words, drawing)
    }
}
