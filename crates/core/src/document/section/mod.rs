//! One table of a text file, read key by key.

mod values;
mod words;

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::{Range, RangeInclusive};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::keys::{Forms, Key, KeyTable, OtherKeys};
use super::{Document, FaultKind, renamed};
use crate::text::quoted;
pub(super) use values::number as float_of;
use words::{article, describe, nearest};

/// The values a number may take, with the unit it is in and why the limits are there.
#[derive(Clone, Debug)]
pub struct Limits {
    pub range: RangeInclusive<f64>,
    pub unit: &'static str,
}

impl Limits {
    /// `Limits::new(100.0..=1000.0, "nm")`; the unit may be empty.
    pub const fn new(range: RangeInclusive<f64>, unit: &'static str) -> Self {
        Self { range, unit }
    }
}

/// One table of a document. Every getter records a fault instead of failing and then returns a value
/// inside the limits, so that one reading finds all faults. Keys that nobody asked for are faults too.
///
/// A value inside the limits that takes the place of a wrong one says nothing about what depends on it:
/// [`Section::fault`] is silent about a key whose value is such a one, and checks of one value against another
/// go through [`Section::fault_given`], which is silent if one of them is.
pub struct Section<'d, 't> {
    document: &'d Document<'t>,
    table: &'d DeTable<'t>,
    name: String,
    /// Place from the top of the file: the name, and a number where several sections have it.
    path: String,
    span: Range<usize>,
    asked: RefCell<BTreeSet<String>>,
    /// Keys that were asked for and are not there, with the number of the fault that says so.
    missing: RefCell<BTreeMap<String, usize>>,
    /// Old names of keys and words, each with the new one.
    renamed: RefCell<BTreeMap<String, String>>,
    /// Stands in for a section that is missing: its absence is one fault, not one for each key.
    vacant: bool,
}

impl<'d, 't> Section<'d, 't> {
    pub(super) fn root(document: &'d Document<'t>, table: &'d Spanned<DeTable<'t>>) -> Self {
        let root = Self::new(document, table.get_ref(), String::new(), 0..0);
        root.note_section(KeyTable::visit);
        root
    }

    fn new(document: &'d Document<'t>, table: &'d DeTable<'t>, name: String, span: Range<usize>) -> Self {
        Self {
            document,
            table,
            path: name.clone(),
            name,
            span,
            asked: RefCell::default(),
            missing: RefCell::default(),
            renamed: RefCell::default(),
            vacant: false,
        }
    }

    /// Note something of this section, where the keys that a reader asks for are noted.
    fn note_section(&self, note: impl FnOnce(&mut KeyTable)) {
        if let Some(noted) = &self.document.noted {
            note(noted.borrow_mut().section_mut(&self.name));
        }
    }

    /// Note something of a key of this section.
    fn note(&self, key: &str, note: impl FnOnce(&mut Key)) {
        self.note_section(|table| note(table.key_mut(key)));
    }

    /// Note a form of the value of a key.
    fn note_form(&self, key: &str, form: impl FnOnce() -> Forms) {
        self.note(key, |key| {
            key.forms.merge(form());
        });
    }

    /// Note that a key must be there.
    fn note_required(&self, key: &str) {
        if !self.vacant {
            self.note(key, Key::require);
        }
    }

    /// Record a fault at a key of this section, or at the section itself if the key is absent. Silent where the
    /// value of the key has a fault already and was replaced.
    pub fn fault(&self, key: &str, what: impl Into<String>, hint: impl Into<String>) {
        self.fault_of(FaultKind::Inconsistent, key, what, hint);
    }

    /// Variant of [`Section::fault`] for another kind than an inconsistent value.
    pub(super) fn fault_of(&self, kind: FaultKind, key: &str, what: impl Into<String>, hint: impl Into<String>) {
        let path = self.place_of(key);
        if !self.vacant && !self.document.is_replaced(&path) {
            self.document.fault(kind, path.clone(), self.span_of(key), what, hint);
            self.document.doubt(path);
        }
    }

    /// Variant of [`Section::fault`] for a byte within the text that stands at a key.
    pub fn fault_in_text(&self, key: &str, byte: usize, what: impl Into<String>, hint: impl Into<String>) {
        let path = self.place_of(key);
        if !self.vacant && !self.document.is_replaced(&path) {
            let span = self.span_of(key);
            // After the quotation mark.
            let at = (span.start + 1 + byte).min(span.end.saturating_sub(1));
            self.document
                .fault(FaultKind::Inconsistent, path.clone(), at..at + 1, what, hint);
            self.document.doubt(path);
        }
    }

