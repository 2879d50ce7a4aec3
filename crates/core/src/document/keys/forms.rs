//! The forms that the value of a key may have.

use std::ops::RangeInclusive;

use toml::{Table, Value};

use super::super::Limits;

/// Forms of a value: one, or several where readers accept several.
#[derive(Clone, Debug, Default)]
pub struct Forms {
    /// Smallest and largest number.
    pub number: Option<[f64; 2]>,
    /// Smallest and largest whole number.
    pub integer: Option<[i64; 2]>,
    /// Any text.
    pub text: bool,
    /// A text that is one of these words.
    pub words: Vec<String>,
    /// `true` or `false`.
    pub switch: bool,
    pub list: Option<Box<ListForm>>,
    /// A table `[key]`.
    pub section: bool,
    /// Tables `[[key]]`.
    pub sections: bool,
    /// Units of the numbers, each once.
    pub units: Vec<&'static str>,
}

/// Form of a list.
#[derive(Clone, Debug, Default)]
pub struct ListForm {
    pub items: Forms,
    /// Number of items, if only one number is accepted.
    pub length: Option<usize>,
}

impl Forms {
    pub(in crate::document) fn of_number(limits: &Limits) -> Self {
        Self {
            number: Some([*limits.range.start(), *limits.range.end()]),
            units: units(limits.unit),
            ..Self::default()
        }
    }

    pub(in crate::document) fn of_integer(range: &RangeInclusive<i64>, unit: &'static str) -> Self {
        Self {
            integer: Some([*range.start(), *range.end()]),
            units: units(unit),
            ..Self::default()
        }
    }

    pub(in crate::document) fn of_text() -> Self {
        Self {
            text: true,
            ..Self::default()
        }
    }

    pub(in crate::document) fn of_words<'w>(words: impl Iterator<Item = &'w str>) -> Self {
        Self {
            words: words.map(str::to_owned).collect(),
            ..Self::default()
        }
    }

    /// Numbers, texts, and switches.
    pub(in crate::document) fn of_scalar() -> Self {
        Self {
            number: Some([f64::MIN, f64::MAX]),
            text: true,
            switch: true,
            ..Self::default()
        }
    }

    pub(in crate::document) fn of_list(items: Self, length: Option<usize>) -> Self {
        Self {
            list: Some(Box::new(ListForm { items, length })),
            ..Self::default()
        }
    }

    pub(in crate::document) fn of_section() -> Self {
        Self {
            section: true,
            ..Self::default()
        }
    }

    pub(in crate::document) fn of_sections() -> Self {
        Self {
            sections: true,
            ..Self::default()
        }
    }

    /// Accept these forms too. True if a form or a word is new: wider limits alone are not.
    pub(in crate::document) fn merge(&mut self, other: Self) -> bool {
        let mut is_new = false;
        for (own, others) in [
            (&mut self.text, other.text),
            (&mut self.switch, other.switch),
            (&mut self.section, other.section),
            (&mut self.sections, other.sections),
        ] {
            is_new |= others && !*own;
            *own |= others;
        }
        is_new |= self.number.is_none() && other.number.is_some();
        is_new |= self.integer.is_none() && other.integer.is_some();
        widen(&mut self.number, other.number);
        widen(&mut self.integer, other.integer);
        is_new |= add(&mut self.words, other.words);
        add(&mut self.units, other.units);
        match (&mut self.list, other.list) {
            (Some(own), Some(others)) => {
                // A list of any length: one that a wider question allows.
                let length = own.length.filter(|length| others.length == Some(*length));
                own.length = length;
                is_new |= own.items.merge(others.items);
            }
            (own @ None, Some(others)) => {
                *own = Some(others);
                is_new = true;
            }
            (_, None) => {}
        }
        is_new
    }

    /// Units of the numbers, or of those in a list.
    pub fn units_of_items(&self) -> &[&'static str] {
        match &self.list {
            Some(list) if self.units.is_empty() => &list.items.units,
            _ => &self.units,
        }
    }

    /// Values of these forms that a reader may distinguish: each word, and the limits of numbers.
    pub(super) fn examples(&self) -> Vec<Value> {
        /// Numbers beyond it are no limits of a quantity.
        const LARGEST: f64 = 1e9;
        let mut examples: Vec<Value> = self.words.iter().map(|word| word.as_str().into()).collect();
        if self.text {
            examples.push("a".into());
        }
        if let Some([low, high]) = self.integer {
            examples.extend([low, high].map(|v| Value::from(v.clamp(-LARGEST as i64, LARGEST as i64))));
        }
        if let Some([low, high]) = self.number {
            examples.extend([low, high].map(|v| Value::from(v.clamp(-LARGEST, LARGEST))));
        }
        if self.switch {
            examples.extend([true, false].map(Value::from));
        }
        if let Some(list) = &self.list {
            let items = list.items.examples();
            examples.extend(
                items
                    .into_iter()
                    .map(|item| Value::from(vec![item; list.length.unwrap_or(2)])),
            );
        }
        if self.section {
            examples.push(Table::new().into());
        }
        if self.sections {
            examples.push(vec![Table::new()].into());
        }
        // A key that was only looked for: its reader says more once it is there.
        if examples.is_empty() {
            examples.push(1.into());
        }
        examples
    }
}

fn units(unit: &'static str) -> Vec<&'static str> {
    if unit.is_empty() { Vec::new() } else { vec![unit] }
}

/// Extend a range to hold another one.
fn widen<T: Copy + PartialOrd>(own: &mut Option<[T; 2]>, other: Option<[T; 2]>) {
    let Some([low, high]) = other else { return };
    let least = own.map_or(low, |[own, _]| if low < own { low } else { own });
    let most = own.map_or(high, |[_, own]| if high > own { high } else { own });
    *own = Some([least, most]);
}

/// Add what is not yet there. True if anything was added.
fn add<T: PartialEq>(own: &mut Vec<T>, others: Vec<T>) -> bool {
    let before = own.len();
    for other in others {
        if !own.contains(&other) {
            own.push(other);
        }
    }
    own.len() > before
}
