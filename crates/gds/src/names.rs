//! Names of cells as small numbers.

use std::collections::HashMap;

use super::oasis::numbered;

const SLOTS: usize = 1024;

/// Names met so far, numbered in the order they were met.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    list: Vec<Box<[u8]>>,
    numbers: HashMap<Box<[u8]>, u32>,
    bytes: usize,
}

impl Names {
    /// Bytes of all names.
    pub(crate) fn bytes(&self) -> usize {
        self.bytes
    }

    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    pub(crate) fn name(&self, number: u32) -> &[u8] {
        &self.list[number as usize]
    }

    /// The number of a name, if it was met.
    pub(crate) fn find(&self, name: &[u8]) -> Option<u32> {
        self.numbers.get(name).copied()
    }

    /// Names with numbered ones replaced by those of `table`, found by either, and for each number of before its
    /// number now: that of the first with the same name. One that is not in the table is called by its number.
    pub(crate) fn resolve(&self, table: &HashMap<u64, Vec<u8>>) -> (Self, Vec<u32>) {
        let mut resolved = Self::default();
        let renumbered = self.list.iter().map(|name| match numbered(name) {
            None => resolved.number(name),
            Some(number) => {
                let unnamed = || format!("#{number}").into_bytes();
                let now = resolved.number(&table.get(&number).cloned().unwrap_or_else(unnamed));
                resolved.numbers.insert(name.clone(), now);
                now
            }
        });
        let renumbered = renumbered.collect();
        (resolved, renumbered)
    }

    /// The number of a name, a new one if it is new.
    pub(crate) fn number(&mut self, name: &[u8]) -> u32 {
        if let Some(number) = self.find(name) {
            return number;
        }
        let number = self.list.len() as u32;
        self.bytes += name.len();
        self.list.push(name.into());
        self.numbers.insert(name.into(), number);
        number
    }
}

/// Numbers of short names found lately, by key ([`super::pillar_records::Reference`]): the millions of references of
/// a layout go to a few hundred cells.
pub(super) struct Recent(Vec<(u64, u32)>);

impl Recent {
    pub(crate) fn new() -> Self {
        Self(vec![(0, 0); SLOTS])
    }

    /// The number of the name with this key, asked of `find` if it was not met lately.
    #[inline]
    pub(crate) fn number(&mut self, key: u64, find: impl FnOnce(&[u8]) -> u32) -> u32 {
        let slot = &mut self.0[(key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 54) as usize % SLOTS];
        if slot.0 != key {
            let bytes = key.to_le_bytes();
            *slot = (key, find(&bytes[..8 - key.leading_zeros() as usize / 8]));
        }
        slot.1
    }
}
