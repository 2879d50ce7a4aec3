//! Cells of polygons, references and labels in whole nanometres, pillars in database units, written as GDSII.

use std::path::Path;

use chrono::NaiveDateTime;

use metalith_core::{AtomicFile, Error, LayerNumber, Result, Silent};
use metalith_design::array::{Class, Symmetry};
use metalith_design::{Design, LayoutLayer};
use metalith_gds::Layout;
use metalith_gds::library::{GdsCell, GdsElement, GdsLibrary};
use metalith_layout::{LayoutFormat, PillarForm, convert, gds_date, gds_units, orientation};
use metalith_pillars::{DatabaseUnit, PillarRows};

/// Layer and datatype.
pub(super) type LayerPair = (i16, i16);

/// Layer and datatype of a layer of the design.
pub(super) fn number(layer: &LayoutLayer) -> LayerPair {
    (layer.layer, layer.datatype)
}

/// A rectangle between two corners (nm).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub(super) struct RectNm {
    pub x0: i64,
    pub y0: i64,
    pub x1: i64,
    pub y1: i64,
}

impl RectNm {
    pub(crate) fn new(x0: i64, y0: i64, x1: i64, y1: i64) -> Self {
        Self { x0, y0, x1, y1 }
    }

    /// A rectangle of this size with its lower left corner at a place.
    pub(crate) fn at(x: i64, y: i64, width: i64, height: i64) -> Self {
        Self::new(x, y, x + width, y + height)
    }

    /// The rectangle with all edges moved outwards.
    pub(crate) fn grown(self, by: i64) -> Self {
        Self::new(self.x0 - by, self.y0 - by, self.x1 + by, self.y1 + by)
    }

    pub(crate) fn centre(&self) -> (i64, i64) {
        ((self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2)
    }

    pub(crate) fn united(&self, other: &Self) -> Self {
        Self::new(
            self.x0.min(other.x0),
            self.y0.min(other.y0),
            self.x1.max(other.x1),
            self.y1.max(other.y1),
        )
    }
}

/// One cell.
pub(super) struct Sheet {
    name: String,
    elements: Vec<GdsElement>,
}

impl Sheet {
    pub(crate) fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            elements: Vec::new(),
        }
    }

    pub(crate) fn rectangle(&mut self, layer: LayerPair, r: RectNm) {
        let corners = [(r.x0, r.y0), (r.x1, r.y0), (r.x1, r.y1), (r.x0, r.y1)];
        self.polygon(layer, (0, 0), &corners);
    }

    /// A polygon with these corners about a place, the first not repeated.
    pub(crate) fn polygon(&mut self, layer: LayerPair, (x, y): (i64, i64), corners: &[(i64, i64)]) {
        let closed = corners.iter().chain(corners.first());
        self.elements.push(GdsElement::Polygon {
            layer: layer_number(layer),
            corners: closed.map(|&(dx, dy)| point(x + dx, y + dy)).collect(),
        });
    }

    pub(crate) fn text(&mut self, layer: LayerPair, (x, y): (i64, i64), words: impl Into<String>) {
        self.elements.push(GdsElement::Text {
            layer: layer_number(layer),
            text: words.into(),
            at: point(x, y),
        });
    }

    pub(crate) fn place(&mut self, cell: &str, (x, y): (i64, i64), symmetry: Symmetry) {
        self.elements.push(GdsElement::Reference {
            cell: cell.to_owned(),
            orientation: orientation(symmetry),
            at: point(x, y),
        });
    }

    /// An array of copies along x and y with these steps, the first at a given position.
    pub(crate) fn array(&mut self, cell: &str, (x, y): (i64, i64), (columns, rows): (i16, i16), steps: [i64; 2]) {
        self.elements.push(GdsElement::Array {
            cell: cell.to_owned(),
            columns,
            rows,
            places: [
                point(x, y),
                point(x + i64::from(columns) * steps[0], y),
                point(x, y + i64::from(rows) * steps[1]),
            ],
        });
    }

    /// A number or word in blocks, its lower left corner at a place. Characters: digits and a few capitals.
    pub(crate) fn numerals(&mut self, layer: LayerPair, (x, y): (i64, i64), height: i64, words: &str) {
        let block = height / 5;
        for (k, c) in words.chars().enumerate() {
            let left = x + 4 * block * k as i64;
            for (row, bits) in glyph(c).iter().enumerate() {
                let bottom = y + block * (4 - row as i64);
                for (first, last) in runs(*bits) {
                    self.rectangle(
                        layer,
                        RectNm::new(left + block * first, bottom, left + block * last, bottom + block),
                    );
                }
            }
        }
    }

    /// Width of [`Sheet::numerals`].
    pub(crate) fn numerals_width(height: i64, words: &str) -> i64 {
        let block = height / 5;
        (4 * words.chars().count() as i64 - 1).max(0) * block
    }
}

