//! Sets with known effects, and sets without effect, from files to the answer.

use std::path::Path;

use metalith_core::Silent;
use metalith_metrology::{Diagnosis, FoundEffect, SetKind, SetVerdict, calibrate, kind_of};
use npyz::WriterBuilder;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIDE: usize = 48;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

fn write_map(path: &Path, values: &[f64]) {
    let file = std::fs::File::create(path).unwrap();
    let options = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&[SIDE as u64, SIDE as u64]);
    let mut writer = options.writer(file).begin_nd().unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
}

/// A map under a Gaussian of a standard deviation in samples, by a direct sum; its outermost samples go on.
fn blurred(map: &[f64], sigma: f64) -> Vec<f64> {
    if sigma == 0.0 {
        return map.to_vec();
    }
    let reach = (5.0 * sigma).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let inside = |k: isize| k.clamp(0, SIDE as isize - 1) as usize;
    let pass = |from: &[f64], at: &dyn Fn(usize, usize) -> usize| -> Vec<f64> {
        let mut out = vec![0.0; SIDE * SIDE];
        for line in 0..SIDE {
            for k in 0..SIDE {
                let near = (-reach..=reach).zip(&weights);
                out[at(line, k)] = near
                    .map(|(d, w)| w * from[at(line, inside(k as isize + d))])
                    .sum::<f64>()
                    / sum;
            }
        }
        out
    };
    let rows = pass(map, &|line, k| line * SIDE + k);
    pass(&rows, &|line, k| k * SIDE + line)
}

/// What was done to the drawn maps.
#[derive(Clone, Copy, Default)]
struct Truth {
    gain: f64,
    level: f64,
    blur: f64,
    by_plate: f64,
    /// Height of a saddle (nm at 2 um along both axes), times the number of the plate from the middle.
    saddle: f64,
}

fn heights(truth: Truth, seed: u64) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    heights_in(folder.path(), truth, None, seed).unwrap()
}

fn heights_in(folder: &Path, truth: Truth, declare: Option<&Path>, seed: u64) -> metalith_core::Result<Diagnosis> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for plate in 0..5 {
        for field in 0..4 {
            let coarse: Vec<f64> = (0..SIDE * SIDE / 16)
                .map(|_| f64::from(rng.random_range(1..12)))
                .collect();
            let drawn: Vec<f64> = (0..SIDE * SIDE)
                .map(|k| coarse[k / SIDE / 4 * (SIDE / 4) + k % SIDE / 4])
                .collect();
            let nm: Vec<f64> = drawn.iter().map(|v| 100.0 * v).collect();
            let level = truth.level + truth.by_plate * f64::from(plate - 2);
            let printed = blurred(&nm, truth.blur);
            let measured: Vec<f64> = printed
                .iter()
                .enumerate()
                .map(|(k, v)| {
                    let um = |k: usize| 0.1 * (k as f64 - 0.5 * (SIDE - 1) as f64);
                    let saddle = truth.saddle * f64::from(plate - 2) * um(k % SIDE) * um(k / SIDE) / 4.0;
                    truth.gain * v + level + saddle + 5.0 * normal(&mut rng)
                })
                .collect();
            write_map(&folder.join(format!("drawn{plate}{field}.npy")), &drawn);
            write_map(&folder.join(format!("measured{plate}{field}.npy")), &measured);
        }
    }
    let text = r#"
schema = 1
kind = "heights"
title = "synthetic"
[grid]
sample_um = 0.1
rim = 4
[drawn]
files = "drawn{plate}{field}.npy"
nm_per_level = 100.0
[measured]
files = "measured{plate}{field}.npy"
nm_per_level = 1.0
[groups]
by = "plate"
not_fitted = ["4"]
"#;
    std::fs::write(folder.join("measurement.toml"), text).unwrap();
    let out = folder.join("out");
    assert_eq!(kind_of(folder), Some(SetKind::Heights));
    let answer = calibrate(folder, SetKind::Heights, &out, (&[], declare), &Silent)?;
    Ok(answer.diagnosis)
}

fn names(answer: &Diagnosis) -> Vec<&str> {
    answer.effects.iter().map(|e| e.name.as_str()).collect()
}

fn holds(effect: &FoundEffect, value: f64) -> bool {
    let [low, high]: [f64; 2] = serde_json::from_value(effect.interval.clone()).unwrap();
    (low..=high).contains(&value)
}

#[test]
fn maps_as_drawn_have_no_effect() {
    let as_drawn = Truth {
        gain: 1.0,
        ..Truth::default()
    };
    for seed in 0..3 {
        let answer = heights(as_drawn, seed);
        assert!(answer.effects.is_empty(), "{seed}: {:?}", names(&answer));
    }
}

