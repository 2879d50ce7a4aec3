//! Effects of heights and spectra that a person declares in a file, by an expression.
//!
//! | kind | stage | key | value of the expression | variables |
//! | --- | --- | --- | --- | --- |
//! | heights | `drawn` | `height_nm` | added to the drawn height (nm), before the blur | `x y h` |
//! | | `printed` | `height_nm` | added to the blurred height (nm), before the gain | `x y h` |
//! | | `measured` | `height_nm` | added to the predicted height (nm) | `x y h` |
//! | spectra | `added` | `reflectance` | added to the predicted reflectance | `wavelength height` |
//! | | `factor` | `factor` | relative change of the predicted reflectance | `wavelength height` |
//! | | `wavelength` | `wavelength_nm` | added to the wavelength (nm) of the stack | `wavelength height` |
//!
//! `x y` from the middle of a field (um), `h` the height at the stage (nm), `height` of the object (nm). Where an expression has
//! no finite value it counts as zero.

use std::path::Path;

use metalith_attribution::{
    DeclaredParameter, RefitEffect, RefitParameter, keys_of_declared_effects, read_declared_effects,
};
use metalith_core::Result;
use metalith_core::document::{KeyTable, Section};
use metalith_core::expression::Expression;

/// Where an expression acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    Drawn,
    Printed,
    Measured,
    Added,
    Factor,
    Wavelength,
}

/// A stage of a kind of set: its word in a file, and the key of its expression.
type StageWord = (&'static str, (Stage, &'static str));

/// Stages and variables of a kind of set.
pub(crate) struct Stages {
    words: &'static [StageWord],
    variables: &'static [&'static str],
    /// Values of the variables at which an expression must be zero when its parameters start.
    tried: &'static [&'static [f64]],
}

pub(crate) const OF_HEIGHTS: Stages = Stages {
    words: &[
        ("drawn", (Stage::Drawn, "height_nm")),
        ("printed", (Stage::Printed, "height_nm")),
        ("measured", (Stage::Measured, "height_nm")),
    ],
    variables: &["x", "y", "h"],
    tried: &[&[0.4, -3.7, 11.0], &[0.0, 2.9], &[0.0, 133.0, 870.0, 1510.0, 40.0]],
};

pub(crate) const OF_SPECTRA: Stages = Stages {
    words: &[
        ("added", (Stage::Added, "reflectance")),
        ("factor", (Stage::Factor, "factor")),
        ("wavelength", (Stage::Wavelength, "wavelength_nm")),
    ],
    variables: &["wavelength", "height"],
    tried: &[&[417.0, 533.0, 851.0], &[0.0, 63.0]],
};

/// Change at which an expression that should do nothing does something, in its unit; less is rounding.
const NOTHING: f64 = 1e-9;

/// Step of a derivative, over the typical size of a parameter.
const STEP: f64 = 1e-3;

/// Most values that one effect has over all groups.
const MOST_VALUES: usize = 200;

/// An effect of a file.
#[derive(Clone, Debug)]
pub(crate) struct DeclaredEffect {
    name: String,
    unit: String,
    word: &'static str,
    key: &'static str,
    pub(crate) stage: Stage,
    text: String,
    expression: Expression,
    parameters: Vec<DeclaredParameter>,
    /// True if each group has its own values.
    by_group: bool,
}

/// A pattern that a residual may have: an expression of one size `a`.
pub(crate) struct Pattern {
    pub(crate) name: &'static str,
    /// Words for a person: over what the residual varies.
    pub(crate) over: &'static str,
    pub(crate) stage: &'static str,
    pub(crate) expression: String,
    pub(crate) by_group: bool,
}

/// Unit of parameters that are declared: those of known units, so that figures have them; others have none.
fn known_unit(unit: &str) -> &'static str {
    const KNOWN: [&str; 8] = ["nm", "um", "mm", "rad", "mrad", "deg", "1/nm", "1/um"];
    KNOWN.iter().find(|known| **known == unit).unwrap_or(&"")
}

impl DeclaredEffect {
    /// The effects of a file for a kind of set.
    ///
    /// # Errors
    /// All faults of the file at once, each with its line and column.
    pub(crate) fn read(path: &Path, stages: &Stages) -> Result<Vec<Self>> {
        read_declared_effects(path, |section| declared(section, stages), |effect| &effect.name)
    }

