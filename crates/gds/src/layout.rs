//! A layout file after its first reading.

use std::path::{Path, PathBuf};

use super::cell::LayoutCell;
use super::cells::{CellInput, FileFormat};
use super::input::Source;
use super::inventory::{Counter, FormatDetails};
use super::limits::ReadLimits;
use super::names::Names;
use super::notes;
use super::oasis::Texts;
use super::read_warnings::ReadWarnings;
use super::scan::{Scan, scan};
use super::tree::{self, Tree};
use super::visit::Selection;
use crate::error::{Error, LayoutError, Result};
use metalith_core::{Progress, Silent};

/// Cells at the top that a message names.
const TOPS_NAMED: usize = 8;

/// A GDSII or OASIS file, or a drawing in DXF, of which every byte has been looked at once: cells in number, their tree, their
/// faults. Shapes are not held; [`Layout::visit`] reads them again.
pub struct Layout {
    source: Source,
    limits: ReadLimits,
    title: String,
    units: [f64; 2],
    cells: Vec<LayoutCell>,
    names: Names,
    tree: Tree,
    trailing: (u64, bool),
    format: FileFormat,
    texts: Texts,
    warnings: ReadWarnings,
    details: FormatDetails,
    /// Number of the name of each cell.
    numbers: Vec<u32>,
    /// True if cells that are not in the file count as empty.
    missing_are_empty: bool,
    /// Places of the cells of notes, which are no layout.
    pub(super) notes: Vec<std::ops::Range<u64>>,
}

/// A reference that leads nowhere or round in a circle, or a second cell of the same name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Faulty {
    /// Cell that holds the reference, or whose name is not its own.
    pub cell: String,
    /// Name referred to.
    pub name: String,
    /// Place in the file of the first such reference, or of the second cell.
    pub offset: u64,
}

/// Steps of a nanometre to which database units are rounded.
const STEPS_PER_NM: f64 = 20.0;

impl Layout {
    /// Read the file at `path` once.
    ///
    /// # Errors
    /// If it cannot be read, is neither GDSII nor OASIS, or is beyond [`ReadLimits::default`].
    pub fn open(path: &Path) -> Result<Self> {
        Self::of(Source::file(path)?, ReadLimits::default(), &Silent)
    }

    /// Read the file at `path` once, within `limits`. Unless `progress` is strict, it is warned of cells that are referred to and
    /// are not in the file, and they count as empty.
    ///
    /// # Errors
    /// As [`Layout::open`].
    pub fn open_with(path: &Path, limits: ReadLimits, progress: &dyn Progress) -> Result<Self> {
        Ok(Self::of(Source::file(path)?, limits, progress)?.without_missing_cells(path, progress))
    }

    /// This layout, in which cells that are not in the file count as empty, with a warning, unless `progress` is strict.
    fn without_missing_cells(mut self, path: &Path, progress: &dyn Progress) -> Self {
        if let Some(Faulty { cell, name, offset }) = self.dangling().into_iter().next().filter(|_| !progress.strict()) {
            let cause = LayoutError::Dangling { cell, name };
            progress.warn(&format!(
                "warning[layout/odd]: {}, byte {offset}: {cause}; such cells were taken as empty",
                path.display()
            ));
            self.missing_are_empty = true;
        }
        self
    }

    /// A layout from bytes in memory; `name` stands for the path in messages.
    ///
    /// # Errors
    /// As [`Layout::open`].
    pub fn from_bytes(name: &str, bytes: impl Into<std::sync::Arc<[u8]>>, limits: ReadLimits) -> Result<Self> {
        let source = Source::Memory {
            name: PathBuf::from(name),
            bytes: bytes.into(),
        };
        Self::of(source, limits, &Silent)
    }

    fn of(source: Source, limits: ReadLimits, progress: &dyn Progress) -> Result<Self> {
        Self::scanned(source, limits, None, progress)
    }

    fn scanned(source: Source, limits: ReadLimits, counter: Option<Counter>, progress: &dyn Progress) -> Result<Self> {
        if let Some(drawing) = source.drawing() {
            if let Some(cause) = drawing.fault().filter(|_| progress.strict()) {
                return Err(Error::Layout {
                    path: source.path().to_owned(),
                    offset: 0,
                    cause,
                });
            }
            let name = source.path().display();
            drawing
                .texts()
                .for_each(|text| progress.warn(&text.replacen(": ", &format!(": {name}: "), 1)));
        }
        let scan = scan(&source, &limits, counter, progress)?;
        scan.warnings.report(source.path(), progress);
        Ok(Self::from_scan(source, limits, scan))
    }

    /// Variant of [`Layout::open_with`] that counts kinds of shapes and extents of references too, for
    /// [`Layout::inventory`].
    ///
    /// # Errors
    /// As [`Layout::open`].
    pub fn open_counted(path: &Path, limits: ReadLimits, progress: &dyn Progress) -> Result<Self> {
        let layout = Self::scanned(Source::file(path)?, limits, Some(Counter::new()), progress)?;
        Ok(layout.without_missing_cells(path, progress))
    }

