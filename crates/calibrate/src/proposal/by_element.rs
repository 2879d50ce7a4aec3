//! A quantity that differs over the chip: what is free for each element, put as that of one element, as linear in their places, or as
//! a value for each.

use crate::effects::{DeclaredEffect, DeclaredParameter, Effect, MOST_PARAMETERS};
use crate::grouping::{Grouping, linear_trend};
use crate::simulator::Simulator;
use crate::statistics::{Pattern, SIGMAS_95};
use metalith_optics::DeclaredQuantity;

/// Fewest elements: two values are always on a line.
const ELEMENTS: usize = 3;

/// The others have nothing of what one element has if none has more than this share of it, or than its noise says.
const NOTHING: f64 = 0.1;

/// A parameter starts at least at this share of a typical size at the outermost element: a fitted slope may be next to
/// nothing along one of the axes.
const LEAST_SHARE: f64 = 0.25;

/// Slopes are per mm, places in um.
const PER_UM: f64 = 1e-3;

/// A quantity that an expression can stand for.
struct Quantity<'a> {
    effect: &'a dyn Effect,
    pattern: &'a Pattern,
    quantity: DeclaredQuantity,
    /// Factor of its expression, with the sign before it.
    factor: String,
    /// Name of the effect, with the number of the parameter if it has several.
    name: String,
    /// Largest value, and a typical one.
    most: f64,
    typical: f64,
}

/// The quantity of a pattern by element as an effect: of one element if the others have nothing of it, else with a slope along each
/// direction in which elements differ if its values are linear and no effect was tried that is this, else with a value for each; none
/// if no expression stands for it, or a declared effect cannot have so many values.
pub(super) fn declared(simulator: &Simulator<'_>, pattern: &Pattern) -> Option<DeclaredEffect> {
    if Grouping::of(pattern) != Grouping::Element || pattern.groups.len() < ELEMENTS {
        return None;
    }
    let slot = simulator.slots[pattern.slot];
    let effect = simulator.effects[slot.effect].as_ref();
    let (quantity, unit_of_it) = effect.declared_form(slot.index)?;
    let (low, high) = slot.parameter.range;
    let own = Quantity {
        effect,
        pattern,
        quantity,
        factor: match unit_of_it.as_str() {
            "1" => String::new(),
            own => format!(" * {own}"),
        },
        name: match effect.parameters().len() {
            1 => effect.name(),
            _ => format!("{}_{}", effect.name(), slot.index + 1),
        },
        most: low.abs().min(high.abs()),
        typical: slot.parameter.typical,
    };
    match own.only_element() {
        Some(group) => Some(own.of_elements(simulator, &[group])),
        None => own.gradient(simulator).or_else(|| own.of_each(simulator)),
    }
}

impl Quantity<'_> {
    /// The group of the element that has all of it.
    fn only_element(&self) -> Option<usize> {
        let values = &self.pattern.values;
        let largest = (0..values.len()).max_by(|&a, &b| values[a].0.abs().total_cmp(&values[b].0.abs()))?;
        let of_it = NOTHING * values[largest].0.abs();
        let mut rest = values.iter().enumerate().filter(|(group, _)| *group != largest);
        rest.all(|(_, (value, sigma))| value.abs() <= of_it.max(SIGMAS_95 * sigma))
            .then_some(largest)
    }

    /// A value for each element.
    fn of_each(&self, simulator: &Simulator<'_>) -> Option<DeclaredEffect> {
        let groups: Vec<usize> = (0..self.pattern.groups.len()).collect();
        (groups.len() <= MOST_PARAMETERS).then(|| self.of_elements(simulator, &groups))
    }

    /// A value for each of some elements.
    fn of_elements(&self, simulator: &Simulator<'_>, groups: &[usize]) -> DeclaredEffect {
        let set = simulator.bench.set();
        let element = |group: &usize| &set.elements[set.measurements[self.pattern.groups[*group]].element];
        let word = |index: [i64; 2]| index.map(|i| i.to_string().replace('-', "m")).join("_");
        let names: Vec<String> = groups
            .iter()
            .map(|g| format!("of_{}", word(element(g).index)))
            .collect();
        let terms = groups.iter().zip(&names).map(|(g, name)| {
            let [x, y] = element(g).centre_um;
            format!("{name} * step(1 - hypot({}, {}))", from("X", x), from("Y", y))
        });
        let terms = terms.collect::<Vec<_>>().join(" + ");
        DeclaredEffect {
            name: match names.as_slice() {
                [one] => format!("{}_{one}", self.name),
                _ => format!("{}_by_element", self.name),
            },
            unit: self.effect.unit().into(),
            quantity: self.quantity,
            expression: match names.len() {
                1 => terms + &self.factor,
                _ => format!("({terms}){}", self.factor),
            },
            parameters: names
                .into_iter()
                .map(|name| DeclaredParameter {
                    name,
                    range: (-self.most, self.most),
                    prior: self.typical,
                    start: 0.0,
                })
                .collect(),
        }
    }

    /// A slope along each direction in which elements differ, about the middle of them; none if values are not linear.
    fn gradient(&self, simulator: &Simulator<'_>) -> Option<DeclaredEffect> {
        let name = self.effect.name();
        let is_tried = |e: &dyn Effect| e.gradient_of() == Some(name.as_str());
        if simulator.effects.iter().any(|e| is_tried(e.as_ref())) {
            return None;
        }
        let trend = linear_trend(self.pattern, simulator.bench.set()).filter(|c| c.is_linear)?;
        let names: &[&str] = match trend.extent.directions.as_slice() {
            [_] => &["slope"],
            _ => &["slope_x", "slope_y"],
        };
        let [x, y] = trend.extent.middle;
        let along = |direction: &[f64; 2]| match direction {
            [1.0, 0.0] => from("X", x),
            [0.0, 1.0] => from("Y", y),
            [a, b] => format!("({a:?} * {} + {b:?} * {})", from("X", x), from("Y", y)),
        };
        let terms: Vec<String> = names
            .iter()
            .zip(&trend.extent.directions)
            .map(|(name, d)| format!("{name} * {}", along(d)))
            .collect();
        let parameters = trend.slopes.iter().zip(&trend.extent.half_spans).zip(names);
        Some(DeclaredEffect {
            name: format!("{}_gradient", self.name),
            unit: format!("{} per mm", self.effect.unit()),
            quantity: self.quantity,
            expression: format!("{PER_UM:?} * ({}){}", terms.join(" + "), self.factor),
            parameters: parameters
                .map(|(((slope, _), half), name)| {
                    let [most, typical] = [self.most, self.typical].map(|v| v / (half * PER_UM));
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
}

/// A place on the chip from another, as an expression.
fn from(variable: &str, middle: f64) -> String {
    match middle {
        0.0 => variable.to_owned(),
        _ => format!("({variable} - {middle:?})"),
    }
}
