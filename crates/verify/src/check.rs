//! The limits of a design, each held or not.

use serde::Serialize;

use super::{PsfPair, SampledElement, SampledSpot, SampledZones, Verification, WhiteChannel};
use metalith_design::LimitSpec;
use metalith_report::{count, sig};

/// One limit and what was reached.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Quantity that is limited, in words, with the place of its worst value.
    pub what: String,
    /// Key of the limit in the design file.
    pub key: &'static str,
    pub reached: f64,
    pub limit: f64,
    /// Sense of the limit: the least or the most that is allowed.
    pub sense: Sense,
    /// True if a sample of zones was judged: `reached` is the end of the interval of three standard errors that is worse.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub sampled: bool,
}

/// Side of a limit that is the right one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Sense {
    AtMost,
    AtLeast,
}

/// Verdict on the limits of a design, in words.
pub fn verdict_words(found: &Verification) -> String {
    let (all, failed) = (found.checks.len(), found.checks.iter().filter(|c| !c.passed()).count());
    let sampled = match found.checks.iter().filter(|c| c.sampled && c.passed()).count() {
        0 => String::new(),
        sampled => format!(", {sampled} of them by a sample of zones alone"),
    };
    match (failed, all) {
        (0, 1) => "FILE MATCHES DESIGN: the one limit holds".into(),
        (0, _) => format!("FILE MATCHES DESIGN: all {all} limits hold{sampled}"),
        _ => format!("{failed} of {all} limits do not hold"),
    }
}

impl Check {
    /// True if the limit holds; what is not a number holds no limit.
    pub fn passed(&self) -> bool {
        match self.sense {
            Sense::AtMost => self.reached <= self.limit,
            Sense::AtLeast => self.reached >= self.limit,
        }
    }

    /// Value reached, for a reader: a count with all its digits, any other value to four significant ones.
    pub fn reached_words(&self) -> String {
        // Counts have whole limits.
        if self.reached.fract() == 0.0 && self.limit.fract() == 0.0 && self.reached >= 0.0 {
            count(self.reached as u64)
        } else {
            sig(self.reached, 4)
        }
    }
}

fn at_most(what: String, key: &'static str, reached: f64, limit: f64) -> Check {
    Check {
        what,
        key,
        reached,
        limit,
        sense: Sense::AtMost,
        sampled: false,
    }
}

fn at_least(what: String, key: &'static str, reached: f64, limit: f64) -> Check {
    Check {
        sense: Sense::AtLeast,
        ..at_most(what, key, reached, limit)
    }
}

