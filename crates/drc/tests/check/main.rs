//! Design rules: for each rule of the standard decks a layout that breaks it once and only it; what does not
//! run is not clean; waivers; the forms of the report.

mod circles;
mod decks;
mod design;
mod foreign;
mod forms;
mod hexagonal;
mod on_lattice;
mod openings;
mod pillars;
mod proportion;
mod rectangles;

use metalith_core::Silent;
use metalith_drc::{CheckInput, Date, Deck, DrcReport};
use metalith_gds::{Layout, ReadLimits};

fn layout(bytes: Vec<u8>) -> Layout {
    Layout::from_bytes("chip.gds", bytes, ReadLimits::default()).unwrap()
}

/// The standard deck with words replaced: for rules that others dominate at the standard limits.
fn deck(changes: &[(&str, &str)]) -> Deck {
    deck_from("rules/sin_pillars.toml", changes)
}

fn deck_from(path: &str, changes: &[(&str, &str)]) -> Deck {
    let path = metalith_testing::root().join(path);
    let mut text = std::fs::read_to_string(path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deck.toml");
    std::fs::write(&path, text).unwrap();
    Deck::read(&path).unwrap()
}

fn input<'a>() -> CheckInput<'a> {
    CheckInput {
        markers: 100,
        today: Date::parse("2026-11-21").unwrap(),
        ..CheckInput::default()
    }
}

fn check(bytes: Vec<u8>, changes: &[(&str, &str)]) -> DrcReport {
    metalith_drc::check(&layout(bytes), &deck(changes), &input(), &Silent).unwrap()
}

/// Ids of rules with violations, how many each.
fn broken(report: &DrcReport) -> Vec<(&str, u64)> {
    let violated = report.rules.iter().filter(|r| r.violations > 0);
    violated.map(|r| (r.id.as_str(), r.violations)).collect()
}
