//! Everything that a layout holds, in number: cells, layers, texts, lattices, and the details of its format. Counts and boxes
//! are arithmetic on what the first reading found: a file that describes more shapes than can be read is counted all the same.

mod boxes;
mod counter;
mod lattices;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

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
    /// Smallest and largest side of squares and rectangles and diameter of circles, as drawn in their cells (nm).
    pub sides_nm: Option<[f64; 2]>,
    /// Left, bottom, right, top of all areas (nm). Around a cell that is turned by other than quarter turns, the box of
    /// its box. None if there are no areas or too many boxes.
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
    /// Left, bottom, right, top of all below it (nm), in its own coordinates.
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
        let boxes = boxes::boxes(self, &roots);
        let nm = |r: &Rect| {
            let unit = self.unit_nm();
            (!r.is_empty()).then(|| [r.x0, r.y0, r.x1, r.y1].map(|v| v as f64 * unit))
        };
        let layers = self.layers(&counts, boxes.as_ref().map(|b| &b.layers));
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
        let sum = |of: &dyn Fn(usize) -> u64| (0..self.cells().len()).map(of).fold(0, u64::saturating_add);
        Ok(Inventory {
            path: self.path().to_owned(),
            bytes: self.bytes(),
            gzip: self.is_gzip(),
            format: FormatInventory::of(self.details()),
            library: self.library().to_owned(),
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

    fn layers(&self, counts: &[u64], boxes: Option<&boxes::LayerBoxes>) -> Vec<LayerInventory> {
        let mut sums: BTreeMap<LayerNumber, (u64, u64, KindTally)> = BTreeMap::new();
        for (cell, &times) in self.cells().iter().zip(counts).filter(|(_, times)| **times > 0) {
            for (k, (layer, tally)) in cell.layers.iter().enumerate() {
                let sum = sums.entry(*layer).or_default();
                sum.0 = sum.0.saturating_add(tally.shapes().saturating_mul(times));
                sum.1 = sum.1.saturating_add(tally.texts.saturating_mul(times));
                if let Some(kinds) = cell.counts.as_ref().and_then(|counts| counts.kinds.get(k)) {
                    sum.2.add(kinds, times);
                }
            }
        }
        let unit = self.unit_nm();
        let each = sums.into_iter().map(|(layer, (shapes, texts, kinds))| LayerInventory {
            layer,
            shapes,
            texts,
            sides_nm: (kinds.sides[0] <= kinds.sides[1]).then(|| kinds.sides.map(|side| side as f64 * unit)),
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
