//! Pictures in colour, as a person sees them.

use ndarray::{Array3, Axis};
use svg::node::element::Group;

use super::bitmap::{address, reduced};
use super::figure::{Anchor, Figure, picture, rectangle, text};

/// Pictures side by side, all of one height, each with a few words above it. Values are sRGB from 0 to 1, `[row, column,
/// colour]`, the first row at the top.
#[derive(Clone, Debug)]
pub struct PhotoRow {
    title: String,
    height: f64,
    photos: Vec<Photo>,
}

#[derive(Clone, Debug)]
struct Photo {
    label: String,
    /// Rows and columns of the picture that was given.
    shape: (usize, usize),
    /// Pixels that are shown.
    bytes: Array3<u8>,
}

/// More pixels an axis than a page shows are averaged away.
const LARGEST: usize = 900;

impl PhotoRow {
    /// A row of pictures of this height in the drawing.
    pub fn new(title: impl Into<String>, height: f64) -> Self {
        Self {
            title: title.into(),
            height,
            photos: Vec::new(),
        }
    }

    /// One more picture.
    ///
    /// # Panics
    /// If it has not three colours.
    pub fn photo(&mut self, label: impl Into<String>, values: &Array3<f64>) -> &mut Self {
        let (rows, columns, colours) = values.dim();
        assert_eq!(colours, 3, "a picture has three colours");
        let means = [0, 1, 2].map(|c| reduced(values.index_axis(Axis(2), c), LARGEST));
        let (shown_rows, shown_columns) = means[0].dim();
        let bytes = Array3::from_shape_fn((shown_rows, shown_columns, 3), |(y, x, c)| {
            (means[c][[y, x]].clamp(0.0, 1.0) * 255.0).round() as u8
        });
        self.photos.push(Photo {
            label: label.into(),
            shape: (rows, columns),
            bytes,
        });
        self
    }
}

impl From<PhotoRow> for Figure {
    fn from(row: PhotoRow) -> Self {
        const GAP: f64 = 12.0;
        const LABEL: f64 = 22.0;
        let mut drawing = Group::new();
        let mut x = 2.0;
        for Photo { label, shape, bytes } in &row.photos {
            let (rows, columns) = *shape;
            let width = row.height * columns as f64 / rows.max(1) as f64;
            drawing = drawing
                .add(text(x + 0.5 * width, LABEL - 7.0, Anchor::Middle, label.as_str()))
                .add(rectangle(x, LABEL, width, row.height, "void"))
                .add(picture(x, LABEL, width, row.height, picture_address(bytes)));
            x += width + GAP;
        }
        let names: Vec<&str> = row.photos.iter().map(|p| p.label.as_str()).collect();
        let words = format!("Pictures: {}.", names.join(", "));
        Figure::new(x - GAP + 2.0, LABEL + row.height + 4.0, &row.title, &words, drawing)
    }
}

/// The picture as `data:` address.
fn picture_address(bytes: &Array3<u8>) -> String {
    let (rows, columns, _) = bytes.dim();
    let pixels: Vec<u8> = bytes.iter().copied().collect();
    address((rows, columns), &pixels, &[0; 3], |encoder| {
        encoder.set_color(png::ColorType::Rgb);
    })
}

#[cfg(test)]
mod tests {
    use super::super::bitmap::tests::decode;
    use super::*;

    #[test]
    fn pictures_stand_side_by_side() {
        let mut row = PhotoRow::new("Two", 100.0);
        row.photo("wide", &Array3::from_elem((10, 20, 3), 0.5));
        row.photo("large", &Array3::from_elem((2000, 1000, 3), 2.0));
        let svg = row.caption("Grey and white.").to_svg();
        assert_eq!(svg.matches("data:image/png").count(), 2);
        assert!(svg.contains("width=\"200\"") && svg.contains("width=\"50\"") && svg.contains("wide"));
    }

    /// Frames much wider than high, and sides that are not whole blocks: all of a picture is shown.
    #[test]
    fn a_strip_is_shown_to_its_end() {
        // Blocks of three: the last ones are a row high, and a column wide.
        let mut strip = Array3::from_elem((4, 2 * LARGEST + 2, 3), 0.2);
        strip.index_axis_mut(Axis(1), 2 * LARGEST + 1).fill(1.0);
        let mut row = PhotoRow::new("Strip", 100.0);
        row.photo("strip", &strip)
            .photo("line", &Array3::from_elem((1, 2 * LARGEST, 3), 0.2));
        let shown: Vec<_> = row.photos.iter().map(|p| decode(&picture_address(&p.bytes))).collect();
        let sizes: Vec<_> = shown
            .iter()
            .map(|(info, _)| (info.width as usize, info.height))
            .collect();
        assert_eq!(sizes, [((2 * LARGEST + 2).div_ceil(3), 2), (LARGEST, 1)]);
        // The last block of the first row: columns 1800 and 1801.
        let last = &shown[0].1[3 * (sizes[0].0 - 1)..][..3];
        assert_eq!(last, [153; 3]);
        row.photo("nothing", &Array3::zeros((0, 5, 3)));
        let svg = row.caption("Strips.").to_svg();
        // As wide as what was given, not as what is shown of it.
        assert!(svg.contains("width=\"180000\"") && svg.contains("nothing"));
    }
}
