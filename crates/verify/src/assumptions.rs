//! What a simulation assumes, and how much each assumption weighs for the design at hand.

use metalith_cell::{Fidelity, ORDERS, Truncation};
use metalith_core::{PillarShape, Rectangles};
use metalith_design::{CellIncidence, Design, Element};
use metalith_report::{Cell, Column, Page, Table, fixed, sig};

use super::page::span;
use super::{EqualRotations, OrderEfficiencies, PsfResult, Verification};

/// Share by which a cell in an infinite lattice of equal pillars overstates the first order of a blazed row at 455,
/// 530 and 660 nm, by the turns of phase a pitch: rows of 18, 6, 3 and 2.5 pillars a turn of the shipped mapping,
/// solved as supercells (`golden/truth`), mean over offsets and polarisations, light as a steered element sees it.
const BLAZED_ROWS: [(f64, [f64; 3]); 5] = [
    (0.0, [0.0, 0.0, 0.0]),
    (1.0 / 18.0, [0.011, 0.023, 0.041]),
    (1.0 / 6.0, [0.070, 0.044, 0.063]),
    (1.0 / 3.0, [0.493, 0.326, 0.328]),
    (0.4, [0.929, 0.540, 0.488]),
];

/// The table of assumptions; none of a layout that was not simulated.
pub(super) fn write(page: &mut Page, design: &Design, found: &Verification) {
    if found.not_simulated.is_some() {
        return;
    }
    page.section("What is assumed");
    let mut table = Table::new([
        Column::text("Assumption"),
        Column::text("Size for this design"),
        Column::text("How it is known"),
    ]);
    let mut row = |what: &str, size: String, how: &str| {
        table.row([Cell::from(what), Cell::from(size), Cell::from(how)]);
    };
    if found.fidelity == Fidelity::Neighbours {
        row(
            "Each pillar passes light by its own width and those of its twelve nearest neighbours",
            equal_neighbours(found),
            "a sum over pairs, fitted to supercells of unlike pillars; rows of real pillars are met to some hundredths of the light; white light is between the wavelengths that have tables. Phase errors of the mapping still take neighbours for equals",
        );
    } else if found.fidelity != Fidelity::Published && found.fidelity != Fidelity::Fitted {
        row(
            "Each pillar passes light as in an infinite lattice of equal pillars",
            if design.cell.is_of_the_paper() {
                neighbours(design)
            } else if design.cell.shape.rectangles().is_some() || !design.cell.lattice.is_square() {
                "not known; at the rim neighbours differ most".into()
            } else {
                "not known for this cell; --fidelity neighbours tells".into()
            },
            "rows of unlike pillars solved rigorously, for the mapping of the shipped designs; where the phase jumps from pillar to pillar it is more",
        );
    } else {
        row(
            "Pillars change the phase alone, by a polynomial",
            "amplitude and resonances are left out".into(),
            "--fidelity rigorous shows them",
        );
    }
    if design.verify.incidence == CellIncidence::Normal && found.fidelity == Fidelity::Neighbours {
        row(
            "Cells are lit from the middle of each element's field",
            "not computed in this run".into(),
            "--as-lit solves them for each field angle",
        );
    } else if design.verify.incidence == CellIncidence::Normal {
        row(
            "Cells are lit along the normal",
            "not computed in this run".into(),
            if design.cell.shape.rectangles().is_some() {
                "rectangles are solved along the normal alone"
            } else {
                "--as-lit solves them at the angle at which light arrives, both polarisations"
            },
        );
    }
    if let Some(pillars) = design.cell.shape.rectangles() {
        polarised(&mut row, design, found, pillars);
    } else if found.fidelity == Fidelity::Rigorous {
        row(
            &format!("Cells are solved with {ORDERS} diffraction orders an axis"),
            match design.cell.shape {
                _ if design.cell.is_of_the_paper() => "0.004 rms in |t|, 0.03 beside resonances".into(),
                PillarShape::Circle => "0.004 rms in t, 0.01 beside resonances".into(),
                PillarShape::Square | PillarShape::Rectangle(_) => {
                    "not known for this cell; more where the index is higher".into()
                }
            },
            "squares of silicon nitride against 27 orders, widths of 100 to 295 nm at 455, 530 and 660 nm; circles of three materials against 33 orders",
        );
    }
    let (least, most) = outside(found);
    row(
        "PSFs and energies are of a window about the chief ray; MTF counts all light that passes",
        format!(
            "{} % of the light is outside of the window",
            span(fixed(least * 100.0, 0), fixed(most * 100.0, 0))
        ),
        "power of all pillars against the energy of the window",
    );
    row(
        "In the tables by wavelength, each wavelength comes from the direction that suits it; those of white light have one direction",
        dispersion(design),
        "f sin(psi) / lambda_w: light of a band from one direction is spread by so much",
    );
    row(
        "A scalar field from point samples, one a pillar",
        match found.accuracy {
            "fast" => "1e-3 of the amplitude of a perfect lens".into(),
            _ => "1e-5 of the amplitude of a perfect lens".into(),
        },
        "direct sums in double precision; polarisation of the field behind the lens is left out",
    );
    page.table(table);
}

