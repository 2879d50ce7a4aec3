//! Cells as GDSII.

use std::io::{BufWriter, Write};
use std::path::Path;

use gds21::{GdsArrayRef, GdsBoundary, GdsDateTimes, GdsElement, GdsLibrary, GdsPath, GdsPoint, GdsStrans};
use gds21::{GdsStruct, GdsStructRef, GdsTextElem, GdsUnits};
use metalith_core::{AtomicFile, Error, LayerNumber, Progress, Result};
use metalith_gds::{CellConsumer, CellItem, Layout, LayoutCell, Point};
use metalith_oasis::Repetition;

use super::does_not_fit;
use crate::gds_frame::encode;

/// Elements that gds21 encodes at a time.
const AT_A_TIME: usize = 4096;
/// Points of one XY record.
const MOST_POINTS: usize = 8191;
/// Columns and rows of an array.
const MOST_COLUMNS: u64 = i16::MAX as u64;
/// Records ENDSTR and ENDLIB.
const END: usize = 4;
/// Record ENDSTR.
const END_OF_CELL: [u8; 4] = [0, 4, 7, 0];
/// Record ENDLIB.
const END_OF_LIBRARY: [u8; 4] = [0, 4, 4, 0];

/// Write all cells. Returns the length of the file.
pub(super) fn write(layout: &Layout, path: &Path, progress: &dyn Progress) -> Result<u64> {
    let mut target = Target {
        layout,
        out: BufWriter::new(AtomicFile::create(path)?),
        path,
        bytes: 0,
        elements: Vec::new(),
        name: None,
    };
    let head = encode(&library(layout))?;
    target.put(&head[..head.len() - END])?;
    layout.cell_items(&mut target, progress)?;
    target.end()?;
    target.put(&END_OF_LIBRARY)?;
    let io = |error| Error::io("write", path)(error);
    target.out.flush().map_err(io)?;
    target.out.into_inner().map_err(|e| io(e.into_error()))?.commit()?;
    Ok(target.bytes)
}

/// The date of everything: a file must not depend on when it was written.
fn dates() -> GdsDateTimes {
    let date = chrono::DateTime::UNIX_EPOCH.naive_utc();
    GdsDateTimes {
        modified: date,
        accessed: date,
    }
}

fn library(layout: &Layout) -> GdsLibrary {
    let mut library = GdsLibrary::new("LIB");
    library.units = GdsUnits::new(layout.user_unit(), layout.unit_nm() * 1e-9);
    library.dates = dates();
    library
}

struct Target<'a> {
    layout: &'a Layout,
    out: BufWriter<AtomicFile>,
    path: &'a Path,
    bytes: u64,
    elements: Vec<GdsElement>,
    /// Name of the cell that is open, and whether its head was written.
    name: Option<(String, bool)>,
}

impl Target<'_> {
    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.bytes += bytes.len() as u64;
        self.out.write_all(bytes).map_err(Error::io("write", self.path))
    }

    /// Write the elements at hand, with the head of their cell if that was not written.
    fn flush(&mut self) -> Result<()> {
        let Some((name, begun)) = &mut self.name else {
            return Ok(());
        };
        let mut library = library(self.layout);
        let head = encode(&library)?.len() - END;
        let cell = |elems| GdsStruct {
            name: name.clone(),
            dates: dates(),
            elems,
        };
        library.structs.push(cell(Vec::new()));
        let empty = encode(&library)?;
        library.structs[0] = cell(std::mem::take(&mut self.elements));
        let full = encode(&library)?;
        // From the head of the cell, or from behind it, to before ENDSTR and ENDLIB.
        let from = if std::mem::replace(begun, true) {
            empty.len() - 2 * END
        } else {
            head
        };
        self.put(&full[from..full.len() - 2 * END])
    }

    fn end(&mut self) -> Result<()> {
        if self.name.is_some() {
            self.flush()?;
            self.name = None;
            self.put(&END_OF_CELL)?;
        }
        Ok(())
    }

    fn push(&mut self, element: GdsElement) -> Result<()> {
        self.elements.push(element);
        if self.elements.len() >= AT_A_TIME {
            self.flush()
        } else {
            Ok(())
        }
    }

    /// One copy of an item, farther by a step.
    fn copy(&mut self, item: &CellItem<'_>, by: [i64; 2]) -> Result<()> {
        let element = match *item {
            CellItem::Area { layer, points } => {
                let (layer, datatype) = numbers(layer)?;
                let mut xy = moved(points, by)?;
                if xy.first() != xy.last() {
                    xy.push(xy[0].clone());
                }
                fits(xy.len())?;
                GdsBoundary {
                    layer,
                    datatype,
                    xy,
                    ..Default::default()
                }
                .into()
            }
            CellItem::Line {
                layer,
                points,
                width,
                extensions,
            } => {
                let (layer, datatype) = numbers(layer)?;
                let xy = moved(points, by)?;
                fits(xy.len())?;
                let plain = extensions == [0, 0];
                GdsPath {
                    layer,
                    datatype,
                    xy,
                    width: Some(coordinate(width)?),
                    path_type: Some(if plain { 0 } else { 4 }),
                    begin_extn: (!plain).then(|| coordinate(extensions[0])).transpose()?,
                    end_extn: (!plain).then(|| coordinate(extensions[1])).transpose()?,
                    ..Default::default()
                }
                .into()
            }
            CellItem::Text { layer, string, at } => {
                let (layer, texttype) = numbers(layer)?;
                GdsTextElem {
                    string: metalith_core::text::printable_bytes(string),
                    layer,
                    texttype,
                    xy: moved(&[at], by)?.remove(0),
                    ..Default::default()
                }
                .into()
            }
            CellItem::Reference { cell, at, .. } => GdsStructRef {
                name: self.layout.cells()[cell].name.clone(),
                xy: moved(&[at], by)?.remove(0),
                strans: strans(item),
                ..Default::default()
            }
            .into(),
        };
        self.push(element)
    }
}