    /// The keys of a file of effects for a kind of set.
    pub(crate) fn keys(stages: &Stages) -> KeyTable {
        keys_of_declared_effects(|section| declared(section, stages), |effect| &effect.name)
    }

    /// An effect of one parameter `a` of a typical size and a largest one, as a file would declare it; none if the expression has a
    /// mistake.
    pub(crate) fn pattern(stages: &Stages, pattern: &Pattern, [prior, most]: [f64; 2]) -> Option<Self> {
        let (word, (stage, key)) = stages.words.iter().find(|(own, _)| *own == pattern.stage)?;
        let names: Vec<&str> = stages.variables.iter().copied().chain(["a"]).collect();
        Some(Self {
            name: pattern.name.into(),
            unit: if key.ends_with("_nm") {
                "nm".into()
            } else {
                String::new()
            },
            word,
            key,
            stage: *stage,
            text: pattern.expression.clone(),
            expression: Expression::parse(&pattern.expression, &names).ok()?,
            parameters: vec![DeclaredParameter {
                name: "a".into(),
                range: (-most, most),
                prior,
                start: 0.0,
            }],
            by_group: pattern.by_group,
        })
    }

    /// Its section of a file that [`DeclaredEffect::read`] reads, with values to start from as typical sizes.
    pub(crate) fn text(&self, values: &[f64]) -> String {
        let mut out = format!(
            "[[effect]]\nname = \"{}\"\nunit = \"{}\"\nstage = \"{}\"\n{} = \"{}\"\n",
            self.name, self.unit, self.word, self.key, self.text
        );
        if self.by_group {
            out.push_str("by = \"group\"\n");
        }
        for (p, value) in self.parameters.iter().zip(values) {
            let prior = if *value == 0.0 { p.prior } else { value.abs() };
            out.push_str(&DeclaredParameter { prior, ..p.clone() }.text());
        }
        out
    }

    /// Value for variables of its kind of set, with values for the parameters.
    pub(crate) fn value(&self, variables: &[f64], parameters: &[f64]) -> f64 {
        let mut all = [0.0; 3 + metalith_attribution::MOST_PARAMETERS];
        let (own, rest) = all.split_at_mut(variables.len());
        own.copy_from_slice(variables);
        rest[..parameters.len()].copy_from_slice(parameters);
        let value = self.expression.value(&all[..variables.len() + parameters.len()]);
        if value.is_finite() { value } else { 0.0 }
    }
}

fn declared(s: &Section<'_, '_>, stages: &Stages) -> Option<DeclaredEffect> {
    let name = DeclaredParameter::name_of_effect(s);
    let unit = s.optional_text("unit").unwrap_or_default();
    let words: Vec<_> = stages.words.iter().map(|word| (word.0, *word)).collect();
    let (word, (stage, key)) = s.choice("stage", &words, None);
    let by_group = s.choice("by", &[("bench", false), ("group", true)], Some(false));
    let text = s.text(key);
    let parameters = DeclaredParameter::read_all(s, stages.variables);
    s.finish();
    if parameters.len() > metalith_attribution::MOST_PARAMETERS {
        return None;
    }
    let names = parameters.iter().map(|p| p.name.as_str());
    let names: Vec<&str> = stages.variables.iter().copied().chain(names).collect();
    let expression = Expression::parse(&text, &names)
        .map_err(|fault| s.fault_in_text(key, fault.at, fault.what, fault.hint))
        .ok()?;
    let effect = DeclaredEffect {
        name,
        unit,
        word,
        key,
        stage,
        text,
        expression,
        parameters,
        by_group,
    };
    let starts: Vec<f64> = effect.parameters.iter().map(|p| p.start).collect();
    let count: usize = stages.tried.iter().map(|own| own.len()).product();
    for k in 0..count {
        let mut rest = k;
        let place = stages.tried.iter().map(|own| {
            let value = own[rest % own.len()];
            rest /= own.len();
            value
        });
        let place: Vec<f64> = place.collect();
        let value = effect.value(&place, &starts);
        if value.abs() > NOTHING {
            let named: Vec<String> = stages
                .variables
                .iter()
                .zip(&place)
                .map(|(n, v)| format!("{n} = {v}"))
                .collect();
            s.fault(
                key,
                format!(
                    "with all parameters at their `start` the expression is {value} at {}, not 0",
                    named.join(", ")
                ),
                "an effect does nothing at the start: write an expression that is 0 there, such as `a` times a shape",
            );
            break;
        }
    }
    Some(effect)
}