/// All limits, each with the worst over elements, wavelengths and field angles. Limits that a design does
/// not set are not listed.
pub(super) fn all(limits: &LimitSpec, found: &Verification) -> Vec<Check> {
    let wrong: u64 = found.elements.iter().map(|e| e.widths.faults()).sum();
    let mut checks = Vec::new();
    // Pillars as fabricated, or moved on purpose, are not those of the mapping.
    let mapping = found
        .distinct
        .iter()
        .map(|d| (d.element.label(), d.phase.mapping.rms_rad));
    if let Some((place, reached)) = worst(mapping).filter(|_| !found.compensated && found.model.is_none()) {
        checks.push(at_most(
            format!("rms phase error of the mapping, element {place} [rad]"),
            "mapping_phase_rms_max_rad",
            reached,
            limits.mapping_phase_rms_max_rad,
        ));
    }
    checks.extend([
        at_most(
            "pillars that are wrong, missing or extra".into(),
            "wrong_widths_max",
            wrong as f64,
            limits.wrong_widths_max as f64,
        ),
        at_most(
            "shapes on the pillar layer that are not pillars".into(),
            "foreign_shapes_max",
            found.foreign.total() as f64,
            limits.foreign_shapes_max as f64,
        ),
    ]);
    let rounding = worst(
        found
            .distinct
            .iter()
            .map(|d| (d.element.label(), d.phase.rounding.rms_rad)),
    );
    // Widths that were moved on purpose are not those of the mapping, rounded.
    if let Some((place, reached)) = rounding.filter(|_| !found.compensated) {
        let nothing = if reached.is_nan() { ": it has no pillars" } else { "" };
        let what = format!("rms phase error of rounding, element {place} [rad]{nothing}");
        checks.push(at_most(
            what,
            "rounding_phase_rms_max_rad",
            reached,
            limits.rounding_phase_rms_max_rad,
        ));
    }
    if let Some(none) = &found.not_simulated {
        let sampled = found.sampled().map_or_else(Vec::new, |zones| of_sample(limits, zones));
        let unknown = not_simulated(limits, &none.why).into_iter();
        checks.extend(unknown.map(|check| {
            let judged = sampled.iter().find(|judged| judged.key == check.key);
            judged.cloned().unwrap_or(check)
        }));
        return checks;
    }
    let spots = || {
        found
            .distinct
            .iter()
            .flat_map(|d| d.spots.iter().map(move |s| (s.label(&d.element), s)))
    };
    let optical: [Optical<'_>; 3] = [
        (
            "distance of the centroids [um]",
            "centroid_shift_max_um",
            limits.centroid_shift_max_um,
            &|s| s.centroid_shift_um(),
        ),
        (
            "difference of the MTF",
            "mtf_difference_max",
            limits.mtf_difference_max,
            &|s| s.mtf_difference(),
        ),
        (
            "rms difference of the PSF",
            "psf_difference_max",
            limits.psf_difference_max,
            &|s| s.psf_difference,
        ),
    ];
    for (name, key, limit, reached) in optical {
        if limit == f64::MAX {
            continue;
        }
        if let Some((place, reached)) = worst(spots().map(|(place, s)| (place, reached(s)))) {
            checks.push(at_most(format!("{name}, {place}"), key, reached, limit));
        }
    }
    let strehls: [Optical<'_>; 2] = [
        (
            "Strehl ratio of the layout over the Strehl ratio of the target",
            "strehl_ratio_min",
            limits.strehl_ratio_min,
            &|s| s.strehl_ratio(),
        ),
        ("Strehl ratio of the layout", "strehl_min", limits.strehl_min, &|s| {
            s.judged().metrics.strehl
        }),
    ];
    for (name, key, limit, reached) in strehls {
        if limit > 0.0
            && let Some((place, least)) = worst(spots().map(|(place, s)| (place, -reached(s))))
        {
            checks.push(at_least(format!("{name}, {place}"), key, -least, limit));
        }
    }
    let told = found.camera.as_ref().map(|c| c.frequencies().half_nyquist_lp_mm);
    let contrast_lp_mm = limits.polychromatic_mtf_lp_mm.or(told).unwrap_or(f64::NAN);
    let white = |of: &dyn Fn(&WhiteChannel) -> f64| {
        let mut all = Vec::new();
        for d in &found.distinct {
            for w in &d.white {
                let place = format!("element {}, channel {}", d.element.label(), w.channel);
                all.push((place, -of(w)));
            }
        }
        worst(all.into_iter())
    };
    let whites: [White<'_>; 2] = [
        (
            "polychromatic MTF",
            "polychromatic_mtf_min",
            limits.polychromatic_mtf_min,
            &|w| w.least_contrast(contrast_lp_mm),
        ),
        (
            "share of polychromatic light in a square of 2 pixels",
            "polychromatic_energy_2_pixels_min",
            limits.polychromatic_energy_2_pixels_min,
            &|w| w.energy_2_pixels,
        ),
    ];
    for (name, key, limit, reached) in whites {
        if limit > 0.0 {
            // A limit on what could not be simulated does not hold.
            let (place, least) = white(reached).unwrap_or_else(|| ("not simulated".into(), f64::NAN));
            checks.push(at_least(format!("{name}, {place}"), key, -least, limit));
        }
    }
    checks
}

