//! The hand-off as the one who receives it meets it: read from its files, by the readers of the library.

mod foreign;
mod formats;
mod job;
mod publish;
mod shapes;
mod trust;

use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use metalith_cell::Fidelity;
use metalith_core::{Error, Progress, Result, Silent};
use metalith_design::{Design, PillarArray};
use metalith_gds::{LayerNumber, Layout, Selection, Shape, Transform, Visitor};
use metalith_handoff::{
    DesignSource, HandoffOptions, HandoffSource, LayoutStatistics, Manifest, handoff, verify_handoff,
};
use metalith_layout::LayoutFormat;
use metalith_wave::Accuracy;

const DESIGN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/mini_3x3.toml");
/// Layers of the first step in that design.
const PILLARS: LayerNumber = LayerNumber { layer: 1, datatype: 0 };
/// Relative: sums of a few million areas in double precision, whose rounding is 1e-10 at most.
const SUMMED: f64 = 1e-9;
/// Times in tables have one decimal (s).
const TABLE_S: f64 = 0.06;
/// Half the widest pillar of the design (um).
const WIDEST_HALF_UM: f64 = 0.15;
/// Largest difference in length of the bars of a vernier (um), both halves of which keep 100 nm from the border.
const VERNIER_UM: f64 = 1.0;
const PROCESS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../processes/jbx6300_zep520a.toml");

fn options(out: &Path) -> HandoffOptions {
    HandoffOptions {
        source: source(DESIGN.as_ref()),
        process: Some(PROCESS.into()),
        out: out.to_owned(),
        command: "metalith handoff designs/mini_3x3.toml".into(),
        format: LayoutFormat::Gds,
        waivers: None,
    }
}

/// A design, simulated in the quickest way: what is simulated is not the matter here.
fn source(design: &Path) -> HandoffSource {
    HandoffSource::Design(DesignSource {
        path: design.to_owned(),
        fidelity: Some(Fidelity::Published),
        accuracy: Accuracy::Fast,
        compensate: None,
        dose_classes: None,
    })
}

/// One hand-off that tests may read, not change. It stays where tests keep their files and is replaced by the next.
fn shared() -> &'static Path {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    MADE.get_or_init(|| {
        let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mini_handoff");
        let _ = fs::remove_dir_all(&out);
        handoff(&options(&out), &Silent).unwrap();
        out
    })
}

fn copy_of_shared(to: &Path) -> PathBuf {
    let out = to.join("received");
    let manifest: Manifest = serde_json::from_slice(&fs::read(shared().join("manifest.json")).unwrap()).unwrap();
    for name in manifest.files.keys().map(String::as_str).chain(["manifest.json"]) {
        let target = out.join(name);
        fs::create_dir_all(target.parent().unwrap()).unwrap();
        fs::copy(shared().join(name), target).unwrap();
    }
    out
}

fn rows(file: &str) -> Vec<BTreeMap<String, String>> {
    rows_in(shared(), file)
}

/// Rows of a table of a hand-off, by the names of its columns.
fn rows_in(folder: &Path, file: &str) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(folder.join(file)).unwrap();
    let mut lines = text.split("\r\n").filter(|l| !l.is_empty());
    let head: Vec<_> = lines.next().unwrap().split(',').map(str::to_owned).collect();
    lines
        .map(|line| {
            // Cells with commas are quoted; none holds a quote.
            let mut cells = vec![String::new()];
            let mut quoted = false;
            for c in line.chars() {
                match c {
                    '"' => quoted = !quoted,
                    ',' if !quoted => cells.push(String::new()),
                    c => cells.last_mut().unwrap().push(c),
                }
            }
            assert_eq!(cells.len(), head.len(), "{line}");
            head.iter().cloned().zip(cells).collect()
        })
        .collect()
}

