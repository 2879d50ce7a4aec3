//! Write the pillars of a lens as OASIS, then read the file and count them on each layer:
//! `cargo run --release -p metalith-oasis --example write_and_count -- LENS.oas`
//!
//! Lengths are in grid steps, here of 1 nm. Pillars of one width are one record with a list of places.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};

use metalith_oasis::{
    CellBounds, CompressedBlock, OasisItem, OasisLimits, OasisReader, OasisShape, OasisWriter, RecordBuffer, Repetition,
};

const PITCH_NM: i32 = 350;
/// Places from the middle of the lens to its rim.
const REACH: i32 = 100;
const LAYER: [u32; 2] = [1, 0];

/// Width of a pillar at this distance from the axis: rings of 100 to 280 nm in steps of 20 nm.
fn width_nm(x: i32, y: i32) -> i64 {
    let waves = (f64::from(x).hypot(f64::from(y)) / 12.0).powi(2).fract();
    100 + 20 * (10.0 * waves) as i64
}

fn main() -> Result<(), Box<dyn Error>> {
    let given = std::env::args_os().nth(1).map(std::path::PathBuf::from);
    let path = given.unwrap_or_else(|| std::env::temp_dir().join("metalith_write_and_count.oas"));

    // Lower left corners of the pillars of each width.
    let mut corners = BTreeMap::<i64, Vec<[i32; 2]>>::new();
    let places = (-REACH..=REACH).flat_map(|y| (-REACH..=REACH).map(move |x| [x, y]));
    for [x, y] in places.filter(|[x, y]| x * x + y * y <= REACH * REACH) {
        let width = width_nm(x, y);
        corners
            .entry(width)
            .or_default()
            .push([x, y].map(|place| place * PITCH_NM - width as i32 / 2));
    }
    let mut writer = OasisWriter::new(BufWriter::new(File::create(&path)?), 1000.0, &["LENS"], false)?;
    let lens = writer.cell_number("LENS");
    writer.begin_cell(lens)?;
    let mut records = RecordBuffer::absolute();
    for (&width, corners) in &corners {
        let first = corners[0];
        let places = corners[1..]
            .iter()
            .map(|c| [c[0] - first[0], c[1] - first[1]])
            .collect();
        records.rectangle(
            LAYER,
            first.map(i64::from),
            [width; 2],
            Some(&Repetition::List { grid: 1, places }),
        );
    }
    writer.block(&CompressedBlock::of(records.bytes(), 6))?;
    writer.end_cell(CellBounds::Unknown);
    let (mut file, bytes) = writer.finish()?;
    file.flush()?;
    println!(
        "{}: {bytes} bytes, {} before compression",
        path.display(),
        records.bytes().len()
    );

    // The checksum is verified here. Copies are counted and areas are summed without drawing them.
    let mut reader = OasisReader::new(BufReader::new(File::open(&path)?), OasisLimits::default())?;
    let step_um = 1.0 / reader.grid_per_um();
    let mut layers = BTreeMap::<[u32; 2], (u64, u64, f64)>::new();
    loop {
        match reader.read_item()? {
            OasisItem::Element(element) => {
                if let OasisShape::Rectangle { size: [width, height] } = element.shape {
                    let (records, shapes, area_um2) = layers.entry([element.layer, element.datatype]).or_default();
                    *records += 1;
                    *shapes += element.copies;
                    *area_um2 += element.copies as f64 * (width * height) as f64 * step_um * step_um;
                }
            }
            OasisItem::End => break,
            _ => {}
        }
    }
    for ([layer, datatype], (records, shapes, area_um2)) in layers {
        println!("layer {layer}/{datatype}: {shapes} rectangles in {records} records, {area_um2:.1} um^2");
    }
    Ok(())
}
