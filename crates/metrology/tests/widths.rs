//! Tables of widths that were simulated with known effects, and without any, from files to the answer.

use std::fmt::Write as _;
use std::path::Path;

use metalith_core::Silent;
use metalith_design::array::PillarArray;
use metalith_design::{Design, Hierarchy};
use metalith_layout::write_pillars;
use metalith_metrology::{Diagnosis, FoundEffect, SetKind, SetVerdict, WidthSet, calibrate, kind_of};
use metalith_optics::{CalibratedModel, fill};
use metalith_pillars::PillarShape;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard deviations of a single measurement, and of a place from what drew it (nm).
const REPEAT_NM: f64 = 1.5;
const PLACE_NM: f64 = 0.4;

const DOSES: [f64; 5] = [90.0, 95.0, 100.0, 105.0, 110.0];
const DRAWN_NM: [f64; 4] = [120.0, 160.0, 200.0, 260.0];
const FIELD_UM: f64 = 500.0;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// Pads in rows of six.
const PADS: usize = 36;

/// Middle, edge and fill of a pad (um).
type Pad = ([f64; 2], f64, f64);

fn pads() -> Vec<Pad> {
    // Sizes and fills in an order that follows no direction; places all over the write fields.
    let mut rng = ChaCha8Rng::seed_from_u64(56);
    let sizes = [20.0, 60.0, 150.0];
    let fills = [0.15, 0.3, 0.45, 0.6];
    (0..PADS)
        .map(|k| {
            let at = [k % 6, k / 6].map(|n| (231.0 * n as f64 + 76.0 * (rng.random::<f64>() - 0.5)).round());
            (
                at.map(|um| um - 600.0),
                sizes[k * 7 % 3],
                fills[(k * 5 + k / 6 * 3) % 4],
            )
        })
        .collect()
}

/// Integral of exp(-t^2) by Simpson's rule, over the root of pi.
fn half_error(to: f64) -> f64 {
    let n = 400;
    let h = to / f64::from(n);
    let at = |k: i32| {
        (-(f64::from(k) * h).powi(2)).exp()
            * if k == 0 || k == n {
                1.0
            } else {
                f64::from(2 + 2 * (k % 2))
            }
    };
    (0..=n).map(at).sum::<f64>() * h / 3.0 / std::f64::consts::PI.sqrt()
}

fn fill_at(pads: &[Pad], place: [f64; 2], range: f64) -> f64 {
    let along = |at: f64, edge: f64| half_error((at + 0.5 * edge) / range) - half_error((at - 0.5 * edge) / range);
    let of = |(at, edge, fill): &Pad| fill * along(at[0] - place[0], *edge) * along(at[1] - place[1], *edge);
    pads.iter().map(of).sum()
}

/// Effects with values, by name; of two values, the second is the range or the slope along y.
type Truth = [(&'static str, [f64; 2])];

fn added_nm(truth: &Truth, pads: &[Pad], pad: usize, drawn: f64, dose: f64, along: f64) -> f64 {
    let (place, _, fill) = pads[pad];
    let spans = [0, 1].map(|axis| {
        let along = pads.iter().map(|p| p.0[axis]);
        along.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)))
    });
    let half = spans.map(|(a, b)| 0.5 * (b - a)).into_iter().fold(0.0, f64::max);
    let chip = [0, 1].map(|k| (place[k] - 0.5 * (spans[k].0 + spans[k].1)) / half);
    let field = place.map(|v| 2.0 * (v / FIELD_UM).rem_euclid(1.0) - 1.0);
    let term = |(name, [a, b]): &(&str, [f64; 2])| match *name {
        "bias" => *a,
        "dose_slope" => a * (dose - 100.0),
        "proximity" => a * fill_at(pads, place, *b),
        "loading" => a * fill,
        "width_slope" => a * (drawn - 185.0) / 100.0,
        "orientation" => 0.5 * a * along,
        "chip_slope" => a * chip[0] + b * chip[1],
        "chip_radial" => a * (chip[0].powi(2) + chip[1].powi(2)),
        "field_slope" => a * field[0] + b * field[1],
        "field_border" => a * (-0.5 * FIELD_UM * (1.0 - field[0].abs().max(field[1].abs())) / b).exp(),
        other => panic!("{other}"),
    };
    truth.iter().map(term).sum()
}

