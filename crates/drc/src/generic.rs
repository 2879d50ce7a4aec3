//! The check of a layout of which nothing is known but what it holds: by the rules that every layout of its pillars must keep.

use super::deck::Deck;
use super::input::CheckInput;
use super::new_rules::pillar_layer;
use super::recognition::add_recognition;
use super::report::DrcReport;
use metalith_core::{Progress, Result};
use metalith_gds::{LayerNumber, Layout, USUAL_LAYER};
use metalith_pillars::DatabaseUnit;

/// Word for the shape of most pillars, as in the name of a deck.
fn plural(layout: &Layout, layer: LayerNumber) -> &'static str {
    let kinds = layout.kinds_on(layer);
    let rectangles = kinds.rectangles.saturating_add(kinds.rotated_rectangles);
    if rectangles > kinds.squares.saturating_add(kinds.circles) {
        "rectangles"
    } else if kinds.circles > kinds.squares {
        "circles"
    } else {
        "squares"
    }
}

/// The deck of the program for a layout without a design: squares, circles or rectangles, whichever most of its pillars are, on
/// the grid of its database unit. What they are is known of layouts of [`Layout::open_counted`].
fn deck_of(name: &str, layout: &Layout) -> Deck {
    let deck = Deck::named(name);
    match DatabaseUnit::of_nm(layout.unit_nm()) {
        Some(unit) => deck.on_grid(unit),
        None => deck,
    }
}

/// Check a layout without a design against the deck of the shape of its pillars. They are on `layer`; if it is left out, on that of
/// [`Layout::pillar_layer`], or where several may be meant, on the one with most shapes that may be pillars.
///
/// # Errors
/// As [`super::check`].
pub fn check_generic(
    layout: &Layout,
    layer: Option<LayerNumber>,
    input: &CheckInput<'_>,
    progress: &dyn Progress,
) -> Result<DrcReport> {
    let layer = match layer {
        Some(layer) => layer,
        None => pillar_layer(layout, progress)?,
    };
    let deck_of = |name: &str| {
        let deck = deck_of(name, layout);
        if layer == USUAL_LAYER {
            deck
        } else {
            deck.with_pillars_on(layer)
        }
    };
    let name = plural(layout, layer);
    let deck = deck_of(name);
    let mut report = super::check(layout, &deck, input, progress)?;
    // Pillars may be told apart from other shapes by their lattice alone.
    if report.elements > 0 && report.shape.plural() != name {
        let deck = deck_of(report.shape.plural());
        report = super::check(layout, &deck, input, progress)?;
    }
    add_recognition(&mut report, layout, layer, input, progress)?;
    Ok(report)
}
