//! Hand-offs of layouts that another program drew, and files for writers of other makers.

use std::fs;
use std::path::{Path, PathBuf};

use gds21::{GdsBoundary, GdsElement, GdsLibrary, GdsPoint, GdsStruct, GdsStructRef, GdsTextElem};
use metalith_core::{LayerNumber, Silent};
use metalith_gds::{Layout, Selection};
use metalith_handoff::{
    Handoff, HandoffOptions, HandoffSource, LayoutSource, LayoutStatistics, handoff, verify_handoff,
};
use metalith_report::Verdict;

use crate::{DESIGN, PROCESS, SUMMED, Squares, options, rows_in, source};

/// Layer of the pillars, a layer with one more shape, and a layer of labels.
const PILLARS: (i16, i16) = (10, 0);
const BESIDE: (i16, i16) = (20, 0);
const LABELS: (i16, i16) = (63, 0);

/// Pitch, radius and places of the lenses (nm).
const PITCH: i32 = 350;
const RADIUS: i32 = 6_000;
const LENSES: [(i32, i32); 2] = [(500_000, 300_000), (540_000, 300_000)];

fn boundary((layer, datatype): (i16, i16), corners: &[(i32, i32)]) -> GdsElement {
    let closed = corners.iter().chain(corners.first());
    let boundary = GdsBoundary {
        layer,
        datatype,
        xy: closed.map(|&(x, y)| GdsPoint::new(x, y)).collect(),
        ..Default::default()
    };
    boundary.into()
}

fn square(layer: (i16, i16), (x, y): (i32, i32), width: i32) -> GdsElement {
    let h = width / 2;
    boundary(layer, &[(x - h, y - h), (x + h, y - h), (x + h, y + h), (x - h, y + h)])
}

/// Pillars of a lens about the origin.
fn lens() -> GdsStruct {
    let mut cell = GdsStruct::new("LENS");
    let n = RADIUS / PITCH;
    for (i, j) in (-n..=n).flat_map(|j| (-n..=n).map(move |i| (i, j))) {
        let (x, y) = (i * PITCH, j * PITCH);
        if x * x + y * y <= RADIUS * RADIUS {
            let width = 100 + 2 * ((x * x + y * y) / 400_000 % 90);
            cell.elems.push(square(PILLARS, (x, y), width));
        }
    }
    cell
}

/// Write a layout with these cells.
fn drawn(folder: &Path, name: &str, cells: Vec<GdsStruct>) -> PathBuf {
    let mut library = GdsLibrary::new("FOREIGN");
    library.structs = cells;
    let mut bytes = Vec::new();
    library.write(&mut bytes).unwrap();
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// Two lenses as references, far from the origin, a mark and a label on separate layers.
fn two_lenses(folder: &Path) -> PathBuf {
    let mut top = GdsStruct::new("TOP");
    for (x, y) in LENSES {
        let reference = GdsStructRef {
            name: "LENS".into(),
            xy: GdsPoint::new(x, y),
            ..Default::default()
        };
        top.elems.push(reference.into());
    }
    top.elems.push(square(BESIDE, (600_000, 400_000), 2_000));
    let label = GdsTextElem {
        string: "for you".into(),
        layer: LABELS.0,
        texttype: LABELS.1,
        ..Default::default()
    };
    top.elems.push(label.into());
    drawn(folder, "two.gds", vec![top, lens()])
}

/// Options for a layout.
fn of_layout(path: &Path, layer: Option<(i16, i16)>, out: &Path) -> HandoffOptions {
    HandoffOptions {
        source: HandoffSource::Layout(LayoutSource {
            path: path.to_owned(),
            top: None,
            layer: layer.map(|(l, d)| LayerNumber::new(l as u16, d as u16)),
            exposed: Vec::new(),
        }),
        ..options(out)
    }
}

fn numbers(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join("handoff.json")).unwrap()).unwrap()
}

/// The error id of a hand-off, which leaves nothing.
fn refused(options: &HandoffOptions) -> String {
    let id = handoff(options, &Silent).unwrap_err().ids().join(" ");
    assert!(!options.out.exists());
    id
}

fn words<'a>(made: &'a Handoff, name: &str) -> &'a str {
    let check = made.checks.iter().find(|check| check.name == name);
    &check.unwrap_or_else(|| panic!("{name}: {:?}", made.checks)).words
}

