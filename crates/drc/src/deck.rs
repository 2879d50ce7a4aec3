//! The deck: which rules with which limits, read from a file with a place for every mistake.

use std::collections::BTreeMap;
use std::path::Path;

use super::rule::{Rule, Severity};
use super::{aperture, budget, density, design, field, lattice, layers, marks, outline, spacing, tree, width};
use metalith_core::Result;
use metalith_core::document::{Document, Limits, Section, load};
use metalith_gds::LayerNumber;

/// The decks that ship with the program, by the names of their files; the first is the standard one.
const SHIPPED: [(&str, &str); 5] = [
    ("sin_pillars.toml", include_str!("../../../rules/sin_pillars.toml")),
    ("sin_apertures.toml", include_str!("../../../rules/sin_apertures.toml")),
    ("dose_matrix.toml", include_str!("../../../rules/dose_matrix.toml")),
    (
        "test_structures.toml",
        include_str!("../../../rules/test_structures.toml"),
    ),
    ("test_openings.toml", include_str!("../../../rules/test_openings.toml")),
];

/// Version of the format of rule files that this program reads.
const SCHEMA: i64 = 1;

/// A deck of rules.
#[derive(Clone, Debug)]
pub struct Deck {
    pub name: String,
    /// Layers that the pillars are on: one, or several where the datatype is a dose. They count as one.
    pub pillars: Vec<LayerNumber>,
    path: std::path::PathBuf,
    text: String,
}

/// One rule of the deck, ready to run.
pub(super) struct ActiveRule {
    pub id: String,
    pub check: String,
    pub severity: Severity,
    /// Whether it applies: some need a design and are written to wait for one.
    pub in_force: bool,
    pub rule: Box<dyn Rule>,
}

/// What rules of all families ask of the file.
pub(super) struct Context {
    pub layers: BTreeMap<String, LayerNumber>,
    pub pillars: LayerNumber,
    pub height_nm: f64,
    /// Checks of the deck with the layers they look at, to let the gravest name win.
    pub covered: Vec<(String, Vec<LayerNumber>)>,
}

impl Deck {
    /// Read the deck at `path`.
    ///
    /// # Errors
    /// With every mistake of the file, each with its place.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, load(path)?)
    }

    /// The deck of the program: SiN pillars on fused silica, electron beam and lift-off.
    ///
    /// # Panics
    /// Never: it is tested.
    pub fn standard() -> Self {
        Self::shipped(Path::new(SHIPPED[0].0)).expect("it is the first of the list")
    }

    /// The deck of the program whose file has the name at the end of `path`, if there is one.
    pub fn shipped(path: &Path) -> Option<Self> {
        let (name, text) = SHIPPED.iter().find(|(name, _)| path.ends_with(name))?;
        let deck = Self::parse(&Path::new("rules").join(name), (*text).to_owned());
        Some(deck.expect("the decks of the program are sound"))
    }

    /// Name and text of the file that it was read from.
    pub fn source(&self) -> (&Path, &str) {
        (&self.path, &self.text)
    }

    fn parse(path: &Path, text: String) -> Result<Self> {
        let mut deck = Self {
            name: String::new(),
            pillars: Vec::new(),
            path: path.to_owned(),
            text,
        };
        let (name, pillars) = Document::read(path, &deck.text, |root| read(root).0)?;
        (deck.name, deck.pillars) = (name, pillars);
        Ok(deck)
    }

    /// The rules, with nothing found yet.
    pub(super) fn rules(&self, with_design: bool) -> Result<Vec<ActiveRule>> {
        let mut rules = Document::read(&self.path, &self.text, |root| read(root).1)?;
        rules.iter_mut().for_each(|r| r.in_force |= with_design);
        Ok(rules)
    }
}

fn read(root: &Section<'_, '_>) -> ((String, Vec<LayerNumber>), Vec<ActiveRule>) {
    root.integer("schema", SCHEMA..=SCHEMA, "");
    let name = root.text("name");
    let section = root.section("layers");
    let mut layers = BTreeMap::new();
    let mut pillars = Vec::new();
    let number = |key: &str, text: &str| {
        parse_layer(text).unwrap_or_else(|| {
            section.fault(
                key,
                format!("\"{text}\" is not a layer"),
                "write layer and datatype as \"1/0\"",
            );
            LayerNumber::default()
        })
    };
    for key in section.keys() {
        if key == "pillars" && section.is_list(&key) {
            pillars = section.texts(&key).iter().map(|text| number(&key, text)).collect();
        } else {
            layers.insert(key.clone(), number(&key, &section.text(&key)));
        }
    }
    match pillars.first() {
        Some(&first) => drop(layers.insert("pillars".into(), first)),
        None => {
            section.text("pillars");
            pillars.extend(layers.get("pillars"));
        }
    }
    section.finish();
    let height_nm = root.float("pillar_height_nm", Limits::new(1.0..=100_000.0, "nm"));
    let sections = root.sections("rule");
    let mut context = Context {
        layers,
        pillars: pillars.first().copied().unwrap_or_default(),
        height_nm,
        covered: Vec::new(),
    };
    context.covered = sections
        .iter()
        .map(|s| (s.text("check"), context.some_layers(s)))
        .collect();
    let mut rules: Vec<ActiveRule> = Vec::new();
    for s in &sections {
        if let Some(rule) = read_rule(s, &context, &rules) {
            rules.push(rule);
        }
        s.finish();
    }
    if sections.is_empty() {
        root.fault("rule", "the deck has no rules", "add one or more [[rule]] sections");
    }
    ((name, pillars), rules)
}

