//! Mistakes of spectra that no fit shows: other units, one file under several names, and repeats that are far from the others.

use super::set::{Spectrum, SpectrumSet};
use crate::number_rows::{NORMAL, median};

/// Reflectance or transmission cannot be above one, nor below zero; errors of the reference are allowed for.
const LEAST: f64 = -0.05;
const MOST: f64 = 1.2;

/// Distance of a repeat from the median of its object (rms), over that of most repeats, from which on it is left out.
const FAR: f64 = 10.0;

/// Least such distance.
const FAR_LEAST: f64 = 0.01;

/// What is wrong with the spectra as a whole, and the remedy.
pub(super) fn wrong_as_a_whole(set: &SpectrumSet) -> Option<(String, &'static str)> {
    let spectra = &set.spectra;
    let all: Vec<f64> = spectra.iter().flat_map(|s| s.reflectance.iter().copied()).collect();
    let middle = median(all);
    if !spectra.is_empty() && !(LEAST..=MOST).contains(&middle) {
        return Some((
            format!("the median of all values is {middle:.3}, and reflectance and transmission are from 0 to 1"),
            "give per cent of the reference with the dark level subtracted, or state `unit`",
        ));
    }
    let highest = spectra.iter().map(|s| s.size_nm).fold(0.0, f64::max);
    if highest > 0.0 && highest < LEAST_SIZE_NM {
        return Some((
            format!("the largest size is {highest} nm"),
            "write heights or widths in nm in the names of files",
        ));
    }
    for (k, one) in spectra.iter().enumerate() {
        let is_same = |other: &&Spectrum| {
            (other.size_nm, other.medium) != (one.size_nm, one.medium) && other.reflectance == one.reflectance
        };
        if let Some(other) = spectra[..k].iter().find(is_same) {
            return Some((
                format!("{} and {} have the same values", other.name, one.name),
                "give each measurement once, with its own file",
            ));
        }
    }
    None
}

/// Heights and widths of objects are at least this, unless their unit is not nm.
const LEAST_SIZE_NM: f64 = 1.0;

/// Leave out repeats that are far from the median of the three or more of their object; what was found, in words.
pub(super) fn leave_out_far_repeats(set: &mut SpectrumSet) -> Vec<String> {
    let mut off = Vec::new();
    for own in set.repeats().into_iter().filter(|own| own.len() > 2) {
        let values = |k: usize| own.iter().map(|&s| set.spectra[s].reflectance[k]).collect();
        let middle: Vec<f64> = (0..set.wavelengths_nm.len()).map(|k| median(values(k))).collect();
        for &s in &own {
            let squares = set.spectra[s]
                .reflectance
                .iter()
                .zip(&middle)
                .map(|(v, m)| (v - m).powi(2));
            off.push((s, (squares.sum::<f64>() / middle.len() as f64).sqrt()));
        }
    }
    let limit = (FAR * NORMAL * median(off.iter().map(|(_, rms)| *rms).collect())).max(FAR_LEAST);
    let mut far: Vec<(usize, f64)> = off.into_iter().filter(|(_, rms)| *rms > limit).collect();
    far.sort_by_key(|(s, _)| std::cmp::Reverse(*s));
    let told = |(s, rms): (usize, f64)| {
        let name = set.spectra.remove(s).name;
        format!(
            "{name} is left out: it differs from its repeats by {rms:.3} (rms), and most differ by less than {limit:.3}"
        )
    };
    let mut out: Vec<String> = far.into_iter().map(told).collect();
    out.reverse();
    out
}
