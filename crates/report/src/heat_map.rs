//! A matrix over two axes as colours.

use ndarray::Array2;
use svg::node::element::{Circle, Group};

use super::axis::{Axis, Fitted};
use super::colour::ColourMap;
use super::figure::{Anchor, Figure, Frame, clipped, line, picture, rectangle, strokes, text, text_width};
use super::number::short;
use super::raster::{self, Shading};

/// A matrix as a map of colours, with axes and a colour bar.
#[derive(Clone, Debug)]
pub struct HeatMap {
    title: String,
    values: Array2<f64>,
    x: (Axis, f64, f64),
    y: (Axis, f64, f64),
    scale: (String, String),
    range: Option<(f64, f64)>,
    logarithmic: bool,
    map: ColourMap,
    size: (f64, f64),
    to_scale: bool,
    contours: Vec<Vec<(f64, f64)>>,
    marks: Vec<(f64, f64, String)>,
}

impl HeatMap {
    /// The matrix, rows along y and columns along x; NaN is left open. Columns are centred on equal steps
    /// from `x.1` to `x.2`, rows likewise, the first row below.
    pub fn new(title: impl Into<String>, values: Array2<f64>, x: (Axis, f64, f64), y: (Axis, f64, f64)) -> Self {
        Self {
            title: title.into(),
            values,
            x,
            y,
            scale: (String::new(), String::new()),
            range: None,
            logarithmic: false,
            map: ColourMap::Sequential,
            size: (560.0, 400.0),
            to_scale: false,
            contours: Vec::new(),
            marks: Vec::new(),
        }
    }

    /// Name and unit of what the colours mean.
    #[must_use]
    pub fn values(mut self, name: impl Into<String>, unit: impl Into<String>) -> Self {
        self.scale = (name.into(), unit.into());
        self
    }

    /// Values at the ends of the colour bar; else those of the data.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// Colours by ratio instead of by difference.
    #[must_use]
    pub fn log(mut self) -> Self {
        self.logarithmic = true;
        self
    }

    /// Colours away from zero in both directions, the range made symmetric: for residuals.
    #[must_use]
    pub fn diverging(mut self) -> Self {
        self.map = ColourMap::Diverging;
        self
    }

    /// Colours that come round, for phases: give it the range of one turn.
    #[must_use]
    pub fn cyclic(mut self) -> Self {
        self.map = ColourMap::Cyclic;
        self
    }

    /// Equal lengths along both axes, for maps of a place: the height follows from the width.
    #[must_use]
    pub fn to_scale(mut self) -> Self {
        self.to_scale = true;
        self
    }

    /// Width and height of the drawing; 560 by 400 else.
    #[must_use]
    pub fn size(mut self, width: f64, height: f64) -> Self {
        self.size = (width.max(240.0), height.max(160.0));
        self
    }

    /// A line over the map, in the units of the axes; NaN lifts the pen.
    #[must_use]
    pub fn contour(mut self, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.contours.push(points.into_iter().collect());
        self
    }

    /// A ring over the map at a place, with a few words or none.
    #[must_use]
    pub fn mark(mut self, x: f64, y: f64, label: impl Into<String>) -> Self {
        self.marks.push((x, y, label.into()));
        self
    }
}

/// Range of the colours: the given one, or that of the data; symmetric for a diverging map.
pub(super) fn shading<'a>(
    values: impl IntoIterator<Item = &'a f64>,
    range: Option<(f64, f64)>,
    logarithmic: bool,
    map: ColourMap,
) -> (Axis, Shading) {
    let axis = if logarithmic {
        Axis::log("", "")
    } else {
        Axis::linear("", "")
    };
    let fitted = match range {
        Some((low, high)) => axis.clone().range(low, high).fit([], 0.0, 1.0, false),
        None => axis.fit(values.into_iter().copied(), 0.0, 1.0, false),
    };
    let (mut low, mut high) = (fitted.low, fitted.high);
    if map == ColourMap::Diverging && !logarithmic {
        high = high.abs().max(low.abs());
        low = -high;
    }
    let shading = Shading {
        map,
        low,
        high,
        logarithmic,
    };
    (axis.range(low, high), shading)
}

/// Length by which a title next to a colour bar may exceed it: drawings have so much room above and below the bar.
const BESIDE_BAR: f64 = 20.0;
/// Distance from one line of a title to the next.
const LINE: f64 = 14.0;

