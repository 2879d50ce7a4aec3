//! The chips and benches that synthetic sets are made of.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::effects::{Effect, Parameter, Stage};
use metalith_core::{Error, Result};

/// The truth of a set without any effect.
pub(crate) const NOTHING: &str = "nothing";

/// Sizes at which every effect is tried (typical sizes).
pub(crate) const SIZES: [f64; 3] = [0.5, 1.0, 2.0];

/// Effects that are tried together, each at its typical size: of one stage and of several, alike and unlike.
const PAIRS: [(&str, &str); 8] = [
    ("cd_bias", "defocus"),
    ("cd_bias", "film_index"),
    ("film_height", "zero_order"),
    ("sidewall_taper", "pixel_blur"),
    ("cd_bias_density", "stray_light"),
    ("tilt", "source_size"),
    ("missing_pillars", "cd_bias"),
    ("source_distance", "led_width"),
];

/// The parameters of an effect with several are unequal and of unlike signs: shares of a typical size.
const SHARES: [f64; 3] = [1.0, -0.6, 0.4];

/// An effect with its parameters.
pub(crate) type AppliedEffect = (String, Vec<f64>);

/// A chip and a bench that sets are made of.
pub(crate) struct SyntheticChip {
    pub truth: String,
    /// Size in typical sizes; of two effects, the size of the first.
    pub size: f64,
    pub parts: Vec<AppliedEffect>,
}

impl SyntheticChip {
    /// Chip without effect.
    pub(crate) fn stated() -> Self {
        Self {
            truth: NOTHING.into(),
            size: 0.0,
            parts: Vec::new(),
        }
    }

    /// Chip with one effect.
    pub(crate) fn single(name: &str, size: f64, numbers: Vec<f64>) -> Self {
        Self {
            truth: name.into(),
            size,
            parts: vec![(name.into(), numbers)],
        }
    }

    fn of(size: f64, parts: Vec<AppliedEffect>) -> Self {
        let names: Vec<&str> = parts.iter().map(|(name, _)| name.as_str()).collect();
        Self {
            truth: names.join(" + "),
            size,
            parts,
        }
    }
}

/// The parameters of an effect of so many typical sizes.
fn numbers(parameters: Vec<Parameter>, size: f64) -> Vec<f64> {
    let parts = parameters.iter().zip(SHARES);
    parts.map(|(p, share)| share * size * p.typical).collect()
}

/// One chip for each effect and size, one for each pair of effects that are both among these.
pub(crate) fn of_each_effect(effects: &[&dyn Effect]) -> Vec<SyntheticChip> {
    let singles = effects.iter().flat_map(|effect| {
        SIZES.map(|size| SyntheticChip::single(&effect.name(), size, numbers(effect.parameters(), size)))
    });
    let pairs = PAIRS.iter().filter_map(|(a, b)| {
        let part = |name: &str| {
            let effect = effects.iter().find(|e| e.name() == name)?;
            Some((effect.name(), numbers(effect.parameters(), 1.0)))
        };
        Some(SyntheticChip::of(1.0, vec![part(a)?, part(b)?]))
    });
    singles.chain(pairs).collect()
}

/// The chip of a text such as `cd_bias=1+film_index=-0.5`: effects with their sizes in typical sizes.
///
/// # Errors
/// If the text has another form, an effect is not among these, or a size lies outside of what physics allows.
pub(crate) fn of_text(effects: &[&dyn Effect], text: &str) -> Result<SyntheticChip> {
    let wrong =
        |what: String, hint: String| Error::refused("calibrate/invalid-trial", format!("trial `{text}`: {what}"), hint);
    let mut parts: Vec<AppliedEffect> = Vec::new();
    let mut first = None;
    for part in text.split('+').map(str::trim) {
        let (name, size) = part.split_once('=').unwrap_or((part, "1"));
        let (name, size) = (name.trim(), size.trim());
        let Some(effect) = effects.iter().find(|e| e.name() == name) else {
            let known: Vec<String> = effects.iter().map(|e| e.name()).collect();
            return Err(wrong(
                format!("no effect `{name}` is tried on this set"),
                format!("known effects are {}", known.join(", ")),
            ));
        };
        if parts.iter().any(|(known, _)| known == name) {
            return Err(wrong(format!("`{name}` stands twice"), "name each effect once".into()));
        }
        let form = || {
            "write effects and their sizes in typical sizes, as in `cd_bias=1+film_index=-0.5`, or each number of an effect, as in \
             `tilt=1,-0.5`"
                .to_owned()
        };
        let parse = |text: &str| match text.trim().parse() {
            Ok(size) if f64::is_finite(size) => Ok(size),
            _ => Err(wrong(format!("`{text}` is no size"), form())),
        };
        let sizes = size.split(',').map(parse).collect::<Result<Vec<f64>>>()?;
        if sizes.iter().all(|s| *s == 0.0) {
            return Err(wrong(format!("`{size}` is no size"), form()));
        }
        let parameters = effect.parameters();
        let own = match sizes.as_slice() {
            [size] => numbers(parameters, *size),
            each if each.len() == parameters.len() => parameters.iter().zip(each).map(|(p, s)| s * p.typical).collect(),
            each => {
                let (has, stand) = (parameters.len(), each.len());
                return Err(wrong(
                    format!("`{name}` has {has} numbers, and {stand} stand there"),
                    form(),
                ));
            }
        };
        for (p, number) in effect.parameters().iter().zip(&own) {
            if !(p.range.0..=p.range.1).contains(number) {
                let (low, high) = (p.range.0 / p.typical, p.range.1 / p.typical);
                return Err(wrong(
                    format!("{size} typical sizes of `{name}` are outside of what physics allows"),
                    format!(
                        "its typical size is {}; it goes from {low} to {high} of these",
                        p.typical
                    ),
                ));
            }
        }
        first.get_or_insert(sizes[0]);
        parts.push((effect.name(), own));
    }
    Ok(SyntheticChip::of(first.unwrap_or(0.0), parts))
}