/// Five rows of three blocks, from above; the highest bit is the left block.
fn glyph(c: char) -> [u8; 5] {
    match c {
        '0' => [0b111, 0b101, 0b101, 0b101, 0b111],
        '1' => [0b010, 0b110, 0b010, 0b010, 0b111],
        '2' => [0b111, 0b001, 0b111, 0b100, 0b111],
        '3' => [0b111, 0b001, 0b111, 0b001, 0b111],
        '4' => [0b101, 0b101, 0b111, 0b001, 0b001],
        '5' => [0b111, 0b100, 0b111, 0b001, 0b111],
        '6' => [0b111, 0b100, 0b111, 0b101, 0b111],
        '7' => [0b111, 0b001, 0b010, 0b010, 0b010],
        '8' => [0b111, 0b101, 0b111, 0b101, 0b111],
        '9' => [0b111, 0b101, 0b111, 0b001, 0b111],
        'D' => [0b110, 0b101, 0b101, 0b101, 0b110],
        'S' => [0b111, 0b100, 0b111, 0b001, 0b111],
        'X' => [0b101, 0b101, 0b010, 0b101, 0b101],
        'Y' => [0b101, 0b101, 0b010, 0b010, 0b010],
        _ => [0; 5],
    }
}

/// Runs of set blocks of a row, as first and one past the last.
fn runs(bits: u8) -> Vec<(i64, i64)> {
    let set: Vec<i64> = (0..3).filter(|k| bits & (0b100 >> k) != 0).collect();
    set.chunk_by(|a, b| a + 1 == *b)
        .map(|run| (run[0], run[run.len() - 1] + 1))
        .collect()
}

/// Cells of a file to be.
pub(super) struct Drawing {
    tree: GdsLibrary,
    unit: DatabaseUnit,
}

impl Drawing {
    /// An empty drawing with the database unit and the date of a design, which was checked when the design was read.
    pub(crate) fn of(design: &Design, name: &str) -> Self {
        let date = design.layout.timestamp.parse::<NaiveDateTime>().unwrap_or_default();
        Self::new(name, design.cell.database_unit, date)
    }

    /// An empty drawing with this database unit and date.
    pub(crate) fn new(name: &str, unit: DatabaseUnit, date: NaiveDateTime) -> Self {
        let tree = GdsLibrary::new(name, gds_units(unit), gds_date(date));
        Self { tree, unit }
    }

    /// Add a cell in nanometres; cells come before those that refer to them.
    pub(crate) fn add(&mut self, mut sheet: Sheet) {
        let per_nm = self.unit.per_nm() as i32;
        let scale = |place: &mut [i32; 2]| *place = place.map(|nm| nm * per_nm);
        for element in &mut sheet.elements {
            match element {
                GdsElement::Polygon { corners, .. } => corners.iter_mut().for_each(scale),
                GdsElement::Text { at, .. } | GdsElement::Reference { at, .. } => scale(at),
                GdsElement::Array { places, .. } => places.iter_mut().for_each(scale),
            }
        }
        self.add_drawn(sheet);
    }

    /// Add a cell in database units.
    fn add_drawn(&mut self, sheet: Sheet) {
        self.tree.cells.push(GdsCell {
            name: sheet.name,
            elements: sheet.elements,
        });
    }

    /// Add a cell of one pillar with these corners (database units), for arrays of it.
    pub(crate) fn add_pillar(&mut self, name: &str, layer: LayerPair, corners: &[(i64, i64)]) {
        let mut sheet = Sheet::new(name);
        sheet.polygon(layer, (0, 0), corners);
        self.add_drawn(sheet);
    }

