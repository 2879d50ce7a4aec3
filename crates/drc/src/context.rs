//! Context that the sections of a deck share: names of its layers, and the layers of each check.

use std::collections::BTreeMap;

use metalith_core::document::Section;
use metalith_gds::LayerNumber;

/// Context of a check: what rules of all families ask of the file.
pub(super) struct Context {
    pub layers: BTreeMap<String, LayerNumber>,
    pub pillars: LayerNumber,
    pub height_nm: f64,
    /// Checks of the deck with the layers they look at, so that the most serious rule reports a defect.
    pub covered: Vec<(String, Vec<LayerNumber>)>,
}

impl Context {
    /// The layer named by `layer`, the pillars if left out.
    pub(crate) fn layer(&self, s: &Section<'_, '_>, key: &str) -> LayerNumber {
        match s.optional_text(key) {
            None => self.pillars,
            Some(name) => self.named(s, key, &name),
        }
    }

    /// The layers named by `layers`, the pillars if left out.
    pub(crate) fn some_layers(&self, s: &Section<'_, '_>) -> Vec<LayerNumber> {
        if s.has("layers") {
            s.texts("layers").iter().map(|n| self.named(s, "layers", n)).collect()
        } else {
            vec![self.pillars]
        }
    }

    /// True if the deck has this check on this layer.
    pub(crate) fn covers(&self, check: &str, layer: LayerNumber) -> bool {
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
