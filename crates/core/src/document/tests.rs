use std::path::Path;
use std::time::Instant;

use super::FaultKind::{Inconsistent, Missing, OutOfRange, Unknown, Unprintable};
use super::{Document, FaultKind, Faults, Limits, Section};
use crate::Error;

fn faults_of(text: &str, read: impl FnOnce(&Section<'_, '_>)) -> Faults {
    match Document::read(Path::new("test.toml"), text, read) {
        Err(Error::Text(faults)) => *faults,
        other => panic!("expected faults, not {other:?}"),
    }
}

fn found(faults: &Faults) -> Vec<(FaultKind, &str)> {
    faults.faults().iter().map(|f| (f.kind, f.key.as_str())).collect()
}

/// A cell whose widest pillar is bounded by its pitch.
fn cell(root: &Section<'_, '_>) {
    let s = root.section("cell");
    let pitch = s.float("pitch_nm", Limits::new(100.0..=2000.0, "nm"));
    let width = s.float("width_nm", Limits::new(10.0..=2000.0, "nm"));
    if width > pitch {
        s.fault_given(
            &["cell.pitch_nm"],
            "width_nm",
            "the pillar is wider than the pitch",
            "make it narrower",
        );
    }
    s.finish();
}

#[test]
fn what_depends_on_a_wrong_value_is_not_judged() {
    let wrong = faults_of("[cell]\npitch_nm = 35\nwidth_nm = 300", cell);
    assert_eq!(found(&wrong), [(OutOfRange, "cell.pitch_nm")]);
    insta::assert_snapshot!(wrong, @"
        test.toml:2:12: `pitch_nm` cannot be 35
          help: it must be a number from 100 to 2000 nm
        ");
    let missing = faults_of("[cell]\nwidth_nm = 300", cell);
    assert_eq!(found(&missing), [(Missing, "cell.pitch_nm")]);
    insta::assert_snapshot!(missing, @"
        test.toml:1:1: [cell] lacks `pitch_nm`
          help: add `pitch_nm`: a number from 100 to 2000 nm
        ");
    let empty = faults_of("", cell);
    assert_eq!(found(&empty), [(Missing, "cell")]);
    insta::assert_snapshot!(empty, @"
        test.toml:1:1: the file lacks `cell`
          help: add `cell`: a section [cell]
        ");
    let right = faults_of("[cell]\npitch_nm = 200\nwidth_nm = 300", cell);
    assert_eq!(found(&right), [(Inconsistent, "cell.width_nm")]);
}

#[test]
fn a_misspelt_key_is_one_mistake() {
    let faults = faults_of("[cell]\npitch_nn = 350\nwidth_nm = 300", cell);
    assert_eq!(found(&faults), [(Unknown, "cell.pitch_nn")]);
    insta::assert_snapshot!(faults, @"
        test.toml:2:1: unknown key `pitch_nn` in [cell]
          help: known here: pitch_nm, width_nm; did you mean `pitch_nm`, which is missing?
        ");
}

/// An old name, of a key or of a word, is one mistake, and the new one is named.
#[test]
fn an_old_name_is_refused_with_the_new_one() {
    let faults = faults_of("[cell]\nspan_nm = 350\nform = \"round\"", |root| {
        let s = root.section("cell");
        s.renamed("span_nm", "pitch_nm");
        s.renamed("round", "circle");
        s.float("pitch_nm", Limits::new(100.0..=2000.0, "nm"));
        s.choice("form", &[("circle", 0), ("square", 1)], None);
        s.finish();
    });
    let found: Vec<[&str; 2]> = faults
        .faults()
        .iter()
        .map(|f| [f.what.as_str(), f.hint.as_str()])
        .collect();
    assert_eq!(
        found,
        [
            ["`span_nm` is called `pitch_nm` now in [cell]", "write `pitch_nm`"],
            ["`round` is called `circle` now", "write `circle`"]
        ]
    );
}

#[test]
fn one_missing_bracket_is_one_mistake() {
    let text = format!("[cell]\nsizes = [1, 2\n{}", "[[mark]]\nx = [1, 2]\n".repeat(50));
    assert_eq!(faults_of(&text, cell).count(), 1);
}

/// Ten times the mistakes take about ten times the time, and little memory: 50 are listed, all are counted.
#[test]
fn many_mistakes_are_counted_in_linear_time() {
    /// Far above what it takes, far below the 97 s of a time that grows with the square.
    const MOST_SECONDS: u64 = 20;
    let start = Instant::now();
    let mut text = "[cell]\npitch_nm = 350\nwidth_nm = 300\n".to_owned();
    (0..100_000).for_each(|k| text += &format!("key_{k} = 1\n"));
    let faults = faults_of(&text, cell);
    assert_eq!((faults.count(), faults.faults().len()), (100_000, 50));
    insta::assert_snapshot!(faults.to_string().lines().last().unwrap(), @"test.toml: 99950 more mistakes");
    let broken = faults_of(&"= ]\n".repeat(1 << 18), cell);
    assert_eq!(broken.count(), 1);
    assert!(start.elapsed().as_secs() < MOST_SECONDS);
}

#[test]
fn texts_are_one_printable_line() {
    for (text, character) in [
        ("\"a\\u001b[2J\"", "U+001B"),
        ("\"a\\nb\"", "U+000A"),
        ("\"\\uFFFE\"", "U+FFFE"),
    ] {
        let faults = faults_of(&format!("title = {text}"), |root| {
            root.text("title");
        });
        assert_eq!(found(&faults), [(Unprintable, "title")]);
        assert!(faults.faults()[0].what.ends_with(character), "{faults}");
    }
    let faults = faults_of("\"a\\u001b\" = 1\n", |_| {});
    assert_eq!(faults.faults()[0].kind, Unknown);
    insta::assert_snapshot!(faults, @r"
        test.toml:1:1: unknown key `a\u{1b}` at the top
          help: known here:
        ");
}

/// The text is drawn with its places, whatever is in it.
#[test]
fn what_is_drawn_keeps_its_places() {
    let text = "# \u{1b}\u{9b}\u{fffe}\u{1fffe}\nwrong = 1\n";
    let drawn = super::fault::drawable(text);
    assert_eq!(drawn.len(), text.len());
    assert!(drawn.chars().all(|c| crate::text::is_printable(c) || c == '\n'));
}

/// One of several sections with a fault says nothing about the others.
#[test]
fn sections_of_one_name_are_judged_each() {
    let text = "[[pair]]\na = 50\nb = 3\n[[pair]]\na = 5\nb = 3\n";
    let faults = faults_of(text, |root| {
        for s in root.sections("pair") {
            let limits = Limits::new(0.0..=10.0, "");
            let (a, b) = (s.float("a", limits.clone()), s.float("b", limits));
            if a != b {
                s.fault_given(&["pair.a"], "b", "a and b differ", "make them equal");
            }
            s.finish();
        }
    });
    assert_eq!(found(&faults), [(OutOfRange, "pair#0.a"), (Inconsistent, "pair#1.b")]);
    assert_eq!(faults.line_column(faults.faults()[1].span.start), (6, 5));
}

#[test]
fn a_file_of_another_kind_is_said_to_be_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lens.gds");
    // A header of GDSII before what no text is long enough for.
    let mut layout = vec![0x00, 0x06, 0x00, 0x02, 0x02, 0x58];
    layout.resize(super::LONGEST as usize + 1, 0xff);
    let mut said = Vec::new();
    for (bytes, id) in [
        (&layout[..], "file/not-text"),
        (b"%SEMI-OASIS\r\n\x01\xff", "file/not-text"),
        (b"\x89PNG\r\n\x1a\n", "file/not-text"),
        (b"\xff\xfe", "table/malformed"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let error = super::load(&path).unwrap_err();
        assert_eq!(error.id(), id);
        said.push(error.to_string().replace(&*path.to_string_lossy(), "lens.gds"));
    }
    // The kind of file is in the words.
    insta::assert_snapshot!(said.join("\n"), @"
        lens.gds is a layout in GDSII, and a text file is needed here
          help: check which file is given where: `--help` says the order
        lens.gds is a layout in OASIS, and a text file is needed here
          help: check which file is given where: `--help` says the order
        lens.gds is a picture (PNG), and a text file is needed here
          help: check which file is given where: `--help` says the order
        lens.gds, line 1: this is not UTF-8 text
          help: save the file as UTF-8
        ");
}

/// A file that cannot be used is a mistake at each key that names it, among the others, and sections are told apart by whole names.
#[test]
fn an_unusable_file_is_a_mistake_of_its_keys() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("curve.csv"), "nm,value\n").unwrap();
    let text = "[cell]\ncurve = \"curve.csv\"\nlater = \"curve.csv\"\nwidth = \"wide\"\n[cells]\n";
    let path = folder.path().join("test.toml");
    let refused = |path: &Path| Error::table(path, Some(1), "no curve", "give one");
    let error = Document::read(&path, text, |root| {
        let s = root.section("cell");
        root.section("cells").finish();
        assert!(root.sound_within(&["cell", "cells"]));
        assert!(s.contents("curve", |path| Err::<(), _>(refused(path))).is_none());
        assert!(s.contents("none", |_| Ok::<_, Error>(())).is_none());
        let later = s.file("later");
        s.unusable_file(refused(&later)).unwrap();
        let other = s.unusable_file(refused("other.csv".as_ref())).unwrap_err();
        assert_eq!(other.id(), "table/malformed");
        s.float("width", Limits::new(1.0..=2.0, "nm"));
        assert!(!root.sound_within(&["cell"]) && root.sound_within(&["cells", "cel"]));
        s.finish();
    })
    .unwrap_err();
    assert_eq!(
        error.ids(),
        [
            "cell.none/missing",
            "cell.curve/unusable-file",
            "cell.later/unusable-file",
            "cell.width/wrong-type"
        ]
    );
}