/// What is assumed of the polarisation of light, and what steps and grid do to the phase of rotated rectangles.
fn polarised(row: &mut impl FnMut(&str, String, &str), design: &Design, found: &Verification, pillars: Rectangles) {
    let arriving = design.cell.arriving.unwrap_or_default();
    let shares: Vec<String> = found
        .distinct
        .iter()
        .flat_map(|d| &d.orders)
        .filter_map(|o| Some(fixed(o.unconverted? * 100.0, 1)))
        .collect();
    row(
        &format!(
            "Light arrives {arriving} circularly polarised; pillars convert it to the other with twice their rotation as phase"
        ),
        if design.verify.analyser {
            "a circular analyser keeps what is not converted from the sensor".into()
        } else {
            format!(
                "{} % is not converted: a background, in all figures of the layout",
                shares.join(", ")
            )
        },
        "Jones matrices of both; light of the other handedness diverges, of unpolarised light that is half",
    );
    let turned = (1..=pillars.steps)
        .map(|number| pillars.turned_by_grid(number).abs())
        .fold(0.0, f64::max);
    row(
        "Rotations are rounded to steps, and corners to the grid of 1 nm",
        format!(
            "steps of {}° are {} rad of phase at most; the grid turns pillars by up to {}°, {} rad, which is simulated, and shears them, which is not",
            sig(pillars.step_deg(), 3),
            sig(pillars.step_deg().to_radians(), 2),
            sig(turned.to_degrees(), 2),
            sig(2.0 * turned, 2),
        ),
        "axis of each outline as it is drawn, against its rotation; each site has the pillar drawn nearest to what is asked",
    );
    let lattice = found.rotations;
    row(
        if design.mapping.rotation.is_half() {
            "The phase is twice the rotation"
        } else {
            "The phase is twice the rotation and what the lattice adds to it, by the series of [mapping]"
        },
        match &lattice {
            Some(EqualRotations { own, half, .. }) if own != half => format!(
                "off by {} rad rms, {} at most, for pillars as drawn; without the series by {} at most",
                fixed(own.rms_rad, 4),
                fixed(own.worst_rad, 4),
                fixed(half.worst_rad, 4)
            ),
            Some(EqualRotations { own, .. }) => format!(
                "off by {} rad rms, {} at most, for pillars as drawn; `metalith cells` has a series that takes it back",
                fixed(own.rms_rad, 4),
                fixed(own.worst_rad, 4)
            ),
            None => "not known".into(),
        },
        "phase of the converted light of all rotations in lattices of equals, solved rigorously at the wavelength of the mapping",
    );
    row(
        "Cells are solved at seven rotations, the others by a Fourier series, with as many diffraction orders as they need",
        match lattice.and_then(|l| l.truncation) {
            Some(Truncation { orders, fewer, apart }) => format!(
                "{orders} orders an axis: {} at most in t from {fewer} orders, so some 0.002 may be left",
                sig(apart, 2)
            ),
            None => "not known".into(),
        },
        "fifteen sizes of three materials: where 17 orders are within 0.005 of 25, 25 are within 0.0018 of 41; of all others 41 are taken, within 0.0023 of 57; the series meets the solver between its rotations to 0.0005",
    );
}

