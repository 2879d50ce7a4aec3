//! A drawing with a text description for screen readers, and the strokes that drawings share.

use std::path::Path as FilePath;

use svg::node::Text as Words;
use svg::node::element::{Description, Group, Image, Line, Path, Rectangle, SVG, Style, Text, Title};

use super::axis::Fitted;
use super::number::short;
use super::{HeatMap, ImageGrid, Matrix, PhotoRow, PillarZoom, Plan, Ranking};
use metalith_core::text::printable;
use metalith_core::{AtomicFile, Result};

/// Styles of all drawings, for light, dark and print.
pub(super) const STYLE: &str = include_str!("figure.css");

/// A finished drawing: SVG, title, description in words, caption.
#[derive(Clone, Debug)]
pub struct Figure {
    pub(super) svg: SVG,
    pub(super) width: f64,
    pub(super) title: String,
    pub(super) caption: String,
}

/// Lets drawings be finished with a caption.
macro_rules! captioned {
    ($($drawing:ty),*) => {$(
        impl $drawing {
            /// The finished drawing, with a caption.
            pub fn caption(self, caption: impl Into<String>) -> Figure {
                Figure::from(self).caption(caption)
            }
        }
    )*};
}
captioned!(HeatMap, ImageGrid, Matrix, PhotoRow, PillarZoom, Plan, Ranking);

impl Figure {
    pub(super) fn new(width: f64, height: f64, title: &str, words: &str, drawing: Group) -> Self {
        let svg = SVG::new()
            .set("viewBox", format!("0 0 {} {}", short(width), short(height)))
            .set("role", "img")
            .set("aria-label", printable(title).into_owned())
            .add(Title::new(printable(title)))
            .add(Description::new().add(Words::new(printable(words))))
            .add(drawing);
        Self {
            svg,
            width,
            title: title.to_owned(),
            caption: title.to_owned(),
        }
    }

    /// This drawing with a caption after its title.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Write the drawing as a separate SVG file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_svg(&self, path: &FilePath) -> Result<()> {
        AtomicFile::write(path, self.to_svg().as_bytes())
    }

    /// The drawing as a separate SVG file, styles included.
    pub fn to_svg(&self) -> String {
        let mut svg = self.svg.clone();
        let backdrop = Rectangle::new()
            .set("class", "paper")
            .set("width", "100%")
            .set("height", "100%");
        svg.get_children_mut().insert(0, Box::new(backdrop));
        svg.get_children_mut().insert(0, Box::new(Style::new(STYLE)));
        format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{svg}\n")
    }
}

/// Position of a text relative to its point.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

pub(super) fn text(x: f64, y: f64, anchor: Anchor, content: impl Into<String>) -> Text {
    let anchor = match anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    Text::new(printable(&content.into()))
        .set("x", short(x))
        .set("y", short(y))
        .set("text-anchor", anchor)
}

pub(super) fn line(x1: f64, y1: f64, x2: f64, y2: f64, class: &str) -> Line {
    Line::new()
        .set("class", class)
        .set("x1", short(x1))
        .set("y1", short(y1))
        .set("x2", short(x2))
        .set("y2", short(y2))
}

pub(super) fn rectangle(x: f64, y: f64, width: f64, height: f64, class: &str) -> Rectangle {
    Rectangle::new()
        .set("class", class)
        .set("x", short(x))
        .set("y", short(y))
        .set("width", short(width.max(0.0)))
        .set("height", short(height.max(0.0)))
}

/// A path of straight strokes; `None` lifts the pen.
pub(super) fn strokes(points: impl IntoIterator<Item = Option<(f64, f64)>>, class: &str) -> Path {
    let mut data = String::new();
    let mut down = false;
    for point in points {
        if let Some((x, y)) = point {
            data.push(if down { 'L' } else { 'M' });
            data.push_str(&format!("{} {}", short(x), short(y)));
        }
        down = point.is_some();
    }
    Path::new().set("class", class).set("d", data)
}