fn read_rule(s: &Section<'_, '_>, context: &Context, before: &[ActiveRule]) -> Option<ActiveRule> {
    let (id, check) = (s.text("id"), s.text("check"));
    if before.iter().any(|r| r.id == id) {
        s.fault(
            "id",
            format!("a second rule `{id}`"),
            "give every rule an id of its own",
        );
    }
    let severities = [
        ("error", Severity::Error),
        ("warning", Severity::Warning),
        ("note", Severity::Note),
    ];
    let severity = s.choice("severity", &severities, Some(Severity::Error));
    let in_force = s.choice("when", &[("always", true), ("design", false)], Some(true));
    let families: [Family; 12] = [
        width::read,
        outline::read,
        lattice::read,
        spacing::read,
        density::read,
        field::read,
        aperture::read,
        marks::read,
        layers::read,
        tree::read,
        budget::read,
        design::read,
    ];
    let rule = families.iter().find_map(|read| read(&check, s, context));
    let Some(rule) = rule else {
        if s.has("check") {
            s.fault(
                "check",
                format!("there is no check `{check}`"),
                "docs/guide/check.md lists all checks",
            );
        }
        return None;
    };
    Some(ActiveRule {
        id,
        check,
        severity,
        in_force,
        rule,
    })
}

/// Reads a rule of one family; none if the check is of another.
type Family = fn(&str, &Section<'_, '_>, &Context) -> Option<Box<dyn Rule>>;

impl Context {
    /// The layer named by `layer`, the pillars if left out.
    pub fn layer(&self, s: &Section<'_, '_>, key: &str) -> LayerNumber {
        match s.optional_text(key) {
            None => self.pillars,
            Some(name) => self.named(s, key, &name),
        }
    }

    /// The layers named by `layers`, the pillars if left out.
    pub fn some_layers(&self, s: &Section<'_, '_>) -> Vec<LayerNumber> {
        if s.has("layers") {
            s.texts("layers").iter().map(|n| self.named(s, "layers", n)).collect()
        } else {
            vec![self.pillars]
        }
    }

    /// Whether the deck has this check on this layer.
    pub fn covers(&self, check: &str, layer: LayerNumber) -> bool {
        self.covered
            .iter()
            .any(|(c, layers)| c == check && layers.contains(&layer))
    }

    fn named(&self, s: &Section<'_, '_>, key: &str, name: &str) -> LayerNumber {
        self.layers.get(name).copied().unwrap_or_else(|| {
            let known = self.layers.keys().cloned().collect::<Vec<_>>().join(", ");
            s.fault(
                key,
                format!("there is no layer `{name}` in [layers]"),
                format!("known: {known}"),
            );
            LayerNumber::default()
        })
    }
}

fn parse_layer(text: &str) -> Option<LayerNumber> {
    let (layer, datatype) = text.split_once('/')?;
    Some(LayerNumber::new(
        layer.trim().parse().ok()?,
        datatype.trim().parse().ok()?,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_decks_of_the_program_are_sound() {
        for (name, _) in SHIPPED {
            assert!(!Deck::shipped(Path::new(name)).unwrap().rules(true).unwrap().is_empty());
        }
        let deck = Deck::standard();
        assert!(deck.rules(true).unwrap().len() > 30);
        assert!(deck.rules(true).unwrap().iter().all(|r| r.in_force));
    }

    #[test]
    fn mistakes_have_places() {
        let text = "schema = 1\nname = \"x\"\npillar_height_nm = 700\n[layers]\npillars = \"1-0\"\n\
                    [[rule]]\nid = \"a\"\ncheck = \"gap_min\"\n[[rule]]\nid = \"a\"\ncheck = \"wings\"\n";
        let error = Deck::parse(Path::new("deck.toml"), text.into())
            .unwrap_err()
            .to_string();
        for expected in ["deck.toml:5:", "lacks `nm`", "a second rule `a`", "no check `wings`"] {
            assert!(error.contains(expected), "{expected}: {error}");
        }
    }
}
