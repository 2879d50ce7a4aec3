//! Lines, points, histograms, bands and limits over two axes.

use svg::node::element::{Circle, Group, Path};

use super::axis::{Axis, Fitted};
use super::colour::SERIES;
use super::figure::{Anchor, Figure, Frame, clipped, line, rectangle, strokes, text, text_width};
use super::number::short;

/// Left edge of a frame with usual labels, where legends begin too.
const LEFT: f64 = 66.0;

/// Room at the right of a frame.
const RIGHT: f64 = 14.0;

/// Series drawn over two axes.
#[derive(Clone, Debug)]
pub struct Chart {
    title: String,
    caption: Option<String>,
    x: Axis,
    y: Axis,
    series: Vec<Series>,
    limits: Vec<LimitLine>,
    size: (f64, f64),
    direct: bool,
}

#[derive(Clone, Debug)]
struct Series {
    name: String,
    kind: SeriesKind,
    points: Vec<[f64; 3]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SeriesKind {
    Line,
    /// Third number: half length of the error bar, zero for none.
    Points,
    /// `x` is the left edge, third number the right edge.
    Bars,
    /// Between the second and the third number.
    Band,
}

#[derive(Clone, Debug)]
struct LimitLine {
    at: f64,
    label: String,
    upright: bool,
}

impl Chart {
    /// An empty chart. The title says what it shows; it is the caption too unless one is given.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            caption: None,
            x,
            y,
            series: Vec::new(),
            limits: Vec::new(),
            size: (560.0, 340.0),
            direct: false,
        }
    }

    fn series(&mut self, name: impl Into<String>, kind: SeriesKind, points: Vec<[f64; 3]>) -> &mut Self {
        self.series.push(Series {
            name: name.into(),
            kind,
            points,
        });
        self
    }

    /// A line through `(x, y)`; a value that is not finite breaks it.
    pub fn line(&mut self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> &mut Self {
        let points = points.into_iter().map(|(x, y)| [x, y, 0.0]).collect();
        self.series(name, SeriesKind::Line, points)
    }

    /// Separate points at `(x, y)`.
    pub fn points(&mut self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> &mut Self {
        let points = points.into_iter().map(|(x, y)| [x, y, 0.0]).collect();
        self.series(name, SeriesKind::Points, points)
    }

    /// Separate points at `(x, y)` with error bars from `y - error` to `y + error`.
    pub fn points_with_errors(
        &mut self,
        name: impl Into<String>,
        points: impl IntoIterator<Item = (f64, f64, f64)>,
    ) -> &mut Self {
        let points = points.into_iter().map(|(x, y, e)| [x, y, e]).collect();
        self.series(name, SeriesKind::Points, points)
    }

    /// A histogram: bars of `(left edge, right edge, height)`.
    pub fn bars(&mut self, name: impl Into<String>, bars: impl IntoIterator<Item = (f64, f64, f64)>) -> &mut Self {
        let points = bars.into_iter().map(|(a, b, h)| [a, h, b]).collect();
        self.series(name, SeriesKind::Bars, points)
    }

    /// An area between `(x, low, high)`, for spreads and intervals.
    pub fn band(&mut self, name: impl Into<String>, points: impl IntoIterator<Item = (f64, f64, f64)>) -> &mut Self {
        let points = points.into_iter().map(|(x, low, high)| [x, low, high]).collect();
        self.series(name, SeriesKind::Band, points)
    }

    /// A dotted line across the chart at a value of y, with a few words.
    pub fn limit(&mut self, y: f64, label: impl Into<String>) -> &mut Self {
        self.limits.push(LimitLine {
            at: y,
            label: label.into(),
            upright: false,
        });
        self
    }

    /// A dotted upright line at a value of x, with a few words.
    pub fn marker(&mut self, x: f64, label: impl Into<String>) -> &mut Self {
        self.limits.push(LimitLine {
            at: x,
            label: label.into(),
            upright: true,
        });
        self
    }

    /// Width and height of the drawing; 560 by 340 else. In a row of figures, smaller reads better.
    #[must_use]
    pub fn size(mut self, width: f64, height: f64) -> Self {
        self.size = (width.max(200.0), height.max(150.0));
        self
    }

    /// Name lines at their right ends instead of in a legend: for a few lines that end apart.
    #[must_use]
    pub fn direct_labels(mut self) -> Self {
        self.direct = true;
        self
    }

    /// The finished drawing, with a caption.
    pub fn caption(mut self, caption: impl Into<String>) -> Figure {
        self.caption = Some(caption.into());
        self.into()
    }

    /// Frame below a legend of so many rows, with room for the labels of both axes.
    fn frame(&self, legend_rows: usize) -> Frame {
        let (width, height) = self.size;
        let right = if self.direct {
            let longest = self.series.iter().map(|s| text_width(&s.name)).fold(0.0, f64::max);
            (longest + RIGHT).min(width / 3.0)
        } else {
            RIGHT
        };
        let mut frame = Frame {
            left: LEFT,
            top: 12.0 + 19.0 * legend_rows as f64,
            right: width - right,
            bottom: height - 44.0,
        };
        let (x, y) = self.fit(&frame);
        frame.left = y.left();
        // The last label has its middle at its tick.
        frame.right = frame.right.min(width - x.last_label_width() / 2.0);
        frame
    }

    fn fit(&self, frame: &Frame) -> (Fitted, Fitted) {
        let all = || {
            self.series
                .iter()
                .flat_map(|s| s.points.iter().map(move |p| (s.kind, *p)))
        };
        let xs = all().flat_map(|(kind, [a, _, b])| [a, if kind == SeriesKind::Bars { b } else { a }]);
        let upright = self.limits.iter().filter(|l| l.upright).map(|l| l.at);
        let level = self.limits.iter().filter(|l| !l.upright).map(|l| l.at);
        let ys = all().flat_map(|(kind, [_, y, z])| match kind {
            SeriesKind::Line => [y, y],
            SeriesKind::Points => [y - z, y + z],
            SeriesKind::Bars => [y, 0.0],
            SeriesKind::Band => [y, z],
        });
        (
            self.x.fit(xs.chain(upright), frame.left, frame.right, false),
            self.y.fit(ys.chain(level), frame.bottom, frame.top, true),
        )
    }

    /// Rows of the legend, each a list of series.
    fn legend_rows(&self, width: f64) -> Vec<Vec<usize>> {
        let mut rows: Vec<Vec<usize>> = Vec::new();
        if self.series.len() < 2 || self.direct {
            return rows;
        }
        let mut used = f64::INFINITY;
        for (i, series) in self.series.iter().enumerate() {
            let need = legend_width(&series.name);
            if used + need > width {
                rows.push(Vec::new());
                used = 0.0;
            }
            used += need;
            rows.last_mut().expect("a row was begun").push(i);
        }
        rows
    }

    fn words(&self, x: &Fitted, y: &Fitted) -> String {
        let names: Vec<_> = self.series.iter().map(|s| s.name.as_str()).collect();
        let limits: Vec<_> = self.limits.iter().map(|l| l.label.as_str()).collect();
        let mut words = format!("{} over {}. Series: {}.", y.words(), x.words(), names.join(", "));
        if !limits.is_empty() {
            words.push_str(&format!(" Marked: {}.", limits.join(", ")));
        }
        words
    }
}

fn legend_width(name: &str) -> f64 {
    44.0 + text_width(name)
}

impl From<Chart> for Figure {
    fn from(chart: Chart) -> Self {
        let (width, height) = chart.size;
        let rows = chart.legend_rows(width - 80.0);
        let frame = chart.frame(rows.len());
        let (x, y) = chart.fit(&frame);
        let mut data = clipped(frame.left, frame.top, frame.width(), frame.height());
        // Areas lie below lines, lines below points.
        for kind in [SeriesKind::Band, SeriesKind::Bars, SeriesKind::Line, SeriesKind::Points] {
            for (i, series) in chart.series.iter().enumerate().filter(|(_, s)| s.kind == kind) {
                data = data.add(draw(series, i % SERIES, &x, &y));
            }
        }
        let mut drawing = Group::new().add(frame.axes(&x, &y, true)).add(data);
        for (row, series) in rows.iter().enumerate() {
            let mut left = LEFT;
            for &i in series {
                let at = 12.0 + 19.0 * row as f64;
                drawing = drawing.add(swatch(chart.series[i].kind, i % SERIES, left, at));
                drawing = drawing.add(text(
                    left + 30.0,
                    at + 4.0,
                    Anchor::Start,
                    chart.series[i].name.as_str(),
                ));
                left += legend_width(&chart.series[i].name);
            }
        }
        if chart.direct {
            drawing = drawing.add(direct_labels(&chart.series, &y, &frame));
        }
        for limit in &chart.limits {
            drawing = drawing.add(draw_limit(limit, &x, &y, &frame));
        }
        let words = chart.words(&x, &y);
        let figure = Figure::new(width, height, &chart.title, &words, drawing);
        match chart.caption {
            Some(caption) => figure.caption(caption),
            None => figure,
        }
    }
}

fn draw(series: &Series, colour: usize, x: &Fitted, y: &Fitted) -> Group {
    let place = |a: f64, b: f64| Some((x.place(a)?, y.place(b)?));
    // Many points are a cloud: smaller, so that its grain can be seen.
    let size = match series.points.len() {
        0..120 => 3.6,
        120..400 => 2.4,
        _ => 1.5,
    };
    let group = Group::new();
    match series.kind {
        SeriesKind::Line => {
            let points: Vec<_> = series.points.iter().map(|p| place(p[0], p[1])).collect();
            let lonely = points.split(Option::is_none).filter(|run| run.len() == 1);
            let dots = lonely.flatten().flatten().map(|&(px, py)| dot(px, py, size, colour));
            dots.fold(group, Group::add)
                .add(strokes(thinned(&points), &format!("line c{colour}")))
        }
        SeriesKind::Points => series.points.iter().fold(group, |group, &[a, b, error]| {
            let Some((px, py)) = place(a, b) else { return group };
            let mut group = group;
            if let (true, Some(low), Some(high)) = (error > 0.0, y.place_or_end(b - error), y.place_or_end(b + error)) {
                group = group
                    .add(line(px, low, px, high, &format!("whisker plain c{colour}")))
                    .add(line(px - 3.5, low, px + 3.5, low, &format!("whisker plain c{colour}")))
                    .add(line(
                        px - 3.5,
                        high,
                        px + 3.5,
                        high,
                        &format!("whisker plain c{colour}"),
                    ));
            }
            group.add(dot(px, py, size, colour))
        }),
        SeriesKind::Bars => series.points.iter().fold(group, |group, &[a, height, b]| {
            let (Some(left), Some(right), Some(top), Some(base)) =
                (x.place(a), x.place(b), y.place_or_end(height), y.place_or_end(0.0))
            else {
                return group;
            };
            let (top, base) = (top.min(base), top.max(base));
            // A hair of paper between bars that are wide enough to have edges.
            let gap = if right - left > 4.0 { 0.5 } else { 0.0 };
            group.add(rectangle(
                left + gap,
                top,
                right - left - 2.0 * gap,
                base - top,
                &format!("bar f{colour}"),
            ))
        }),
        SeriesKind::Band => {
            let there = series
                .points
                .iter()
                .filter_map(|p| Some((x.place(p[0])?, y.place_or_end(p[1])?, y.place_or_end(p[2])?)));
            let (low, mut high): (Vec<_>, Vec<_>) = there.map(|(px, a, b)| ((px, a), (px, b))).unzip();
            high.reverse();
            group.add(strokes(
                low.into_iter().chain(high).map(Some),
                &format!("band f{colour}"),
            ))
        }
    }
}

/// Points of a line thinned to at most four a column of the drawing (first, lowest, highest, last): looks the same,
/// stays small.
fn thinned(points: &[Option<(f64, f64)>]) -> Vec<Option<(f64, f64)>> {
    if points.len() < 3000 || points.iter().any(Option::is_none) {
        return points.to_vec();
    }
    let points: Vec<_> = points.iter().flatten().copied().collect();
    points
        .chunk_by(|a, b| a.0.floor() == b.0.floor())
        .flat_map(|column| {
            let by_height = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
            let lowest = *column.iter().min_by(by_height).expect("a column has points");
            let highest = *column.iter().max_by(by_height).expect("a column has points");
            [column[0], lowest, highest, column[column.len() - 1]].map(Some)
        })
        .collect()
}

/// A mark of another shape for each colour.
fn dot(x: f64, y: f64, s: f64, colour: usize) -> Group {
    let class = format!("dot f{colour}");
    let outline =
        |points: &[(f64, f64)]| -> Path { strokes(points.iter().map(|(a, b)| Some((x + s * a, y + s * b))), &class) };
    let group = Group::new();
    match colour % 4 {
        0 => group.add(
            Circle::new()
                .set("class", class.as_str())
                .set("cx", short(x))
                .set("cy", short(y))
                .set("r", short(s)),
        ),
        1 => group.add(outline(&[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)])),
        2 => group.add(outline(&[(0.0, -1.2), (1.1, 0.9), (-1.1, 0.9)])),
        _ => group.add(outline(&[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)])),
    }
}