/// The limits on phase and light that a design sets, none of which holds of a layout that is not simulated.
fn not_simulated(limits: &LimitSpec, why: &str) -> Vec<Check> {
    let most = [
        ("mapping_phase_rms_max_rad", limits.mapping_phase_rms_max_rad),
        ("rounding_phase_rms_max_rad", limits.rounding_phase_rms_max_rad),
        ("centroid_shift_max_um", limits.centroid_shift_max_um),
        ("mtf_difference_max", limits.mtf_difference_max),
        ("psf_difference_max", limits.psf_difference_max),
    ];
    let least = [
        ("strehl_ratio_min", limits.strehl_ratio_min),
        ("strehl_min", limits.strehl_min),
        ("polychromatic_mtf_min", limits.polychromatic_mtf_min),
        (
            "polychromatic_energy_2_pixels_min",
            limits.polychromatic_energy_2_pixels_min,
        ),
    ];
    let set = most
        .into_iter()
        .filter(|(_, limit)| *limit != f64::MAX)
        .map(|l| (l, Sense::AtMost));
    let set = set.chain(
        least
            .into_iter()
            .filter(|(_, limit)| *limit > 0.0)
            .map(|l| (l, Sense::AtLeast)),
    );
    set.map(|((key, limit), sense)| Check {
        sense,
        ..at_most(format!("not simulated: {why}"), key, f64::NAN, limit)
    })
    .collect()
}

/// The limits that a sample of zones tells, each held by the end of an interval of three standard errors that is worse: what is
/// left open by the sample does not hold.
fn of_sample(limits: &LimitSpec, sample: &SampledZones) -> Vec<Check> {
    let words =
        |name: &str, place: &str| format!("{name}, by a sample of zones, three standard errors allowed for, {place}");
    let phase = |name: &str, key: &'static str, limit: f64, of: &dyn Fn(&SampledElement) -> f64| {
        let all = sample.elements.iter().map(|e| (e.element.label(), of(e)));
        worst(all).map(|(place, most)| at_most(words(name, &format!("element {place}")), key, most, limit))
    };
    let strehl = |name: &str, key: &'static str, limit: f64, of: &dyn Fn(&SampledSpot) -> f64| {
        let elements = sample.elements.iter();
        let all = elements.flat_map(|e| e.spots.iter().map(|spot| (spot.label(&e.element), -of(spot))));
        worst(all).map(|(place, least)| at_least(words(name, &place), key, -least, limit))
    };
    let mapping = phase(
        "rms phase error of the mapping [rad]",
        "mapping_phase_rms_max_rad",
        limits.mapping_phase_rms_max_rad,
        &|e| e.mapping_rms_rad.most(),
    );
    let rounding = phase(
        "rms phase error of rounding [rad]",
        "rounding_phase_rms_max_rad",
        limits.rounding_phase_rms_max_rad,
        &|e| e.rounding_rms_rad.most(),
    );
    let ratio = strehl(
        "Strehl ratio of the layout over the Strehl ratio of the target",
        "strehl_ratio_min",
        limits.strehl_ratio_min,
        &|spot| spot.strehl_ratio.map_or(0.0, |ratio| ratio.least()),
    );
    let peak = strehl("Strehl ratio of the layout", "strehl_min", limits.strehl_min, &|spot| {
        spot.strehl.least()
    });
    let all = [mapping, rounding, ratio, peak].into_iter().flatten();
    all.map(|check| Check { sampled: true, ..check }).collect()
}

/// Name, key and limit of what is measured of a channel in white light.
type White<'a> = (&'static str, &'static str, f64, &'a dyn Fn(&WhiteChannel) -> f64);

/// Name, key and limit of what is measured of a spot.
type Optical<'a> = (&'static str, &'static str, f64, &'a dyn Fn(&PsfPair) -> f64);

/// The greatest value with its place; one that is not a number is greater than all.
fn worst(values: impl Iterator<Item = (String, f64)>) -> Option<(String, f64)> {
    values.reduce(|a, b| if b.1 > a.1 || b.1.is_nan() { b } else { a })
}
