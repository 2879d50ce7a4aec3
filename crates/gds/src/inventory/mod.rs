//! Everything that a layout holds, in number: cells, layers, texts, lattices, and the details of its format. Counts and boxes
//! are arithmetic on what the first reading found: a file that describes more shapes than can be read is counted all the same.

mod boxes;
pub(crate) mod contents;
mod counter;
mod lattices;
mod magnifications;

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use serde::Serialize;

use self::magnifications::magnifications;
use crate::error::Result;
use crate::layout::{Faulty, Layout};
use crate::shape::Rect;
use crate::tree;
use crate::visit::Selection;
use metalith_core::text::printable_bytes;
use metalith_core::{LayerNumber, Progress};
use metalith_oasis::OasisDetails;

pub use counter::KindTally;
pub(crate) use counter::{CellCounts, Counter};
pub use lattices::{FoundElement, LayerLattices};

/// Cells that are listed, and faults of each kind.
const LISTED: usize = 1000;

/// Details of the format of a file.
#[derive(Clone, Debug)]
pub enum FormatDetails {
    Gds {
        /// Version in HEADER, such as 600.
        version: Option<u16>,
        /// Date of the last change in BGNLIB: year, month, day, hour, minute, second.
        modified: Option<[u16; 6]>,
    },
    Oasis(OasisDetails),
}

/// One layer with all references followed.
#[derive(Clone, Debug, Serialize)]
pub struct LayerInventory {
    pub layer: LayerNumber,
    /// Areas: the sum of all kinds.
    pub shapes: u64,
    #[serde(flatten)]
    pub kinds: KindTally,
    pub texts: u64,
    /// Smallest and largest side of squares and rectangles and diameter of circles (nm).
    pub sides_nm: Option<[f64; 2]>,
    /// Left, bottom, right, top of all areas (nm). None if there are no areas or too many boxes.
    pub bounds_nm: Option<[f64; 4]>,
}

/// One cell.
#[derive(Clone, Debug, Serialize)]
pub struct CellInventory {
    pub name: String,
    /// Copies of it, all references followed.
    pub copies: u64,
    /// Areas drawn in the cell itself, its texts, and its references (an array is one).
    pub shapes: u64,
    pub texts: u64,
    pub references: u64,
    /// Left, bottom, right, top of all below it (nm), in its own coordinates. Of a cell that is no top cell and turns others by
    /// other than quarter turns, around their boxes.
    pub bounds_nm: Option<[f64; 4]>,
}

/// One text, in the coordinates of its cell.
#[derive(Clone, Debug, Serialize)]
pub struct TextInventory {
    pub layer: LayerNumber,
    /// Printable: see [`metalith_core::text::printable_bytes`].
    pub string: String,
    pub cell: String,
    pub at_nm: [f64; 2],
}

/// A record that departs from its format and was read over.
#[derive(Clone, Debug, Serialize)]
pub struct Departure {
    pub byte: u64,
    pub what: String,
    pub taken: String,
}

/// Everything that a layout holds, in number.
#[derive(Clone, Debug, Serialize)]
pub struct Inventory {
    pub path: PathBuf,
    /// Size of the file; uncompressed if it is compressed by gzip.
    pub bytes: u64,
    pub gzip: bool,
    pub format: FormatInventory,
    /// Name of the library in GDSII.
    pub library: String,
    pub database_unit_nm: f64,
    /// Database units in a user unit.
    pub units_per_user_unit: f64,
    pub tops: Vec<String>,
    pub cell_count: u64,
    /// Longest chain of references.
    pub depth: u32,
    /// References, an array being one, and copies of cells with all of them followed.
    pub references: u64,
    pub copies: u64,
    /// Elements with properties.
    pub with_properties: u64,
    /// True if the file has notes of KLayout or gdsfactory, which are no layout.
    pub has_notes: bool,
    pub layers: Vec<LayerInventory>,
    /// The first cells, in the order of the file.
    pub cells: Vec<CellInventory>,
    pub text_count: u64,
    /// The first texts, each once for its cell.
    pub texts: Vec<TextInventory>,
    /// The first references to cells that the file does not have.
    pub dangling: Vec<Reference>,
    /// The first references that lead round in a circle.
    pub circular: Vec<Reference>,
    /// The first cells of a name that another cell has.
    pub doubled: Vec<String>,
    pub departure_count: u64,
    /// The first departures from the format.
    pub departures: Vec<Departure>,
    pub lattices: Vec<LayerLattices>,
    /// Reason why lattices were not looked for.
    pub lattices_left_out: Option<String>,
}

