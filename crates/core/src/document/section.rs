//! One table of a text file, read key by key.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::{Range, RangeInclusive};
use std::path::PathBuf;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::Document;

/// The values a number may take, with the unit it is in and why the limits are there.
#[derive(Clone, Debug)]
pub struct Limits {
    pub range: RangeInclusive<f64>,
    pub unit: &'static str,
}

impl Limits {
    /// `Limits::new(100.0..=1000.0, "nm")`; the unit may be empty.
    pub fn new(range: RangeInclusive<f64>, unit: &'static str) -> Self {
        Self { range, unit }
    }
}

/// One table of a document. Every getter records a fault instead of failing and then returns a value
/// inside the limits, so that one reading finds all faults. Keys that nobody asked for are faults too.
pub struct Section<'d, 't> {
    document: &'d Document<'t>,
    table: &'d DeTable<'t>,
    name: String,
    span: Range<usize>,
    asked: RefCell<BTreeSet<String>>,
    /// Stands in for a section that is missing: its absence is one fault, not one for each key.
    vacant: bool,
}

impl<'d, 't> Section<'d, 't> {
    pub(super) fn root(document: &'d Document<'t>, table: &'d Spanned<DeTable<'t>>) -> Self {
        Self::new(document, table.get_ref(), String::new(), 0..0)
    }

    fn new(document: &'d Document<'t>, table: &'d DeTable<'t>, name: String, span: Range<usize>) -> Self {
        Self {
            document,
            table,
            name,
            span,
            asked: RefCell::default(),
            vacant: false,
        }
    }

    /// Record a fault at a key of this section, or at the section itself if the key is absent.
    pub fn fault(&self, key: &str, what: impl Into<String>, hint: impl Into<String>) {
        if !self.vacant {
            self.document.fault(self.span_of(key), what, hint);
        }
    }

    /// Whether the key is there.
    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// Whether the key holds a list.
    pub fn is_list(&self, key: &str) -> bool {
        matches!(self.table.get(key).map(Spanned::get_ref), Some(DeValue::Array(_)))
    }

    /// A number that must be there.
    pub fn float(&self, key: &str, limits: Limits) -> f64 {
        match self.optional_float(key, limits.clone()) {
            Some(value) => value,
            None => {
                self.missing_unless_present(key, &format!("a number{}", describe(&limits)));
                *limits.range.start()
            }
        }
    }

    /// A number that may be left out.
    pub fn optional_float(&self, key: &str, limits: Limits) -> Option<f64> {
        let value = self.get(key)?;
        let Some(number) = number(value.get_ref()) else {
            self.wrong_type(key, value, &format!("a number{}", describe(&limits)));
            return Some(*limits.range.start());
        };
        Some(self.limited(value.span(), key, number, &limits))
    }

    /// A whole number that must be there.
    pub fn integer(&self, key: &str, range: RangeInclusive<i64>, unit: &'static str) -> i64 {
        match self.optional_integer(key, range.clone(), unit) {
            Some(value) => value,
            None => {
                self.missing_unless_present(key, "a whole number");
                *range.start()
            }
        }
    }

    /// A whole number that may be left out.
    pub fn optional_integer(&self, key: &str, range: RangeInclusive<i64>, unit: &'static str) -> Option<i64> {
        let value = self.get(key)?;
        let limits = Limits::new(*range.start() as f64..=*range.end() as f64, unit);
        let DeValue::Integer(integer) = value.get_ref() else {
            self.wrong_type(key, value, &format!("a whole number{}", describe(&limits)));
            return Some(*range.start());
        };
        let parsed = i64::from_str_radix(integer.as_str(), integer.radix()).ok();
        match parsed {
            Some(v) if range.contains(&v) => Some(v),
            _ => {
                self.out_of_range(value.span(), key, integer.as_str(), &limits);
                Some(*range.start())
            }
        }
    }

    /// A text that must be there.
    pub fn text(&self, key: &str) -> String {
        match self.optional_text(key) {
            Some(text) => text,
            None => {
                self.missing_unless_present(key, "a text in quotes");
                String::new()
            }
        }
    }

    /// A text that may be left out.
    pub fn optional_text(&self, key: &str) -> Option<String> {
        let value = self.get(key)?;
        match value.get_ref() {
            DeValue::String(s) => Some(s.to_string()),
            _ => {
                self.wrong_type(key, value, "a text in quotes");
                Some(String::new())
            }
        }
    }