/// Declared effects of a model, with the slots of their parameters.
#[derive(Clone, Debug, Default)]
pub(crate) struct DeclaredSlots {
    effects: Vec<DeclaredEffect>,
    /// Slots of each effect, in the order of groups and parameters.
    slots: Vec<std::ops::Range<usize>>,
}

impl DeclaredSlots {
    /// Add declared effects to the parameters and effects of a model with some groups.
    ///
    /// # Errors
    /// If an effect has the name of another, or values for too many groups.
    pub(crate) fn add(
        &mut self,
        effects: &[DeclaredEffect],
        groups: usize,
        to: (&mut Vec<RefitParameter>, &mut Vec<RefitEffect>),
    ) -> Result<()> {
        let (parameters, known) = to;
        for effect in effects {
            let copies = if effect.by_group { groups } else { 1 };
            let wrong = if known.iter().any(|e| e.name == effect.name) {
                Some("the list has an effect of this name")
            } else if copies * effect.parameters.len() > MOST_VALUES {
                Some("it has too many values over all groups")
            } else {
                None
            };
            if let Some(what) = wrong {
                return Err(metalith_core::Error::refused(
                    "calibrate/declared-effect",
                    format!("`{}` cannot be declared: {what}", effect.name),
                    "rename it, or declare it without `by = \"group\"`",
                ));
            }
            let first = parameters.len();
            for group in 0..copies {
                parameters.extend(effect.parameters.iter().map(|p| RefitParameter {
                    name: match (effect.by_group, effect.parameters.len()) {
                        (true, _) => format!("{} {} {}", effect.name, p.name, group + 1),
                        (false, 1) => effect.name.clone(),
                        (false, _) => format!("{} {}", effect.name, p.name),
                    },
                    unit: known_unit(&effect.unit),
                    neutral: p.start,
                    // A little away: parameters of a shape have no influence where its size is zero.
                    start: p.start
                        + if p.start + p.prior <= p.range.1 {
                            p.prior
                        } else {
                            -p.prior
                        } * STEP,
                    range: p.range,
                    shown: |v| v,
                }));
            }
            known.push(RefitEffect {
                name: effect.name.clone(),
                slots: (first..parameters.len()).collect(),
                after: Vec::new(),
                across: effect.by_group.then_some(0),
            });
            self.effects.push(effect.clone());
            self.slots.push(first..parameters.len());
        }
        Ok(())
    }

    /// Step of a derivative along a slot; none of a slot that is not declared.
    pub(crate) fn step(&self, slot: usize) -> Option<f64> {
        let place = self.slots.iter().position(|own| own.contains(&slot))?;
        let own = &self.effects[place].parameters;
        Some(STEP * own[(slot - self.slots[place].start) % own.len()].prior)
    }

    fn of(&self, stage: Stage) -> impl Iterator<Item = (&DeclaredEffect, &std::ops::Range<usize>)> {
        self.effects
            .iter()
            .zip(&self.slots)
            .filter(move |(e, _)| e.stage == stage)
    }

    /// True if an effect of a stage acts with these values.
    pub(crate) fn acts(&self, stage: Stage, theta: &[f64]) -> bool {
        self.of(stage).any(|(e, slots)| {
            let starts = e.parameters.iter().map(|p| p.start).cycle();
            theta[slots.clone()].iter().zip(starts).any(|(v, start)| *v != start)
        })
    }

    /// Sum of the expressions of a stage for variables and a group.
    pub(crate) fn value(&self, stage: Stage, group: usize, variables: &[f64], theta: &[f64]) -> f64 {
        let value = |(e, slots): (&DeclaredEffect, &std::ops::Range<usize>)| {
            let count = e.parameters.len();
            let at = slots.start + if e.by_group { group * count } else { 0 };
            e.value(variables, &theta[at..at + count])
        };
        self.of(stage).map(value).sum()
    }
}