/// Chips, so many, with one or two effects each, of 0.5 to 2 typical sizes and both signs, drawn from a seed. Effects
/// of the pillar itself take one of [`SIZES`], and no two of them meet: tables of cells would be solved for one chip
/// alone.
pub(crate) fn at_random(effects: &[&dyn Effect], count: u64, seed: u64) -> Vec<SyntheticChip> {
    let [least, .., most] = SIZES;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut chips = Vec::new();
    if effects.is_empty() {
        return chips;
    }
    for k in 0..count {
        let wanted = 1 + (k % 2) as usize;
        let mut parts: Vec<AppliedEffect> = Vec::new();
        let mut first = 0.0;
        let mut is_solved = false;
        // All may be of the pillar itself: then some chips have one effect.
        for _ in 0..TRIES {
            if parts.len() == wanted {
                break;
            }
            let effect = effects[rng.random_range(0..effects.len())];
            let own = effect.stage() == Stage::Stack;
            if own && is_solved || parts.iter().any(|(name, _)| *name == effect.name()) {
                continue;
            }
            is_solved |= own;
            let size = if own {
                SIZES[rng.random_range(0..SIZES.len())]
            } else {
                least * (most / least).powf(rng.random())
            };
            if parts.is_empty() {
                first = size;
            }
            let numbers = effect.parameters().into_iter().enumerate().map(|(k, p)| {
                let sign = if p.one_sided() || rng.random() { 1.0 } else { -1.0 };
                // All but the first are any share of it.
                let share = if k == 0 { 1.0 } else { rng.random::<f64>() };
                sign * share * size * p.typical
            });
            parts.push((effect.name(), numbers.collect()));
        }
        chips.push(SyntheticChip::of(first, parts));
    }
    chips
}

/// Draws of an effect for one chip.
const TRIES: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::of_any_chip;

    fn known() -> Vec<Box<dyn Effect>> {
        of_any_chip()
    }

    #[test]
    fn chips_are_read_from_text() {
        let known = known();
        let effects: Vec<&dyn Effect> = known.iter().map(AsRef::as_ref).collect();
        let chip = of_text(&effects, "cd_bias=-2 + tilt").unwrap();
        assert_eq!((chip.truth.as_str(), chip.size), ("cd_bias + tilt", -2.0));
        assert_eq!(
            chip.parts,
            [
                ("cd_bias".to_owned(), vec![-10.0]),
                ("tilt".to_owned(), vec![3.0, -0.6 * 3.0])
            ]
        );
        let each = of_text(&effects, "tilt=-1, 0.5+cd_bias=1").unwrap();
        assert_eq!((each.size, &each.parts[0].1), (-1.0, &vec![-3.0, 1.5]));
        for (text, what) in [
            ("cd_bias=1,2", "has 1 numbers, and 2 stand there"),
            ("tilt=0,0", "`0,0` is no size"),
            ("cd_bais=1", "no effect `cd_bais`"),
            ("cd_bias=big", "`big` is no size"),
            ("cd_bias=1+cd_bias=2", "stands twice"),
            ("stray_light=-1", "outside of what physics allows"),
        ] {
            let error = of_text(&effects, text).err().unwrap().to_string();
            assert!(error.contains(what), "{error}");
        }
    }

    #[test]
    fn random_chips_are_possible_and_have_one_or_two_effects() {
        let known = known();
        let effects: Vec<&dyn Effect> = known.iter().map(AsRef::as_ref).collect();
        let chips = at_random(&effects, 200, 1);
        assert_eq!(chips.len(), 200);
        for (k, chip) in chips.iter().enumerate() {
            assert_eq!(chip.parts.len(), 1 + k % 2, "{}", chip.truth);
            for (name, numbers) in &chip.parts {
                let effect = effects.iter().find(|e| e.name() == *name).unwrap();
                for (p, v) in effect.parameters().iter().zip(numbers) {
                    assert!((p.range.0..=p.range.1).contains(v), "{name} {v}");
                    assert!(v.abs() <= 2.0 * p.typical * (1.0 + 1e-12), "{name} {v}");
                }
            }
        }
        // Both signs, and every effect.
        assert!(chips.iter().any(|c| c.parts[0].1[0] < 0.0));
        for e in &effects {
            assert!(
                chips.iter().any(|c| c.parts.iter().any(|(n, _)| *n == e.name())),
                "{}",
                e.name()
            );
        }
    }
}