    pub(super) fn from_scan(source: Source, limits: ReadLimits, mut scan: Scan) -> Self {
        let notes = notes::take(&mut scan);
        let tree = tree::resolve(&mut scan.cells, &scan.names, &scan.numbers);
        Self {
            source,
            limits,
            title: scan.title,
            units: scan.units,
            cells: scan.cells,
            names: scan.names,
            tree,
            trailing: scan.trailing,
            format: scan.format,
            texts: scan.texts,
            warnings: scan.warnings,
            details: scan.details,
            numbers: scan.numbers,
            notes,
            missing_are_empty: false,
        }
    }

    /// Path that it was read from.
    pub fn path(&self) -> &Path {
        self.source.path()
    }

    /// Size of the file.
    pub fn bytes(&self) -> u64 {
        self.source.bytes()
    }

    /// Bytes behind ENDLIB, and whether any of them is not zero.
    pub fn trailing(&self) -> (u64, bool) {
        self.trailing
    }

    /// ReadWarnings from the format that were read over.
    pub fn warnings(&self) -> &ReadWarnings {
        &self.warnings
    }

    /// Details of its format.
    pub fn details(&self) -> &FormatDetails {
        &self.details
    }

    /// True if the file is compressed by gzip.
    pub fn is_gzip(&self) -> bool {
        self.source.is_gzip()
    }

    /// True if the file is a drawing in DXF, which is read as if it were GDSII.
    pub fn is_drawing(&self) -> bool {
        self.source.drawing().is_some()
    }

    /// Format that it is in.
    pub fn format(&self) -> FileFormat {
        self.format
    }

    /// Name of the library; OASIS has none.
    pub fn library(&self) -> &str {
        &self.title
    }

    /// Database unit (nm).
    pub fn unit_nm(&self) -> f64 {
        let nm = self.units[1] * 1e9;
        // The format's reals are not decimal: 1 and 0.1 nm come back to within 1e-16.
        let steps = nm * STEPS_PER_NM;
        if (steps - steps.round()).abs() < 1e-9 * steps {
            steps.round() / STEPS_PER_NM
        } else {
            nm
        }
    }

    /// Database unit in user units; 0.001 for a user unit of 1 um.
    pub fn user_unit(&self) -> f64 {
        self.units[0]
    }

    /// Database unit in nanometres as a ratio of whole numbers.
    ///
    /// # Errors
    /// If it is none, as with units of an inch.
    pub fn unit_ratio_nm(&self) -> Result<(i64, i64)> {
        let nm = self.unit_nm();
        (1..=10_000i64)
            .map(|den| (nm * den as f64, den))
            .find(|(num, _)| num.round() >= 1.0 && (num - num.round()).abs() < 1e-9 * num)
            .map(|(num, den)| (num.round() as i64, den))
            .ok_or_else(|| self.fault(0, LayoutError::UnitRatio { nm }))
    }

    /// Cells in the order of the file.
    pub fn cells(&self) -> &[LayoutCell] {
        &self.cells
    }

    /// Indices of cells that no other refers to.
    pub fn tops(&self) -> &[usize] {
        &self.tree.tops
    }

    /// The layout below one cell: the cell, and the cells that it refers to, as if the file had no others.
    ///
    /// # Errors
    /// If there is no such cell.
    pub fn below(mut self, top: &str) -> Result<Self> {
        let top = self.roots(&Selection {
            top: Some(top.to_owned()),
            lenient: true,
            ..Selection::default()
        })?[0];
        let mut wanted = vec![false; self.cells.len()];
        let mut next = vec![top];
        while let Some(cell) = next.pop() {
            if !std::mem::replace(&mut wanted[cell], true) {
                next.extend(self.cells[cell].children.iter().filter_map(|c| c.cell));
            }
        }
        let mut kept = wanted.iter();
        self.cells.retain(|_| kept.next().is_some_and(|&k| k));
        let mut kept = wanted.iter();
        self.numbers.retain(|_| kept.next().is_some_and(|&k| k));
        let children = self.cells.iter_mut().flat_map(|cell| &mut cell.children);
        children.for_each(|child| child.cut = false);
        self.tree = tree::resolve(&mut self.cells, &self.names, &self.numbers);
        Ok(self)
    }

    /// Bytes of the name of a cell.
    pub fn name_bytes(&self, cell: usize) -> &[u8] {
        self.names.name(self.numbers[cell])
    }

    /// Index of the cell with this name: its bytes, or as it is printed.
    pub fn cell_index(&self, name: &str) -> Option<usize> {
        match self.names.find(name.as_bytes()) {
            Some(number) => self.tree.definitions[number as usize],
            None => self.cells.iter().position(|cell| cell.name == name),
        }
    }

    /// Longest chain of references.
    pub fn depth(&self) -> u32 {
        self.cells.iter().map(|c| c.depth).max().unwrap_or(0)
    }