/// A reference that leads nowhere.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    pub from: String,
    pub to: String,
    pub byte: u64,
}

/// Details of the format in numbers and words.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "name")]
pub enum FormatInventory {
    #[serde(rename = "GDSII")]
    Gds {
        version: Option<u16>,
        /// Date of the last change, "2026-11-28 12:00:00".
        modified: Option<String>,
    },
    /// Drawing that is read as GDSII.
    #[serde(rename = "DXF")]
    Dxf {
        /// Version in $ACADVER, such as AC1015.
        version: Option<String>,
        /// Unit of the drawing, and what states it.
        unit: String,
    },
    #[serde(rename = "OASIS")]
    Oasis {
        compressed_blocks: u64,
        table_offsets_in_end: bool,
        strict_tables: bool,
        checksum: Option<&'static str>,
    },
}

impl FormatInventory {
    fn of(details: &FormatDetails) -> Self {
        match details {
            FormatDetails::Gds { version, modified } => Self::Gds {
                version: *version,
                // Writers count years from 1900, or write all of them.
                modified: modified.map(|[year, month, day, hour, minute, second]| {
                    let year = if year < 1900 { year + 1900 } else { year };
                    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}")
                }),
            },
            FormatDetails::Oasis(details) => Self::Oasis {
                compressed_blocks: details.compressed_blocks,
                table_offsets_in_end: details.table_offsets_in_end,
                strict_tables: details.strict_tables,
                checksum: details.checksum,
            },
        }
    }
}

impl Layout {
    /// Everything that the layout holds, in number, from all of its top cells. Layouts of [`Layout::open_counted`] know
    /// kinds of shapes and boxes, others the numbers alone.
    ///
    /// # Errors
    /// If the file cannot be read again, or the user stopped it.
    pub fn inventory(&self, progress: &dyn Progress) -> Result<Inventory> {
        let selection = Selection {
            lenient: true,
            ..Selection::default()
        };
        let roots = self.roots(&selection)?;
        let (counts, _) = tree::count(self.cells(), &self.tree().order, &roots);
        let mut boxes = boxes::boxes(self, &roots);
        if let Some(boxes) = boxes.as_mut().filter(|_| boxes::has_turned(self)) {
            boxes::tighten(boxes, self, &roots, progress)?;
        }
        let nm = |r: &Rect| {
            let unit = self.unit_nm();
            (!r.is_empty()).then(|| [r.x0, r.y0, r.x1, r.y1].map(|v| v as f64 * unit))
        };
        let layers = self.layers(
            &counts,
            &magnifications(self, &roots),
            boxes.as_ref().map(|b| &b.layers),
        );
        let cells = self.cells().iter().zip(&counts).enumerate();
        let cells = cells.take(LISTED).map(|(index, (cell, &copies))| CellInventory {
            name: cell.name.clone(),
            copies,
            shapes: cell.shapes(),
            texts: cell.texts(),
            references: cell.references(),
            bounds_nm: boxes.as_ref().and_then(|b| nm(&b.cells[index])),
        });
        let cells = cells.collect();
        let (lattices, lattices_left_out) = lattices::find(self, &roots, &layers, progress)?;
        let drawing = self.source().drawing();
        let sum = |of: &dyn Fn(usize) -> u64| (0..self.cells().len()).map(of).fold(0, u64::saturating_add);
        Ok(Inventory {
            path: self.path().to_owned(),
            bytes: drawing.map_or(self.bytes(), |drawing| drawing.bytes),
            gzip: self.is_gzip(),
            format: match drawing {
                Some(drawing) => FormatInventory::Dxf {
                    version: drawing.version.clone(),
                    unit: drawing.unit.clone(),
                },
                None => FormatInventory::of(self.details()),
            },
            library: drawing.map_or(self.library(), |_| "").to_owned(),
            database_unit_nm: self.unit_nm(),
            units_per_user_unit: 1.0 / self.user_unit(),
            tops: self.tops().iter().map(|&top| self.cells()[top].name.clone()).collect(),
            cell_count: self.cells().len() as u64,
            depth: self.depth(),
            references: sum(&|k| self.cells()[k].references()),
            copies: sum(&|k| counts[k]) - roots.len() as u64,
            with_properties: sum(&|k| self.cells()[k].with_properties),
            has_notes: self.has_notes(),
            text_count: layers.iter().fold(0, |sum, l| sum.saturating_add(l.texts)),
            texts: self.first_texts(),
            layers,
            cells,
            dangling: references(self.dangling()),
            circular: references(self.circles()),
            doubled: self.doubled().into_iter().take(LISTED).map(|f| f.name).collect(),
            departure_count: self.warnings().count,
            departures: self.departures(),
            lattices,
            lattices_left_out,
        })
    }

