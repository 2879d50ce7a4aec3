//! A deck of what a layout keeps: pitch, widths and gaps found in it.

use std::fmt::Write;
use std::path::Path;

use super::deck::Deck;
use super::input::CheckInput;
use super::measure::{Measures, measure};
use super::rule::Status;
use metalith_core::{Error, Progress, Result};
use metalith_gds::{LayerNumber, Layout, USUAL_LAYER};
use metalith_report::{counted, exact};

/// Steps of a nanometre that a gap is rounded down to.
const GAP_STEPS: f64 = 100.0;

/// Decks that are tried: rules that a layout breaks are taken out of the first.
const TRIES: usize = 3;

/// A deck that was written from a layout.
#[derive(Clone, Debug)]
pub struct NewRules {
    /// The text of the file.
    pub text: String,
    pub in_force: usize,
    /// Rules that the layout breaks, which the file has as comments.
    pub left_out: usize,
}

/// One rule of the new deck.
struct NewRule {
    comment: String,
    id: &'static str,
    lines: Vec<String>,
    /// Reason why it is a comment.
    broken: Option<String>,
}

impl NewRule {
    fn new(id: &'static str, comment: impl Into<String>, lines: &[String]) -> Self {
        Self {
            comment: comment.into(),
            id,
            lines: lines.to_vec(),
            broken: None,
        }
    }

    fn write(&self, out: &mut String) {
        let _ = writeln!(out, "\n# {}", self.comment);
        let mark = if let Some(why) = &self.broken {
            let _ = writeln!(out, "# Left out: {why}.");
            "# "
        } else {
            ""
        };
        let _ = writeln!(out, "{mark}[[rule]]\n{mark}id = \"{}\"", self.id);
        for line in &self.lines {
            let _ = writeln!(out, "{mark}{line}");
        }
    }
}

/// The deck of what a layout keeps, for pillars on a layer; on the layer with most squares, rectangles and circles if none is
/// named. Widths are known of layouts of [`Layout::open_counted`].
///
/// # Errors
/// If the layout cannot be read, or has no shapes that may be pillars.
pub fn new_rules(layout: &Layout, layer: Option<LayerNumber>, progress: &dyn Progress) -> Result<NewRules> {
    let pillars = match layer {
        Some(layer) => layer,
        None => pillar_layer(layout, progress)?,
    };
    let found = measure(layout, pillars, progress)?;
    let mut rules = rules(layout, pillars, &found);
    let path = Path::new("new rules");
    for _ in 0..TRIES {
        let text = written(layout, pillars, &found, &rules);
        let deck = Deck::of_text(path, text.clone())?;
        let input = CheckInput::default();
        let report = super::check(layout, &deck, &input, progress)?;
        let mut changed = false;
        for judged in &report.rules {
            let why = match &judged.status {
                Status::Run if judged.open() > 0 => Some(counted(judged.open() as usize, "violation")),
                Status::Skipped(why) | Status::Failed(why) => Some(why.clone()),
                _ => None,
            };
            let rule = rules.iter_mut().find(|rule| rule.id == judged.id);
            if let (Some(why), Some(rule)) = (why, rule) {
                rule.broken = Some(why.lines().next().unwrap_or_default().to_owned());
                changed = true;
            }
        }
        if !changed {
            let left_out = rules.iter().filter(|rule| rule.broken.is_some()).count();
            return Ok(NewRules {
                text,
                in_force: rules.len() - left_out,
                left_out,
            });
        }
    }
    Err(Error::refused(
        "check/no-rules",
        format!("{} keeps no rule", layout.path().display()),
        "see what it holds with `metalith info`",
    ))
}

/// The layer of the pillars; where several may be meant, the one with most shapes that may be pillars: rules say something of any
/// layer.
pub(super) fn pillar_layer(layout: &Layout, progress: &dyn Progress) -> Result<LayerNumber> {
    let cause = match layout.pillar_layer(progress) {
        Err(cause @ metalith_gds::Error::Extraction { .. }) => cause,
        other => return Ok(other?),
    };
    let layers = layout.drawn_layers();
    let most = layers.iter().max_by_key(|&&layer| {
        let kinds = layout.kinds_on(layer);
        // Of two layers the first.
        (kinds.pillar_like(), std::cmp::Reverse(layer))
    });
    let most = most.copied().unwrap_or(USUAL_LAYER);
    progress.warn(&format!(
        "note: {cause}; layer {most} is checked as that of the pillars: --layer names another"
    ));
    Ok(most)
}

/// Name of a layer in the deck.
fn name(layer: LayerNumber, pillars: LayerNumber) -> String {
    if layer == pillars {
        return "pillars".into();
    }
    format!("layer_{}_{}", layer.layer, layer.datatype)
}

