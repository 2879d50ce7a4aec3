//! Names of layers as numbers.

use std::collections::{BTreeMap, BTreeSet};

use metalith_core::LayerNumber;
use metalith_core::text::printable_bytes;

/// Layers that a message names.
const NAMED: usize = 12;

/// Numbers of the layers of a drawing. Names that are numbers are these: `7`, `7/1`, `7.1`, `L7`, `L7D1`. Others get the smallest
/// layers from 1 that no name has, in the order of their names.
#[derive(Debug, Default)]
pub(super) struct Layers(BTreeMap<Vec<u8>, LayerNumber>);

/// Number that the name of a layer is.
fn numbered(name: &[u8]) -> Option<LayerNumber> {
    let name = std::str::from_utf8(name).ok()?;
    let (digits, separators): (_, &[char]) = match name.strip_prefix(['L', 'l']) {
        Some(rest) => (rest, &['D', 'd', '/', '.']),
        None => (name, &['/', '.']),
    };
    let whole = |digits: &str| {
        digits
            .bytes()
            .all(|b| b.is_ascii_digit())
            .then(|| digits.parse().ok())?
    };
    let (layer, datatype) = match digits.split_once(separators) {
        Some((layer, datatype)) => (whole(layer)?, whole(datatype)?),
        None => (whole(digits)?, 0),
    };
    Some(LayerNumber::new(layer, datatype))
}

impl Layers {
    pub(super) fn of(names: BTreeSet<Vec<u8>>) -> Self {
        let mut layers: BTreeMap<_, _> = names.iter().filter_map(|n| Some((n.clone(), numbered(n)?))).collect();
        let taken: BTreeSet<u16> = layers.values().map(|l| l.layer).collect();
        let mut free = (1..u16::MAX).filter(|n| !taken.contains(n));
        for name in names {
            // Past the last number all have one.
            layers
                .entry(name)
                .or_insert_with(|| LayerNumber::new(free.next().unwrap_or(u16::MAX), 0));
        }
        Self(layers)
    }

    pub(super) fn number(&self, name: &[u8]) -> LayerNumber {
        self.0.get(name).copied().unwrap_or(LayerNumber::new(0, 0))
    }

    /// Words on which name is which number, for a message.
    pub(super) fn words(&self) -> String {
        let word = |(name, number): (&Vec<u8>, &LayerNumber)| format!("{} is {number}", printable_bytes(name));
        let mut words: Vec<String> = self.0.iter().take(NAMED).map(word).collect();
        if let more @ 1.. = self.0.len().saturating_sub(NAMED) {
            words.push(format!("and {more} more"));
        }
        words.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_numbers_or_get_free_ones() {
        let names = ["0", "PILLARS", "2", "L3D7", "4/5", "6.1", "APERTURE", "L", "70000"];
        let layers = Layers::of(names.iter().map(|n| n.as_bytes().to_vec()).collect());
        let number = |name: &str| layers.number(name.as_bytes()).to_string();
        let found: Vec<String> = names[..8].iter().map(|n| number(n)).collect();
        // In the order of their names: 70000, APERTURE, L, PILLARS.
        assert_eq!(number("70000"), "1/0");
        assert_eq!(found, ["0/0", "8/0", "2/0", "3/7", "4/5", "6/1", "5/0", "7/0"]);
    }
}
