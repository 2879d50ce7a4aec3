//! Horizontal bars: candidates in order, each with its evidence.

use svg::node::element::Group;

use super::axis::Axis;
use super::figure::{Anchor, Figure, line, rectangle, text};

/// Bars from zero, one a row, with an optional interval and a remark.
#[derive(Clone, Debug)]
pub struct Ranking {
    title: String,
    axis: Axis,
    rows: Vec<RankedBar>,
}

#[derive(Clone, Debug)]
struct RankedBar {
    name: String,
    value: f64,
    interval: Option<(f64, f64)>,
    remark: String,
    chosen: bool,
}

impl Ranking {
    /// Bars along an axis, in the order in which they are added.
    pub fn new(title: impl Into<String>, axis: Axis) -> Self {
        Self {
            title: title.into(),
            axis,
            rows: Vec::new(),
        }
    }

    /// One bar; `chosen` ones stand out and say so in words through their remark.
    pub fn bar(
        &mut self,
        name: impl Into<String>,
        value: f64,
        interval: Option<(f64, f64)>,
        remark: impl Into<String>,
        chosen: bool,
    ) -> &mut Self {
        self.rows.push(RankedBar {
            name: name.into(),
            value,
            interval,
            remark: remark.into(),
            chosen,
        });
        self
    }
}

impl From<Ranking> for Figure {
    fn from(ranking: Ranking) -> Self {
        const WIDTH: f64 = 760.0;
        const STEP: f64 = 24.0;
        let letters =
            |f: fn(&RankedBar) -> &str| ranking.rows.iter().map(|r| f(r).chars().count()).max().unwrap_or(0) as f64;
        let left = (20.0 + 6.9 * letters(|r| &r.name)).min(260.0);
        let right = WIDTH - (20.0 + 6.5 * letters(|r| &r.remark)).min(300.0);
        let bottom = 10.0 + STEP * ranking.rows.len() as f64;
        let height = bottom + 46.0;
        let values = ranking.rows.iter().flat_map(|r| {
            [
                r.value,
                r.interval.map_or(r.value, |i| i.0),
                r.interval.map_or(r.value, |i| i.1),
            ]
        });
        let x = ranking.axis.fit(values.chain([0.0]), left, right, true);
        let base = x.place_or_end(0.0).unwrap_or(left).clamp(left, right);
        let ticks = x.ticks();
        let mut drawing = Group::new();
        for (value, label) in &ticks.labelled {
            let Some(px) = x.place(*value) else { continue };
            drawing = drawing.add(line(px, 6.0, px, bottom, "grid")).add(text(
                px,
                bottom + 16.0,
                Anchor::Middle,
                label.as_str(),
            ));
        }
        for (i, row) in ranking.rows.iter().enumerate() {
            let middle = 8.0 + STEP * (i as f64 + 0.5);
            drawing = drawing.add(text(left - 8.0, middle + 4.0, Anchor::End, row.name.as_str()));
            if let Some(px) = x.place(row.value) {
                let class = if row.chosen { "bar f0" } else { "bar f6" };
                let (a, b) = (px.min(base), px.max(base));
                drawing = drawing.add(rectangle(a, middle - 7.0, b - a, 14.0, class));
            }
            if let Some((Some(a), Some(b))) = row.interval.map(|i| (x.place_or_end(i.0), x.place_or_end(i.1))) {
                let class = "whisker axis";
                drawing = drawing
                    .add(line(a, middle, b, middle, class))
                    .add(line(a, middle - 4.0, a, middle + 4.0, class))
                    .add(line(b, middle - 4.0, b, middle + 4.0, class));
            }
            let class = if row.chosen { "title" } else { "small" };
            drawing =
                drawing.add(text(right + 10.0, middle + 4.0, Anchor::Start, row.remark.as_str()).set("class", class));
        }
        let drawing = drawing.add(line(base, 6.0, base, bottom, "axis")).add(
            text(
                (left + right) / 2.0,
                bottom + 36.0,
                Anchor::Middle,
                ticks.title.as_str(),
            )
            .set("class", "title"),
        );
        let words: Vec<_> = ranking
            .rows
            .iter()
            .map(|r| format!("{} {} {}", r.name, super::sig(r.value, 3), r.remark))
            .collect();
        Figure::new(WIDTH, height, &ranking.title, &words.join("; "), drawing)
    }
}
