use std::path::Path;
use std::time::Instant;

use super::{Document, Faults, Limits, Section};
use crate::Error;

fn faults_of(text: &str, read: impl FnOnce(&Section<'_, '_>)) -> Faults {
    match Document::read(Path::new("test.toml"), text, read) {
        Err(Error::Text(faults)) => *faults,
        other => panic!("expected faults, not {other:?}"),
    }
}

fn words(faults: &Faults) -> Vec<&str> {
    faults.faults().iter().map(|f| f.what.as_str()).collect()
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
    assert_eq!(
        words(&faults_of("[cell]\npitch_nm = 35\nwidth_nm = 300", cell)),
        ["`pitch_nm` cannot be 35"]
    );
    assert_eq!(
        words(&faults_of("[cell]\nwidth_nm = 300", cell)),
        ["[cell] lacks `pitch_nm`"]
    );
    assert_eq!(words(&faults_of("", cell)), ["the file lacks `cell`"]);
    let right = faults_of("[cell]\npitch_nm = 200\nwidth_nm = 300", cell);
    assert_eq!(words(&right), ["the pillar is wider than the pitch"]);
}

#[test]
fn a_misspelt_key_is_one_mistake() {
    let faults = faults_of("[cell]\npitch_nn = 350\nwidth_nm = 300", cell);
    assert_eq!(words(&faults), ["unknown key `pitch_nn` in [cell]"]);
    assert!(
        faults.faults()[0]
            .hint
            .ends_with("did you mean `pitch_nm`, which is missing?")
    );
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
    assert!(faults.to_string().ends_with("99950 more mistakes"));
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
        assert_eq!(words(&faults), [format!("`title` contains the character {character}")]);
    }
    let faults = faults_of("\"a\\u001b\" = 1\n", |_| {});
    assert_eq!(words(&faults), ["unknown key `a\\u{1b}` at the top"]);
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
    assert_eq!(words(&faults), ["`a` cannot be 50", "a and b differ"]);
    assert_eq!(faults.line_column(faults.faults()[1].span.start), (6, 5));
}

#[test]
fn a_file_of_another_kind_is_said_to_be_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lens.gds");
    // A header of GDSII before what no text is long enough for.
    let mut layout = vec![0x00, 0x06, 0x00, 0x02, 0x02, 0x58];
    layout.resize(super::LONGEST as usize + 1, 0xff);
    for (bytes, kind) in [
        (&layout[..], "a layout in GDSII"),
        (b"%SEMI-OASIS\r\n\x01\xff", "a layout in OASIS"),
        (b"\x89PNG\r\n\x1a\n", "a picture (PNG)"),
        (b"\xff\xfe", "not UTF-8"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let error = super::load(&path).unwrap_err().to_string();
        assert!(error.contains("lens.gds") && error.contains(kind), "{error}");
    }
}
