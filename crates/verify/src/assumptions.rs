//! Assumptions of a simulation, and the weight of each for the design at hand.

use metalith_cell::{Fidelity, FocusedLight, ORDERS, Truncation};
use metalith_design::{CellIncidence, Design, Element};
use metalith_pillars::{OutlineForm, PolarisationBasis, RotatedRectangles};
use metalith_report::{Cell, Column, Page, Table, exact, fixed, sig};

use super::page::span;
use super::steep_phase_errors::Slopes;
use super::{EqualRotations, OrderEfficiencies, PsfResult, Verification, birefringence, media};

/// The table of assumptions of a layout that was simulated.
pub(super) fn write(page: &mut Page, design: &Design, found: &Verification) {
    let mut table = Table::new([
        Column::text("Assumption"),
        Column::text("Size for this design"),
        Column::text("Basis"),
    ]);
    let mut row = |what: &str, size: String, how: &str| {
        table.row([Cell::from(what), Cell::from(size), Cell::from(how)]);
    };
    let of_paper = design.cell.is_of_the_paper();
    if found.fidelity == Fidelity::Neighbours {
        row(
            "The transmission of a pillar depends on its width and on the widths of its twelve nearest neighbours",
            format!("{}; {}", left_out(found), equal_neighbours(found)),
            &format!(
                "sum over pairs, fitted to supercells of dissimilar pillars; {}polychromatic light is interpolated between the wavelengths that have tables. Phase errors of the mapping assume equal neighbours",
                if of_paper {
                    "for rows of real pillars of prototype_3x3 the error is some hundredths of the light; "
                } else {
                    ""
                }
            ),
        );
        row(
            "Three parts of the light are not counted: steep orders, the other polarisation, and light that pairs of pillars do not explain",
            if of_paper {
                Slopes::of(design).not_counted()
            } else {
                "not known for this cell; more where the phase is steep".into()
            },
            "light that the sum over pairs transmits along the normal through blazed rows, with the mapping of the shipped designs, against their supercells. From the viewing direction rows of 2.5 pillars per wave lose 36 % at 455 nm in steep orders alone. Steep is a sine beyond half the wavelength over the pitch",
        );
    } else if found.fidelity != Fidelity::Published && found.fidelity != Fidelity::Fitted {
        row(
            "Each pillar transmits as in an infinite lattice of equal pillars (local periodic approximation)",
            if of_paper {
                Slopes::of(design).overstated()
            } else if design.cell.shape.basis().is_some() || !design.cell.lattice.is_square() {
                "not known; at the rim neighbours differ most".into()
            } else {
                "not known for this cell; --fidelity neighbours shows it".into()
            },
            "supercells of dissimilar pillars with the mapping of the shipped designs; the error is larger where the phase jumps from pillar to pillar",
        );
    } else {
        row(
            "Pillars change the phase only, by a polynomial",
            "amplitude and resonances are not simulated".into(),
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
                OutlineForm::Square | OutlineForm::Polygon | OutlineForm::Mixed => {
                    "not known for this cell; more where the index is higher".into()
                }
            },
            "squares of silicon nitride against 27 orders, widths of 100 to 295 nm at 455, 530 and 660 nm; circles of three materials against 33 orders",
        );
    }
    media::rows(&mut row, design, found);
    let (least, most) = outside(found);
    row(
        "PSFs and energies are of a window about the chief ray; MTF counts all light that the simulation model transmits",
        format!(
            "{} % of the transmitted light is outside of the window",
            span(fixed(least * 100.0, 0), fixed(most * 100.0, 0))
        ),
        "power of all pillars against the energy of the window",
    );
    row(
        "In figures of single wavelengths, light comes from the viewing direction at this wavelength; in polychromatic figures all wavelengths come from one direction",
        dispersion(design),
        "f sin(psi) / lambda_w: spread of a band of light from one direction",
    );
    row(
        "The field is scalar, with one point sample for each pillar",
        match found.accuracy {
            "fast" => "1e-3 of the amplitude of an ideal lens".into(),
            _ => "1e-5 of the amplitude of an ideal lens".into(),
        },
        "direct sums in double precision; the polarisation of the field behind the lens is not simulated",
    );
    page.table(table);
}

