//! Contents of the layers of a layout, in words: for those who name the wrong layer.

use std::collections::BTreeMap;

use crate::{LayerNumber, Layout, Result, Selection, Shape, Text, Transform, Visitor};
use metalith_core::Progress;

/// Kinds of shapes that are counted, and the words for one and for several.
const KINDS: [[&str; 2]; 4] = [
    ["square", "squares"],
    ["circle", "circles"],
    ["rectangle", "rectangles"],
    ["polygon", "polygons"],
];
/// Layers that are named, at most.
const MOST_LAYERS: usize = 8;

#[derive(Default)]
struct Counter(BTreeMap<LayerNumber, Content>);

/// Content of one layer.
#[derive(Default)]
struct Content {
    shapes: [u64; 4],
    texts: u64,
}

impl Visitor for Counter {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        let kind = match (&shape.rect, &shape.circle) {
            (Some(rect), _) if rect.width() == rect.height() => 0,
            (Some(_), _) => 2,
            (None, Some(_)) => 1,
            (None, None) => 3,
        };
        self.0.entry(shape.layer).or_default().shapes[kind] += placements.len() as u64;
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.0.entry(text.layer).or_default().texts += placements.len() as u64;
        Ok(())
    }
}

/// Words such as `10/0: 4,427 squares; 20/0: 3 polygons; text on 63/0`; fullest layers first.
pub(crate) fn words(layout: &Layout, from: &Selection, progress: &dyn Progress) -> Result<String> {
    let mut counter = Counter::default();
    let all = Selection {
        layers: None,
        ..from.clone()
    };
    layout.visit(&all, &mut counter, progress)?;
    let mut layers: Vec<_> = counter.0.iter().filter(|(_, c)| c.shapes != [0; 4]).collect();
    layers.sort_by_key(|(layer, content)| (std::cmp::Reverse(content.shapes.iter().sum::<u64>()), **layer));
    let holds = |(layer, content): &(&LayerNumber, &Content)| {
        let each = content.shapes.iter().zip(KINDS).filter(|(n, _)| **n > 0);
        let words: Vec<String> = each
            .map(|(n, [one, several])| format!("{} {}", grouped(*n), if *n == 1 { one } else { several }))
            .collect();
        format!("{layer}: {}", words.join(", "))
    };
    let mut parts: Vec<String> = layers.iter().take(MOST_LAYERS).map(holds).collect();
    if layers.len() > MOST_LAYERS {
        parts.push(format!("{} more layers", layers.len() - MOST_LAYERS));
    }
    let texts: Vec<String> = (counter.0.iter().filter(|(_, c)| c.texts > 0))
        .take(MOST_LAYERS)
        .map(|(layer, _)| layer.to_string())
        .collect();
    if !texts.is_empty() {
        parts.push(format!("text on {}", texts.join(", ")));
    }
    if parts.is_empty() {
        parts.push("nothing".into());
    }
    Ok(parts.join("; "))
}

/// A number with its digits in groups of three.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut words = String::new();
    for (k, digit) in digits.char_indices() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            words.push(',');
        }
        words.push(digit);
    }
    words
}
