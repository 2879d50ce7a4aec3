//! `[[phase.term]]`: phases over the plane of an element, added to that over the radius.

use std::collections::BTreeSet;

use super::lens::{COEFFICIENT, read_normalisation, read_radial};
use super::{ArraySpec, LensSpec};
use crate::phase::{Interpolation, MapTable, PhaseTerm, RadialPhase, TermForm, ZernikeOrder};
use metalith_core::Zernike;
use metalith_core::document::{Limits, Section};

/// Most polynomials of a sum.
const MOST_TERMS: usize = 231;

/// Highest power of a coordinate.
const HIGHEST_POWER: f64 = 30.0;

#[derive(Clone, Copy, PartialEq)]
enum TermSource {
    Radial,
    Map,
    Zernike,
    Polynomial,
    OpticStudio,
}

/// Sources that a phase over the radius does not have.
const PLANE: [&str; 4] = ["map", "zernike", "polynomial", "optic_studio"];

/// True if a section of a phase is itself a phase over the plane.
pub(super) fn is_plane(s: &Section<'_, '_>) -> bool {
    s.is_one_of("source", &PLANE)
}

/// Sections of the terms of a phase, whose own sections of terms are these: the phase itself is the first if it is over the plane.
pub(super) fn sections<'s, 'd, 't>(
    phase: &'s Section<'d, 't>,
    own: &'s [Section<'d, 't>],
) -> impl Iterator<Item = &'s Section<'d, 't>> {
    is_plane(phase).then_some(phase).into_iter().chain(own)
}

pub(super) fn read(s: &Section<'_, '_>, focal_length_um: f64, radius_um: f64) -> PhaseTerm {
    let term = read_keys(s, focal_length_um, radius_um);
    s.finish();
    term
}

/// A term whose section has other keys too.
pub(super) fn read_keys(s: &Section<'_, '_>, focal_length_um: f64, radius_um: f64) -> PhaseTerm {
    let sources = [
        ("hyperbola", TermSource::Radial),
        ("even_powers", TermSource::Radial),
        ("table", TermSource::Radial),
        ("map", TermSource::Map),
        ("zernike", TermSource::Zernike),
        ("polynomial", TermSource::Polynomial),
        ("optic_studio", TermSource::OpticStudio),
    ];
    let normalisation = |s: &Section<'_, '_>| read_normalisation(s, radius_um);
    let form = match s.choice("source", &sources, None) {
        TermSource::Radial => TermForm::Radial(read_radial(s, focal_length_um, radius_um)),
        TermSource::Map => TermForm::Map(MapTable::new(
            s.file("file"),
            s.float("pitch_um", Limits::new(1e-3..=1e5, "um")),
            Interpolation::read(s),
            s.choice("wrapped", &[("no", false), ("yes", true)], Some(true)),
        )),
        TermSource::Zernike => {
            let (order, coefficients) = zernike(s);
            TermForm::Zernike {
                order,
                coefficients,
                radius_um: normalisation(s),
            }
        }
        TermSource::Polynomial => TermForm::Polynomial {
            terms: polynomial(s),
            radius_um: normalisation(s),
        },
        TermSource::OpticStudio => TermForm::OpticStudio {
            file: s.file("file"),
            surface: s
                .optional_integer("surface", 0..=10_000, "")
                .map(|number| number as u32),
        },
    };
    let file = match &form {
        TermForm::Radial(RadialPhase::Table { file, .. }) | TermForm::OpticStudio { file, .. } => Some(file.clone()),
        TermForm::Map(map) => Some(map.file().to_owned()),
        _ => None,
    };
    let term = PhaseTerm {
        form,
        file,
        scale: s.float_or("scale", Limits::new(-1e6..=1e6, ""), 1.0),
        centre_um: s
            .optional_array::<2>("centre_um", Limits::new(-1e5..=1e5, "um"))
            .unwrap_or([0.0; 2]),
        elements: elements(s),
    };
    if let TermForm::Map(map) = &term.form
        && map.is_wrapped()
        && term.scale.fract() != 0.0
    {
        s.fault(
            "scale",
            format!("phases that are known up to whole turns, times {}", term.scale),
            "multiply them by a whole number, or say `wrapped = \"no\"` of a table that never jumps by a turn",
        );
    }
    term
}

/// A hyperbola that names no focal length has that of the element; `s` is the section that the term was read from.
pub(super) fn default_focal_length(term: &mut PhaseTerm, s: &Section<'_, '_>, of_element_um: f64) {
    if let TermForm::Radial(RadialPhase::Hyperbola { focal_length_um, .. }) = &mut term.form
        && !s.has("focal_length_um")
    {
        *focal_length_um = of_element_um;
    }
}

