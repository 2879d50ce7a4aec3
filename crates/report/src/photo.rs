//! Pictures in colour, as a person sees them.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ndarray::Array3;
use svg::node::element::Group;

use super::figure::{Anchor, Figure, picture, rectangle, text};

/// Pictures side by side, all of one height, each with a few words above it. Values are sRGB from 0 to 1, `[row, column,
/// colour]`, the first row at the top.
#[derive(Clone, Debug)]
pub struct PhotoRow {
    title: String,
    height: f64,
    photos: Vec<(String, Array3<u8>)>,
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
        let block = rows.max(columns).div_ceil(LARGEST).max(1);
        let shape = (rows / block, columns / block, 3);
        let bytes = Array3::from_shape_fn(shape, |(y, x, c)| {
            let all = (0..block * block).map(|k| values[[y * block + k / block, x * block + k % block, c]]);
            let mean = all.sum::<f64>() / (block * block) as f64;
            (mean.clamp(0.0, 1.0) * 255.0).round() as u8
        });
        self.photos.push((label.into(), bytes));
        self
    }

    /// The finished drawing, with a caption.
    pub fn caption(self, caption: impl Into<String>) -> Figure {
        Figure::from(self).caption(caption)
    }
}

impl From<PhotoRow> for Figure {
    fn from(row: PhotoRow) -> Self {
        const GAP: f64 = 12.0;
        const LABEL: f64 = 22.0;
        let mut drawing = Group::new();
        let mut x = 2.0;
        for (label, bytes) in &row.photos {
            let (rows, columns, _) = bytes.dim();
            let width = row.height * columns as f64 / rows.max(1) as f64;
            drawing = drawing
                .add(text(x + 0.5 * width, LABEL - 7.0, Anchor::Middle, label.as_str()))
                .add(rectangle(x, LABEL, width, row.height, "void"))
                .add(picture(x, LABEL, width, row.height, address(bytes)));
            x += width + GAP;
        }
        let names: Vec<&str> = row.photos.iter().map(|p| p.0.as_str()).collect();
        let words = format!("Pictures: {}.", names.join(", "));
        Figure::new(x - GAP + 2.0, LABEL + row.height + 4.0, &row.title, &words, drawing)
    }
}

fn address(bytes: &Array3<u8>) -> String {
    let (rows, columns, _) = bytes.dim();
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, columns.max(1) as u32, rows.max(1) as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    let data: Vec<u8> = if bytes.is_empty() {
        vec![0; 3]
    } else {
        bytes.iter().copied().collect()
    };
    // Writing to memory fails only for a wrong size, which is ours to keep.
    let mut writer = encoder.write_header().expect("a header fits in memory");
    writer.write_image_data(&data).expect("as many bytes as pixels");
    writer.finish().expect("an end fits in memory");
    format!("data:image/png;base64,{}", STANDARD.encode(file))
}

#[cfg(test)]
mod tests {
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
}