impl CellConsumer for Target<'_> {
    fn cell(&mut self, _index: usize, cell: &LayoutCell) -> Result<()> {
        self.end()?;
        self.name = Some((cell.name.clone(), false));
        Ok(())
    }

    fn item(&mut self, item: &CellItem<'_>, repetition: Option<&Repetition>) -> Result<()> {
        let Some(repetition) = repetition else {
            return self.copy(item, [0, 0]);
        };
        if let (CellItem::Reference { cell, at, .. }, Repetition::Grid { count, step }) = (item, repetition)
            && count.iter().all(|&n| n <= MOST_COLUMNS)
        {
            let [columns, rows] = count.map(|n| n as i64);
            let along = [columns * step[0][0], columns * step[0][1]];
            let up = [rows * step[1][0], rows * step[1][1]];
            let corner = |by: [i64; 2]| Ok::<_, Error>(moved(&[*at], by)?.remove(0));
            return self.push(
                GdsArrayRef {
                    name: self.layout.cells()[*cell].name.clone(),
                    xy: [corner([0, 0])?, corner(along)?, corner(up)?],
                    cols: columns as i16,
                    rows: rows as i16,
                    strans: strans(item),
                    ..Default::default()
                }
                .into(),
            );
        }
        // So many copies fit: see `Layout::copies_fit`.
        repetition.each(|by| self.copy(item, by))
    }
}

fn strans(item: &CellItem<'_>) -> Option<GdsStrans> {
    let CellItem::Reference {
        mirrored,
        magnification,
        angle_deg,
        ..
    } = *item
    else {
        return None;
    };
    (mirrored || magnification != 1.0 || angle_deg != 0.0).then(|| GdsStrans {
        reflected: mirrored,
        mag: (magnification != 1.0).then_some(magnification),
        angle: (angle_deg != 0.0).then_some(angle_deg),
        ..Default::default()
    })
}

fn numbers(layer: LayerNumber) -> Result<(i16, i16)> {
    match (i16::try_from(layer.layer), i16::try_from(layer.datatype)) {
        (Ok(layer), Ok(datatype)) => Ok((layer, datatype)),
        _ => Err(does_not_fit(
            format!("layer {layer}"),
            "GDSII has layers and datatypes up to 32767: renumber it",
        )),
    }
}

fn coordinate(value: i64) -> Result<i32> {
    i32::try_from(value).map_err(|_| {
        does_not_fit(
            format!("a coordinate of {value}"),
            "coordinates of GDSII have 32 bits: write the layout about the origin, or on a coarser grid",
        )
    })
}

fn moved(points: &[Point], by: [i64; 2]) -> Result<Vec<GdsPoint>> {
    points
        .iter()
        .map(|p| Ok(GdsPoint::new(coordinate(p.x + by[0])?, coordinate(p.y + by[1])?)))
        .collect()
}

fn fits(points: usize) -> Result<()> {
    if points > MOST_POINTS {
        return Err(does_not_fit(
            format!("an outline of {points} points"),
            "an element of GDSII has at most 8191: split the polygon",
        ));
    }
    Ok(())
}