fn write_set(folder: &Path, truth: &Truth, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let pads = pads();
    let mut regions = "name,x_um,y_um,width_um,height_um,fill\n".to_owned();
    for (k, ([x, y], edge, fill)) in pads.iter().enumerate() {
        writeln!(regions, "P{k},{x},{y},{edge},{edge},{fill}").unwrap();
    }
    let mut table = "pad,drawn_nm,dose,measured_x_nm,measured_y_nm,repeat\n".to_owned();
    for pad in 0..pads.len() {
        for (k, drawn) in DRAWN_NM.into_iter().enumerate() {
            // Each pad has two doses, another two for each width.
            for dose in [DOSES[(pad + k) % 5], DOSES[(pad + k + 2) % 5]] {
                let own = [1.0, -1.0]
                    .map(|along| drawn + added_nm(truth, &pads, pad, drawn, dose, along) + PLACE_NM * normal(&mut rng));
                for repeat in 1..=3 {
                    let [x, y] = own.map(|nm| nm + REPEAT_NM * normal(&mut rng));
                    writeln!(table, "P{pad},{drawn},{dose},{x:.2},{y:.2},{repeat}").unwrap();
                }
            }
        }
    }
    std::fs::write(folder.join("regions.csv"), regions).unwrap();
    std::fs::write(folder.join("widths.csv"), table).unwrap();
    let text = "schema = 1\nkind = \"widths\"\ntitle = \"synthetic\"\n[table]\nfile = \"widths.csv\"\n[dose]\nnominal = 100.0\n\
                [fill]\nregions = \"regions.csv\"\n[field]\nsize_um = 500.0\n";
    std::fs::write(folder.join("measurement.toml"), text).unwrap();
}

fn answer(truth: &Truth, seed: u64) -> (Diagnosis, Option<CalibratedModel>) {
    let folder = tempfile::tempdir().unwrap();
    write_set(folder.path(), truth, seed);
    assert_eq!(kind_of(folder.path()), Some(SetKind::Widths));
    let out = folder.path().join("out");
    let done = calibrate(folder.path(), SetKind::Widths, &out, (&[], None), &Silent).unwrap();
    let model = done.model.map(|path| CalibratedModel::read(&path).unwrap());
    (done.diagnosis, model)
}

fn names(answer: &Diagnosis) -> Vec<&str> {
    answer.effects.iter().map(|e| e.name.as_str()).collect()
}

/// Values of an effect with their intervals.
fn values(effect: &FoundEffect) -> Vec<(f64, [f64; 2])> {
    let list = |v: &serde_json::Value| v.as_array().cloned().unwrap_or_else(|| vec![v.clone()]);
    let intervals = if effect.parameters.len() == 1 {
        vec![effect.interval.clone()]
    } else {
        list(&effect.interval)
    };
    let ends = intervals.into_iter().map(|v| serde_json::from_value(v).unwrap());
    list(&effect.value)
        .iter()
        .map(|v| v.as_f64().unwrap())
        .zip(ends)
        .collect()
}

