//! Wanted result of a session: each effect at a size, and distinguished from every other.

use metalith_core::{Error, Result};
use metalith_report::{exact, sig};

use crate::bench_file::BenchFile;
use crate::choice::{Choice, Requirement};
use crate::expected_performance::amount;
use metalith_attribution::Parameter;
use metalith_calibrate::MeasuredSet;
use metalith_calibrate::check_effects;
use metalith_calibrate::{Effect, all_effects};

/// The parameters of an effect that are asked for, with their places: all but those that change nothing by themselves.
fn asked(effect: &dyn Effect) -> impl Iterator<Item = (usize, Parameter)> + use<> {
    let is_dormant = effect.dormant();
    let all = effect.parameters().into_iter().enumerate();
    all.filter(move |(k, _)| *k == 0 || !is_dormant)
}

/// Succeeds if all wanted sizes are of effects of a set and within what physics allows.
///
/// # Errors
/// If a name is not known; if a size is beyond, with what sizes are counted from.
pub(crate) fn check_wanted(set: &MeasuredSet, bench: &BenchFile) -> Result<()> {
    let known = all_effects(set);
    let names: Vec<String> = bench.wanted.keys().cloned().collect();
    check_effects(&known, &names)?;
    for effect in &known {
        let Some(&wanted) = bench.wanted.get(&effect.name()) else {
            continue;
        };
        let size = effect.parameter(wanted);
        let is_within = |p: &Parameter| (p.range.0..=p.range.1).contains(&size);
        if let Some((_, parameter)) = asked(effect.as_ref()).find(|(_, p)| !is_within(p)) {
            return Err(beyond(effect.as_ref(), wanted, &parameter, set));
        }
    }
    Ok(())
}

fn beyond(effect: &dyn Effect, wanted: f64, parameter: &Parameter, set: &MeasuredSet) -> Error {
    let (name, unit) = (effect.name(), effect.unit());
    let mut ends = [parameter.range.0, parameter.range.1].map(|end| amount(effect, end, set).max(0.0));
    ends.sort_by(f64::total_cmp);
    let stated = effect.value(0.0, set);
    // Of some effects the whole is reported, which is not zero where nothing is wrong.
    let is_whole = effect.parameter(wanted) == wanted && stated != 0.0;
    let change = (wanted - stated).abs();
    let hint = match is_whole {
        true if change > 0.0 && change <= ends[1] => format!(
            "sizes are changes from what is stated, {stated}: for {wanted} write {}",
            exact(change)
        ),
        true => format!("sizes are changes from what is stated, {stated}"),
        false => "give a size that the chip or the bench may have".to_owned(),
    };
    let [low, high] = ends.map(|end| sig(end, 3));
    let what = format!("`{name} = {wanted}` of [wanted]: it may be {low} to {high} {unit}");
    Error::refused("plan/size-out-of-range", what.trim_end(), hint)
}

/// Each parameter of each effect is to be detected, and to be told from each other effect. Parameters that change nothing
/// by themselves are not asked for.
pub(crate) fn requirements(effects: &[Box<dyn Effect>], bench: &BenchFile) -> Vec<Requirement> {
    let mut slots: Vec<Vec<usize>> = Vec::new();
    let mut own: Vec<(usize, usize, f64)> = Vec::new();
    let mut next = 0;
    for (e, effect) in effects.iter().enumerate() {
        let wanted = bench.wanted.get(&effect.name());
        for (k, p) in asked(effect.as_ref()) {
            let size = wanted.map_or(p.typical, |amount| effect.parameter(*amount));
            own.push((e, next + k, size));
        }
        let parameters = effect.parameters().len();
        slots.push((next..next + parameters).collect());
        next += parameters;
    }
    let detected = own.iter().map(|&(_, slot, size)| Requirement {
        slot,
        size,
        beside: Vec::new(),
    });
    let apart = own.iter().flat_map(|&(e, slot, size)| {
        let others = slots.iter().enumerate().filter(move |(other, _)| *other != e);
        others.map(move |(_, beside)| Requirement {
            slot,
            size,
            beside: beside.clone(),
        })
    });
    detected.chain(apart).collect()
}

/// An effect that cannot be found is not to be told from others.
pub(crate) fn only_of_what_is_found(choice: &Choice<'_>, reachable: &mut [bool]) {
    let lost: Vec<usize> = choice
        .requirements
        .iter()
        .zip(reachable.iter())
        .filter(|(r, reached)| r.beside.is_empty() && !**reached)
        .map(|(r, _)| r.slot)
        .collect();
    for (r, reached) in choice.requirements.iter().zip(reachable) {
        *reached &= !lost.contains(&r.slot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench_file::tests::small_bench;
    use metalith_core::Silent;
    use metalith_gds::extract::PillarsAt;

    #[test]
    fn sizes_that_cannot_be_are_refused_with_what_they_are_counted_from() {
        let folder = tempfile::tempdir().unwrap();
        metalith_testing::session::small_set(folder.path());
        let set = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
        let checked = |wanted: &str| check_wanted(&set, &small_bench(&format!("[wanted]\n{wanted}\n")));
        for sound in [
            "film_height = 10",
            "led_width = 0.3",
            "source_distance = 20000.0",
            "defocus = 2",
        ] {
            assert!(checked(sound).is_ok(), "{sound}");
        }
        for (wanted, parts) in [
            (
                "film_height = 710",
                ["0 to 60.0 nm", "what is stated, 700: for 710 write 10"],
            ),
            ("led_width = 2.6", ["0 to 1.50", "what is stated, 1"]),
            ("source_distance = 2000.0", ["source_distance = 2000", "5,000 to"]),
            ("defocus = 100", ["0 to 60.0 um", "may have"]),
            ("defokus = 1", ["defokus", "did you mean"]),
        ] {
            let error = checked(wanted).unwrap_err().to_string();
            for part in parts {
                assert!(error.contains(part), "{wanted}: {part} is not in:\n{error}");
            }
        }
    }
}