    /// Shapes with all references followed, from all top cells; at most `u64::MAX`.
    pub fn flat_shapes(&self) -> u64 {
        let placements: Vec<u64> = self.cells.iter().map(|c| c.placements).collect();
        tree::flat_shapes(&self.cells, &placements)
    }

    /// References to cells that are not in the file.
    pub fn dangling(&self) -> Vec<Faulty> {
        self.faulty(&self.tree.dangling)
    }

    /// References by which a cell contains itself.
    pub fn circles(&self) -> Vec<Faulty> {
        self.faulty(&self.tree.circles)
    }

    /// Cells with the name of a cell before them; references go to the first.
    pub fn doubled(&self) -> Vec<Faulty> {
        let faulty = |&c: &usize| Faulty {
            cell: self.cells[c].name.clone(),
            name: self.cells[c].name.clone(),
            offset: self.cells[c].bytes.start,
        };
        self.tree.doubled.iter().map(faulty).collect()
    }

    fn faulty(&self, places: &[(usize, usize)]) -> Vec<Faulty> {
        let faulty = |&(cell, child): &(usize, usize)| Faulty {
            cell: self.cells[cell].name.clone(),
            name: self.cells[cell].children[child].name.clone(),
            offset: self.cells[cell].children[child].offset,
        };
        places.iter().map(faulty).collect()
    }

    /// The limits it was read with.
    pub fn limits(&self) -> &ReadLimits {
        &self.limits
    }

    /// Indices of the cells a visit starts from.
    ///
    /// # Errors
    /// If there is no such cell, more than one to choose from, or a fault in the tree, unless lenient.
    pub fn roots(&self, selection: &Selection) -> Result<Vec<usize>> {
        if !selection.lenient {
            self.no_circles()?;
            if !(selection.without_missing || self.missing_are_empty) {
                self.no_dangling()?;
            }
            self.no_doubled()?;
        }
        if let Some(name) = &selection.top {
            let index = self.cell_index(name).ok_or_else(|| {
                let (name, tops) = (name.clone(), self.top_names());
                self.fault(0, LayoutError::NoSuchCell { name, tops })
            })?;
            return Ok(vec![index]);
        }
        match self.tree.tops.as_slice() {
            [] if !selection.lenient => Err(self.fault(0, LayoutError::NoCells)),
            [_] => Ok(self.tree.tops.clone()),
            all if selection.lenient => Ok(all.to_vec()),
            all => {
                let cause = LayoutError::SeveralTops {
                    count: all.len(),
                    tops: self.top_names(),
                };
                Err(self.fault(self.cells[all[1]].bytes.start, cause))
            }
        }
    }

    /// Checks that every reference leads to a cell.
    ///
    /// # Errors
    /// The first reference to a cell that is not in the file.
    pub fn no_dangling(&self) -> Result<()> {
        match self.dangling().into_iter().next() {
            Some(Faulty { cell, name, offset }) => Err(self.fault(offset, LayoutError::Dangling { cell, name })),
            None => Ok(()),
        }
    }

    /// Checks that no reference leads round in a circle.
    pub(super) fn no_circles(&self) -> Result<()> {
        match self.circles().into_iter().next() {
            Some(Faulty { cell, name, offset }) => Err(self.fault(offset, LayoutError::Circle { cell, name })),
            None => Ok(()),
        }
    }

    /// Checks that no two cells have one name.
    pub(super) fn no_doubled(&self) -> Result<()> {
        match self.doubled().into_iter().next() {
            Some(Faulty { name, offset, .. }) => Err(self.fault(offset, LayoutError::Doubled { name })),
            None => Ok(()),
        }
    }

    /// The first cells at the top.
    fn top_names(&self) -> Vec<String> {
        let first = self.tree.tops.iter().take(TOPS_NAMED);
        let mut names: Vec<String> = first.map(|&t| self.cells[t].name.clone()).collect();
        if self.tree.tops.len() > TOPS_NAMED {
            names.push("...".into());
        }
        names
    }

    /// An error at a place of this layout.
    pub(super) fn fault(&self, offset: u64, cause: LayoutError) -> Error {
        Error::Layout {
            path: self.path().to_owned(),
            offset,
            cause,
        }
    }

    /// Start reading its cells again.
    pub(super) fn reopen(&self) -> Result<CellInput> {
        CellInput::open(&self.source, self.format, &self.texts)
    }

    pub(super) fn tree(&self) -> &Tree {
        &self.tree
    }

    pub(super) fn source(&self) -> &Source {
        &self.source
    }

    pub(super) fn names(&self) -> &Names {
        &self.names
    }

    /// Index of the inline cell with this name, or `u32::MAX`.
    pub(super) fn inline_cell(&self, name: &[u8]) -> u32 {
        self.names
            .find(name)
            .and_then(|number| self.tree.definitions[number as usize])
            .filter(|&index| self.cells[index].inline)
            .map_or(u32::MAX, |index| index as u32)
    }
}