    /// Areas on a layer by what they are, from all top cells. None are known of a layout that was not opened by
    /// [`Layout::open_counted`].
    pub fn kinds_on(&self, layer: LayerNumber) -> KindTally {
        let mut sum = KindTally::default();
        let magnifications = magnifications(self, self.tops());
        let each = self.cells().iter().zip(magnifications);
        for (cell, magnifications) in each.filter(|(cell, _)| cell.placements > 0) {
            let kinds = cell.counts.iter().flat_map(|counts| &counts.kinds);
            let on_layer = cell.layers.iter().zip(kinds).filter(|((l, _), _)| *l == layer);
            on_layer.for_each(|(_, kinds)| sum.add(kinds, cell.placements, magnifications));
        }
        sum
    }

    /// Number of areas on a layer, from all top cells.
    pub fn shapes_on(&self, layer: LayerNumber) -> u64 {
        let of_cell = |cell: &crate::LayoutCell| {
            let tally = cell.layers.iter().find(|(l, _)| *l == layer)?;
            Some(tally.1.shapes().saturating_mul(cell.placements))
        };
        self.cells().iter().filter_map(of_cell).fold(0, u64::saturating_add)
    }

    /// Layers with areas or texts below the top cells, in order.
    pub fn used_layers(&self) -> Vec<LayerNumber> {
        let cells = self.cells().iter().filter(|cell| cell.placements > 0);
        let layers: BTreeSet<LayerNumber> = cells.flat_map(|cell| cell.layers.iter().map(|(l, _)| *l)).collect();
        layers.into_iter().collect()
    }

    fn layers(
        &self,
        counts: &[u64],
        magnifications: &[[f64; 2]],
        boxes: Option<&boxes::LayerBoxes>,
    ) -> Vec<LayerInventory> {
        let mut sums: BTreeMap<LayerNumber, (u64, u64, KindTally)> = BTreeMap::new();
        let each = self.cells().iter().zip(counts).zip(magnifications);
        for ((cell, &times), &magnifications) in each.filter(|((_, times), _)| **times > 0) {
            for (k, (layer, tally)) in cell.layers.iter().enumerate() {
                let sum = sums.entry(*layer).or_default();
                sum.0 = sum.0.saturating_add(tally.shapes().saturating_mul(times));
                sum.1 = sum.1.saturating_add(tally.texts.saturating_mul(times));
                if let Some(kinds) = cell.counts.as_ref().and_then(|counts| counts.kinds.get(k)) {
                    sum.2.add(kinds, times, magnifications);
                }
            }
        }
        let unit = self.unit_nm();
        let each = sums.into_iter().map(|(layer, (shapes, texts, kinds))| LayerInventory {
            layer,
            shapes,
            texts,
            sides_nm: kinds.sides_nm(unit),
            bounds_nm: boxes
                .and_then(|boxes| boxes.get(&layer))
                .filter(|r| !r.is_empty())
                .map(|r| [r.x0, r.y0, r.x1, r.y1].map(|v| v as f64 * unit)),
            kinds,
        });
        each.collect()
    }

    fn first_texts(&self) -> Vec<TextInventory> {
        let unit = self.unit_nm();
        let of_cell = |cell: &crate::LayoutCell| -> Vec<TextInventory> {
            let texts = cell.counts.iter().flat_map(|counts| &counts.texts);
            let each = texts.map(|text| TextInventory {
                layer: text.layer,
                string: printable_bytes(&text.string),
                cell: cell.name.clone(),
                at_nm: [text.at.x, text.at.y].map(|v| v as f64 * unit),
            });
            each.collect()
        };
        self.cells().iter().flat_map(of_cell).collect()
    }

    fn departures(&self) -> Vec<Departure> {
        let each = self.warnings().listed.iter().map(|warning| Departure {
            byte: warning.offset,
            what: warning.cause.to_string(),
            taken: warning.taken.to_owned(),
        });
        each.collect()
    }
}