    /// Add a cell of polygons with these corners (database units).
    pub(crate) fn add_polygons(&mut self, name: &str, layer: LayerPair, polygons: &[Vec<(i64, i64)>]) {
        let mut sheet = Sheet::new(name);
        polygons
            .iter()
            .for_each(|corners| sheet.polygon(layer, (0, 0), corners));
        self.add_drawn(sheet);
    }

    /// Add the pillars of a lens as a cell of this name, folded by its symmetries. Squares are drawn where they are; other
    /// outlines, which have more corners, once each in a separate cell.
    pub(crate) fn add_lens(&mut self, name: &str, layer: LayerPair, class: &Class, form: PillarForm) {
        let own = |number: u16| format!("{name}_{}", form.cell_name(number));
        if !form.is_square() {
            let counts = class.widths.histogram();
            for number in (1..counts.len()).filter(|&w| counts[w] > 0).map(|w| w as u16) {
                self.add_pillar(&own(number), layer, &form.corners(number));
            }
        }
        let lattice = class.widths.lattice();
        let (n, mut room) = (lattice.sites(), Vec::new());
        let mut whole = Sheet::new(name);
        for (j, part) in class.group.domain(&class.widths).iter().enumerate() {
            let mut sheet = Sheet::new(format!("{name}_{}", (b'A' + j as u8) as char));
            for (iy, run) in (0..n).flat_map(|iy| class.group.runs(part, n, iy).map(|run| (iy, run))) {
                for (ix, &width) in run
                    .clone()
                    .zip(class.widths.row(iy, run, &mut room))
                    .filter(|(_, w)| **w != 0)
                {
                    let at = (lattice.place_units(0, ix), lattice.place_units(1, iy));
                    if form.is_square() {
                        sheet.polygon(layer, at, &form.corners(width));
                    } else {
                        sheet.place(&own(width), at, Symmetry::IDENTITY);
                    }
                }
            }
            for symmetry in &part.copies {
                whole.place(&sheet.name, (0, 0), *symmetry);
            }
            self.add_drawn(sheet);
        }
        self.add_drawn(whole);
    }

    /// Write the file, in the format that its name asks for.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn write(&self, path: &Path) -> Result<()> {
        let format = LayoutFormat::of_name(path);
        if format == LayoutFormat::Gds {
            return self.write_gds(path);
        }
        let made = path.with_extension(LayoutFormat::Gds.extension());
        self.write_gds(&made)?;
        convert(&Layout::open(&made)?, format, path, &Silent)?;
        std::fs::remove_file(&made).map_err(Error::io("remove", &made))
    }

    fn write_gds(&self, path: &Path) -> Result<()> {
        let bytes = self.tree.encode().map_err(|e| {
            Error::refused(
                "layout/encoding-failed",
                format!("{} cannot be encoded: {e:?}", path.display()),
                "please report this with the design and the process file",
            )
        })?;
        AtomicFile::write(path, &bytes)
    }
}

/// A point of the layout; sizes in process and design files keep far below 2.1 m.
fn point(x_nm: i64, y_nm: i64) -> [i32; 2] {
    [x_nm, y_nm].map(|nm| i32::try_from(nm).expect("sizes are limited when they are read"))
}

/// Layer and datatype as records have them.
fn layer_number((layer, datatype): LayerPair) -> LayerNumber {
    LayerNumber::new(layer as u16, datatype as u16)
}

/// Whole nanometres.
pub(super) fn nm(um: f64) -> i64 {
    (um * 1e3).round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numerals_touch_but_never_overlap() {
        for c in "0123456789DSXY".chars() {
            let rows = glyph(c);
            assert!(rows.iter().any(|&r| r != 0), "{c} is drawn");
            for row in rows {
                let runs = runs(row);
                let blocks: i64 = runs.iter().map(|(a, b)| b - a).sum();
                assert_eq!(blocks, i64::from(row.count_ones()));
                assert!(
                    runs.windows(2).all(|w| w[0].1 < w[1].0),
                    "{c}: runs of a row stay apart"
                );
            }
        }
    }
}