/// Head and rules of the file.
fn written(layout: &Layout, pillars: LayerNumber, found: &Measures, rules: &[NewRule]) -> String {
    let mut out = String::new();
    let file = layout.path().file_name().unwrap_or_default().to_string_lossy();
    let file = metalith_core::text::printable(&file).replace(['"', '\\'], "_");
    let _ = writeln!(
        out,
        "# Rules that {file} keeps, written by `metalith check --new-rules`. The limits are what this layout holds:\n\
         # {} in {}, and {} off every lattice.\n\
         # Replace them by what your process makes, and check the next layout with --rules.\n\
         schema = 1\n\
         name = \"As in {file}\"\n\
         pillar_height_nm = 1000           # no layout tells the height: give yours, for rules about aspect ratios\n\n\
         [layers]",
        counted(found.pillars as usize, "pillar"),
        counted(found.elements, "element"),
        counted(found.loose as usize, "shape"),
    );
    for layer in layout.used_layers() {
        let _ = writeln!(out, "{} = \"{layer}\"", name(layer, pillars));
    }
    rules.iter().for_each(|rule| rule.write(&mut out));
    out
}

/// Rules with the limits of the layout, whether it keeps them or not.
fn rules(layout: &Layout, pillars: LayerNumber, found: &Measures) -> Vec<NewRule> {
    let check = |name: &str| format!("check = \"{name}\"");
    let plain = |id, comment: &str, name: &str| NewRule::new(id, comment, &[check(name)]);
    let unit = layout.unit_nm();
    let all: Vec<String> = layout.used_layers().into_iter().map(|l| name(l, pillars)).collect();
    let listed = |layers: &[String]| {
        format!(
            "layers = [{}]",
            layers.iter().map(|l| format!("\"{l}\"")).collect::<Vec<_>>().join(", ")
        )
    };
    let shape = found.shape.plural().trim_end_matches('s');
    let mut rules = vec![NewRule::new(
        "pillar.shape",
        format!("Pillars are {}.", found.shape.plural()),
        &[check(shape)],
    )];
    if let Some([smallest, largest]) = layout.kinds_on(pillars).sides_nm(unit) {
        let limit = |name, nm: f64| [check(name), format!("nm = {nm}")];
        let width = |id, words: String, name, nm| NewRule::new(id, words, &limit(name, nm));
        rules.push(width(
            "pillar.width.min",
            format!("The smallest side is {} nm.", exact(smallest)),
            "width_min",
            smallest,
        ));
        rules.push(width(
            "pillar.width.max",
            format!("The largest side is {} nm.", exact(largest)),
            "width_max",
            largest,
        ));
    }
    if let [pitch] = found.pitches_nm[..] {
        let lines = [check("on_lattice"), format!("pitch_nm = {pitch}")];
        let words = format!("Pillars stand on lattices of {} nm.", exact(pitch));
        rules.push(NewRule::new("pillar.lattice", words, &lines));
    }
    if let Some(gap) = found.gap_nm {
        let nm = (gap * GAP_STEPS).floor() / GAP_STEPS;
        let lines = [check("gap_min"), format!("nm = {nm}")];
        let words = format!("The smallest gap is {} nm.", exact(gap));
        rules.push(NewRule::new("gap.min", words, &lines));
    }
    rules.push(plain("gap.overlap", "No two shapes share area.", "overlap"));
    rules.push(plain("gap.duplicate", "No shape is there twice.", "duplicate"));
    let coarse = [1.0, unit].into_iter().find(|step| *step >= unit).unwrap_or(unit);
    rules.push(NewRule::new(
        "outline.grid",
        "Corners are on a grid.",
        &[check("grid"), listed(&all), format!("nm = {coarse}")],
    ));
    for (id, comment, name) in [
        ("outline.self_crossing", "No outline crosses itself.", "self_crossing"),
        (
            "outline.doubled_vertex",
            "No corner is there twice in a row.",
            "doubled_vertex",
        ),
        ("outline.zero_area", "Every outline has area.", "zero_area"),
        ("outline.closed", "Every outline ends where it begins.", "closed"),
        ("layer.known", "No other layer is used.", "layers_known"),
    ] {
        rules.push(NewRule::new(id, comment, &[check(name), listed(&all)]));
    }
    let exposed = [name(pillars, pillars)];
    rules.push(NewRule::new(
        "layer.text",
        "No text is on the layer of the pillars.",
        &[check("no_text_exposed"), listed(&exposed)],
    ));
    for (id, comment, name) in [
        ("cell.one_top", "There is one cell at the top.", "one_top"),
        ("cell.dangling", "Every reference leads to a cell.", "dangling"),
        ("cell.recursive", "No cell contains itself.", "recursive"),
    ] {
        rules.push(plain(id, comment, name));
    }
    rules
}