/// An image that fills a rectangle of the drawing, pixels as they are.
pub(super) fn picture(x: f64, y: f64, width: f64, height: f64, address: String) -> Image {
    Image::new()
        .set("class", "pixels")
        .set("x", short(x))
        .set("y", short(y))
        .set("width", short(width))
        .set("height", short(height))
        .set("preserveAspectRatio", "none")
        .set("href", address)
}

/// A clipped part of a drawing with the drawing's own coordinates.
pub(super) fn clipped(x: f64, y: f64, width: f64, height: f64) -> SVG {
    SVG::new()
        .set("x", short(x))
        .set("y", short(y))
        .set("width", short(width))
        .set("height", short(height))
        .set(
            "viewBox",
            format!("{} {} {} {}", short(x), short(y), short(width), short(height)),
        )
}

/// Frame of a plot.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Frame {
    pub(crate) fn width(&self) -> f64 {
        self.right - self.left
    }

    pub(crate) fn height(&self) -> f64 {
        self.bottom - self.top
    }

    /// Ticks, labels and titles of both axes; grid lines under the data if wanted.
    pub(crate) fn axes(&self, x: &Fitted, y: &Fitted, grid: bool) -> Group {
        let mut group = Group::new();
        let across = x.ticks();
        for (value, label) in &across.labelled {
            let Some(px) = x.place(*value) else { continue };
            if grid {
                group = group.add(line(px, self.top, px, self.bottom, "grid"));
            }
            group = group
                .add(line(px, self.bottom, px, self.bottom + 5.0, "axis"))
                .add(text(px, self.bottom + 18.0, Anchor::Middle, label.as_str()));
        }
        for px in across.small.iter().filter_map(|&v| x.place(v)) {
            group = group.add(line(px, self.bottom, px, self.bottom + 3.0, "axis"));
        }
        let up = y.ticks();
        for (value, label) in &up.labelled {
            let Some(py) = y.place(*value) else { continue };
            if grid {
                group = group.add(line(self.left, py, self.right, py, "grid"));
            }
            group = group.add(line(self.left - 5.0, py, self.left, py, "axis")).add(text(
                self.left - 8.0,
                py + 4.0,
                Anchor::End,
                label.as_str(),
            ));
        }
        for py in up.small.iter().filter_map(|&v| y.place(v)) {
            group = group.add(line(self.left - 3.0, py, self.left, py, "axis"));
        }
        let middle = (self.top + self.bottom) / 2.0;
        group
            .add(rectangle(self.left, self.top, self.width(), self.height(), "frame"))
            .add(
                text(
                    (self.left + self.right) / 2.0,
                    self.bottom + 37.0,
                    Anchor::Middle,
                    across.title.as_str(),
                )
                .set("class", "title"),
            )
            .add(
                text(14.0, middle, Anchor::Middle, up.title.as_str())
                    .set("class", "title")
                    .set("transform", format!("rotate(-90 14 {})", short(middle))),
            )
    }
}

/// Width of a text in a drawing, measured by its letters: fonts differ, and a little air does no harm.
pub(super) fn text_width(name: &str) -> f64 {
    6.9 * name.chars().count() as f64
}

/// A bar of round length: `x` is its left end, `y` its middle, `longest` the room it has in the drawing.
/// Classes: `ink` on paper, `over` on images.
pub(super) fn scale_bar(x: f64, y: f64, longest: f64, um_per_unit: f64, class: &str) -> Group {
    let room = longest * um_per_unit;
    let decade = 10f64.powf(room.log10().floor());
    let length = [5.0, 2.0, 1.0]
        .into_iter()
        .map(|m| m * decade)
        .find(|&l| l <= room)
        .unwrap_or(decade);
    let label = if length < 1.0 {
        format!("{} nm", super::sig(length * 1e3, 1))
    } else if length >= 1e3 {
        format!("{} mm", super::sig(length * 1e-3, 1))
    } else {
        format!("{} um", super::sig(length, 1))
    };
    let end = x + length / um_per_unit;
    Group::new()
        .add(rectangle(x, y - 2.0, end - x, 4.0, class))
        .add(text((x + end) / 2.0, y - 6.0, Anchor::Middle, label).set("class", class))
}