/// The fill around pillars of a layout is the one that a chip as fabricated is simulated with.
#[test]
fn the_fill_of_a_layout_is_that_of_simulations() {
    let small = [
        ("diameter_um = 60", "diameter_um = 20"),
        ("focal_length_um = 144", "focal_length_um = 48"),
    ];
    let text = metalith_testing::changed("mini_3x3", &small);
    let design = Design::parse(&metalith_testing::design("mini_3x3"), &text).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let layout = folder.path().join("layout.gds");
    write_pillars(&design, &array, Hierarchy::Folded, &layout, &Silent).unwrap();
    let centre = array.placed.iter().find(|p| p.element.index == (0, 0)).unwrap();
    let map = array.classes[centre.class].widths.map();
    let lattice = map.lattice;
    let shown = map.number.indexed_iter().filter(|(_, w)| **w > 0).step_by(97).take(20);
    let (mut table, mut sites) = ("x_um,y_um,drawn_nm,measured_nm\n".to_owned(), Vec::new());
    for ((iy, ix), w) in shown {
        writeln!(table, "{},{},{w},{w}", lattice.place_um(0, ix), lattice.place_um(1, iy)).unwrap();
        sites.push(iy * lattice.sites() + ix);
    }
    std::fs::write(folder.path().join("widths.csv"), table).unwrap();
    let text = "schema = 1\nkind = \"widths\"\ntitle = \"x\"\n[table]\nfile = \"widths.csv\"\n[fill]\nlayout = \"layout.gds\"\n";
    std::fs::write(folder.path().join("measurement.toml"), text).unwrap();
    let set = WidthSet::read(&folder.path().join("measurement.toml"), &Silent).unwrap();
    for range in [2.0, 8.0] {
        let simulated = fill(&map, PillarShape::Square, range);
        for (site, own) in sites.iter().zip(&set.sites) {
            let (found, want) = (own.fill(range).unwrap(), f64::from(simulated[*site]));
            // Rings are a quarter of a micrometre wide, and a lens in the layout has neighbours.
            assert!((found - want).abs() < 0.02 * want + 1e-3, "{range}: {found} {want}");
        }
    }
}

/// Sets without effect of which one was claimed.
fn claims(seeds: std::ops::Range<u64>) -> usize {
    let claimed = |seed: &u64| {
        let (found, _) = answer(&[], *seed);
        if !found.effects.is_empty() {
            println!("{seed}: {:?}", found.sentence());
        }
        !found.effects.is_empty()
    };
    seeds.filter(claimed).count()
}

/// Effects as they are put into sets, in sizes that a process has.
const EFFECTS: [(&str, [f64; 2]); 10] = [
    ("bias", [-6.0, 0.0]),
    ("dose_slope", [0.5, 0.0]),
    ("proximity", [20.0, 15.0]),
    ("width_slope", [3.0, 0.0]),
    ("orientation", [2.0, 0.0]),
    ("chip_slope", [2.0, -1.0]),
    ("chip_radial", [4.0, 0.0]),
    ("field_slope", [1.5, 1.5]),
    ("loading", [10.0, 0.0]),
    ("field_border", [6.0, 40.0]),
];

/// What is found of sets with two effects each: sets with all named, sets with more than these, intervals that hold, intervals.
fn pairs(count: usize) -> [usize; 4] {
    let mut out = [0; 4];
    for k in 0..count {
        let n = EFFECTS.len();
        let (a, b) = (k % n, (k + 1 + k / n * 2) % n);
        let truth = [EFFECTS[a], EFFECTS[b]];
        let (found, _) = answer(&truth, 1000 + k as u64);
        let named = truth.iter().all(|(name, _)| names(&found).contains(name));
        out[0] += usize::from(named);
        out[1] += usize::from(found.effects.len() > 2);
        for (name, values_put) in truth {
            let Some(effect) = found.effects.iter().find(|e| e.name == name) else {
                continue;
            };
            for ((value, [low, high]), put) in values(effect).into_iter().zip(values_put) {
                let holds = (low..=high).contains(&put);
                out[2] += usize::from(holds);
                out[3] += 1;
                if !holds {
                    println!("{k}: {name} {put}: {value} ({low} to {high})");
                }
            }
        }
        if !named || found.effects.len() > 2 {
            println!("{k} {:?}: {}", truth.map(|t| t.0), found.sentence());
            println!("{}", found.ladder_lines().join("\n"));
        }
    }
    out
}

#[test]
fn widths_as_drawn_have_no_effect_and_two_known_ones_are_named() {
    assert_eq!(claims(0..4), 0);
    let [named, more, held, all] = pairs(3);
    assert_eq!((named, more), (3, 0));
    // Of some eight 95 % intervals, one may miss.
    assert!(held + 1 >= all, "{held} of {all}");
}

