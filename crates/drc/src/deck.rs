//! The deck: which rules with which limits, read from a file with a place for every mistake.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use include_dir::{Dir, File, include_dir};

use super::context::Context;
use super::rule::{DeckRule, Rule, Severity};
use super::{aperture, budget, density, design, grids, layers, marks, outline, spacing, tree, width, write_fields};
use metalith_core::Result;
use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::text::quoted;
use metalith_design::Design;
use metalith_gds::LayerNumber;
use metalith_pillars::{DatabaseUnit, PillarShape};

/// The decks that ship with the program.
static SHIPPED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/rules");

const STANDARD: &str = "sin_pillars.toml";

/// Version of the format of rule files that this program reads.
const SCHEMA: i64 = 1;
/// Rules of one deck: every outline is shown to every rule of its layer.
const MOST_RULES: usize = 1000;
/// Characters of an id.
const LONGEST_ID: usize = 64;

/// A deck of rules.
#[derive(Clone)]
pub struct Deck {
    pub name: String,
    /// Layers that the pillars are on: one, or several where the datatype is a dose. They count as one.
    pub pillars: Vec<LayerNumber>,
    /// The layer of the layout that counts as the first of these, in place of them; none if they are as the deck says.
    pub(super) pillars_on: Option<LayerNumber>,
    path: PathBuf,
    text: String,
    /// Rules in the order of the file; shared by all clones.
    rules: Arc<[DeckRule]>,
}

impl std::fmt::Debug for Deck {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Deck")
            .field("name", &self.name)
            .field("path", &self.path)
            .field("rules", &self.rules.len())
            .finish_non_exhaustive()
    }
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
        Self::shipped(Path::new(STANDARD)).expect("it is one of them")
    }

    /// The deck of what holds of every layout of pillars of this shape.
    ///
    /// # Panics
    /// Never: it is tested.
    pub fn for_shape(shape: PillarShape) -> Self {
        Self::named(shape.plural())
    }

    /// The deck of the program for pillars of this shape, in the plural.
    pub(super) fn named(plural: &str) -> Self {
        let name = format!("{plural}.toml");
        Self::shipped(Path::new(&name)).expect("it is in the list")
    }

    /// A deck of one rule on pillars of these layers, which no file has.
    pub(super) fn of_rule(name: &str, pillars: Vec<LayerNumber>, rule: Box<dyn Rule>) -> Self {
        let rule = DeckRule {
            id: name.to_owned(),
            check: name.to_owned(),
            severity: Severity::Note,
            always: true,
            rule,
        };
        Self {
            name: name.to_owned(),
            pillars,
            path: PathBuf::from(name),
            text: String::new(),
            pillars_on: None,
            rules: Arc::new([rule]),
        }
    }

    /// A deck of the text of a file that is yet to be written to `path`.
    ///
    /// # Errors
    /// As [`Deck::read`].
    pub(super) fn of_text(path: &Path, text: String) -> Result<Self> {
        Self::parse(path, text)
    }

    /// The deck that a design is checked by where no other is named: [`Deck::standard`] for the cell that this is of, else the deck
    /// of the shape of its pillars, on the grid of its database unit. Without a design: [`super::check_generic`].
    pub fn for_design(design: &Design) -> Self {
        if design.cell.is_of_the_paper() {
            return Self::standard();
        }
        Self::for_shape(design.cell.shape).on_grid(design.cell.database_unit)
    }

    /// The deck with this unit as the step of its `grid` rules where that is 1 nm.
    ///
    /// # Panics
    /// Never: one number takes the place of another.
    #[must_use]
    pub fn on_grid(self, unit: DatabaseUnit) -> Self {
        if unit.is_nanometre() {
            return self;
        }
        Self::parse(&self.path, on_grid(&self.text, unit)).expect("a number for a number")
    }

    /// The deck with the height of the pillars of a design in its rules about proportions, in place of the height that the file
    /// states.
    ///
    /// # Panics
    /// Never: the same text was read before.
    #[must_use]
    pub fn for_pillars_of(self, design: &Design) -> Self {
        let known = Known {
            height_nm: Some(design.cell.pillar_height_nm),
            ..Known::default()
        };
        Self::read_text(&self.path, self.text, &known).expect("it was read before")
    }

    /// The deck for a layout without a design: the rules of these checks, which state what a design holds, are not in force.
    /// With `layers` pillars and marks are on these layers, and all other names of the deck on none.
    ///
    /// # Panics
    /// Never: the same text was read before.
    #[must_use]
    pub fn without_design(self, of_a_design: &[&str], layers: Option<LayoutLayers>) -> Self {
        let known = Known {
            layers,
            of_a_design,
            ..Known::default()
        };
        Self::read_text(&self.path, self.text, &known).expect("it was read before")
    }

    /// This deck for a layout whose pillars are on another layer than it says.
    #[must_use]
    pub fn with_pillars_on(self, layer: LayerNumber) -> Self {
        Self {
            pillars_on: Some(layer),
            ..self
        }
    }

    /// The deck of the program whose file has the name at the end of `path`, if there is one.
    pub fn shipped(path: &Path) -> Option<Self> {
        let file = SHIPPED.get_file(path.file_name()?)?;
        let text = file.contents_utf8().expect("rules are text");
        let deck = Self::parse(&Path::new("rules").join(file.path()), text.to_owned());
        Some(deck.expect("the decks of the program are sound"))
    }

    /// True if it is one of the program, unaltered.
    pub fn is_shipped(&self) -> bool {
        let file = self.path.file_name().and_then(|name| SHIPPED.get_file(name));
        file.and_then(File::contents_utf8).is_some_and(|text| {
            // The step of its `grid` rules follows the database unit.
            let shipped = DatabaseUnit::ALL.map(|unit| on_grid(text, unit));
            shipped.contains(&self.text)
        })
    }

    /// Name and text of the file that it was read from.
    pub fn source(&self) -> (&Path, &str) {
        (&self.path, &self.text)
    }

    /// The keys of a file of rules.
    pub fn keys() -> KeyTable {
        explore(&[], |root, _| read(root, &Known::default()))
    }

    fn parse(path: &Path, text: String) -> Result<Self> {
        Self::read_text(path, text, &Known::default())
    }

    fn read_text(path: &Path, text: String, known: &Known<'_>) -> Result<Self> {
        let contents = Document::read(path, &text, |root| read(root, known))?;
        Ok(Self {
            name: contents.name,
            pillars: contents.pillars,
            pillars_on: None,
            path: path.to_owned(),
            text,
            rules: contents.rules.into(),
        })
    }

    /// The rules, in the order of the file.
    pub(super) fn rules(&self) -> &[DeckRule] {
        &self.rules
    }
}