#[test]
fn a_layout_is_handed_over_as_it_is_with_doses_sites_and_times() {
    let folder = tempfile::tempdir().unwrap();
    let path = two_lenses(folder.path());
    let out = folder.path().join("out");
    let made = handoff(&of_layout(&path, Some(PILLARS), &out), &Silent).unwrap();
    assert!(verify_handoff(&out, &Silent).unwrap().holds());
    assert_eq!(fs::read(out.join("layout/two.gds")).unwrap(), fs::read(&path).unwrap());

    let of_lens = lens().elems.len() as u64;
    assert!(words(&made, "pillars").contains("in 2 elements"), "{:?}", made.checks);
    let numbers = numbers(&out);
    assert_eq!(numbers["found"]["pillars"], 2 * of_lens);
    assert_eq!(numbers["found"]["pitch_nm"], 350.0);
    assert_eq!(numbers["exposed"], serde_json::json!(["10/0"]));
    let left_out = numbers["left_out"].as_array().unwrap();
    let page = fs::read_to_string(out.join("index.html")).unwrap();
    for left in left_out {
        assert!(page.contains(left["part"].as_str().unwrap()), "{left}");
    }
    assert!(left_out.len() > 8);
    // Chip, tone and dose first, the list of files last.
    let place = |heading: &str| {
        page.rfind(&format!(">{heading}</h2>"))
            .unwrap_or_else(|| panic!("{heading}"))
    };
    let headings = [
        "Layout",
        "Layers and tone",
        "Dose matrix",
        "Write time",
        "Checks",
        "Left out",
        "Files",
    ];
    assert!(headings.windows(2).all(|pair| place(pair[0]) < place(pair[1])));

    let census = LayoutStatistics::take(&path, &Silent).unwrap();
    let pillars = census.layer(10, 0).unwrap();
    let time = rows_in(&out, "dose/write_time.csv").remove(0);
    let beam_s = 280e-6 * pillars.area_um2 * 1e-8 / 0.5e-9;
    assert!((time["beam_s"].parse::<f64>().unwrap() - beam_s).abs() < 0.06);

    // Each block holds one lens of the layout, moved to it, and pads of its pillars.
    let matrix = LayoutStatistics::take(&out.join("dose/two_dose_matrix.gds"), &Silent).unwrap();
    let first = matrix.layer(20, 1).unwrap();
    assert!(first.shapes > of_lens);
    for dose in 2..=9 {
        let block = matrix.layer(20, dose).unwrap();
        assert_eq!(block.shapes, first.shapes);
        assert!((block.area_um2 - first.area_um2).abs() < SUMMED * first.area_um2);
    }
    assert_eq!(numbers["piece"]["shapes"], of_lens);

    let layout = Layout::open(&out.join("layout/two.gds")).unwrap();
    let mut squares = Squares::default();
    let selection = Selection {
        layers: Some(vec![LayerNumber::new(10, 0)]),
        ..Default::default()
    };
    layout.visit(&selection, &mut squares, &Silent).unwrap();
    let sites = rows_in(&out, "metrology/cd_table.csv");
    assert!(sites.len() >= 8, "{}", sites.len());
    for row in sites {
        let twice = |key: &str| (row[key].parse::<f64>().unwrap() * 2e3).round() as i64;
        let width = squares.found.get(&(twice("x_um"), twice("y_um")));
        assert_eq!(width, Some(&row["drawn_nm"].parse().unwrap()), "{row:?}");
    }
    let deck = fs::read_to_string(out.join("job/two_2nA.jdf")).unwrap();
    assert!(
        deck.contains("layout two sha256") && deck.contains("P(2) 'two_dose_matrix.v30'"),
        "{deck}"
    );
    assert!(deck.contains("(520,300) um"), "{deck}");
}

/// Shapes among the pillars that are none are violations of the layout, as `metalith check` counts them.
#[test]
fn shapes_among_pillars_are_violations() {
    let folder = tempfile::tempdir().unwrap();
    let mut cell = lens();
    let all = cell.elems.len();
    let odd = cell.elems.split_off(all - all / 10);
    for k in 0..odd.len() as i32 {
        let (x, y) = (PITCH * (k % 8 - 4) + PITCH / 2, PITCH * (k / 8) + PITCH / 2);
        cell.elems.push(boundary(PILLARS, &[(x, y), (x + 60, y), (x, y + 50)]));
    }
    let path = drawn(folder.path(), "odd.gds", vec![cell]);
    let made = handoff(&of_layout(&path, Some(PILLARS), &folder.path().join("out")), &Silent).unwrap();
    let verdict = |name: &str| made.checks.iter().find(|check| check.name == name).unwrap();
    assert_eq!(verdict("pillars").verdict, Verdict::Fail);
    let of_rules = verdict("design rules, layout");
    assert_ne!(of_rules.verdict, Verdict::Pass);
    let broken = of_rules.broken.iter().find(|rule| rule.rule == "element.recognised");
    assert_eq!(broken.map(|rule| rule.violations), Some(odd.len() as u64));
}

#[test]
fn shapes_that_are_no_pillars_are_handed_over() {
    let folder = tempfile::tempdir().unwrap();
    let mut cell = GdsStruct::new("TRIANGLES");
    for k in 0..40 {
        let (x, y) = (k * 7_919 % 90_000, k * k * 613 % 80_000);
        cell.elems
            .push(boundary((1, 0), &[(x, y), (x + 3_000, y), (x, y + 2_000)]));
    }
    let path = drawn(folder.path(), "triangles.gds", vec![cell]);
    let out = folder.path().join("out");
    let made = handoff(&of_layout(&path, None, &out), &Silent).unwrap();
    assert!(
        words(&made, "pillars").starts_with("none were found: "),
        "{:?}",
        made.checks
    );
    assert!(words(&made, "pillars").contains("(extract/"), "{:?}", made.checks);
    assert!(!out.join("metrology").exists());
    let numbers = numbers(&out);
    assert!(numbers["piece"]["shapes"].as_u64().unwrap() > 0);
    let parts: Vec<_> = numbers["left_out"]
        .as_array()
        .unwrap()
        .iter()
        .map(|l| l["part"].clone())
        .collect();
    assert!(parts.contains(&"places to measure".into()), "{parts:?}");
}