fn swatch(kind: SeriesKind, colour: usize, x: f64, y: f64) -> Group {
    let group = Group::new();
    match kind {
        SeriesKind::Line => group.add(line(x, y, x + 26.0, y, &format!("line c{colour}"))),
        SeriesKind::Points => group.add(dot(x + 13.0, y, 3.6, colour)),
        SeriesKind::Bars => group.add(rectangle(x + 5.0, y - 6.0, 16.0, 12.0, &format!("bar f{colour}"))),
        SeriesKind::Band => group.add(rectangle(x, y - 6.0, 26.0, 12.0, &format!("band f{colour}"))),
    }
}

/// Names at the right ends of the lines, moved apart where they would touch.
fn direct_labels(series: &[Series], y: &Fitted, frame: &Frame) -> Group {
    const APART: f64 = 14.0;
    let mut labels: Vec<(f64, usize)> = series
        .iter()
        .enumerate()
        .filter_map(|(i, s)| {
            let end = s.points.iter().rev().find(|p| p[1].is_finite())?;
            Some((y.place_or_end(end[1])?.clamp(frame.top, frame.bottom), i))
        })
        .collect();
    labels.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for i in 1..labels.len() {
        labels[i].0 = labels[i].0.max(labels[i - 1].0 + APART);
    }
    let over = labels.last().map_or(0.0, |l| (l.0 - frame.bottom).max(0.0));
    labels.iter().fold(Group::new(), |group, &(py, i)| {
        group.add(
            text(
                frame.right + 7.0,
                py - over + 4.0,
                Anchor::Start,
                series[i].name.as_str(),
            )
            .set("class", format!("f{}", i % SERIES)),
        )
    })
}

