//! Directions into which the pillars of a written layout send light: `cargo run --release --example light -- DESIGN LAYOUT`.
//!
//! Each pillar that is read back from the layout passes its rigorous transmission; the order m of an
//! element is the share that has m times the phase of the design there. The first order makes the image,
//! the zero order is haze. The library of the cell is that of `metalith cells`.

use std::path::Path;

use metalith::cell::{RigorousCell, cache_folder};
use metalith::layout::read_pillars;
use metalith::phase::{ElementPhase, LensPhase};
use metalith::{CellModel, Design, PillarArray, Result, Silent};
use num_complex::Complex64;

fn main() -> Result<()> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [design, layout] = arguments.as_slice() else {
        panic!("usage: light DESIGN.toml LAYOUT.gds");
    };
    let design = Design::read(Path::new(design))?;
    let array = PillarArray::build(&design, &Silent)?;
    let extraction = read_pillars(&design, Path::new(layout), &Silent)?;
    let lens = LensPhase::of(&design);
    let (cell, _) = RigorousCell::obtain(&design.table_spec()?, cache_folder().as_deref(), &Silent)?;
    let wavelengths_um = design.compared_um();
    let tables = wavelengths_um
        .iter()
        .map(|&l| {
            Ok((
                cell.transmissions(l, design.cell.pitch_nm.nm() as u16)?,
                cell.full_transmission(l)?,
            ))
        })
        .collect::<Result<Vec<_>>>()?;

    let mut sums = vec![[0.0; 2]; wavelengths_um.len()];
    for (placed, found) in array.placed.iter().zip(&extraction.elements) {
        let phase = ElementPhase::of(&lens, &placed.element);
        // Sums of exp(-2 pi i m u) over the pillars of each width, for m = 0 and 1.
        let mut by_width = vec![[Complex64::ZERO; 2]; design.cell.pitch_nm.nm() as usize + 1];
        let mut pillars = 0.0;
        for ((iy, ix), &width) in found.widths.number.indexed_iter() {
            if let (Some(u), true) = (phase.wrapped(ix, iy), width > 0) {
                let entry = &mut by_width[usize::from(width)];
                entry[0] += 1.0;
                entry[1] += Complex64::cis(-std::f64::consts::TAU * u);
                pillars += 1.0;
            }
        }
        for ((table, full), sum) in tables.iter().zip(&mut sums) {
            for order in [0, 1] {
                let amplitude: Complex64 = table.iter().zip(&by_width).map(|(t, w)| t * w[order]).sum();
                sum[order] += (amplitude / (pillars * full)).norm_sqr() / array.placed.len() as f64;
            }
        }
    }
    println!("wavelength   first order   zero order");
    for (wavelength, [zero, first]) in wavelengths_um.iter().zip(&sums) {
        println!("{:>7.0} nm {first:>13.3} {zero:>12.3}", wavelength * 1e3);
    }
    Ok(())
}