/// Terms name elements that there are: of others they would change nothing, without a word. `phase` is the section of the phase
/// that all elements share, `placed` those of elements that are placed one by one.
pub(super) fn check_elements(array: &ArraySpec, lens: &LensSpec, phase: &Section<'_, '_>, placed: &[Section<'_, '_>]) {
    let check = |phase: &Section<'_, '_>, lens: &LensSpec, there: &BTreeSet<(i32, i32)>, hint: &str| {
        let (own, y) = (phase.sections("term"), phase.optional_section("y"));
        let own_y = y.as_ref().map_or_else(Vec::new, |y| y.sections("term"));
        let along_y = lens.along_y.iter().zip(&y);
        let along_y = along_y.flat_map(|(along, s)| along.terms.iter().zip(sections(s, &own_y)));
        for (term, s) in lens.terms.iter().zip(sections(phase, &own)).chain(along_y) {
            if let Some((m, n)) = term.elements.iter().find(|index| !there.contains(index)) {
                let what = format!("no element of this phase is ({m}, {n})");
                s.fault_given(&["array.elements"], "elements_m", what, hint);
            }
        }
    };
    let all = array.elements().iter().map(|e| e.index).collect();
    let hint = "give m and n of elements that there are, as the report of `metalith layout` names them; where their number along \
                an axis is even, none is 0";
    check(phase, lens, &all, hint);
    for ((s, element), k) in placed.iter().zip(&array.placed).zip(1..) {
        if let (Some(own), Some(lens)) = (s.optional_section("phase"), &element.lens) {
            let hint = format!("leave `elements_m` and `elements_n` out: this phase is of element ({k}, 0) alone");
            check(&own, lens, &BTreeSet::from([(k, 0)]), &hint);
        }
    }
}

/// Order and coefficients of a sum of Zernike polynomials.
fn zernike(s: &Section<'_, '_>) -> (ZernikeOrder, Vec<f64>) {
    let orders = [("standard", ZernikeOrder::Standard), ("fringe", ZernikeOrder::Fringe)];
    let order = s.choice("order", &orders, None);
    let coefficients = some(s, "coefficients_waves", Limits::new(-1e8..=1e8, "waves"));
    let most = Zernike::FRINGE_SET as usize;
    if order == ZernikeOrder::Fringe && (most + 1..=MOST_TERMS).contains(&coefficients.len()) {
        s.fault(
            "coefficients_waves",
            format!("{} coefficients of the fringe order", coefficients.len()),
            format!("give the first {most} of them at most, which are all there are, or use `order = \"standard\"`"),
        );
    }
    (order, coefficients)
}

/// A list that is not empty and not too long.
fn some(s: &Section<'_, '_>, key: &str, limits: Limits) -> Vec<f64> {
    let values = s.floats(key, limits);
    if s.has(key) && (values.is_empty() || values.len() > MOST_TERMS) {
        s.fault(
            key,
            format!("{} coefficients", values.len()),
            format!("give 1 to {MOST_TERMS} of them"),
        );
    }
    values
}

fn polynomial(s: &Section<'_, '_>) -> Vec<(u32, u32, f64)> {
    let power = Limits::new(0.0..=HIGHEST_POWER, "");
    let coefficients = some(s, "coefficients_rad", COEFFICIENT);
    let [x, y] = ["powers_x", "powers_y"].map(|key| {
        let powers = s.floats(key, power.clone());
        if s.has(key) && (powers.len() != coefficients.len() || powers.iter().any(|p| p.fract() != 0.0)) {
            s.fault_given(
                &["coefficients_rad"],
                key,
                format!("{} powers for {} coefficients", powers.len(), coefficients.len()),
                "give one whole power for each coefficient",
            );
        }
        powers
    });
    let each = x.iter().zip(&y).zip(&coefficients);
    each.map(|((i, j), a)| (*i as u32, *j as u32, *a)).collect()
}

/// Indices of the elements that the term is of.
fn elements(s: &Section<'_, '_>) -> Vec<(i32, i32)> {
    if !s.has("elements_m") && !s.has("elements_n") {
        return Vec::new();
    }
    let index = Limits::new(-99.0..=99.0, "");
    let [m, n] = ["elements_m", "elements_n"].map(|key| s.floats(key, index.clone()));
    if m.len() != n.len() || m.is_empty() || m.iter().chain(&n).any(|k| k.fract() != 0.0) {
        s.fault(
            "elements_m",
            format!("{} indices along x and {} along y", m.len(), n.len()),
            "give m and n of each element, as the report of `metalith layout` names them; leave both out for all elements",
        );
        return Vec::new();
    }
    m.iter().zip(&n).map(|(m, n)| (*m as i32, *n as i32)).collect()
}
