//! The keys that a reader of text files knows, found by letting it read.
//!
//! A reader asks a [`Section`](super::Section) for one key after the other. Each question is noted here: the form of the value, its
//! limits, whether the key must be there, and the value where it is left out. Thus the table of keys, and what is made of it for
//! editors, is the reader itself and no second list. Which keys a reader asks for depends on values that it has read:
//! [`explore`] gives it files with each of them.

mod explore;
mod forms;

use std::collections::BTreeMap;

pub use explore::explore;
pub use forms::{Forms, ListForm};

use super::Scalar;

/// Keys of a section that a reader knows.
#[derive(Clone, Debug, Default)]
pub struct KeyTable {
    keys: BTreeMap<String, Key>,
    others: OtherKeys,
    /// Number of times that a reader came to such a section.
    visits: usize,
}

/// Rule for keys of a section whose names the reader does not state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OtherKeys {
    /// Mistakes.
    #[default]
    Refused,
    /// Keys that the user names; all are read like the key [`KeyTable::OF_THE_USER`].
    Named,
    /// Keys for other readers, of which nothing is known.
    Ignored,
}

/// One key of a section.
#[derive(Clone, Debug, Default)]
pub struct Key {
    /// Forms that its value may have.
    pub forms: Forms,
    /// Keys of the section, or of each of the sections, that its value is.
    pub table: KeyTable,
    /// False of a key that is only looked for, to refuse it or to find out which kind of file this is.
    is_known: bool,
    /// Number of visits of the section in which it had to be there.
    required: usize,
    defaults: Defaults,
}

/// Values that a reader takes where a key is left out.
#[derive(Clone, Debug, Default, PartialEq)]
enum Defaults {
    #[default]
    None,
    One(Scalar),
    /// Depends on other values.
    Several,
}

impl KeyTable {
    /// Name that stands for any name in a section whose keys the user names.
    pub const OF_THE_USER: &str = "any_name";

    /// The keys that a file may have here, in the order of the alphabet; those that the user names are not among them.
    pub fn keys(&self) -> impl Iterator<Item = (&str, &Key)> {
        let is_named = |name: &str| self.others != OtherKeys::Named || name != Self::OF_THE_USER;
        let known = self
            .keys
            .iter()
            .filter(move |(name, key)| key.is_known && is_named(name));
        known.map(|(name, key)| (name.as_str(), key))
    }

    /// The key of this name, if a file may have it.
    pub fn key(&self, name: &str) -> Option<&Key> {
        self.keys.get(name).filter(|key| key.is_known)
    }

    /// Rule for keys whose names the reader does not state.
    pub fn others(&self) -> OtherKeys {
        self.others
    }

    /// True if a key must be there, whatever other values are.
    pub fn requires(&self, name: &str) -> bool {
        self.keys
            .get(name)
            .is_some_and(|key| self.visits > 0 && key.required == self.visits)
    }

    pub(super) fn visit(&mut self) {
        self.visits += 1;
    }

    pub(super) fn open(&mut self, others: OtherKeys) {
        self.others = others;
    }

    /// Table of a section by its path from the top, as `verify.limits`.
    pub(super) fn section_mut(&mut self, path: &str) -> &mut Self {
        let parts = path.split('.').filter(|part| !part.is_empty());
        parts.fold(self, |table, part| &mut table.key_mut(part).table)
    }

    pub(super) fn key_mut(&mut self, name: &str) -> &mut Key {
        self.keys.entry(name.to_owned()).or_default()
    }

    /// Add what another reading has found. True if it says anything that is new, other than how often.
    fn merge(&mut self, other: Self) -> bool {
        self.visits += other.visits;
        let mut is_new = other.others != OtherKeys::Refused && self.others != other.others;
        if is_new {
            self.others = other.others;
        }
        for (name, key) in other.keys {
            is_new |= !self.keys.contains_key(&name);
            is_new |= self.key_mut(&name).merge(key);
        }
        is_new
    }
}

impl Key {
    /// Value that a reader takes where the key is left out, if it is one whatever other values are.
    pub fn default(&self) -> Option<&Scalar> {
        match &self.defaults {
            Defaults::One(value) => Some(value),
            Defaults::None | Defaults::Several => None,
        }
    }

    pub(super) fn know(&mut self) {
        self.is_known = true;
    }

    pub(super) fn require(&mut self) {
        self.is_known = true;
        self.required += 1;
    }

    pub(super) fn left_out_is(&mut self, value: Scalar) {
        self.defaults.add(value);
    }

    fn merge(&mut self, other: Self) -> bool {
        self.required += other.required;
        let is_new = other.is_known && !self.is_known;
        self.is_known |= other.is_known;
        match other.defaults {
            Defaults::None => {}
            Defaults::One(value) => self.defaults.add(value),
            Defaults::Several => self.defaults = Defaults::Several,
        }
        let has_forms = self.forms.merge(other.forms);
        self.table.merge(other.table) || has_forms || is_new
    }
}

impl Defaults {
    fn add(&mut self, value: Scalar) {
        match self {
            Self::None => *self = Self::One(value),
            Self::One(known) if *known == value => {}
            Self::One(_) | Self::Several => *self = Self::Several,
        }
    }
}

#[cfg(test)]
mod tests;