/// The text of a deck with this unit as the step of its `grid` rules where that is 1 nm.
fn on_grid(text: &str, unit: DatabaseUnit) -> String {
    let step = format!("nm = {}", unit.nm());
    let mut in_grid_rule = false;
    let lines = text.split('\n').map(|line| {
        in_grid_rule = line == "check = \"grid\"" || in_grid_rule && line != "[[rule]]";
        if in_grid_rule && line == "nm = 1" { &step } else { line }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// Layers of a layout that a deck is used for.
#[derive(Clone, Copy, Debug)]
pub struct LayoutLayers {
    pub pillars: LayerNumber,
    /// Layer of the marks of the first step, if it has some.
    pub marks: Option<LayerNumber>,
}

/// Layer that no shape is on: layers of a deck that a layout does not have.
const NO_LAYER: LayerNumber = LayerNumber {
    layer: u16::MAX,
    datatype: u16::MAX,
};

/// What is known of a layout better than by the file of the deck.
#[derive(Default)]
struct Known<'a> {
    /// Height of the pillars.
    height_nm: Option<f64>,
    layers: Option<LayoutLayers>,
    /// Checks whose rules wait for a design.
    of_a_design: &'a [&'a str],
}

/// The checks of all families.
const CHECKS: [&str; 50] = [
    "width_min",
    "width_max",
    "aspect_max",
    "width_library",
    "square",
    "circle",
    "rectangle",
    "manhattan",
    "acute_angle",
    "self_crossing",
    "doubled_vertex",
    "collinear_vertex",
    "zero_area",
    "winding",
    "vertices_max",
    "closed",
    "on_lattice",
    "grid",
    "exposure_grid",
    "gap_min",
    "gap_aspect_max",
    "overlap",
    "duplicate",
    "fill",
    "fill_gradient",
    "field_cut",
    "field_in_lens",
    "aperture_margin",
    "metal_on_pillars",
    "aperture_each",
    "mark_keep_out",
    "marks_complete",
    "layers_known",
    "active_area",
    "no_text_exposed",
    "cell_names",
    "depth_max",
    "references_max",
    "one_top",
    "dangling",
    "recursive",
    "cell_twice",
    "bytes_behind_end",
    "file_size",
    "shape_count",
    "write_time",
    "pillar_count",
    "width_map",
    "phase_step",
    "lattice_orders",
];

/// Content of a deck file.
struct DeckContents {
    name: String,
    pillars: Vec<LayerNumber>,
    rules: Vec<DeckRule>,
}

fn read(root: &Section<'_, '_>, known: &Known<'_>) -> DeckContents {
    root.integer("schema", SCHEMA..=SCHEMA, "");
    let name = root.text("name");
    let section = root.section("layers");
    let mut layers = BTreeMap::new();
    let mut pillars = Vec::new();
    let number = |key: &str, text: &str| {
        parse_layer(text).unwrap_or_else(|| {
            section.fault(
                key,
                format!("\"{}\" is not a layer", quoted(text)),
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
    if let Some(&first) = pillars.first() {
        layers.insert("pillars".into(), first);
    } else {
        section.text("pillars");
        pillars.extend(layers.get("pillars"));
    }
    section.finish();
    if let Some(own) = known.layers {
        layers.values_mut().for_each(|layer| *layer = NO_LAYER);
        let marks = own.marks.unwrap_or(NO_LAYER);
        layers.extend([("pillars".to_owned(), own.pillars), ("marks".to_owned(), marks)]);
        pillars = vec![own.pillars];
    }
    let stated_nm = root.float("pillar_height_nm", Limits::new(1.0..=100_000.0, "nm"));
    let sections = root.sections("rule");
    let mut context = Context {
        layers,
        pillars: pillars.first().copied().unwrap_or_default(),
        height_nm: known.height_nm.unwrap_or(stated_nm),
        covered: Vec::new(),
    };
    context.covered = sections
        .iter()
        .map(|s| {
            let check = CHECKS.into_iter().find(|check| s.is_one_of("check", &[check]));
            (check.unwrap_or_default().to_owned(), context.some_layers(s))
        })
        .collect();
    if sections.len() > MOST_RULES {
        root.fault(
            "rule",
            format!("{} rules, at most {MOST_RULES}", sections.len()),
            "split the deck and check with each part",
        );
    }
    let mut ids = BTreeSet::new();
    let mut rules: Vec<DeckRule> = Vec::new();
    for s in sections.iter().take(MOST_RULES) {
        if let Some(mut rule) = read_rule(s, &context, &mut ids) {
            rule.always &= !known.of_a_design.contains(&rule.check.as_str());
            rules.push(rule);
        }
        s.finish();
    }
    if sections.is_empty() {
        root.fault("rule", "the deck has no rules", "add one or more [[rule]] sections");
    }
    DeckContents { name, pillars, rules }
}

fn read_rule(s: &Section<'_, '_>, context: &Context, ids: &mut BTreeSet<String>) -> Option<DeckRule> {
    let (id, check) = (
        s.text("id"),
        s.choice("check", &CHECKS.map(|check| (check, check)), None),
    );
    if s.has("id") && !legal_id(&id) {
        s.fault(
            "id",
            format!("\"{}\" is not an id", id.escape_debug()),
            format!("use letters, digits and _ - ., at most {LONGEST_ID} characters"),
        );
    }
    if !ids.insert(id.clone()) {
        s.fault("id", format!("a second rule `{id}`"), "give every rule its own id");
    }
    let severities = [
        ("error", Severity::Error),
        ("warning", Severity::Warning),
        ("note", Severity::Note),
    ];
    let severity = s.choice("severity", &severities, Some(Severity::Error));
    let always = s.choice("when", &[("always", true), ("design", false)], Some(true));
    let families: [Family; 12] = [
        width::read,
        outline::read,
        grids::read,
        spacing::read,
        density::read,
        write_fields::read,
        aperture::read,
        marks::read,
        layers::read,
        tree::read,
        budget::read,
        design::read,
    ];
    // The check that stands in for an unknown one has other keys.
    if !s.sound(&["rule.check"]) {
        return None;
    }
    let rule = families.iter().find_map(|read| read(check, s, context))?;
    Some(DeckRule {
        id,
        check: check.to_owned(),
        severity,
        always,
        rule,
    })
}

/// Ids name rules in reports of several formats, and their parts between dots are nested categories in one.
fn legal_id(id: &str) -> bool {
    (1..=LONGEST_ID).contains(&id.len()) && id.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c))
}

/// Reads a rule of one family; none if the check is of another.
type Family = fn(&str, &Section<'_, '_>, &Context) -> Option<Box<dyn Rule>>;

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
    use metalith_pillars::RotatedRectangles;

    #[test]
    fn the_decks_of_the_program_are_sound() {
        assert!(SHIPPED.files().count() > 10);
        for file in SHIPPED.files() {
            assert!(!Deck::shipped(file.path()).unwrap().rules().is_empty());
        }
        let deck = Deck::standard();
        assert!(deck.rules().len() > 30);
        assert!(deck.rules().iter().any(|r| !r.always));
        let rectangle = RotatedRectangles {
            width_nm: 90,
            length_nm: 240,
            steps: 180,
        };
        let rectangle = PillarShape::Rectangle(rectangle.into());
        for (name, shape) in PillarShape::CHOICES.into_iter().chain([("rectangle", rectangle)]) {
            let deck = Deck::for_shape(shape);
            assert!(deck.rules().iter().any(|r| r.check == name), "{name}: {}", deck.name);
        }
    }

    /// Every shipped rule for the grid follows the database unit; nothing else changes.
    #[test]
    fn the_grid_of_a_deck_is_the_database_unit_of_the_design() {
        for file in SHIPPED.files() {
            let words = |unit| -> Vec<(String, String)> {
                let deck = Deck::shipped(file.path()).unwrap().on_grid(unit);
                let rules = deck.rules().iter();
                rules.map(|r| (r.check.clone(), r.rule.words())).collect()
            };
            let changed = words(DatabaseUnit::Quarter);
            for (known, new) in words(DatabaseUnit::Nanometre).into_iter().zip(changed) {
                if known.0 == "grid" {
                    assert_eq!(new.1, "vertices are on a grid of 0.25 nm");
                } else {
                    assert_eq!(new, known);
                }
            }
        }
    }

    #[test]
    fn rules_about_proportions_use_the_height_of_a_design() {
        let text = metalith_testing::accepting(&metalith_testing::changed(
            "mini_3x3",
            &[("pillar_height_nm = 700", "pillar_height_nm = 5100")],
        ));
        let design = Design::parse(&metalith_testing::design("mini_3x3"), &text).unwrap();
        let passes = |deck: &Deck| {
            let aspect = deck.rules().iter().find(|r| r.check == "aspect_max").unwrap();
            aspect.rule.passes_square(100.0, true)
        };
        // 1 : 7 and 1 : 51.
        let deck = Deck::standard();
        assert!(passes(&deck));
        assert!(!passes(&deck.for_pillars_of(&design)));
    }

    #[test]
    fn mistakes_have_places() {
        let text = "schema = 1\nname = \"x\"\npillar_height_nm = 700\n[layers]\npillars = \"1-0\"\n\
                    [[rule]]\nid = \"a\"\ncheck = \"gap_min\"\n[[rule]]\nid = \"a\"\ncheck = \"wings\"\n\
                    [[rule]]\nid = \"b\"\ncheck = \"on_lattice\"\nfrom = \"layout\"\n";
        let error = Deck::parse(Path::new("deck.toml"), text.into()).unwrap_err();
        insta::assert_snapshot!(error, @r#"
            deck.toml:5:11: "1-0" is not a layer
              help: write layer and datatype as "1/0"
            deck.toml:6:1: [rule] lacks `nm`
              help: add `nm`: a number from 0 to 1000000 nm
            deck.toml:10:6: a second rule `a`
              help: give every rule its own id
            deck.toml:11:9: `check` cannot be "wings"
              help: use one of: width_min, width_max, aspect_max, width_library, square, circle, rectangle, manhattan, acute_angle, self_crossing, doubled_vertex, collinear_vertex, zero_area, winding, vertices_max, closed, on_lattice, grid, exposure_grid, gap_min, gap_aspect_max, overlap, duplicate, fill, fill_gradient, field_cut, field_in_lens, aperture_margin, metal_on_pillars, aperture_each, mark_keep_out, marks_complete, layers_known, active_area, no_text_exposed, cell_names, depth_max, references_max, one_top, dangling, recursive, cell_twice, bytes_behind_end, file_size, shape_count, write_time, pillar_count, width_map, phase_step, lattice_orders
            deck.toml:15:8: `from` cannot be "layout"
              help: use one of: design
            "#);
        assert_eq!(
            error.ids(),
            [
                "layers.pillars/inconsistent",
                "rule#0.nm/missing",
                "rule#1.id/inconsistent",
                "rule#1.check/unknown-choice",
                "rule#2.from/unknown-choice"
            ]
        );
    }
}