fn references(faulty: Vec<Faulty>) -> Vec<Reference> {
    let each = faulty.into_iter().take(LISTED).map(|fault| Reference {
        from: fault.cell,
        to: fault.name,
        byte: fault.offset,
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::extract::{ExtractionPlan, extract};
    use crate::limits::ReadLimits;
    use crate::record::kind;
    use metalith_core::Silent;

    fn golden(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../golden/mini_3x3")
            .join(name)
    }

    fn inventory(path: &Path) -> Inventory {
        let layout = Layout::open_counted(path, ReadLimits::default(), &Silent).unwrap();
        layout.inventory(&Silent).unwrap()
    }

    /// What arithmetic on cells says is what reading every shape says.
    #[test]
    fn counts_and_boxes_are_those_of_all_shapes_one_by_one() {
        let path = golden("flat.gds.gz");
        let found = inventory(&path);
        let layout = Layout::open(&path).unwrap();
        let plan = ExtractionPlan::discover(LayerNumber::new(1, 0));
        let read = extract(&layout, &plan, &Silent).unwrap();
        assert_eq!(found.layers.len(), read.survey.layers.len());
        for (own, other) in found.layers.iter().zip(&read.survey.layers) {
            assert_eq!(
                (own.layer, own.shapes, own.texts),
                (other.layer, other.shapes, other.texts)
            );
            assert_eq!(own.bounds_nm, other.bounds_nm);
            let kinds = own.kinds;
            let sum = kinds.pillar_like() + kinds.polygons + kinds.paths;
            assert_eq!(sum, own.shapes);
        }
        assert_eq!(found.lattices.len(), 1);
        assert_eq!(found.lattices[0].element_count, read.elements.len());
        let texts: Vec<&str> = found.texts.iter().map(|t| t.string.as_str()).collect();
        let want: Vec<&str> = read.survey.texts.iter().map(|t| t.string.as_str()).collect();
        assert_eq!(texts, want);
        assert!(found.gzip);
    }

    /// A GDSII file of records.
    struct Records(Vec<u8>);

    impl Records {
        fn new() -> Self {
            let mut records = Self(Vec::new());
            records.put(kind::HEADER, 2, &[2, 0x58]);
            let units = [0x3E41_8937_4BC6_A7F0u64, 0x3944_B82F_A09B_5A54].map(u64::to_be_bytes);
            records.put(kind::UNITS, 5, units.concat().as_slice());
            records
        }

        fn put(&mut self, kind: u8, data: u8, body: &[u8]) -> &mut Self {
            self.0.extend((body.len() as u16 + 4).to_be_bytes());
            self.0.extend([kind, data]);
            self.0.extend(body);
            self
        }

        fn cell(&mut self, name: &str) -> &mut Self {
            self.put(kind::BGNSTR, 2, &[0; 24])
                .put(kind::STRNAME, 6, name.as_bytes())
        }

        fn xy(&mut self, points: &[[i32; 2]]) -> &mut Self {
            let bytes: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_be_bytes()).collect();
            self.put(kind::XY, 3, &bytes).put(kind::ENDEL, 0, &[])
        }

        fn outline(&mut self, points: &[[i32; 2]]) -> &mut Self {
            self.put(kind::BOUNDARY, 0, &[])
                .put(kind::LAYER, 2, &[0, 1])
                .put(kind::DATATYPE, 2, &[0, 0])
                .xy(points)
        }

        fn inventory(&mut self) -> Inventory {
            self.put(kind::ENDLIB, 0, &[]);
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), &self.0).unwrap();
            inventory(file.path())
        }
    }

    const SQUARE: [[i32; 2]; 5] = [[0, 0], [100, 0], [100, 100], [0, 100], [0, 0]];

    /// Each outline is counted as what it is, and a box of an array of 60,000 x 30,000 copies is exact.
    #[test]
    fn kinds_are_told_and_arrays_of_arrays_are_not_expanded() {
        let circle: Vec<[i32; 2]> = (0..=24)
            .map(|k| {
                let angle = std::f64::consts::TAU * f64::from(k % 24) / 24.0;
                [angle.cos(), angle.sin()].map(|v| (100.0 * v).round() as i32)
            })
            .collect();
        let mut records = Records::new();
        records
            .cell("AA")
            .outline(&SQUARE)
            .outline(&[[0, 0], [100, 0], [100, 50], [0, 50], [0, 0]])
            .outline(&[[0, 0], [80, 60], [20, 140], [-60, 80], [0, 0]])
            .outline(&circle)
            .outline(&[[0, 0], [300, 0], [0, 300], [0, 0]])
            .put(kind::ENDSTR, 0, &[]);
        records.cell("BB");
        for _ in 0..2 {
            records
                .put(kind::AREF, 0, &[])
                .put(kind::SNAME, 6, b"AA")
                .put(kind::COLROW, 2, &[[0x75, 0x30], [0x75, 0x30]].concat())
                .xy(&[[1000, 2000], [1000 + 30_000 * 400, 2000], [1000, 2000 + 30_000 * 500]]);
        }
        let found = records.put(kind::ENDSTR, 0, &[]).inventory();
        let copies = 2 * 30_000 * 30_000;
        let layer = &found.layers[0];
        assert_eq!(layer.shapes, 5 * copies);
        let kinds = layer.kinds;
        for count in [
            kinds.squares,
            kinds.rectangles,
            kinds.rotated_rectangles,
            kinds.circles,
            kinds.polygons,
        ] {
            assert_eq!(count, copies);
        }
        assert_eq!(layer.sides_nm, Some([50.0, 200.0]));
        let [right, top] = [1000.0 + 29_999.0 * 400.0 + 300.0, 2000.0 + 29_999.0 * 500.0 + 300.0];
        assert_eq!(layer.bounds_nm, Some([900.0, 1900.0, right, top]));
        assert!(found.lattices.is_empty() && found.lattices_left_out.is_some());
        assert_eq!(
            (found.tops.as_slice(), found.copies),
            (["BB".to_owned()].as_slice(), copies)
        );
    }

    /// Sides are those of shapes as they stand: of a square of 100 nm in a cell of twice the size, in one of three times.
    #[test]
    fn sides_are_as_large_as_their_cells_are_placed() {
        let mut records = Records::new();
        records.cell("AA").outline(&SQUARE).put(kind::ENDSTR, 0, &[]);
        records.cell("BB");
        for magnification in [2, 1] {
            // An 8-byte real: an exponent of 65, and sixteenths.
            let real = [0x41, 0x10 * magnification, 0, 0, 0, 0, 0, 0];
            records
                .put(kind::SREF, 0, &[])
                .put(kind::SNAME, 6, b"AA")
                .put(kind::STRANS, 1, &[0, 0])
                .put(kind::MAG, 5, &real)
                .xy(&[[1000, 2000]]);
        }
        records.put(kind::ENDSTR, 0, &[]);
        records.cell("CC");
        records
            .put(kind::SREF, 0, &[])
            .put(kind::SNAME, 6, b"BB")
            .put(kind::STRANS, 1, &[0, 0])
            .put(kind::MAG, 5, &[0x41, 0x30, 0, 0, 0, 0, 0, 0])
            .xy(&[[0, 0]]);
        let found = records.put(kind::ENDSTR, 0, &[]).inventory();
        assert_eq!(found.layers[0].sides_nm, Some([300.0, 600.0]));
    }

    /// A square at 45 degrees in a cell that is placed at 45 degrees, in a cell that is placed at 90: its own edge, not the box of a box.
    #[test]
    fn boxes_of_turned_cells_are_those_of_their_shapes() {
        let mut records = Records::new();
        records
            .cell("AA")
            .outline(&[[0, -1000], [1000, 0], [0, 1000], [-1000, 0], [0, -1000]]);
        records.put(kind::ENDSTR, 0, &[]);
        for (cell, child, angle) in [
            ("BB", "AA", 0x422D_0000_0000_0000u64),
            ("CC", "BB", 0x425A_0000_0000_0000),
        ] {
            records
                .cell(cell)
                .put(kind::SREF, 0, &[])
                .put(kind::SNAME, 6, child.as_bytes())
                .put(kind::STRANS, 1, &[0, 0])
                .put(kind::ANGLE, 5, &angle.to_be_bytes())
                .xy(&[[5000, 0]])
                .put(kind::ENDSTR, 0, &[]);
        }
        let found = records.inventory();
        let half = 707.0;
        let want = [5000.0 - half, 5000.0 - half, 5000.0 + half, 5000.0 + half];
        assert_eq!(found.layers[0].bounds_nm, Some(want));
        assert_eq!(found.cells[2].bounds_nm, Some(want));
    }

    /// References that lead nowhere and round in circles are named; what can be counted is.
    #[test]
    fn faults_of_the_tree_are_named() {
        let mut records = Records::new();
        for (cell, child) in [("AA", "BB"), ("BB", "AA"), ("TT", "NO")] {
            records
                .cell(cell)
                .outline(&SQUARE)
                .put(kind::SREF, 0, &[])
                .put(kind::SNAME, 6, child.as_bytes())
                .xy(&[[500, 0]])
                .put(kind::ENDSTR, 0, &[]);
        }
        let found = records.inventory();
        assert_eq!((found.dangling.len(), found.circular.len()), (1, 1));
        assert_eq!(found.dangling[0].to, "NO");
        assert!(found.layers[0].shapes >= 2);
    }
}