fn draw_limit(limit: &LimitLine, x: &Fitted, y: &Fitted, frame: &Frame) -> Group {
    let group = Group::new();
    let place = if limit.upright {
        x.place(limit.at)
    } else {
        y.place(limit.at)
    };
    let Some(at) = place else { return group };
    if limit.upright && (frame.left - 0.5..=frame.right + 0.5).contains(&at) {
        let anchor = if at > frame.right - 60.0 {
            Anchor::End
        } else {
            Anchor::Start
        };
        let side = if at > frame.right - 60.0 { -5.0 } else { 5.0 };
        group
            .add(line(at, frame.top, at, frame.bottom, "limit"))
            .add(text(at + side, frame.top + 14.0, anchor, limit.label.as_str()).set("class", "small halo"))
    } else if !limit.upright && (frame.top - 0.5..=frame.bottom + 0.5).contains(&at) {
        let below = if at < frame.top + 16.0 { 14.0 } else { -5.0 };
        group
            .add(line(frame.left, at, frame.right, at, "limit"))
            .add(text(frame.right - 6.0, at + below, Anchor::End, limit.label.as_str()).set("class", "small halo"))
    } else {
        group
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two points for each column of pixels, some twenty letters each, and the frame: not a million points.
    const LARGEST_SVG: usize = 60_000;

    #[test]
    fn a_long_line_stays_small_and_keeps_its_extremes() {
        let mut chart = Chart::new("noise", Axis::linear("i", ""), Axis::linear("y", ""));
        chart.line(
            "one peak",
            (0..1_000_000).map(|i| (f64::from(i), f64::from(u8::from(i == 654_321)))),
        );
        let svg = Figure::from(chart).to_svg();
        assert!(svg.len() < LARGEST_SVG, "{}", svg.len());
        // The peak reaches the top of the frame.
        assert!(svg.contains(" 12L"), "the peak is lost");
    }

    #[test]
    fn a_line_shows_points_without_neighbours() {
        let dots = |points: &[(f64, f64)]| {
            let mut chart = Chart::new("front", Axis::linear("x", ""), Axis::linear("y", ""));
            chart.line("best", points.iter().copied());
            Figure::from(chart).to_svg().matches("dot f0").count()
        };
        assert_eq!(dots(&[(1.0, 2.0)]), 1);
        assert_eq!(dots(&[(1.0, 2.0), (2.0, f64::NAN), (3.0, 4.0), (4.0, 4.0)]), 1);
        assert_eq!(dots(&[(1.0, 2.0), (2.0, 3.0)]), 0);
    }

    #[test]
    fn the_label_of_the_last_tick_is_inside_the_drawing() {
        let end = |last: f64, label: &str| {
            let x = Axis::linear("x", "").range(0.0, last);
            let mut chart = Chart::new("wide", x, Axis::linear("y", ""));
            chart.line("line", [(0.0, 0.0), (last, 1.0)]);
            (chart.frame(0).right, text_width(label) / 2.0, chart.size.0)
        };
        let (right, half, width) = end(50_000.0, "50 000");
        assert!(right + half <= width);
        // Short labels leave the frame as wide as it was.
        let (right, _, width) = end(5.0, "5");
        assert_eq!(right, width - RIGHT);
    }

    #[test]
    fn names_are_text_and_cannot_break_the_drawing() {
        let mut chart = Chart::new("<script>", Axis::log("x", ""), Axis::log("y", ""));
        chart.line("a < b & c", [(1.0, f64::NAN), (0.0, -1.0)]);
        let svg = Figure::from(chart).to_svg();
        assert!(!svg.contains("<script>") && svg.contains("a &lt; b &amp; c"));
        assert!(!svg.contains("NaN"));
    }
}
