//! Jones matrices of cells of circles, on a square and on a hexagonal lattice, and of rotated rectangles, for `scripts/shape_peers.py`:
//! `cargo run --release --example shapes -- 17 25`.
//!
//! One line of JSON for each number of orders, along the normal, of all kinds or of those that are named (`circle`, `rectangle`,
//! `upright`): all cases of [`CIRCLES`] at five diameters on both lattices,
//! [`RECTANGLES`] of one size at five angles, of all sizes at the angles of [`ALIGNED`], and all of them as upright rectangles, which
//! have a rule of their own.

use metalith::cell::{CellStack, Material, RotatedRectangle};
use metalith::rcwa::{CellLattice, Orders};
use metalith::{PillarShape, Result};
use num_complex::Complex64;

/// Film, pitch, height (nm), wavelength (um) and the smallest diameter and its step (nm). From fused silica to air.
const CIRCLES: [(&str, f64, f64, f64, f64, f64); 6] = [
    ("sin_luke_2015", 350.0, 700.0, 0.455, 110.0, 45.0),
    ("sin_luke_2015", 350.0, 700.0, 0.530, 110.0, 45.0),
    ("sin_luke_2015", 350.0, 700.0, 0.660, 110.0, 45.0),
    ("tio2_siefke_2016", 320.0, 600.0, 0.532, 90.0, 40.0),
    ("a_si_pierce_1972", 450.0, 550.0, 0.940, 100.0, 50.0),
    ("a_si_pierce_1972", 750.0, 900.0, 1.550, 200.0, 70.0),
];

/// Film, pitch, height (nm), wavelength (um), widths and lengths (nm).
type RectangleCase = (&'static str, f64, f64, f64, &'static [(f64, f64)]);
const RECTANGLES: [RectangleCase; 7] = [
    ("sin_luke_2015", 350.0, 700.0, 0.530, &[(110.0, 260.0), (90.0, 200.0)]),
    ("sin_luke_2015", 400.0, 800.0, 0.660, &[(140.0, 320.0), (180.0, 260.0)]),
    (
        "tio2_siefke_2016",
        355.0,
        600.0,
        0.532,
        &[(100.0, 250.0), (70.0, 280.0)],
    ),
    (
        "tio2_siefke_2016",
        320.0,
        600.0,
        0.532,
        &[(90.0, 200.0), (120.0, 170.0), (130.0, 240.0)],
    ),
    (
        "a_si_pierce_1972",
        450.0,
        550.0,
        0.940,
        &[(120.0, 260.0), (160.0, 300.0)],
    ),
    (
        "a_si_pierce_1972",
        750.0,
        900.0,
        1.550,
        &[(200.0, 440.0), (300.0, 520.0), (260.0, 360.0)],
    ),
    ("sin_luke_2015", 350.0, 700.0, 0.455, &[(120.0, 220.0)]),
];

/// Of so many of [`RECTANGLES`] the first size is turned by [`ANGLES`].
const TURNED: usize = 6;

/// Angles of the rectangles (degrees).
const ANGLES: [f64; 5] = [10.0, 30.0, 45.0, 70.0, 110.0];

/// Angles at which rectangles are parallel to the edges of a square cell, of one pitch or of two pillars at the root of two
/// (degrees): codes without rotated shapes can solve these too.
const ALIGNED: [f64; 2] = [0.0, 45.0];

fn stack(film: &str, pitch: f64, height: f64) -> Result<CellStack> {
    Ok(CellStack {
        film: Material::named(film)?,
        ..CellStack::paper(pitch, height)?
    })
}

/// What a point is, and its Jones matrix: xx, xy, yx, yy.
fn point(stack: &CellStack, wavelength: f64, shape: &str, jones: [[Complex64; 2]; 2]) -> Result<String> {
    let film = stack.film.index(wavelength)?;
    let entries = jones.iter().flatten().map(|t| format!("[{:.8}, {:.8}]", t.re, t.im));
    Ok(format!(
        "{{\"pitch\": {}, \"height\": {}, \"wavelength\": {}, {shape}, \"film\": [{}, {}], \"below\": {}, \"jones\": [{}]}}",
        stack.pitch_nm,
        stack.height_nm,
        wavelength * 1e3,
        film.re,
        film.im,
        stack.substrate.index(wavelength)?.re,
        entries.collect::<Vec<_>>().join(", ")
    ))
}