/// Assumption on the angle at which light arrives at the cells, where they are not solved for each.
fn angles(row: &mut impl FnMut(&str, String, &str), design: &Design, found: &Verification) {
    let prototype = |size: String| {
        if design.cell.is_of_the_paper() {
            format!(
                "{size}; in the local periodic approximation the corner element of prototype_3x3 has, of the Strehl ratio of its target, {OF_ANGLE}"
            )
        } else {
            size
        }
    };
    if found.fidelity != Fidelity::Neighbours {
        row(
            "Cells are solved at normal incidence",
            prototype("not computed in this run".into()),
            if design.cell.shape.basis().is_some() {
                "rectangles are solved at normal incidence only"
            } else {
                "--oblique solves them at the angle of arrival, for both polarisations"
            },
        );
        return;
    }
    let widest_deg = design.verify.field_angles.iter().map(|a| a.x_deg.hypot(a.y_deg));
    let widest_deg = widest_deg.fold(0.0, f64::max);
    row(
        "Cells are solved for light from the viewing direction of each element",
        if widest_deg == 0.0 {
            "none: there is no other field angle".into()
        } else {
            prototype(format!(
                "field angles are up to {}° from this direction: not computed in this run",
                sig(widest_deg, 3)
            ))
        },
        "--oblique solves them for each field angle; each new wavelength and direction needs a table of 50 to 60 CPU s",
    );
    if let Some(camera) = &found.camera {
        let ends = [camera.wavelengths_nm.first(), camera.wavelengths_nm.last()];
        let apart = ends.into_iter().flatten().map(|nm| white_apart_deg(design, nm * 1e-3));
        row(
            "Polychromatic light comes from one direction, but its cells are solved for the viewing direction at each wavelength",
            in_degrees(apart.fold(0.0, f64::max)),
            "angle between both directions for the outermost element; --oblique solves cells for the direction of the point",
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
const OF_ANGLE: &str = "57 to 83 % at normal incidence, 48 to 85 % at oblique incidence in the middle of its field, and 21 to 77 % at oblique incidence 15° from the middle";

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
    let (what, whose) = if arriving == focused.polarisation() {
        (
            "pillars convert it to the other handedness with twice their rotation as phase".into(),
            "light of the other handedness, half of unpolarised light, diverges; `polarisation` in [verify] states the light",
        )
    } else {
        (
            format!(
                "pillars convert each handedness to the other with twice their rotation as phase, and focus light that arrives {hand} circularly polarised"
            ),
            "Strehl ratios and shares are of all light that arrives; the target focuses all of it",
        )
    };
    row(
        &format!("Light arrives {arriving}; {what}"),
        format!(
            "{}, in all figures of the layout; {}",
            lands.into_iter().flatten().collect::<Vec<_>>().join("; "),
            light.detector(focused)
        ),
        &format!("Jones matrices for both handednesses; {whose}"),
    );
    let turned = (1..=pillars.steps)
        .map(|number| pillars.turned_by_grid(number).abs())
        .fold(0.0, f64::max);
    row(
        "Rotations are rounded to steps, and corners to the grid of 1 nm",
        format!(
            "steps of {}° are {} rad of phase at most. The grid rotates pillars by up to {}°, {} rad, which is simulated. It also shears them, which is not simulated",
            sig(pillars.step_deg(), 3),
            sig(pillars.step_deg().to_radians(), 2),
            sig(turned.to_degrees(), 2),
            sig(2.0 * turned, 2),
        ),
        "axis of each outline as drawn, against its rotation; each site has the pillar whose drawn rotation is nearest",
    );
    let lattice = found.rotations;
    row(
        if design.mapping.rotation.is_half() {
            "The phase is twice the rotation"
        } else {
            "The phase is twice the rotation plus the phase of the lattice, by the series of [mapping]"
        },
        match &lattice {
            Some(EqualRotations { own, half, .. }) if own != half => format!(
                "off by {} rad rms, {} at most, for pillars as drawn; without the series by {} at most",
                fixed(own.rms_rad, 4),
                fixed(own.worst_rad, 4),
                fixed(half.worst_rad, 4)
            ),
            Some(EqualRotations { own, .. }) => format!(
                "off by {} rad rms, {} at most, for pillars as drawn; `metalith cells` gives a series that corrects it",
                fixed(own.rms_rad, 4),
                fixed(own.worst_rad, 4)
            ),
            None => "not known".into(),
        },
        "phase of the converted light of all rotations in lattices of equal pillars, by RCWA at the wavelength of the mapping",
    );
    row(
        "Seven rotations are solved, with as many diffraction orders as they need; a Fourier series gives the others",
        match lattice.and_then(|l| l.truncation) {
            Some(Truncation { orders, fewer, apart }) => format!(
                "{orders} orders an axis: t differs by {} at most from {fewer} orders, so an error of some 0.002 may remain",
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
        return "the local periodic approximation was not simulated for comparison".into();
    }
    format!(
        "light in the first order by the local periodic approximation over the coupled model, by wavelength: {}",
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