    /// Variant of [`Section::fault`] for a check that depends on other values too. `others` are their paths from the
    /// top of the file, such as `"cell.pitch_nm"`; a path into sections of the name of this one means this one. Silent
    /// if one of them has a fault.
    pub fn fault_given(&self, others: &[&str], key: &str, what: impl Into<String>, hint: impl Into<String>) {
        if self.sound(others) {
            self.fault(key, what, hint);
        }
    }

    /// True if none of these values, given by their paths from the top of the file, has a fault so far: each is then
    /// what the file says, or a default.
    pub fn sound(&self, paths: &[&str]) -> bool {
        let in_here = |path: &str| {
            let key = path.strip_prefix(&self.name)?.strip_prefix('.')?;
            Some(self.place_of(key))
        };
        paths.iter().all(|path| {
            self.document
                .is_sound(&in_here(path).unwrap_or_else(|| (*path).to_owned()))
        })
    }

    /// True if the key is there.
    pub fn has(&self, key: &str) -> bool {
        self.note(key, |_| ());
        self.table.contains_key(key)
    }

    /// Record that a key may be given: it is among those that are known here, whether it is there or not.
    pub fn may_have(&self, key: &str) {
        self.note(key, Key::know);
        self.asked.borrow_mut().insert(key.to_owned());
    }

    /// Record that a key is missing, if it is: one that other values of the file ask for. `expected` says what to add, and why.
    pub fn must_have(&self, key: &str, expected: &str) {
        self.note_required(key);
        if !self.has(key) {
            self.asked.borrow_mut().insert(key.to_owned());
            self.missing_unless_present(key, expected);
        }
    }

    /// Record that a key, which is known, has no place beside others, if it is there.
    pub fn refuse(&self, key: &str, what: impl Into<String>, hint: impl Into<String>) {
        if self.has(key) {
            self.asked.borrow_mut().insert(key.to_owned());
            self.fault(key, what, hint);
        }
    }

    /// True if the key is one of these texts. Says nothing of whether it may be, and does not count as asking for it.
    pub fn is_one_of(&self, key: &str, words: &[&str]) -> bool {
        self.note_form(key, || Forms::of_words(words.iter().copied()));
        let value = self.table.get(key).map(Spanned::get_ref);
        matches!(value, Some(DeValue::String(word)) if words.contains(&word.as_ref()))
    }

    /// True if the key holds a list.
    pub fn is_list(&self, key: &str) -> bool {
        self.note_form(key, || Forms::of_list(Forms::of_text(), None));
        matches!(self.table.get(key).map(Spanned::get_ref), Some(DeValue::Array(_)))
    }

    /// A table that must be there.
    #[must_use]
    pub fn section(&self, key: &str) -> Section<'d, 't> {
        self.note_required(key);
        self.optional_section(key).unwrap_or_else(|| {
            self.missing_unless_present(key, &format!("a section [{}]", self.path_of(key)));
            self.vacant(key)
        })
    }

    /// A table that may be left out, where it then has no keys and no faults.
    #[must_use]
    pub fn section_or_none(&self, key: &str) -> Section<'d, 't> {
        self.optional_section(key).unwrap_or_else(|| self.vacant(key))
    }

    /// A table that may be left out.
    pub fn optional_section(&self, key: &str) -> Option<Section<'d, 't>> {
        self.note_form(key, Forms::of_section);
        let value = self.get(key)?;
        if let DeValue::Table(table) = value.get_ref() {
            let mut section = Self::new(self.document, table, self.path_of(key), self.span_of(key));
            section.path = self.place_of(key);
            section.note_section(KeyTable::visit);
            Some(section)
        } else {
            self.wrong_type(key, value, &format!("a section [{}]", self.path_of(key)));
            None
        }
    }

    /// The tables of `[[key]]`, none where the key is left out.
    pub fn sections(&self, key: &str) -> Vec<Section<'d, 't>> {
        self.note_form(key, Forms::of_sections);
        let Some(value) = self.get(key) else { return Vec::new() };
        let DeValue::Array(items) = value.get_ref() else {
            self.wrong_type(key, value, &format!("one or more sections [[{}]]", self.path_of(key)));
            return Vec::new();
        };
        items
            .iter()
            .enumerate()
            .filter_map(|(k, item)| {
                if let DeValue::Table(table) = item.get_ref() {
                    let mut section = Self::new(self.document, table, self.path_of(key), item.span());
                    section.path = format!("{}#{k}", self.place_of(key));
                    section.note_section(KeyTable::visit);
                    Some(section)
                } else {
                    self.wrong_type(key, item, &format!("a section [[{}]]", self.path_of(key)));
                    None
                }
            })
            .collect()
    }

    /// All keys of this section, for maps whose keys the user names.
    pub fn keys(&self) -> Vec<String> {
        self.note_section(|table| table.open(OtherKeys::Named));
        self.table.keys().map(|k| k.get_ref().to_string()).collect()
    }