/// A title in as many lines as it takes for each to be no longer than the room that there is; a word is never broken.
fn in_lines(title: &str, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in title.split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_width(line) + text_width(" ") + text_width(word) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A colour bar with ticks to its right.
pub(super) fn colour_bar(frame: &Frame, axis: &Axis, name: &str, unit: &str, map: ColourMap) -> (Group, String) {
    let fitted = axis.fit([], frame.bottom, frame.top, false);
    let ticks = fitted.ticks();
    let mut group = Group::new().add(picture(
        frame.left,
        frame.top,
        frame.width(),
        frame.height(),
        raster::bar(map),
    ));
    for (value, label) in &ticks.labelled {
        let Some(py) = fitted.place(*value) else { continue };
        group = group
            .add(line(frame.right, py, frame.right + 4.0, py, "axis"))
            .add(text(frame.right + 7.0, py + 4.0, Anchor::Start, label.as_str()));
    }
    // The bar's own axis has no name: what its title holds is a common power of ten.
    let scale = ticks.title.trim_start_matches('[').trim_end_matches(']');
    let unit = format!("{scale} {unit}");
    let title = match unit.trim() {
        "" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    };
    let lines = in_lines(&title, frame.height() + BESIDE_BAR);
    let middle = (frame.top + frame.bottom) / 2.0;
    let outline = rectangle(frame.left, frame.top, frame.width(), frame.height(), "frame");
    let group = lines.iter().enumerate().fold(group.add(outline), |group, (i, words)| {
        // Several lines stand about the place of a single one.
        let x = frame.right + 67.0 + LINE * (i as f64 - (lines.len() - 1) as f64 / 2.0);
        group.add(
            text(x, middle, Anchor::Middle, words.as_str())
                .set("class", "title")
                .set("transform", format!("rotate(-90 {} {})", short(x), short(middle))),
        )
    });
    let words = format!(
        "{title} from {} to {}",
        super::sig(fitted.low, 3),
        super::sig(fitted.high, 3)
    );
    (group, words)
}

impl From<HeatMap> for Figure {
    fn from(heat: HeatMap) -> Self {
        let (width, mut height) = heat.size;
        let (left, right) = (66.0, width - 108.0);
        if heat.to_scale {
            let span = |(_, first, last): &(Axis, f64, f64)| (last - first).abs();
            let ratio = span(&heat.y) / span(&heat.x);
            if ratio.is_finite() {
                height = 56.0 + (right - left) * ratio.clamp(0.1, 3.0);
            }
        }
        let frame = Frame {
            left,
            top: 12.0,
            right,
            bottom: height - 44.0,
        };
        let (rows, cols) = heat.values.dim();
        let over = |(axis, first, last): &(Axis, f64, f64), n: usize, start, end| -> Fitted {
            let half = if n > 1 {
                (last - first) / (n - 1) as f64 / 2.0
            } else {
                0.5
            };
            axis.clone().range(first - half, last + half).fit([], start, end, false)
        };
        let x = over(&heat.x, cols, frame.left, frame.right);
        let y = over(&heat.y, rows, frame.bottom, frame.top);
        let (axis, shading) = shading(&heat.values, heat.range, heat.logarithmic, heat.map);
        let mut data = clipped(frame.left, frame.top, frame.width(), frame.height())
            .add(rectangle(frame.left, frame.top, frame.width(), frame.height(), "void"))
            .add(picture(
                frame.left,
                frame.top,
                frame.width(),
                frame.height(),
                raster::image(heat.values.view(), &shading),
            ));
        for contour in &heat.contours {
            let points = contour.iter().map(|&(a, b)| Some((x.place(a)?, y.place(b)?)));
            data = data.add(strokes(points, "contour"));
        }
        for (a, b, label) in &heat.marks {
            let (Some(px), Some(py)) = (x.place(*a), y.place(*b)) else {
                continue;
            };
            let ring = Circle::new().set("cx", short(px)).set("cy", short(py)).set("r", 4.5);
            data = data.add(ring.set("class", "spot"));
            if !label.is_empty() {
                data = data.add(text(px + 8.0, py + 4.0, Anchor::Start, label.as_str()).set("class", "over"));
            }
        }
        let side = Frame {
            left: width - 96.0,
            right: width - 82.0,
            ..frame
        };
        let (bar, meaning) = colour_bar(&side, &axis, &heat.scale.0, &heat.scale.1, heat.map);
        let words = format!("Colours: {meaning}. Along x {}, along y {}.", x.words(), y.words());
        let drawing = Group::new().add(data).add(frame.axes(&x, &y, false)).add(bar);
        Figure::new(width, height, &heat.title, &words, drawing)
    }
}

#[cfg(test)]
mod tests {
    use super::in_lines;

    #[test]
    fn a_title_longer_than_its_bar_is_broken_between_words() {
        // Twenty-four letters have this room.
        const ROOM: f64 = 170.0;
        assert_eq!(in_lines("zero order", ROOM), ["zero order"]);
        assert_eq!(
            in_lines("energy in a pixel, of the light there", ROOM),
            ["energy in a pixel, of", "the light there"]
        );
        assert!(in_lines("", ROOM).is_empty());
    }
}
