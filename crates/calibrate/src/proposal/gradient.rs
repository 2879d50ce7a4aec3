//! A quantity that differs over the chip: what is free for each element, put as linear in its place.

use crate::effects::{DeclaredEffect, DeclaredParameter};
use crate::search::{Grouping, Pattern};
use crate::simulator::Simulator;

/// Fewest elements: two values are always on a line.
const ELEMENTS: usize = 3;

/// A parameter starts at least at this share of a typical size at the outermost element: a fitted slope may be next to
/// nothing along one of the axes.
const LEAST_SHARE: f64 = 0.25;

/// Slopes are per mm, places in um.
const PER_UM: f64 = 1e-3;

/// The quantity of a pattern by element with a slope along each direction in which elements differ, about the middle of
/// them; none if its values are not linear, if no expression stands for it, or if an effect was tried that is this.
pub(super) fn declared(simulator: &Simulator<'_>, pattern: &Pattern) -> Option<DeclaredEffect> {
    let set = simulator.bench.set();
    let slot = simulator.slots[pattern.slot];
    let effect = &simulator.effects[slot.effect];
    let (quantity, unit_of_it) = effect.declared_form(slot.index)?;
    let is_tried = |e: &dyn crate::effects::Effect| e.gradient_of() == Some(effect.name().as_str());
    if pattern.by != Grouping::Element
        || pattern.groups.len() < ELEMENTS
        || simulator.effects.iter().any(|e| is_tried(e.as_ref()))
    {
        return None;
    }
    let course = pattern.course(set).filter(|c| c.is_linear)?;
    let names: &[&str] = match course.extent.directions.as_slice() {
        [_] => &["slope"],
        _ => &["slope_x", "slope_y"],
    };
    let [x, y] = course.extent.middle;
    let from = |variable: &str, middle: f64| match middle {
        0.0 => variable.to_owned(),
        _ => format!("({variable} - {middle:?})"),
    };
    let along = |direction: &[f64; 2]| match direction {
        [1.0, 0.0] => from("X", x),
        [0.0, 1.0] => from("Y", y),
        [a, b] => format!("({a:?} * {} + {b:?} * {})", from("X", x), from("Y", y)),
    };
    let terms: Vec<String> = names
        .iter()
        .zip(&course.extent.directions)
        .map(|(name, d)| format!("{name} * {}", along(d)))
        .collect();
    let parameters = course.slopes.iter().zip(&course.extent.half_spans).zip(names);
    let (low, high) = slot.parameter.range;
    let most = low.abs().min(high.abs());
    let factor = match unit_of_it.as_str() {
        "1" => String::new(),
        own => format!(" * {own}"),
    };
    Some(DeclaredEffect {
        name: match effect.parameters().len() {
            1 => format!("{}_gradient", effect.name()),
            _ => format!("{}_{}_gradient", effect.name(), slot.index + 1),
        },
        unit: format!("{} per mm", effect.unit()),
        quantity,
        expression: format!("{PER_UM:?} * ({}){factor}", terms.join(" + ")),
        parameters: parameters
            .map(|(((slope, _), half), name)| {
                let [most, typical] = [most, slot.parameter.typical].map(|v| v / (half * PER_UM));
                DeclaredParameter {
                    name: (*name).into(),
                    range: (-most, most),
                    prior: (slope.abs() / PER_UM).clamp(LEAST_SHARE * typical, typical),
                    start: 0.0,
                }
            })
            .collect(),
    })
}