#[test]
fn what_was_found_is_a_model_file_and_what_it_cannot_hold_is_named() {
    let truth = [
        ("bias", [-6.0, 0.0]),
        ("dose_slope", [0.5, 0.0]),
        ("proximity", [20.0, 15.0]),
        ("orientation", [3.0, 0.0]),
    ];
    let (found, model) = answer(&truth, 7);
    assert_eq!(found.verdict, SetVerdict::Explained);
    let model = model.unwrap();
    let geometry = &model.perturbation.geometry;
    let close = |value: f64, put: f64, off: f64| assert!((value - put).abs() < off, "{value} {put}");
    close(geometry.cd_bias_nm, -6.0, 1.0);
    close(geometry.cd_bias_density_nm, 20.0, 3.0);
    close(geometry.cd_bias_density_range_um.unwrap(), 15.0, 4.0);
    let dose = model.dose.unwrap();
    close(dose.nm_per_percent, 0.5, 0.05);
    assert_eq!(dose.measured_percent, [-10.0, 10.0]);
    let lost: Vec<&str> = found.not_in_model.iter().map(|l| l.effect.as_str()).collect();
    assert_eq!(lost, ["orientation"]);
}

#[test]
fn the_example_is_explained_by_what_was_put_in() {
    let set = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/measured/widths.toml");
    let out = tempfile::tempdir().unwrap();
    let done = calibrate(&set, SetKind::Widths, out.path(), (&[], None), &Silent).unwrap();
    println!("{}", done.diagnosis.sentence());
    let mut found = names(&done.diagnosis);
    found.sort_unstable();
    assert_eq!(found, ["bias", "dose_slope", "proximity"]);
    assert_eq!(done.diagnosis.verdict, SetVerdict::Explained);
    let page = std::fs::read_to_string(&done.report).unwrap();
    for figure in [
        "Measured and drawn widths",
        "Residual over dose",
        "Residual over x",
        "Ladder of errors",
    ] {
        assert!(page.contains(figure), "{figure}");
    }
}

#[test]
fn numbers_that_cannot_be_are_named_with_line_and_column_at_once() {
    let folder = tempfile::tempdir().unwrap();
    write_set(folder.path(), &[], 1);
    let table = folder.path().join("widths.csv");
    let text = std::fs::read_to_string(&table).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    lines[3] = "P0,120,95,abc,120.0,1".into();
    lines[8] = "P0,-5,nan,120.0,120.0,1".into();
    lines[9] = "P0,120".into();
    std::fs::write(&table, lines.join("\n")).unwrap();
    let error = calibrate(folder.path(), SetKind::Widths, folder.path(), (&[], None), &Silent).unwrap_err();
    let said = error.to_string();
    assert!(said.contains("widths.csv, line 10"), "{said}");
    lines.remove(9);
    std::fs::write(&table, lines.join("\n")).unwrap();
    let error = calibrate(folder.path(), SetKind::Widths, folder.path(), (&[], None), &Silent).unwrap_err();
    let said = error.to_string();
    for place in [
        "widths.csv, line 4, column `measured_x_nm`: `abc`",
        "line 9, column `drawn_nm`: `-5`",
        "line 9, column `dose`: `nan`",
    ] {
        assert!(said.contains(place), "{place}: {said}");
    }
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn claims_of_sixty_sets_of_widths_and_names_of_twenty() {
    let claimed = claims(0..60);
    let [named, more, held, all] = pairs(20);
    println!("claims {claimed} of 60; named {named} of 20, more {more}; intervals {held} of {all}");
    assert!(claimed <= 3, "{claimed} of 60");
    assert_eq!(named, 20);
    // 95 % of the intervals, and one standard deviation of that count.
    assert!(
        held as f64 >= 0.95 * all as f64 - (0.05 * all as f64).sqrt(),
        "{held} of {all}"
    );
}