    /// A list of texts; an empty one where the key is left out.
    pub fn texts(&self, key: &str) -> Vec<String> {
        let Some(value) = self.get(key) else { return Vec::new() };
        let DeValue::Array(items) = value.get_ref() else {
            self.wrong_type(key, value, "a list of texts in quotes");
            return Vec::new();
        };
        let text = |item: &Spanned<DeValue<'t>>| match item.get_ref() {
            DeValue::String(s) => Some(s.to_string()),
            _ => {
                self.wrong_type(key, item, "a list of texts in quotes");
                None
            }
        };
        items.iter().filter_map(text).collect()
    }

    /// One of a few words; the first choice takes the place of a wrong one.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&str, T)], default: Option<T>) -> T {
        let words = choices.iter().map(|(w, _)| *w).collect::<Vec<_>>().join(", ");
        let Some(value) = self.get(key) else {
            return default.unwrap_or_else(|| {
                self.missing_unless_present(key, &format!("one of: {words}"));
                choices[0].1
            });
        };
        let DeValue::String(word) = value.get_ref() else {
            self.wrong_type(key, value, &format!("one of: {words}"));
            return choices[0].1;
        };
        choices.iter().find(|(w, _)| *w == word.as_ref()).map_or_else(
            || {
                self.document.fault(
                    value.span(),
                    format!("`{key}` cannot be \"{word}\""),
                    format!("use one of: {words}{}", nearest(word, choices.iter().map(|c| c.0))),
                );
                choices[0].1
            },
            |(_, v)| *v,
        )
    }

    /// A list of numbers, each within the limits; an empty one where the key is left out.
    pub fn floats(&self, key: &str, limits: Limits) -> Vec<f64> {
        let Some(value) = self.get(key) else { return Vec::new() };
        let DeValue::Array(items) = value.get_ref() else {
            self.wrong_type(key, value, &format!("a list of numbers{}", describe(&limits)));
            return Vec::new();
        };
        items
            .iter()
            .map(|item| match number(item.get_ref()) {
                Some(v) => self.limited(item.span(), key, v, &limits),
                None => {
                    self.wrong_type(key, item, &format!("a list of numbers{}", describe(&limits)));
                    *limits.range.start()
                }
            })
            .collect()
    }

    /// Exactly `N` numbers that must be there, each within the limits.
    pub fn array<const N: usize>(&self, key: &str, limits: Limits) -> [f64; N] {
        match self.optional_array(key, limits.clone()) {
            Some(values) => values,
            None => {
                self.missing_unless_present(key, &format!("a list of {N} numbers"));
                [*limits.range.start(); N]
            }
        }
    }

    /// Exactly `N` numbers, each within the limits, or nothing where the key is left out.
    pub fn optional_array<const N: usize>(&self, key: &str, limits: Limits) -> Option<[f64; N]> {
        self.get(key)?;
        let values = self.floats(key, limits.clone());
        let count = values.len();
        Some(values.try_into().unwrap_or_else(|_| {
            self.fault(
                key,
                format!("`{key}` has {count} entries"),
                format!("give exactly {N} numbers"),
            );
            [*limits.range.start(); N]
        }))
    }

    /// A path, relative ones counted from the folder of this file. The file must exist.
    pub fn file(&self, key: &str) -> PathBuf {
        let text = self.text(key);
        let path = self.document.folder().join(&text);
        if !text.is_empty() && !path.is_file() {
            self.fault(
                key,
                format!("there is no file {}", path.display()),
                "relative paths count from the folder of this file",
            );
        }
        path
    }

    /// A table that must be there.
    pub fn section(&self, key: &str) -> Section<'d, 't> {
        self.optional_section(key).unwrap_or_else(|| {
            self.missing_unless_present(key, &format!("a section [{}]", self.path_of(key)));
            self.vacant(key)
        })
    }

    /// A table that may be left out.
    pub fn optional_section(&self, key: &str) -> Option<Section<'d, 't>> {
        let value = self.get(key)?;
        match value.get_ref() {
            DeValue::Table(table) => Some(Self::new(self.document, table, self.path_of(key), self.span_of(key))),
            _ => {
                self.wrong_type(key, value, &format!("a section [{}]", self.path_of(key)));
                None
            }
        }
    }

    /// The tables of `[[key]]`, none where the key is left out.
    pub fn sections(&self, key: &str) -> Vec<Section<'d, 't>> {
        let Some(value) = self.get(key) else { return Vec::new() };
        let DeValue::Array(items) = value.get_ref() else {
            self.wrong_type(key, value, &format!("one or more sections [[{}]]", self.path_of(key)));
            return Vec::new();
        };
        items
            .iter()
            .filter_map(|item| match item.get_ref() {
                DeValue::Table(table) => Some(Self::new(self.document, table, self.path_of(key), item.span())),
                _ => {
                    self.wrong_type(key, item, &format!("a section [[{}]]", self.path_of(key)));
                    None
                }
            })
            .collect()
    }

    /// All keys of this section, for maps whose keys the user names.
    pub fn keys(&self) -> Vec<String> {
        self.table.keys().map(|k| k.get_ref().to_string()).collect()
    }

    /// Report the keys that nobody asked for. Called when all known keys have been read.
    pub fn finish(&self) {
        let asked = self.asked.borrow();
        for (key, _) in self.table {
            let name = key.get_ref().as_ref();
            if !asked.contains(name) {
                let place = if self.name.is_empty() {
                    "at the top".into()
                } else {
                    format!("in [{}]", self.name)
                };
                let known = asked.iter().cloned().collect::<Vec<_>>().join(", ");
                self.document.fault(
                    key.span(),
                    format!("unknown key `{name}` {place}"),
                    format!("known here: {known}{}", nearest(name, asked.iter().map(String::as_str))),
                );
            }
        }
    }

    fn get(&self, key: &str) -> Option<&'d Spanned<DeValue<'t>>> {
        self.asked.borrow_mut().insert(key.to_owned());
        self.table.get(key)
    }

    fn vacant(&self, key: &str) -> Section<'d, 't> {
        thread_local!(static EMPTY: &'static DeTable<'static> = Box::leak(Box::default()));
        let mut section = Self::new(self.document, EMPTY.with(|e| *e), self.path_of(key), self.span.clone());
        section.vacant = true;
        section
    }

    fn missing_unless_present(&self, key: &str, expected: &str) {
        if self.table.contains_key(key) || self.vacant {
            return;
        }
        let place = if self.name.is_empty() {
            "the file".into()
        } else {
            format!("[{}]", self.name)
        };
        self.document.fault(
            self.span.clone(),
            format!("{place} lacks `{key}`"),
            format!("add `{key}`: {expected}"),
        );
    }

    fn wrong_type(&self, key: &str, value: &Spanned<DeValue<'t>>, expected: &str) {
        self.document.fault(
            value.span(),
            format!("`{key}` is {}", article(value.get_ref().type_str())),
            format!("it must be {expected}"),
        );
    }

    fn limited(&self, span: Range<usize>, key: &str, value: f64, limits: &Limits) -> f64 {
        if limits.range.contains(&value) {
            return value;
        }
        self.out_of_range(span, key, &value.to_string(), limits);
        *limits.range.start()
    }

    fn out_of_range(&self, span: Range<usize>, key: &str, value: &str, limits: &Limits) {
        self.document.fault(
            span,
            format!("`{key}` cannot be {value}"),
            format!("it must be a number{}", describe(limits)),
        );
    }

    fn span_of(&self, key: &str) -> Range<usize> {
        self.table.get(key).map_or_else(|| self.span.clone(), Spanned::span)
    }

    fn path_of(&self, key: &str) -> String {
        if self.name.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.name)
        }
    }
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(|v| v as f64),
        DeValue::Float(f) => f.as_str().parse().ok(),
        _ => None,
    }
}

fn describe(limits: &Limits) -> String {
    let unit = if limits.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", limits.unit)
    };
    match (*limits.range.start(), *limits.range.end()) {
        (a, b) if a == f64::MIN && b == f64::MAX => unit,
        (a, b) if b == f64::MAX => format!(" of at least {a}{unit}"),
        (a, b) => format!(" from {a} to {b}{unit}"),
    }
}

fn article(kind: &str) -> String {
    match kind.chars().next() {
        Some('a' | 'e' | 'i' | 'o' | 'u') => format!("an {kind}"),
        _ => format!("a {kind}"),
    }
}

/// `, did you mean ...?` if a known word is close to the one given.
fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> String {
    known
        .map(|k| (distance(word, k), k))
        .filter(|(d, k)| *d <= 1 + k.len() / 4)
        .min()
        .map_or_else(String::new, |(_, k)| format!("; did you mean `{k}`?"))
}

/// Number of single-letter edits between two words (Levenshtein).
fn distance(a: &str, b: &str) -> usize {
    let b = b.as_bytes();
    let mut row = (0..=b.len()).collect::<Vec<_>>();
    for (i, ca) in a.bytes().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(1 + row[j].min(diagonal));
        }
    }
    row[b.len()]
}