/// The Jones matrix of a rectangle of this width and length (nm).
fn rectangle(
    stack: &CellStack,
    wavelength: f64,
    (width_nm, length_nm): (f64, f64),
    degrees: f64,
    orders: Orders,
) -> Result<[[Complex64; 2]; 2]> {
    let pillar = RotatedRectangle {
        width_nm,
        length_nm,
        rotation: degrees.to_radians(),
    };
    stack.jones(&pillar, wavelength, [0.0; 2], orders)
}

/// Round pillars.
fn circles(orders: Orders, points: &mut Vec<String>) -> Result<()> {
    for hexagonal in [false, true] {
        for (film, pitch, height, wavelength, first, step) in CIRCLES {
            let stack = CellStack {
                shape: PillarShape::Circle,
                lattice: if hexagonal {
                    CellLattice::hexagonal(pitch)
                } else {
                    CellLattice::Square
                },
                ..stack(film, pitch, height)?
            };
            for diameter in (0..5).map(|k| first + step * f64::from(k)) {
                let t = stack.transmission(diameter, wavelength, orders)?;
                let jones = [[t, Complex64::ZERO], [Complex64::ZERO, t]];
                let shape = format!("\"diameter\": {diameter}, \"hexagonal\": {hexagonal}");
                points.push(point(&stack, wavelength, &shape, jones)?);
            }
        }
    }
    Ok(())
}

/// Rotated rectangles.
fn rectangles(orders: Orders, points: &mut Vec<String>) -> Result<()> {
    let mut add = |case: &RectangleCase, size: (f64, f64), degrees: f64, remark: &str| -> Result<()> {
        let (film, pitch, height, wavelength, _) = *case;
        let stack = stack(film, pitch, height)?;
        let jones = rectangle(&stack, wavelength, size, degrees, orders)?;
        let shape = format!("\"size\": [{}, {}], \"degrees\": {degrees}{remark}", size.0, size.1);
        points.push(point(&stack, wavelength, &shape, jones)?);
        Ok(())
    };
    for case in &RECTANGLES[..TURNED] {
        for degrees in ANGLES {
            add(case, case.4[0], degrees, "")?;
        }
    }
    for case in &RECTANGLES {
        for size in case.4 {
            for degrees in ALIGNED {
                add(case, *size, degrees, ", \"aligned\": true")?;
            }
        }
    }
    Ok(())
}

/// Upright rectangles, by the rule for sides along the axes.
fn upright(orders: Orders, points: &mut Vec<String>) -> Result<()> {
    for (film, pitch, height, wavelength, sizes) in RECTANGLES {
        let stack = stack(film, pitch, height)?;
        for &(x, y) in sizes {
            let [along_x, along_y] = stack.birefringent([x, y], wavelength, orders)?;
            let jones = [[along_x, Complex64::ZERO], [Complex64::ZERO, along_y]];
            let shape = format!("\"size\": [{x}, {y}], \"degrees\": 0, \"upright\": true");
            points.push(point(&stack, wavelength, &shape, jones)?);
        }
    }
    Ok(())
}

fn main() -> Result<()> {
    type Kind = (&'static str, fn(Orders, &mut Vec<String>) -> Result<()>);
    const KINDS: [Kind; 3] = [("circle", circles), ("rectangle", rectangles), ("upright", upright)];
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let named: Vec<Kind> = KINDS
        .into_iter()
        .filter(|(kind, _)| arguments.iter().any(|a| a == kind))
        .collect();
    let kinds = if named.is_empty() { &KINDS[..] } else { &named[..] };
    for along_axis in arguments.iter().filter_map(|a| a.parse::<usize>().ok()) {
        let orders = Orders::new(along_axis)?;
        let mut points = Vec::new();
        for (_, add) in kinds {
            add(orders, &mut points)?;
        }
        println!("{{\"orders\": {along_axis}, \"points\": [{}]}}", points.join(", "));
    }
    Ok(())
}