#[test]
fn known_effects_of_maps_lie_in_their_intervals() {
    let truth = Truth {
        gain: 0.7,
        level: 150.0,
        blur: 1.6,
        by_plate: 30.0,
        saddle: 0.0,
    };
    let answer = heights(truth, 7);
    let mut found = names(&answer);
    found.sort_unstable();
    assert_eq!(found, ["blur", "gain", "level", "level_by_plate"]);
    let effect = |name: &str| answer.effects.iter().find(|e| e.name == name).unwrap();
    assert!(holds(effect("gain"), truth.gain), "{:?}", effect("gain"));
    assert!(holds(effect("blur"), 0.1 * truth.blur), "{:?}", effect("blur"));
    assert_eq!(effect("level_by_plate").of, "plate");
    // Noise of 5 nm.
    assert!((answer.error.after.fit - 5.0).abs() < 0.1, "{:?}", answer.error);
}

/// Spectra of a plain glass plate under a film of known index: the thickness is 8 nm more than stated.
fn spectra(thicker_nm: f64, gain: f64, seed: u64) -> Diagnosis {
    let folder = tempfile::tempdir().unwrap();
    spectra_in(folder.path(), (thicker_nm, gain, 0.0), None, seed)
}

/// As [`spectra`] with a ripple over the wavelength that no effect of the list has, and effects of a file.
fn spectra_in(
    folder: &Path,
    (thicker_nm, gain, ripple): (f64, f64, f64),
    declare: Option<&Path>,
    seed: u64,
) -> Diagnosis {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let film = |nm: f64, height: f64, medium: f64| {
        // Airy sum of two films at normal incidence, by amplitude ratios.
        use num_complex::Complex64;
        let [n0, n1, n2, n3] = [1.0, 2.2, medium, 1.5_f64];
        let r = |a: f64, b: f64| Complex64::from((a - b) / (a + b));
        let pass = |n: f64, d: f64| (Complex64::i() * 2.0 * std::f64::consts::TAU * n * d / nm).exp();
        let join = |r1: Complex64, r2: Complex64| (r1 + r2) / (1.0 + r1 * r2);
        let inner = join(r(n1, n2), r(n2, n3) * pass(n2, height));
        join(r(n0, n1), inner * pass(n1, 300.0 + thicker_nm)).norm_sqr()
    };
    std::fs::create_dir_all(folder.join("water")).unwrap();
    std::fs::write(folder.join("mirror.csv"), "300,90\n900,90\n").unwrap();
    for (medium, height) in [0, 40, 60, 80, 100]
        .map(|h| (1.0, h))
        .into_iter()
        .chain([(1.333, 40), (1.333, 90)])
    {
        let water = if medium == 1.0 { "" } else { "water/" };
        for repeat in 0..3 {
            let row = |k: usize| {
                let nm = 380.0 + 2.0 * k as f64;
                let wave = ripple * (2.0 * std::f64::consts::PI * (nm - 400.0) / 400.0).cos();
                let value = gain * film(nm, f64::from(height), medium) + wave + 0.004 * normal(&mut rng);
                format!("{nm},{}\n", 100.0 * value / 0.9)
            };
            let rows: String = (0..220).map(row).collect();
            std::fs::write(
                folder.join(format!("{water}{height}_{repeat}.csv")),
                format!("head\n{rows}"),
            )
            .unwrap();
        }
    }
    let text = r#"
schema = 1
kind = "spectra"
title = "synthetic"
[range]
from_nm = 400.0
to_nm = 800.0
step_nm = 2.0
[stack]
substrate = "1.5"
[[layer]]
name = "film"
material = "2.2"
thickness_nm = 300.0
[[layer]]
name = "channel"
object = "yes"
[reference]
file = "mirror.csv"
[[captures]]
files = "{height_nm}_{repeat}.csv"
header_lines = 1
medium_name = "air"
medium = "1.0"
not_fitted = ["60"]
[[captures]]
files = "water/{height_nm}_{repeat}.csv"
header_lines = 1
medium_name = "water"
medium = "1.333"
fitted = "no"
"#;
    std::fs::write(folder.join("measurement.toml"), text).unwrap();
    let out = folder.join("out");
    let only = ["film_thickness".to_owned(), "reference_gain".into(), "added_2".into()];
    let only = match (ripple == 0.0, declare) {
        (true, _) => &[],
        (false, None) => &only[..2],
        (false, Some(_)) => &only[..],
    };
    calibrate(folder, SetKind::Spectra, &out, (only, declare), &Silent)
        .unwrap()
        .diagnosis
}

