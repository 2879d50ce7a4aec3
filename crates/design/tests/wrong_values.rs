//! What the program says of each number of a design that is ten times too large or too small.

use std::collections::BTreeMap;
use std::fmt::Write;

use metalith_core::document::{Scalar, with_values};
use metalith_core::{Error, Warning};
use metalith_design::Design;
use metalith_testing::{changed, design, golden, rows};
use toml::Value;

mod legitimate;

use legitimate::LEGITIMATE;

/// Designs whose numbers are changed, those without a warning first, each with the changes that give it more keys. A key is changed
/// in the first that has it.
const DESIGNS: [(&str, &[(&str, &str)]); 13] = [
    (
        "asi_940",
        &[
            ("[cell]\n", "[cell]\nband_nm = [900, 1000]\n"),
            (
                "\n[mapping.cell]",
                "band_nm = [920, 960]\ncompared_nm = [940]\n\n[mapping.cell]",
            ),
            ("[layout]\n", "[layout]\ncircle_chord_error_nm = 0.5\n"),
            (
                "[verify.limits]",
                "[verify.limits]\nmapping_phase_rms_max_rad = 0.3\nstrehl_ratio_min = 0.5\nstrehl_min = 0.5\n\
                 centroid_shift_max_um = 1.0\nmtf_difference_max = 0.05\npsf_difference_max = 0.5\npolychromatic_mtf_min = 0.05\npolychromatic_mtf_lp_mm = 40\n\
                 polychromatic_energy_2_pixels_min = 0.05\nrounding_phase_rms_max_rad = 0.05",
            ),
        ],
    ),
    ("geometric_phase_532", &[]),
    ("birefringent_532", &[]),
    ("mini_3x3", &[]),
    ("wide_5x5", &[]),
    ("neural_nano_optics", &[]),
    ("hologram", &[]),
    ("mixed_lenses", &[]),
    (
        "asi_940",
        &[
            (
                "[cell]\n",
                "[cell]\nresidual_nm = 10\nspacer_nm = 50\nspacer_material = \"alumina_zhukovsky_2015\"\nambient_index = 1.1\n",
            ),
            ("wavelength_nm = 940\n", "wavelength_nm = 940\nfocal_length_um = 150\n"),
            (
                "\n[mapping.cell] ",
                "\n[mapping.cell]\nresidual_nm = 10\nspacer_nm = 50\nspacer_material = \"alumina_zhukovsky_2015\"\nambient_index = 1.1\n#",
            ),
        ],
    ),
    (
        "array_2x4",
        &[(
            "[array]\n",
            "[[phase.term]]\nsource = \"zernike\"\norder = \"fringe\"\ncoefficients_waves = [0, 0, 0, 0.5]\nscale = 0.5\n\
             normalisation_radius_um = 30\n\n[array]\n",
        )],
    ),
    (
        "mixed_lenses",
        &[
            (
                "aperture = \"rectangle\"\naperture_um = [56, 56]",
                "aperture = \"polygon\"\ncorners_x_um = [-28, 28, 0]\ncorners_y_um = [-28, -28, 28]",
            ),
            ("\nsteering_x_deg = ", "\nsteering_y_deg = 5\nsteering_x_deg = "),
            ("layer = 1, datatype = 0", "layer = 1, datatype = 1"),
            ("layer = 3, datatype = 0", "layer = 3, datatype = 1"),
            ("layer = 2, datatype = 0", "layer = 2, datatype = 1"),
            ("layer = 4, datatype = 0", "layer = 4, datatype = 1"),
            ("layer = 10, datatype = 0", "layer = 10, datatype = 1"),
            ("layer = 11, datatype = 0", "layer = 11, datatype = 1"),
        ],
    ),
    (
        "mini_3x3",
        &[
            (
                "\n[verify]\n",
                "\n[optimise]\nband_nm = [450, 650]\nstep_nm = 2\nstep_limit_waves = 0.2\nseed = 1\nchains = 4\nhot_sweeps = 60\n\
                 temperature = [3e-3, 1e-4]\nblocks = 60\nmemory_mb = 1024\n\n[optimise.merit]\nsum = 0.5\nlog = 1.0\n\
                 side_lobes = 0.1\nside_lobe_radius_um = 10\n\n[optimise.robust]\nwidth_bias_nm = 6\nheight_percent = 2\n\
                 defocus_um = 10\ndraws = 16\n\n[verify]\n",
            ),
            ("field_y_deg = [0, 0]", "field_y_deg = [5, 5]"),
            ("wrong_widths_max = 0", "wrong_widths_max = 10"),
            ("foreign_shapes_max = 0", "foreign_shapes_max = 10"),
        ],
    ),
    (
        "mini_3x3",
        &[(
            "\n[verify]\n",
            "\n[optimise]\nsolver = \"adam\"\nsteps = 400\nrate_waves = 0.01\n\n[optimise.merit]\ndeconvolution = 1.0\n\n\
             [optimise.views]\nangles_deg = [0, 15]\nstep_nm = 10\npixels = 160\npixel_um = 5.86\nshared_filter = 0.5\ndrawn = 3\n\n\
             [verify]\n",
        )],
    ),
];

/// Keys that say nothing of one element without steering.
const OF_AN_ARRAY: [&str; 2] = ["array.spacing_um", "array.wedge_wavelength_nm"];

