//! Assumptions of a simulation, and the weight of each for the design at hand.

use metalith_cell::{Fidelity, FocusedLight, ORDERS, Truncation};
use metalith_design::{CellIncidence, Design, Element};
use metalith_pillars::{OutlineForm, PolarisationBasis, RotatedRectangles};
use metalith_report::{Cell, Column, Page, Table, exact, fixed, sig};

use super::page::span;
use super::steep::Slopes;
use super::{EqualRotations, OrderEfficiencies, PsfResult, Verification, birefringence, media};

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
    let of_paper = design.cell.is_of_the_paper();
    if found.fidelity == Fidelity::Neighbours {
        row(
            "Each pillar passes light by its own width and those of its twelve nearest neighbours",
            format!("{}; {}", left_out(found), equal_neighbours(found)),
            &format!(
                "a sum over pairs, fitted to supercells of unlike pillars; {}white light is between the wavelengths that have tables. Phase errors of the mapping still take neighbours for equals",
                if of_paper {
                    "rows of real pillars of prototype_3x3 are met to some hundredths of the light; "
                } else {
                    ""
                }
            ),
        );
        row(
            "Light that leaves in steep orders or in the other polarisation is not counted, nor what pairs cannot explain",
            if of_paper {
                Slopes::of(design).not_counted()
            } else {
                "not known for this cell; more where the phase is steep".into()
            },
            "light that passes blazed rows of the mapping of the shipped designs by the sum over pairs, against their supercells, along the normal; as a steered element looks, rows of 2.5 pillars a turn lose 36 % at 455 nm in steep orders alone. Steep is beyond half the wavelength over the pitch",
        );
    } else if found.fidelity != Fidelity::Published && found.fidelity != Fidelity::Fitted {
        row(
            "Each pillar passes light as in an infinite lattice of equal pillars",
            if of_paper {
                Slopes::of(design).overstated()
            } else if design.cell.shape.basis().is_some() || !design.cell.lattice.is_square() {
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
    if design.verify.incidence == CellIncidence::Normal {
        angles(&mut row, design, found);
    }
    if let Some(pillars) = design.cell.shape.rotated() {
        polarised(&mut row, design, found, pillars);
    } else if design.cell.shape.basis() == Some(PolarisationBasis::Linear) {
        birefringence::rows(&mut row, design, found);
    } else if found.fidelity == Fidelity::Rigorous {
        row(
            &format!("Cells are solved with {ORDERS} diffraction orders an axis"),
            match design.cell.shape.outline() {
                _ if of_paper => "0.004 rms in |t|, 0.03 beside resonances".into(),
                OutlineForm::Circle => "0.004 rms in t, 0.01 beside resonances".into(),
                OutlineForm::Square | OutlineForm::Polygon => {
                    "not known for this cell; more where the index is higher".into()
                }
            },
            "squares of silicon nitride against 27 orders, widths of 100 to 295 nm at 455, 530 and 660 nm; circles of three materials against 33 orders",
        );
    }
    media::rows(&mut row, design, found);
    let (least, most) = outside(found);
    row(
        "PSFs and energies are of a window about the chief ray; MTF counts all light that passes by this cell",
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

/// Assumption on the angle at which light arrives at the cells, where they are not solved for each.
fn angles(row: &mut impl FnMut(&str, String, &str), design: &Design, found: &Verification) {
    let prototype = |size: String| {
        if design.cell.is_of_the_paper() {
            format!(
                "{size}; equal pillars of the corner element of prototype_3x3 keep, of the Strehl ratio of its design, {OF_ANGLE}"
            )
        } else {
            size
        }
    };
    if found.fidelity != Fidelity::Neighbours {
        row(
            "Cells are lit along the normal",
            prototype("not computed in this run".into()),
            if design.cell.shape.basis().is_some() {
                "rectangles are solved along the normal alone"
            } else {
                "--oblique solves them at the angle at which light arrives, both polarisations"
            },
        );
        return;
    }
    let widest_deg = design.verify.field_angles.iter().map(|a| a.x_deg.hypot(a.y_deg));
    let widest_deg = widest_deg.fold(0.0, f64::max);
    row(
        "Cells are lit from the middle of each element's field",
        if widest_deg == 0.0 {
            "none: there is no other field angle".into()
        } else {
            prototype(format!(
                "field angles are up to {}° from there: not computed in this run",
                sig(widest_deg, 3)
            ))
        },
        "--oblique solves them for each field angle: a table of 50 to 60 CPU s for each wavelength and direction that has none yet",
    );
    if let Some(camera) = &found.camera {
        let ends = [camera.wavelengths_nm.first(), camera.wavelengths_nm.last()];
        let apart = ends.into_iter().flatten().map(|nm| white_apart_deg(design, nm * 1e-3));
        row(
            "In white light, which arrives from one direction, cells are lit from where the element looks at each wavelength",
            in_degrees(apart.fold(0.0, f64::max)),
            "angle between both directions for the outermost element; --oblique lights cells from the point itself",
        );
    }
}

fn in_degrees(apart_deg: f64) -> String {
    if apart_deg == 0.0 {
        "none: no element has a wedge".into()
    } else {
        format!("up to {}° apart, at the ends of the band", sig(apart_deg, 2))
    }
}

/// Effect of the angle on the corner element of `designs/prototype_3x3.toml`, at 455, 530 and 660 nm:
/// docs/method/verify.md, "Angle of incidence".
const OF_ANGLE: &str = "57 to 83 % along the normal, 48 to 85 % at oblique incidence in the middle of its field and 21 to 77 % at 15° from there";

/// Largest angle between where an element looks at a wavelength (um) and where it looks at that of its wedge (degrees).
fn white_apart_deg(design: &Design, wavelength_um: f64) -> f64 {
    let apart = |e: &Element| {
        let [a, b] = [wavelength_um, e.wedge.wavelength_um].map(|um| {
            let (x, y) = e.wedge.looks_at(um);
            [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
        });
        let chord = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
        2.0 * (0.5 * chord).min(1.0).asin().to_degrees()
    };
    design.elements().iter().map(apart).fold(0.0, f64::max)
}

/// Assumptions on the polarisation of light, and the effect of steps and grid on the phase of rotated rectangles.
fn polarised(
    row: &mut impl FnMut(&str, String, &str),
    design: &Design,
    found: &Verification,
    pillars: RotatedRectangles,
) {
    let hand = design.cell.arriving.unwrap_or_default();
    let focused = FocusedLight::Circular(hand);
    let light = design.verify.light();
    let shares = |what: &str, of: fn(&OrderEfficiencies) -> Option<f64>| -> Option<String> {
        let orders = found.distinct.iter().flat_map(|d| &d.orders);
        let shares: Vec<_> = orders.filter_map(|o| Some(fixed(of(o)? * 100.0, 1))).collect();
        (!shares.is_empty()).then(|| format!("{} % {what}", shares.join(", ")))
    };
    let lands = [
        shares("is focused", |o| Some(o.first)),
        shares("diverges", |o| o.diverging),
        shares("is not converted", |o| o.unconverted),
    ];
    let arriving = light.arriving_at(focused);
    let (what, whose) = match arriving == focused.polarisation() {
        true => (
            "pillars convert it to the other hand with twice their rotation as phase".into(),
            "light of the other hand diverges, of unpolarised light that is half: `polarisation` in [verify]",
        ),
        false => (
            format!(
                "pillars convert each hand to the other with twice their rotation as phase, and focus what arrives {hand} circularly \
                 polarised"
            ),
            "Strehl ratios and shares are of all light that arrives, and the design phase focuses all of it",
        ),
    };
    row(
        &format!("Light arrives {arriving}; {what}"),
        format!(
            "{}, in all figures of the layout; {}",
            lands.into_iter().flatten().collect::<Vec<_>>().join("; "),
            light.detector(focused)
        ),
        &format!("Jones matrices of both hands; {whose}"),
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

/// Light that the sums over pairs put elsewhere than supercells that they were not fitted to, by wavelength.
fn left_out(found: &Verification) -> String {
    let mut by_um: Vec<(f64, [f64; 2])> = Vec::new();
    for order in found.distinct.iter().flat_map(|d| &d.orders) {
        let Some(share) = order.left_out else { continue };
        match by_um.iter_mut().find(|(um, _)| *um == order.wavelength_um) {
            Some((_, ends)) => *ends = [ends[0].min(share), ends[1].max(share)],
            None => by_um.push((order.wavelength_um, [share; 2])),
        }
    }
    let each: Vec<String> = by_um
        .iter()
        .map(|(um, [least, most])| {
            let shares = span(fixed(*least, 3), fixed(*most, 3));
            format!("{shares} of the light at {} nm", exact(um * 1e3))
        })
        .collect();
    match each[..] {
        [] => "error not known".into(),
        _ => format!("off by {}, on supercells left out of the fit", each.join(", ")),
    }
}

/// Share of the light in the first order by equal neighbours over that by the neighbours that there are.
fn equal_neighbours(found: &Verification) -> String {
    let of = |orders: &[OrderEfficiencies], fidelity, um: f64| {
        let same = |o: &&OrderEfficiencies| o.fidelity == fidelity && o.wavelength_um == um;
        orders.iter().find(same).map(|o| o.first)
    };
    let each = found.distinct.iter().filter_map(|element| {
        let orders = &element.orders;
        let own = orders.iter().filter(|o| o.fidelity == Fidelity::Neighbours);
        let ratios = own.filter_map(|o| Some(of(orders, Fidelity::Rigorous, o.wavelength_um)? / o.first));
        let ratios: Vec<String> = ratios.map(|r| fixed(r, 2)).collect();
        (!ratios.is_empty()).then(|| format!("{} times in element {}", ratios.join(", "), element.element.label()))
    });
    let each: Vec<String> = each.collect();
    if each.is_empty() {
        return "what equal neighbours would have was not simulated beside it".into();
    }
    format!(
        "equal neighbours would have in the first order, by wavelength, {}",
        each.join("; ")
    )
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
    fn white_light_is_as_far_from_where_elements_look_as_their_wedges_say() {
        /// Rounding of angles.
        const ROUNDING: f64 = 1e-9;
        let design = Design::read(&metalith_testing::design("prototype_3x3")).unwrap();
        // The corner looks at sines that grow with the wavelength over 550 nm.
        let sine = 2f64.sqrt() * 15f64.to_radians().sin();
        let angle = |um: f64| (sine * um / 0.55).asin().to_degrees();
        for um in [0.4, 0.7] {
            let found = white_apart_deg(&design, um);
            assert!((found - (angle(um) - angle(0.55)).abs()).abs() < ROUNDING, "{found}");
        }
        assert!(white_apart_deg(&design, 0.55) < ROUNDING);
    }
}