    /// Refuse an old key or word of this section by name of the new one. Called before the words are read.
    pub fn renamed(&self, old: &str, new: &str) {
        self.renamed.borrow_mut().insert(old.to_owned(), new.to_owned());
    }

    /// Report the keys that nobody asked for. Called when all known keys have been read.
    pub fn finish(&self) {
        let asked = self.asked.borrow();
        let known = asked.iter().cloned().collect::<Vec<_>>().join(", ");
        let place = if self.name.is_empty() {
            "at the top".to_owned()
        } else {
            format!("in [{}]", self.name)
        };
        for (key, _) in self.table {
            let name = key.get_ref().as_ref();
            if asked.contains(name) {
                continue;
            }
            if self.document.is_full() {
                self.document.count_one_more();
                continue;
            }
            let mut missing = self.missing.borrow_mut();
            if let Some(new) = self.renamed.borrow().get(name) {
                if let Some(number) = missing.remove(new) {
                    self.document.withdraw(number);
                }
                let (what, hint) = renamed(name, new);
                self.document.fault(
                    FaultKind::Renamed,
                    self.place_of(name),
                    key.span(),
                    format!("{what} {place}"),
                    hint,
                );
                continue;
            }
            // A key that is missing and one that nobody knows, much alike, are one mistake.
            let hint = if let Some(meant) = nearest(name, missing.keys().map(String::as_str)).map(str::to_owned) {
                if let Some(number) = missing.remove(&meant) {
                    self.document.withdraw(number);
                }
                format!("known here: {known}; did you mean `{meant}`, which is missing?")
            } else {
                let meant = words::did_you_mean(name, asked.iter().map(String::as_str));
                format!("known here: {known}{meant}")
            };
            let what = format!("unknown key `{}` {place}", quoted(name));
            self.document
                .fault(FaultKind::Unknown, self.place_of(name), key.span(), what, hint);
        }
    }

    /// Accept all keys that nobody asked for: they are for other readers of the file.
    pub fn accept_others(&self) {
        self.note_section(|table| table.open(OtherKeys::Ignored));
        self.accept_unread();
    }

    /// Accept all keys that nobody asked for, since a mistake kept their reader from asking.
    pub fn accept_unread(&self) {
        let names = self.table.keys().map(|key| key.get_ref().to_string());
        self.asked.borrow_mut().extend(names);
    }

    fn get(&self, key: &str) -> Option<&'d Spanned<DeValue<'t>>> {
        self.note(key, Key::know);
        self.asked.borrow_mut().insert(key.to_owned());
        self.table.get(key)
    }

    fn vacant(&self, key: &str) -> Section<'d, 't> {
        thread_local!(static EMPTY: &'static DeTable<'static> = Box::leak(Box::default()));
        let mut section = Self::new(self.document, EMPTY.with(|e| *e), self.path_of(key), self.span.clone());
        section.path = self.place_of(key);
        section.vacant = true;
        section
    }

    fn missing_unless_present(&self, key: &str, expected: &str) {
        self.document.replace(self.place_of(key));
        if self.table.contains_key(key) || self.vacant {
            return;
        }
        let place = if self.name.is_empty() {
            "the file".into()
        } else {
            format!("[{}]", self.name)
        };
        let number = self.document.fault(
            FaultKind::Missing,
            self.place_of(key),
            self.span.clone(),
            format!("{place} lacks `{key}`"),
            format!("add `{key}`: {expected}"),
        );
        if let Some(number) = number {
            self.missing.borrow_mut().insert(key.to_owned(), number);
        }
    }

    fn wrong_type(&self, key: &str, value: &Spanned<DeValue<'t>>, expected: &str) {
        self.document.replace(self.place_of(key));
        self.document.fault(
            FaultKind::WrongType,
            self.place_of(key),
            value.span(),
            format!("`{key}` is {}", article(value.get_ref().type_str())),
            format!("it must be {expected}"),
        );
    }

    fn out_of_range(&self, span: Range<usize>, key: &str, value: &str, limits: &Limits) {
        self.document.replace(self.place_of(key));
        self.document.fault(
            FaultKind::OutOfRange,
            self.place_of(key),
            span,
            format!("`{key}` cannot be {}", quoted(value)),
            format!("it must be a number{}", describe(limits)),
        );
    }

    fn span_of(&self, key: &str) -> Range<usize> {
        self.table.get(key).map_or_else(|| self.span.clone(), Spanned::span)
    }

    /// The place of a key from the top of the file.
    fn place_of(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    fn path_of(&self, key: &str) -> String {
        if self.name.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.name)
        }
    }
}