#[test]
fn a_received_folder_is_whole_or_it_is_said_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let received = copy_of_shared(folder.path());
    assert!(verify_handoff(&received, &Silent).unwrap().holds());

    let layout = received.join("layout/mini_3x3_pillars.gds");
    let mut bytes = fs::read(&layout).unwrap();
    bytes[1000] ^= 1;
    fs::write(&layout, bytes).unwrap();
    fs::remove_file(received.join("metrology/cd_table.csv")).unwrap();
    fs::write(received.join("layout/other.gds"), b"x").unwrap();
    let found = verify_handoff(&received, &Silent).unwrap();
    assert_eq!(found.altered, ["layout/mini_3x3_pillars.gds"]);
    assert_eq!(found.missing, ["metrology/cd_table.csv"]);
    assert_eq!(found.unknown, ["layout/other.gds"]);
    assert!(found.seal_holds && !found.holds());

    // Whoever makes the manifest fit the altered file breaks the seal.
    let path = received.join("manifest.json");
    let mut manifest: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    manifest["files"]["layout/mini_3x3_pillars.gds"]["bytes"] = 1.into();
    fs::write(&path, manifest.to_string()).unwrap();
    assert!(!verify_handoff(&received, &Silent).unwrap().seal_holds);
    fs::write(&path, "{").unwrap();
    assert!(matches!(verify_handoff(&received, &Silent), Err(Error::Table { .. })));
}

#[test]
fn every_rule_of_both_decks_is_told_and_so_is_the_simulation() {
    let numbers: serde_json::Value = serde_json::from_slice(&fs::read(shared().join("handoff.json")).unwrap()).unwrap();
    let page = fs::read_to_string(shared().join("index.html")).unwrap();
    for name in [
        "pillars",
        "apertures",
        "dose_matrix",
        "tests_pillars",
        "tests_apertures",
        "reference_pillars",
        "reference_apertures",
    ] {
        let report = fs::read(shared().join(format!("checks/{name}.json"))).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        let rules = report["rules"].as_array().unwrap();
        assert!(rules.len() > 5);
        for rule in rules {
            assert!(page.contains(rule["id"].as_str().unwrap()), "{rule}");
        }
        assert!(
            !report["layout"].as_str().unwrap().contains('/'),
            "no path of this machine"
        );
    }
    let checks = numbers["checks"].as_array().unwrap();
    assert_eq!(checks.len(), 8);
    for check in checks {
        assert!(
            ["pass", "fail", "not run"].contains(&check["verdict"].as_str().unwrap()),
            "{check}"
        );
        let rules = check["name"].as_str().unwrap().starts_with("design rules");
        assert!(!rules || check["verdict"] == "pass", "{check}");
        assert!(shared().join(check["report"].as_str().unwrap()).exists());
    }
    assert!(shared().join("verification/report.json").exists());
}

#[cfg(unix)]
#[test]
fn a_link_is_no_file_of_a_hand_off() {
    let folder = tempfile::tempdir().unwrap();
    let received = copy_of_shared(folder.path());
    let page = received.join("index.html");
    fs::rename(&page, folder.path().join("elsewhere")).unwrap();
    std::os::unix::fs::symlink(folder.path().join("elsewhere"), &page).unwrap();
    let found = verify_handoff(&received, &Silent).unwrap();
    assert_eq!(
        (found.missing, found.unknown),
        (vec!["index.html".to_owned()], vec!["index.html".to_owned()])
    );
}

