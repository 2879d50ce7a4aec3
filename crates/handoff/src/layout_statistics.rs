//! Content of a layout file, counted from its bytes.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use metalith_core::{Progress, Result};
use metalith_gds::{LayerNumber, Layout, LayoutCell, ReadLimits, Rect, Selection, Shape, Text, Transform, Visitor};

/// One file.
#[derive(Clone, Debug, Serialize)]
pub struct LayoutStatistics {
    pub file: String,
    pub bytes: u64,
    pub top: String,
    /// Longest chain of references.
    pub depth: u32,
    pub cells: Vec<CellCount>,
    pub layers: Vec<LayerCount>,
}

/// One cell of the tree.
#[derive(Clone, Debug, Serialize)]
pub struct CellCount {
    pub name: String,
    pub depth: u32,
    pub shapes: u64,
    pub references: u64,
    /// Number of placements in the layout.
    pub placements: u64,
    pub children: Vec<String>,
}

/// One layer, all references followed.
#[derive(Clone, Debug, Serialize)]
pub struct LayerCount {
    pub layer: u16,
    pub datatype: u16,
    pub shapes: u64,
    pub texts: u64,
    /// Sum of the areas drawn.
    pub area_um2: f64,
    /// Lower left and upper right corner.
    pub bounds_um: Option<[f64; 4]>,
}

impl LayoutStatistics {
    /// Count the file at `path`.
    ///
    /// # Errors
    /// If it cannot be read or has faults.
    pub fn take(path: &Path, progress: &dyn Progress) -> Result<Self> {
        Self::of(&Layout::open_with(path, ReadLimits::default(), progress)?, progress)
    }

    /// Count a layout that is open.
    ///
    /// # Errors
    /// If it cannot be read again or has faults.
    pub fn of(layout: &Layout, progress: &dyn Progress) -> Result<Self> {
        let mut counter = Counter::default();
        layout.visit(&Selection::default(), &mut counter, progress)?;
        counter.flush();
        let nm = layout.unit_nm();
        let um = nm * 1e-3;
        let layers = counter.layers.iter().map(|(layer, tally)| LayerCount {
            layer: layer.layer,
            datatype: layer.datatype,
            shapes: tally.shapes,
            texts: tally.texts,
            area_um2: tally.twice_area as f64 / 2.0 * um * um,
            bounds_um: (!tally.bounds.is_empty())
                .then(|| [tally.bounds.x0, tally.bounds.y0, tally.bounds.x1, tally.bounds.y1].map(|v| v as f64 * um)),
        });
        let cells = layout.cells().iter().map(|cell| CellCount {
            name: cell.name.clone(),
            depth: cell.depth,
            shapes: cell.shapes(),
            references: cell.references(),
            placements: cell.placements,
            children: cell.children.iter().map(|c| c.name.clone()).collect(),
        });
        Ok(Self {
            file: layout
                .path()
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            bytes: layout.bytes(),
            top: layout
                .tops()
                .first()
                .map_or_else(String::new, |&t| layout.cells()[t].name.clone()),
            depth: layout.depth(),
            cells: cells.collect(),
            layers: layers.collect(),
        })
    }

    /// The counts of one layer.
    pub fn layer(&self, layer: i16, datatype: i16) -> Option<&LayerCount> {
        self.layers
            .iter()
            .find(|l| (i32::from(l.layer), i32::from(l.datatype)) == (i32::from(layer), i32::from(datatype)))
    }
}

#[derive(Default)]
struct Counter {
    layers: BTreeMap<LayerNumber, LayerSum>,
    /// Bounds of the cell that is being visited, in its own coordinates.
    own: BTreeMap<LayerNumber, Rect>,
    placements: Vec<Transform>,
}

struct LayerSum {
    shapes: u64,
    texts: u64,
    twice_area: i128,
    bounds: Rect,
}

impl LayerSum {
    const NONE: Self = Self {
        shapes: 0,
        texts: 0,
        twice_area: 0,
        bounds: Rect::EMPTY,
    };
}

impl Counter {
    /// Place the bounds of the last cell.
    fn flush(&mut self) {
        for (layer, own) in std::mem::take(&mut self.own) {
            let bounds = &mut self.layers.entry(layer).or_insert(LayerSum::NONE).bounds;
            for placed in self.placements.iter().filter_map(|t| t.apply_rect(&own)) {
                bounds.unite(&placed);
            }
        }
    }
}

impl Visitor for Counter {
    fn cell(&mut self, _cell: &LayoutCell, placements: &[Transform]) -> Result<()> {
        self.flush();
        self.placements = placements.to_vec();
        Ok(())
    }

    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let tally = self.layers.entry(shape.layer).or_insert(LayerSum::NONE);
        tally.shapes += placements.len() as u64;
        if !placements.iter().all(Transform::is_square) {
            for placement in placements {
                let points = shape.outline.placed(placement);
                tally.twice_area += twice_area(points.iter().copied());
                tally.bounds.unite(&Rect::around(&points));
            }
            return Ok(());
        }
        let twice = match &shape.rect {
            Some(r) => 2 * i128::from(r.width()) * i128::from(r.height()),
            None => twice_area(shape.outline.points()),
        };
        tally.twice_area += twice * placements.len() as i128;
        let around = shape.rect.unwrap_or_else(|| shape.outline.around());
        self.own.entry(shape.layer).or_insert(Rect::EMPTY).unite(&around);
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> Result<()> {
        self.layers.entry(text.layer).or_insert(LayerSum::NONE).texts += placements.len() as u64;
        Ok(())
    }
}

/// Twice the area of a polygon, whichever way it turns.
pub(super) fn twice_area(points: impl Iterator<Item = metalith_gds::Point> + Clone) -> i128 {
    let around = points.clone().zip(points.cycle().skip(1));
    let signed: i128 = around
        .map(|(a, b)| i128::from(a.x) * i128::from(b.y) - i128::from(b.x) * i128::from(a.y))
        .sum();
    signed.abs()
}