#[test]
fn golden_each_wrong_value_is_said_or_legitimate() {
    let mut table = String::from(
        "# Each number of a design, ten times too large and ten times too small: what the program says before it writes a file.\n\
         # key, factor: refusal, warning, limit of the verdict, or the reason why it is legitimate.\n# Made by crates/design/tests/wrong_values.rs.\n",
    );
    let mut seen = BTreeMap::new();
    let mut silent = Vec::new();
    // The reason for each wrong value that is not used yet.
    let mut reasons: BTreeMap<String, String> = BTreeMap::new();
    for [why, values] in rows(LEGITIMATE) {
        for value in values.split(", ") {
            let earlier = reasons.insert(value.into(), why.clone());
            assert_eq!(earlier, None, "a reason for {value} stands twice");
        }
    }
    for (name, more) in DESIGNS {
        let path = design(name);
        let text = changed(name, more);
        let base = Design::parse(&path, &text).unwrap().warnings().unwrap();
        let mut keys = Vec::new();
        numbers("", &toml::from_str(&text).unwrap(), &mut keys);
        for (key, values) in keys {
            let shown = words(&key);
            if seen.contains_key(&shown) {
                continue;
            }
            if OF_AN_ARRAY.contains(&shown.as_str()) && name != "mini_3x3" {
                continue;
            }
            seen.insert(shown.clone(), name);
            for (factor, sign) in [(10.0, "x 10"), (0.1, "/ 10")] {
                let wrong: Vec<(String, Scalar)> = values
                    .iter()
                    .map(|(key, value)| (key.clone(), times(value, factor)))
                    .collect();
                let changes: Vec<(&str, &Scalar)> = wrong.iter().map(|(key, value)| (key.as_str(), value)).collect();
                let changed = with_values(&text, &changes).unwrap();
                let said = said(
                    &base,
                    Design::parse(&path, &changed).and_then(|design| design.warnings()),
                );
                let said = match (said, reasons.remove(&format!("{shown} {sign}"))) {
                    (Some(said), None) => said,
                    (None, Some(why)) => why,
                    (Some(said), Some(_)) => {
                        silent.push(format!("{shown} {sign} is said: {said}"));
                        said
                    }
                    (None, None) => {
                        silent.push(format!("{shown} {sign} of {name} is silent"));
                        "SILENT".into()
                    }
                };
                writeln!(table, "{shown} {sign}: {said}").unwrap();
            }
        }
    }
    silent.extend(
        reasons
            .keys()
            .map(|value| format!("a reason for {value} is not needed")),
    );
    assert!(silent.is_empty(), "{}", silent.join("\n"));
    golden("wrong_values.txt", table.as_bytes());
}

/// What the program says of a changed design and not of the one before; none if nothing.
fn said(base: &[Warning], changed: metalith_core::Result<Vec<Warning>>) -> Option<String> {
    match changed {
        Err(Error::Text(faults)) => {
            let mut each: Vec<_> = faults
                .faults()
                .iter()
                .map(|f| format!("{:?} {}", f.kind, words(&f.key)))
                .collect();
            each.dedup();
            Some(format!("refused, {}", each.join(", ")))
        }
        Err(error) => Some(format!("refused, {}", error.id())),
        Ok(warnings) => {
            let new = warnings.iter().filter(|w| !base.contains(w)).map(|w| w.id);
            let new: Vec<_> = new.collect();
            (!new.is_empty()).then(|| format!("warning, {}", new.join(", ")))
        }
    }
}

/// Numbers of a table by their keys, lists as one.
fn numbers(above: &str, value: &Value, found: &mut Vec<(String, Vec<(String, Scalar)>)>) {
    let path = |key: &str| {
        if above.is_empty() {
            key.to_owned()
        } else {
            format!("{above}.{key}")
        }
    };
    let scalar = |value: &Value| match value {
        Value::Integer(v) => Some(Scalar::Whole(*v)),
        Value::Float(v) => Some(Scalar::Number(*v)),
        _ => None,
    };
    match value {
        Value::Table(table) => table.iter().for_each(|(key, value)| numbers(&path(key), value, found)),
        Value::Array(items) => {
            let own: Vec<_> = items
                .iter()
                .zip(0..)
                .filter_map(|(v, k)| Some((path(&format!("{k}")), scalar(v)?)))
                .collect();
            // Ten times zero is zero.
            if own.iter().any(|(_, v)| v.number() != Some(0.0)) {
                found.push((above.to_owned(), own));
            }
            for (item, k) in items.iter().zip(0..).filter(|(item, _)| item.is_table()) {
                numbers(&path(&format!("{k}")), item, found);
            }
        }
        value => {
            if let Some(value) = scalar(value).filter(|v| v.number() != Some(0.0)) {
                found.push((above.to_owned(), vec![(above.to_owned(), value)]));
            }
        }
    }
}

/// A value times a factor: whole numbers stay whole.
fn times(value: &Scalar, factor: f64) -> Scalar {
    match value {
        Scalar::Whole(v) => Scalar::Whole((*v as f64 * factor).round() as i64),
        other => Scalar::Number(other.number().unwrap() * factor),
    }
}

/// A key without the numbers of sections and entries.
fn words(key: &str) -> String {
    let parts = key.split('.').map(|part| part.split('#').next().unwrap());
    parts
        .filter(|part| part.parse::<u32>().is_err())
        .collect::<Vec<_>>()
        .join(".")
}
