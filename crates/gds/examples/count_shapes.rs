//! Shapes and area on each layer of a layout: `cargo run --release -p metalith-gds --example count_shapes -- FILE`
//!
//! FILE is GDSII, OASIS or DXF, gzip or not; its first bytes tell which. Without FILE a small chip in memory is counted. The file
//! is streamed: each shape is decoded once and comes with all places of its cell.

use std::collections::BTreeMap;
use std::error::Error;

use metalith_core::{LayerNumber, Silent};
use metalith_gds::library::{GdsCell, GdsElement, GdsLibrary};
use metalith_gds::{Layout, Point, ReadLimits, Selection, Shape, Transform, Visitor};

/// Sums of one layer.
#[derive(Default)]
struct Tally {
    shapes: u64,
    area: f64,
}

/// Sums of all layers, in database units.
#[derive(Default)]
struct Tallies(BTreeMap<LayerNumber, Tally>);

impl Visitor for Tallies {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        let points: Vec<Point> = shape.outline.points().collect();
        let next = points.iter().cycle().skip(1);
        // The shoelace formula.
        let twice: f64 = points
            .iter()
            .zip(next)
            .map(|(a, b)| (a.x * b.y - b.x * a.y) as f64)
            .sum();
        let tally = self.0.entry(shape.layer).or_default();
        tally.shapes += placements.len() as u64;
        tally.area += placements
            .iter()
            .map(|at| at.magnification().powi(2) * 0.5 * twice.abs())
            .sum::<f64>();
        Ok(())
    }
}

/// A chip of 3 x 3 copies of a cell with two squares, one in a frame on another layer. Database unit 1 nm.
fn small_chip() -> Result<Layout, Box<dyn Error>> {
    let square = |layer, [x, y]: [i32; 2], width| GdsElement::Polygon {
        layer: LayerNumber::new(layer, 0),
        corners: vec![[x, y], [x + width, y], [x + width, y + width], [x, y + width], [x, y]],
    };
    let mut library = GdsLibrary::new("CHIP", [1e-3, 1e-9], [2026, 1, 1, 0, 0, 0]);
    library.cells = vec![
        GdsCell {
            name: "LENS".into(),
            elements: vec![
                square(1, [0, 0], 120),
                square(1, [350, 0], 200),
                square(2, [-100, -100], 800),
            ],
        },
        GdsCell {
            name: "TOP".into(),
            elements: vec![GdsElement::Array {
                cell: "LENS".into(),
                columns: 3,
                rows: 3,
                places: [[0, 0], [3000, 0], [0, 3000]],
            }],
        },
    ];
    let bytes = library
        .encode()
        .map_err(|long| format!("a record of {} bytes", long.bytes))?;
    Ok(Layout::from_bytes("chip.gds", bytes, ReadLimits::default())?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let layout = match std::env::args_os().nth(1) {
        Some(path) => Layout::open(path.as_ref())?,
        None => small_chip()?,
    };
    let mut tallies = Tallies::default();
    layout.visit(&Selection::default(), &mut tallies, &Silent)?;
    let unit_um = 1e-3 * layout.unit_nm();
    println!(
        "{} cells, {} bytes, database unit {} nm",
        layout.cells().len(),
        layout.bytes(),
        layout.unit_nm()
    );
    for (layer, Tally { shapes, area }) in tallies.0 {
        println!("layer {layer}: {shapes} shapes, {:.3} um^2", area * unit_um * unit_um);
    }
    Ok(())
}