#[test]
fn layouts_with_nothing_to_expose_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let two = two_lenses(folder.path());
    let empty = drawn(folder.path(), "empty.gds", vec![GdsStruct::new("EMPTY")]);
    let tops = drawn(folder.path(), "tops.gds", vec![lens(), GdsStruct::new("OTHER")]);
    let cut = folder.path().join("cut.gds");
    let bytes = fs::read(&two).unwrap();
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    for (path, layer, id) in [
        (&empty, None, "handoff/nothing-drawn"),
        (&two, Some((5, 0)), "handoff/layer-empty"),
        (&tops, None, "layout"),
        (&cut, None, "layout"),
    ] {
        let found = refused(&of_layout(path, layer, &out));
        assert!(found.starts_with(id), "{}: {found}", path.display());
    }
    let mut without = of_layout(&two, Some(PILLARS), &out);
    without.process = None;
    assert_eq!(refused(&without), "handoff/process-missing");
}

/// A process with words replaced, beside which rules are found.
fn process(folder: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../rules");
    let mut text = fs::read_to_string(PROCESS).unwrap().replace("../rules", root);
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let path = folder.join("process.toml");
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_writer_of_raith_reads_the_dose_from_the_datatype() {
    let folder = tempfile::tempdir().unwrap();
    let path = two_lenses(folder.path());
    let out = folder.path().join("out");
    let mut options = of_layout(&path, Some(PILLARS), &out);
    options.process = Some(process(
        folder.path(),
        &[("[job]", "[job]\nformat = \"raith\"\n[never]")],
    ));
    // Keys of the other format are mistakes.
    assert!(handoff(&options, &Silent).is_err());
    let text = fs::read_to_string(options.process.as_ref().unwrap()).unwrap();
    let job = text.find("[never]").unwrap();
    fs::write(options.process.as_ref().unwrap(), &text[..job]).unwrap();
    let made = handoff(&options, &Silent).unwrap();
    let jobs = made.manifest.files.keys().filter(|name| name.starts_with("job/"));
    assert_eq!(
        jobs.collect::<Vec<_>>(),
        ["job/two_dose_matrix_raith.gds", "job/two_raith.gds"]
    );
    let layout = LayoutStatistics::take(&out.join("job/two_raith.gds"), &Silent).unwrap();
    let plain = LayoutStatistics::take(&path, &Silent).unwrap();
    assert_eq!(
        layout.layer(10, 1000).unwrap().shapes,
        plain.layer(10, 0).unwrap().shapes
    );
    // What is not exposed keeps its datatype.
    assert!(layout.layer(10, 0).is_none() && layout.layer(20, 0).is_some());
    let matrix = LayoutStatistics::take(&out.join("job/two_dose_matrix_raith.gds"), &Silent).unwrap();
    let plain = LayoutStatistics::take(&out.join("dose/two_dose_matrix.gds"), &Silent).unwrap();
    for (dose, datatype) in [(1, 720), (5, 1000), (9, 1250)] {
        let (own, of_plain) = (matrix.layer(20, datatype).unwrap(), plain.layer(20, dose).unwrap());
        assert_eq!((own.shapes, own.area_um2), (of_plain.shapes, of_plain.area_um2));
    }
}

/// Pads narrower than the limit of a shipped deck: a guess fails nothing, a limit that the lab confirmed does.
#[test]
fn an_assumed_limit_is_reported_and_fails_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(DESIGN).unwrap();
    let narrow = text.replace("width_min_nm = 100", "width_min_nm = 90");
    assert_ne!(text, narrow);
    let design = folder.path().join("design.toml");
    fs::write(&design, narrow).unwrap();
    let verdict = |limits: &str| {
        let out = folder.path().join(limits);
        let limits = format!("[checks]\nlimits = \"{limits}\"");
        let options = HandoffOptions {
            source: source(&design),
            process: Some(process(folder.path(), &[("[checks]", limits.as_str())])),
            ..options(&out)
        };
        let made = handoff(&options, &Silent).unwrap();
        let page = fs::read_to_string(out.join("index.html")).unwrap();
        assert!(page.contains("What to change or to confirm"));
        let check = made
            .checks
            .into_iter()
            .find(|c| c.name == "design rules, tests pillars")
            .unwrap();
        let broken = check.broken.into_iter().find(|b| b.rule == "pillar.width.min").unwrap();
        (broken.assumed, broken.cure)
    };
    let (assumed, cure) = verdict("assumed");
    assert!(assumed && cure.starts_with("ask the lab for its limit"), "{cure}");
    assert!(!verdict("confirmed").0);
}