/// Share of the light in the first order by equal neighbours over that by the neighbours that there are.
fn equal_neighbours(found: &Verification) -> String {
    let of = |orders: &[OrderEfficiencies], fidelity, um: f64| {
        let same = |o: &&OrderEfficiencies| o.fidelity == fidelity && o.wavelength_um == um;
        orders.iter().find(same).map(|o| o.first)
    };
    let each = found.distinct.iter().map(|element| {
        let orders = &element.orders;
        let own = orders.iter().filter(|o| o.fidelity == Fidelity::Neighbours);
        let ratios = own.filter_map(|o| Some(of(orders, Fidelity::Rigorous, o.wavelength_um)? / o.first));
        let ratios: Vec<String> = ratios.map(|r| fixed(r, 2)).collect();
        format!("{} times in element {}", ratios.join(", "), element.element.label())
    });
    let each: Vec<String> = each.collect();
    format!(
        "equal neighbours would have in the first order, by wavelength, {}",
        each.join("; ")
    )
}

/// By how much the first order is overstated, for the wedges of the middle and of the outermost element.
fn neighbours(design: &Design) -> String {
    let turns = |e: &Element| e.wedge.sin_x.hypot(e.wedge.sin_y) / e.wedge.wavelength_um * design.lattice().pitch_um();
    let steepest = design.elements().iter().map(turns).fold(0.0, f64::max);
    // The lens adds its own slope, at its rim as much as sin(atan(R / f)) / wavelength.
    let slope = |e: &Element| {
        let lens = design.lens_of(e);
        (lens.radius_um() / lens.focal_length_um).atan().sin()
    };
    let rim = design.elements().iter().map(slope).fold(0.0, f64::max);
    let rim = rim / design.mapping.wavelength_um * design.lattice().pitch_um();
    let worst = |turns: f64| {
        let all = overstated(turns);
        all.iter().copied().fold(0.0, f64::max)
    };
    format!(
        "first order too high by up to {} % in the middle of the outermost element, {} % at its steepest rim",
        fixed(worst(steepest) * 100.0, 0),
        if steepest + rim > BLAZED_ROWS[4].0 {
            format!("over {}", fixed(worst(0.4) * 100.0, 0))
        } else {
            fixed(worst(steepest + rim) * 100.0, 0)
        },
    )
}

/// Straight lines through [`BLAZED_ROWS`].
fn overstated(turns: f64) -> [f64; 3] {
    let above = BLAZED_ROWS
        .partition_point(|(t, _)| *t < turns)
        .clamp(1, BLAZED_ROWS.len() - 1);
    let ((a, low), (b, high)) = (BLAZED_ROWS[above - 1], BLAZED_ROWS[above]);
    let share = ((turns - a) / (b - a)).clamp(0.0, 1.0);
    std::array::from_fn(|i| low[i] + share * (high[i] - low[i]))
}

/// Least and greatest share of the light that passes and is not in the window.
fn outside(found: &Verification) -> (f64, f64) {
    let share = |psf: &PsfResult| 1.0 - psf.metrics.energy_window / psf.metrics.energy_passed;
    let all = found.distinct.iter().flat_map(|d| &d.spots).map(|s| share(s.judged()));
    all.fold((1.0, 0.0), |(least, most), s| (f64::min(least, s), f64::max(most, s)))
}

fn dispersion(design: &Design) -> String {
    let of = |e: &Element| {
        design.lens_of(e).focal_length_um * e.wedge.sin_x.hypot(e.wedge.sin_y) / (e.wedge.wavelength_um * 1e3)
    };
    let most = design.elements().iter().map(of).fold(0.0, f64::max);
    if most == 0.0 {
        return "none: no element has a wedge".into();
    }
    format!(
        "{} um per nm of wavelength for the outermost element, {} sensor pixels over 25 nm",
        sig(most, 3),
        sig(most * 25.0 / design.verify.pixel_um, 2)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_solved_rows_the_size_of_the_assumption_is_interpolated() {
        const ROUNDING: f64 = 1e-12;
        assert_eq!(overstated(0.0), [0.0; 3]);
        assert_eq!(overstated(1.0 / 6.0), BLAZED_ROWS[2].1);
        assert!((overstated(0.25)[1] - 0.5 * (0.044 + 0.326)).abs() < ROUNDING);
        assert_eq!(overstated(2.0), BLAZED_ROWS[4].1);
    }
}
