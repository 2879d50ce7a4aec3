//! Images side by side on one common scale.

use ndarray::Array2;
use svg::node::element::Group;

use super::colour::ColourMap;
use super::figure::{Anchor, Figure, Frame, picture, rectangle, scale_bar, text};
use super::heat_map::{colour_bar, shading};
use super::raster;

/// Images in a grid with one colour scale, one colour bar, and a scale bar in each.
#[derive(Clone, Debug)]
pub struct ImageGrid {
    title: String,
    columns: usize,
    images: Vec<(String, Array2<f64>)>,
    pixel_um: Option<f64>,
    scale: (String, String),
    range: Option<(f64, f64)>,
    decades: Option<f64>,
    map: ColourMap,
    side: f64,
}

impl ImageGrid {
    /// A grid with a given number of columns, filled row by row.
    pub fn new(title: impl Into<String>, columns: usize) -> Self {
        Self {
            title: title.into(),
            columns: columns.max(1),
            images: Vec::new(),
            pixel_um: None,
            scale: (String::new(), String::new()),
            range: None,
            decades: None,
            map: ColourMap::Sequential,
            side: 220.0,
        }
    }

    /// One more image, rows along +y from below, with a few words above it.
    pub fn image(&mut self, label: impl Into<String>, values: Array2<f64>) -> &mut Self {
        self.images.push((label.into(), values));
        self
    }

    /// Size of a pixel (um): draws a scale bar.
    #[must_use]
    pub fn pixel_um(mut self, pixel_um: f64) -> Self {
        self.pixel_um = Some(pixel_um).filter(|p| p.is_finite() && *p > 0.0);
        self
    }

    /// Name and unit of what the colours mean.
    #[must_use]
    pub fn values(mut self, name: impl Into<String>, unit: impl Into<String>) -> Self {
        self.scale = (name.into(), unit.into());
        self
    }

    /// Values at the ends of the colour bar; else those of all the images.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// A logarithmic scale over a given number of decades below the highest value of all images.
    #[must_use]
    pub fn log(mut self, decades: f64) -> Self {
        self.decades = Some(decades);
        self
    }

    /// Colours away from zero in both directions: for residuals.
    #[must_use]
    pub fn diverging(mut self) -> Self {
        self.map = ColourMap::Diverging;
        self
    }

    /// Width of one image in the drawing; 220 else.
    #[must_use]
    pub fn side(mut self, side: f64) -> Self {
        self.side = side.max(60.0);
        self
    }
}

impl From<ImageGrid> for Figure {
    fn from(grid: ImageGrid) -> Self {
        const GAP: f64 = 14.0;
        const LABEL: f64 = 22.0;
        let all = || grid.images.iter().flat_map(|i| i.1.iter());
        let range = match (grid.range, grid.decades) {
            (None, Some(decades)) => {
                let highest = all().copied().filter(|x| x.is_finite()).fold(0.0, f64::max);
                (highest > 0.0).then(|| (highest * 10f64.powf(-decades), highest))
            }
            (range, _) => range,
        };
        let (axis, shading) = shading(all(), range, grid.decades.is_some(), grid.map);
        let ratio = grid
            .images
            .first()
            .map_or(1.0, |i| i.1.nrows() as f64 / i.1.ncols().max(1) as f64);
        let (side, tall) = (grid.side, grid.side * ratio.clamp(0.1, 4.0));
        let columns = grid.columns.min(grid.images.len().max(1));
        let rows = grid.images.len().div_ceil(columns).max(1);
        let width = columns as f64 * (side + GAP) + 106.0;
        let height = rows as f64 * (tall + LABEL) + 10.0;
        let mut drawing = Group::new();
        let mut names = Vec::new();
        for (i, (label, values)) in grid.images.iter().enumerate() {
            let x = 2.0 + (i % columns) as f64 * (side + GAP);
            let y = LABEL + (i / columns) as f64 * (tall + LABEL);
            drawing = drawing
                .add(text(x + side / 2.0, y - 7.0, Anchor::Middle, label.as_str()))
                .add(rectangle(x, y, side, tall, "void"))
                .add(picture(x, y, side, tall, raster::image(values.view(), &shading)));
            if let Some(pixel_um) = grid.pixel_um {
                let um_per_unit = pixel_um * values.ncols().max(1) as f64 / side;
                drawing = drawing.add(scale_bar(x + 10.0, y + tall - 12.0, side / 3.0, um_per_unit, "over"));
            }
            names.push(label.as_str());
        }
        let frame = Frame {
            left: width - 100.0,
            right: width - 86.0,
            top: LABEL,
            bottom: LABEL + tall.max(((rows as f64 * (tall + LABEL)) - LABEL).min(360.0)),
        };
        let (bar, meaning) = colour_bar(&frame, &axis, &grid.scale.0, &grid.scale.1, grid.map);
        let words = format!("Images: {}. Common colours: {meaning}.", names.join(", "));
        Figure::new(width, height, &grid.title, &words, drawing.add(bar))
    }
}