#[test]
fn the_same_inputs_give_the_same_bytes_and_the_archive_holds_them() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("mini_handoff");
    let made = handoff(&options(&out), &Silent).unwrap();
    // Again over the first: it is replaced, and nothing changes.
    assert_eq!(handoff(&options(&out), &Silent).unwrap().manifest, made.manifest);
    assert_eq!(
        fs::read(out.join("manifest.json")).unwrap(),
        fs::read(shared().join("manifest.json")).unwrap()
    );
    let archive = fs::read(&made.archive).unwrap();
    assert_eq!(archive, fs::read(shared().with_extension("zip")).unwrap());
    let unpacked = unpack(&archive);
    assert_eq!(unpacked.len(), made.manifest.files.len() + 1);
    for (name, bytes) in unpacked {
        let name = name.strip_prefix("mini_handoff/").unwrap();
        assert_eq!(bytes, fs::read(out.join(name)).unwrap(), "{name}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

/// Files of an archive, found from its end as readers do, with ZIP64 numbers; sums checked.
fn unpack(archive: &[u8]) -> Vec<(String, Vec<u8>)> {
    let u16_at = |at: usize| usize::from(u16::from_le_bytes(archive[at..at + 2].try_into().unwrap()));
    let u32_at = |at: usize| u32::from_le_bytes(archive[at..at + 4].try_into().unwrap());
    let u64_at = |at: usize| u64::from_le_bytes(archive[at..at + 8].try_into().unwrap()) as usize;
    let end = archive.len() - 22;
    assert_eq!(u32_at(end), 0x0605_4b50);
    let end64 = u64_at(end - 20 + 8);
    assert_eq!(u32_at(end64), 0x0606_4b50);
    let (count, mut at) = (u64_at(end64 + 32), u64_at(end64 + 48));
    let mut files = Vec::new();
    for _ in 0..count {
        assert_eq!(u32_at(at), 0x0201_4b50);
        let (name_len, extra_len) = (u16_at(at + 28), u16_at(at + 30));
        let name = String::from_utf8(archive[at + 46..at + 46 + name_len].to_vec()).unwrap();
        let extra = at + 46 + name_len;
        let (size, packed, offset) = (u64_at(extra + 4), u64_at(extra + 12), u64_at(extra + 20));
        let data = offset + 30 + u16_at(offset + 26) + u16_at(offset + 28);
        let mut bytes = Vec::new();
        flate2::read::DeflateDecoder::new(&archive[data..data + packed])
            .read_to_end(&mut bytes)
            .unwrap();
        let mut crc = flate2::Crc::new();
        crc.update(&bytes);
        assert_eq!((bytes.len(), crc.sum()), (size, u32_at(at + 16)), "{name}");
        files.push((name, bytes));
        at = extra + extra_len;
    }
    files
}

#[derive(Default)]
struct Squares {
    /// Centre in half nanometres, width (nm).
    found: BTreeMap<(i64, i64), i64>,
}

impl Visitor for Squares {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> Result<()> {
        let rect = shape.rect.expect("pillars are rectangles");
        for placed in placements.iter().filter_map(|t| t.apply_rect(&rect)) {
            self.found
                .insert((placed.x0 + placed.x1, placed.y0 + placed.y1), placed.width());
        }
        Ok(())
    }
}

#[test]
fn at_every_place_to_look_stands_the_pillar_of_the_table() {
    let layout = Layout::open(&shared().join("layout/mini_3x3_pillars.gds")).unwrap();
    let mut squares = Squares::default();
    let selection = Selection {
        layers: Some(vec![PILLARS]),
        ..Default::default()
    };
    layout.visit(&selection, &mut squares, &Silent).unwrap();
    let mut seen = 0;
    for row in rows("metrology/cd_table.csv") {
        if row["file"] != "pillars" {
            continue;
        }
        let twice = |key: &str| (row[key].parse::<f64>().unwrap() * 2e3).round() as i64;
        let width = squares.found.get(&(twice("x_um"), twice("y_um")));
        assert_eq!(width, Some(&row["drawn_nm"].parse().unwrap()), "{row:?}");
        seen += 1;
    }
    // Five widths in three rings of two elements, less what a lens this small does not have.
    assert!(seen >= 20, "{seen} sites");
}

#[test]
fn nine_blocks_are_alike_but_for_their_dose() {
    let census = LayoutStatistics::take(&shared().join("dose/mini_3x3_dose_matrix.gds"), &Silent).unwrap();
    let first = census.layer(20, 1).unwrap();
    // 60 um: pads of 171 x 171 pillars for three widths, and one lens.
    let pads = 171 * 171 * 3;
    let pad_area = 171.0 * 171.0 * (0.12f64.powi(2) + 0.2f64.powi(2) + 0.28f64.powi(2));
    assert!(first.shapes > pads && first.area_um2 > pad_area);
    for dose in 2..=9 {
        let block = census.layer(20, dose).unwrap();
        assert_eq!(block.shapes, first.shapes);
        assert!((block.area_um2 - first.area_um2).abs() < SUMMED * first.area_um2);
        let (a, b) = (first.bounds_um.unwrap(), block.bounds_um.unwrap());
        assert!(
            a[0] > b[2] || b[0] > a[2] || a[1] > b[3] || b[1] > a[3],
            "blocks {dose} and 1 touch"
        );
    }
    let doses = rows("dose/dose_table.csv");
    assert_eq!(doses.len(), 9);
    assert_eq!(
        (doses[0]["dose_uc_cm2"].as_str(), doses[8]["dose_uc_cm2"].as_str()),
        ("201.60", "350.00")
    );
    assert_eq!(doses[4]["modulation_percent"], "+0.00");
}

#[test]
fn areas_are_those_of_the_pillars_and_times_follow_from_them() {
    let design = Design::read(Path::new(DESIGN)).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    let drawn: f64 = array
        .placed
        .iter()
        .flat_map(|p| array.widths(p).into_owned().number.into_iter())
        .map(|w| (f64::from(w) * 1e-3).powi(2))
        .sum();
    let census = LayoutStatistics::take(&shared().join("layout/mini_3x3_pillars.gds"), &Silent).unwrap();
    let pillars = census.layer(1, 0).unwrap();
    assert_eq!(pillars.shapes, array.pillars());
    // Areas are summed in whole square nanometres: only this test's own sum is rounded.
    assert!((pillars.area_um2 - drawn).abs() < SUMMED * drawn);
    let marks = census.layer(3, 0).unwrap();
    let times = rows("dose/write_time.csv");
    let two_na = times
        .iter()
        .find(|t| t["file"] == "mini_3x3_pillars.gds" && t["current_na"] == "2")
        .unwrap();
    let expected_s = 280e-6 * (drawn + marks.area_um2) * 1e-8 / 2e-9;
    assert!((two_na["beam_s"].parse::<f64>().unwrap() - expected_s).abs() < TABLE_S);
    assert_eq!(two_na["shot_step_nm"], "4");
}

#[test]
fn no_text_is_exposed_and_step_two_is_flat() {
    let files = ["layout/mini_3x3", "tests/mini_3x3_tests", "tests/mini_3x3_reference"];
    for file in files {
        for (step, exposed) in [("pillars", [1, 3]), ("apertures", [2, 4])] {
            let census = LayoutStatistics::take(&shared().join(format!("{file}_{step}.gds")), &Silent).unwrap();
            let shown = census.layers.iter().filter(|l| exposed.contains(&l.layer));
            assert!(shown.clone().any(|l| l.shapes > 0), "{file}_{step} exposes something");
            assert!(shown.map(|l| l.texts).sum::<u64>() == 0, "{file}_{step}");
            if step == "apertures" {
                assert!(census.cells.iter().all(|c| c.references == 0), "{file} is flat");
            }
        }
    }
}

#[test]
fn test_structures_do_not_overlap_and_lie_in_their_frame() {
    let rows = rows("tests/structures.csv");
    let boxes: Vec<_> = rows
        .iter()
        .filter(|r| r["id"] != "CLEAVE")
        .map(|r| {
            (
                r["id"].clone(),
                ["x0_um", "y0_um", "x1_um", "y1_um"].map(|k| r[k].parse::<f64>().unwrap()),
            )
        })
        .collect();
    assert!(boxes.len() > 30);
    for (i, (name, a)) in boxes.iter().enumerate() {
        assert!(a[0] > 0.0 && a[1] > 0.0, "{name} leaves the frame");
        for (other, b) in &boxes[i + 1..] {
            let apart = a[0] > b[2] || b[0] > a[2] || a[1] > b[3] || b[1] > a[3];
            assert!(apart, "{name} and {other} overlap");
        }
    }
    for id in [
        "ETCH", "FILM", "OVER_x", "OVER_y", "FIELD_x", "FIELD_y", "D100", "S300", "CD_x_100", "CD_y_300",
    ] {
        assert!(boxes.iter().any(|b| b.0 == id), "{id} is missing");
    }
    // The field verniers lie on borders of the fields in use.
    let field_um = 499.8;
    let off_border = |v: f64| (v / field_um - (v / field_um).round()).abs() * field_um;
    for (id, b) in &boxes {
        let between = |lo: f64, hi: f64| (lo / field_um).floor() != (hi / field_um).floor();
        match id.as_str() {
            "FIELD_x" => assert!(between(b[1], b[3]) && off_border((b[1] + b[3]) / 2.0) < VERNIER_UM),
            "FIELD_y" => assert!(between(b[0], b[2]) && off_border((b[0] + b[2]) / 2.0) < VERNIER_UM),
            id if id.starts_with(['D', 'S']) => assert!(!between(b[0], b[2]), "{id} is cut by a field border"),
            _ => {}
        }
    }
}

/// Waivers of what test structures break on purpose have their reasons, and every waiver covers something.
#[test]
fn what_is_broken_on_purpose_is_waived_with_its_reason() {
    let report = fs::read(shared().join("checks/tests_pillars.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    let rules = report["rules"].as_array().unwrap();
    let cut = rules.iter().find(|r| r["id"] == "field.cut").unwrap();
    let waivers = fs::read_to_string(shared().join("checks/tests_pillars_waivers.toml")).unwrap();
    let count = waivers.matches("[[waiver]]").count() as u64;
    // One line across each border, and the film witness, which is wider than a field.
    assert_eq!(
        (count, cut["waived"].as_u64(), cut["violations"].as_u64()),
        (3, Some(3), Some(3))
    );
    assert!(["FIELD_x: ", "FIELD_y: ", "FILM: "].iter().all(|w| waivers.contains(w)));
    assert_eq!(report["warnings"].as_array().unwrap().len(), 0);
    let other = rules.iter().filter(|r| r["id"] != "field.cut");
    assert_eq!(other.map(|r| r["violations"].as_u64().unwrap()).sum::<u64>(), 0);
}

#[test]
fn a_hand_off_never_replaces_what_it_did_not_make() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("mine");
    fs::create_dir(&out).unwrap();
    fs::write(out.join("thesis.tex"), "years of work").unwrap();
    let error = handoff(&options(&out), &Silent).unwrap_err();
    assert_eq!(error.id(), "handoff/foreign-file");
    assert_eq!(fs::read_to_string(out.join("thesis.tex")).unwrap(), "years of work");
}

#[test]
fn a_process_that_cannot_make_pillars_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let process = folder.path().join("wrong.toml");
    // The decks of rules are named from the folder of the process file.
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../rules");
    let text = fs::read_to_string(PROCESS).unwrap().replace("../rules", root);
    fs::write(&process, text.replace("\"lift_off\"", "\"direct_etch\"")).unwrap();
    let mut wrong = options(&folder.path().join("out"));
    wrong.process = Some(process.clone());
    assert_eq!(handoff(&wrong, &Silent).unwrap_err().id(), "handoff/tone-inverted");
    fs::write(&process, text.replace("layer = 20", "layer = 1")).unwrap();
    assert_eq!(handoff(&wrong, &Silent).unwrap_err().id(), "handoff/layer-taken");
    assert!(!folder.path().join("out").exists());
}

/// Asks to stop at the first chance.
struct Stop;

impl Progress for Stop {
    fn begin(&self, _: &str, _: u64) {}
    fn advance(&self, _: u64) {}
    fn stopped(&self) -> bool {
        true
    }
}

#[test]
fn stopped_it_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("mini_handoff");
    assert!(matches!(handoff(&options(&out), &Stop), Err(Error::Interrupted)));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_reference_lens_is_as_large_as_the_elements() {
    let design = Design::read(Path::new(DESIGN)).unwrap();
    let census = LayoutStatistics::take(&shared().join("tests/mini_3x3_reference_pillars.gds"), &Silent).unwrap();
    let bounds = census.layer(1, 0).unwrap().bounds_um.unwrap();
    let lattice = design.cell.lattice_covering(design.lens.diameter_nm).unwrap();
    let reach = lattice.coordinate_um(lattice.sites() - 1);
    assert!(
        bounds
            .iter()
            .all(|b| (b.abs() - reach).abs() < WIDEST_HALF_UM + f64::from(design.cell.pitch_nm) * 1e-3)
    );
}