#[test]
fn spectra_as_stated_have_no_effect_and_known_ones_are_found() {
    let answer = spectra(0.0, 1.0, 1);
    assert!(answer.effects.is_empty(), "{:?}", names(&answer));
    assert_eq!(answer.verdict, SetVerdict::NoResidual);
    // Of eight 95 % intervals, one may miss.
    let mut held = 0;
    for seed in 2..6 {
        let answer = spectra(8.0, 1.05, seed);
        let mut found = names(&answer);
        found.sort_unstable();
        assert_eq!(found, ["film_thickness", "reference_gain"], "{seed}");
        let effect = |name: &str| answer.effects.iter().find(|e| e.name == name).unwrap();
        held += usize::from(holds(effect("film_thickness"), 8.0));
        held += usize::from(holds(effect("reference_gain"), 0.05));
        assert_eq!(answer.verdict, SetVerdict::Explained);
        assert!(
            answer.validation.contains(&"never fitted, medium: water".to_owned()),
            "{:?}",
            answer.validation
        );
        // Noise of 0.004 in a mean of three.
        let (_, rms) = &answer.ladder.last().unwrap().not_fitted_figures[0];
        assert!(*rms < 0.003, "{rms}");
    }
    assert!(held >= 7, "{held}");
}

#[test]
fn mistakes_of_a_set_are_found_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let text = "schema = 1\nkind = \"heights\"\ntitle = \"x\"\n[grid]\nsample_um = -1.0\n[drawn]\nfiles = \"a{\"\nnm_per_level = 1.0\n[measured]\nfiles = \"b{plate}.tif\"\nnm_per_level = 1.0\n[groups]\nby = \"plate\"\nnot_fited = []\n";
    std::fs::write(folder.path().join("measurement.toml"), text).unwrap();
    let error = calibrate(folder.path(), SetKind::Heights, folder.path(), (&[], None), &Silent).unwrap_err();
    let ids = error.ids();
    for wanted in [
        "grid.sample_um/out-of-range",
        "drawn.files/",
        "groups.not_fited/unknown",
    ] {
        assert!(ids.iter().any(|id| id.starts_with(wanted)), "{wanted}: {ids:?}");
    }
}

/// What no effect of the list explains is proposed; once declared, it is found, with an interval that holds.
#[test]
fn a_ripple_over_the_wavelength_is_proposed_and_can_be_declared() {
    let folder = tempfile::tempdir().unwrap();
    let truth = (8.0, 1.05, 0.02);
    let answer = spectra_in(folder.path(), truth, None, 3);
    let first = answer.proposals.first().unwrap();
    assert_eq!(
        (first.name.as_str(), first.over.as_str()),
        ("added_2", "the wavelength"),
        "{:?}",
        answer.proposals
    );
    assert!((first.size[0] - 0.02).abs() < 0.004, "{first:?}");
    let proposal = folder.path().join("proposal.toml");
    let text = std::fs::read_to_string(folder.path().join("out/proposal.toml")).unwrap();
    // The first of the patterns alone.
    let end = text[1..].find("[[effect]]").map_or(text.len(), |at| at + 1);
    std::fs::write(&proposal, &text[..end]).unwrap();
    let answer = spectra_in(folder.path(), truth, Some(&proposal), 3);
    let found = answer.effects.iter().find(|e| e.name == "added_2").unwrap();
    assert!(holds(found, 0.02), "{found:?}");
    assert_eq!(answer.verdict, SetVerdict::Explained);
}

#[test]
fn mistakes_of_declared_effects_have_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("effects.toml");
    let text = "[[effect]]\nname = \"tip\"\nstage = \"measured\"\nheight_nm = \"a * q\"\nrange = [-9.0, 9.0]\nprior = 1.0\n\
        [[effect]]\nname = \"jump\"\nstage = \"drawn\"\nheight_nm = \"5 + a * x\"\nrange = [-9.0, 9.0]\nprior = 1.0\n";
    std::fs::write(&file, text).unwrap();
    let as_drawn = Truth {
        gain: 1.0,
        ..Truth::default()
    };
    let error = heights_in(folder.path(), as_drawn, Some(&file), 1)
        .unwrap_err()
        .to_string();
    for place in [":4:18", ":10:"] {
        assert!(error.contains(place), "{place} is not in:\n{error}");
    }
}

/// A saddle that a scanner bends into every measured map, with a size of its own in each plate.
#[test]
fn a_declared_effect_of_maps_has_a_value_for_each_group() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("effects.toml");
    let effect = "[[effect]]\nname = \"saddle\"\nunit = \"nm\"\nstage = \"measured\"\nheight_nm = \"a * x * y / 4\"\n\
        range = [-200.0, 200.0]\nprior = 10.0\n";
    std::fs::write(&file, format!("{effect}by = \"group\"\n")).unwrap();
    let truth = Truth {
        gain: 0.7,
        saddle: 8.0,
        ..Truth::default()
    };
    let answer = heights_in(folder.path(), truth, Some(&file), 4).unwrap();
    let found = answer.effects.iter().find(|e| e.name == "saddle").unwrap();
    assert_eq!(found.of, "plate");
    let sizes: Vec<f64> = serde_json::from_value(found.value.clone()).unwrap();
    for (plate, size) in sizes.iter().enumerate() {
        assert!((size - 8.0 * (plate as f64 - 2.0)).abs() < 1.0, "{sizes:?}");
    }
}
