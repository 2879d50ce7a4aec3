//! How far single cells and local gratings are from rows of real pillars of `designs/prototype_3x3.toml`, whose optimised
//! phase jumps from ring to ring.
//!
//! Rows of 20 consecutive pillars along x at three radii of the centre element, light along the normal; prints the light
//! that each model puts elsewhere than the supercell of the row does. From the folder `crates/grating`:
//! `cargo run --release --example real_rows -- 530`; about half a minute on one core.

use std::f64::consts::TAU;

use metalith_cell::{CellModel, PointwiseCell};
use metalith_core::{Error, Result, Silent, Wedge};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, WidthRule};
use metalith_grating::{CoarseCell, FIRST_KEPT, GratingTable, GratingTableSpec, Mapping, RealRow, SlopeMap};
use num_complex::Complex64;

/// Pillars of a row.
const PILLARS: usize = 20;

/// Radii of the rows (um).
const RADII_UM: [f64; 3] = [60.0, 220.0, 420.0];

fn main() -> Result<()> {
    let nm = std::env::args().nth(1).unwrap_or_else(|| "530".into());
    let nm: f64 = nm
        .parse()
        .map_err(|_| Error::invalid(format!("`{nm}` as a wavelength"), "give it in nm, such as 530"))?;
    let design = Design::read(&metalith_testing::design("prototype_3x3"))?;
    let (stack, um) = (design.cell_stack()?, nm * 1e-3);
    let rule = WidthRule::new(&design.cell, &design.mapping);
    let mapping = Mapping::new(|u| rule.width_nm(u));
    let coarse = CoarseCell::new(&stack, um, mapping.range_nm())?;
    let pointwise = PointwiseCell::new(stack.clone(), design.cell.widths_nm());
    let by_width = pointwise.transmissions(um, design.cell.pitch_nm as u16)?;
    let full = coarse.full_transmission()?;

    let lattice = design.lattice();
    let lens = LensPhase::new(lattice, design.lens.diameter_nm, &design.lens.phase);
    let wedge = Wedge {
        wavelength_um: 0.55,
        sin_x: 0.0,
        sin_y: 0.0,
    };
    let phase = ElementPhase::new(&lens, &wedge);
    let slopes = SlopeMap::new(lattice, |x, y| phase.turns(x, y));
    let spec = GratingTableSpec {
        wavelength_um: um,
        sines: [0.0; 2],
        middle: [0.0; 2],
        radius: 0.14,
    };
    let table = GratingTable::obtain(&spec, &stack, &mapping, None, &Silent)?;
    println!(
        "{nm} nm: {} gratings, left out: {:.3} in amplitude; blocks reach {:.3} turns a site",
        GratingTable::gratings(&spec)?,
        table.left_out()?,
        slopes.radius([0.0; 2], 0.99),
    );
    println!("| radius (um) | vector (turns a site) | local cell | local grating |");
    println!("| ---: | ---: | ---: | ---: |");
    for radius_um in RADII_UM {
        let (first, y) = (
            (radius_um / lattice.pitch_um()) as usize + lattice.sites() / 2,
            lattice.sites() / 2,
        );
        let row = RealRow {
            direction: [1, 0],
            widths_nm: (first..first + PILLARS)
                .filter_map(|x| phase.wrapped(x, y))
                .map(|u| f64::from(rule.width_nm(u)))
                .collect(),
        };
        let k = slopes.at(first + PILLARS / 2, y);
        let amplitudes = table.amplitudes(k);
        let local = row.misfit(&coarse, [0.0; 2], |_, widths| {
            let t: Vec<_> = widths.iter().map(|w| by_width[*w as usize]).collect();
            Ok([t.clone(), t])
        })?;
        let grating = row.misfit(&coarse, [0.0; 2], |_, widths| {
            Ok([0, 1].map(|pol: usize| {
                let each = widths.iter().map(|w| {
                    let u = mapping.phase(*w as u16).unwrap_or(0.0);
                    let orders = amplitudes[pol].iter().zip(FIRST_KEPT..);
                    let sum: Complex64 = orders.map(|(c, m)| c * Complex64::cis(TAU * f64::from(m) * u)).sum();
                    sum * full
                });
                each.collect()
            }))
        })?;
        println!("| {radius_um} | {:.3} | {local:.3} | {grating:.3} |", k[0]);
    }
    Ok(())
}
