//! Contents of the layers of a layout, in words: for those who name the wrong layer.

use std::collections::BTreeMap;

use super::counter::KindTally;
use crate::{LayerNumber, Layout, Point, Result, Selection, Shape, Text, Transform, Visitor};
use metalith_core::Progress;
use metalith_core::text::count;

/// Layers that are named, at most.
const MOST_LAYERS: usize = 8;

/// Contents of each layer: what its areas are, and the number of its texts.
#[derive(Default)]
struct Contents {
    unit_nm: f64,
    layers: BTreeMap<LayerNumber, (KindTally, u64)>,
    points: Vec<Point>,
}

impl Visitor for Contents {
    fn shape(&mut self, shape: &Shape<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.points.clear();
        self.points.extend(shape.outline.points());
        let (kinds, _) = self.layers.entry(shape.layer).or_default();
        kinds.outline(&self.points, self.unit_nm, placements.len() as u64);
        Ok(())
    }

    fn text(&mut self, text: &Text<'_>, placements: &[Transform]) -> metalith_core::Result<()> {
        self.layers.entry(text.layer).or_default().1 += placements.len() as u64;
        Ok(())
    }
}

/// Words such as `10/0: 4,427 squares; 20/0: 3 polygons; text on 63/0`; fullest layers first.
pub(crate) fn words(layout: &Layout, from: &Selection, progress: &dyn Progress) -> Result<String> {
    let mut contents = Contents {
        unit_nm: layout.unit_nm(),
        ..Contents::default()
    };
    let all = Selection {
        layers: None,
        ..from.clone()
    };
    layout.visit(&all, &mut contents, progress)?;
    let shapes = |kinds: &KindTally| kinds.named().map(|(n, _)| n).iter().sum::<u64>();
    let mut layers: Vec<_> = contents
        .layers
        .iter()
        .filter(|(_, (kinds, _))| shapes(kinds) > 0)
        .collect();
    layers.sort_by_key(|(layer, (kinds, _))| (std::cmp::Reverse(shapes(kinds)), **layer));
    let holds = |(layer, (kinds, _)): &(&LayerNumber, &(KindTally, u64))| {
        let each = kinds.named().into_iter().filter(|(n, _)| *n > 0);
        let words: Vec<String> = each
            .map(|(n, word)| format!("{} {word}{}", count(n), if n == 1 { "" } else { "s" }))
            .collect();
        format!("{layer}: {}", words.join(", "))
    };
    let mut parts: Vec<String> = layers.iter().take(MOST_LAYERS).map(holds).collect();
    if layers.len() > MOST_LAYERS {
        parts.push(format!("{} more layers", layers.len() - MOST_LAYERS));
    }
    let texts: Vec<String> = (contents.layers.iter().filter(|(_, (_, texts))| *texts > 0))
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
