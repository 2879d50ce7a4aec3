//! The values of a section: numbers, texts, choices, lists, paths.

use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::DeValue;

use super::words::{describe, did_you_mean};
use super::{Limits, Section};
use crate::document::{FaultKind, Forms, Scalar, renamed};
use crate::error::{Error, Result};
use crate::text::{first_unprintable, quoted};

/// Remedy where a file is not there.
const RELATIVE: &str = "relative paths count from the folder of this file";

impl<'t> Section<'_, 't> {
    /// A number that must be there.
    pub fn float(&self, key: &str, limits: Limits) -> f64 {
        self.note_required(key);
        if let Some(value) = self.optional_float(key, limits.clone()) {
            value
        } else {
            self.missing_unless_present(key, &format!("a number{}", describe(&limits)));
            *limits.range.start()
        }
    }

    /// A number that may be left out.
    pub fn optional_float(&self, key: &str, limits: Limits) -> Option<f64> {
        self.note_form(key, || Forms::of_number(&limits));
        let value = self.get(key)?;
        let Some(number) = number(value.get_ref()) else {
            self.wrong_type(key, value, &format!("a number{}", describe(&limits)));
            return Some(*limits.range.start());
        };
        Some(self.limited(value.span(), key, number, &limits))
    }

    /// A number, or this one where the key is left out.
    pub fn float_or(&self, key: &str, limits: Limits, default: f64) -> f64 {
        self.note_default(key, || Scalar::Number(default));
        self.optional_float(key, limits).unwrap_or(default)
    }

    /// A whole number that must be there.
    pub fn integer(&self, key: &str, range: RangeInclusive<i64>, unit: &'static str) -> i64 {
        self.note_required(key);
        if let Some(value) = self.optional_integer(key, range.clone(), unit) {
            value
        } else {
            self.missing_unless_present(key, "a whole number");
            *range.start()
        }
    }

    /// A whole number that may be left out.
    pub fn optional_integer(&self, key: &str, range: RangeInclusive<i64>, unit: &'static str) -> Option<i64> {
        self.note_form(key, || Forms::of_integer(&range, unit));
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

    /// A whole number, or this one where the key is left out.
    pub fn integer_or(&self, key: &str, range: RangeInclusive<i64>, unit: &'static str, default: i64) -> i64 {
        self.note_default(key, || Scalar::Whole(default));
        self.optional_integer(key, range, unit).unwrap_or(default)
    }

    /// Note the value that stands for a key that is left out.
    fn note_default(&self, key: &str, value: impl FnOnce() -> Scalar) {
        self.note(key, |key| key.left_out_is(value()));
    }

    /// A text that must be there.
    pub fn text(&self, key: &str) -> String {
        self.note_required(key);
        self.present_text(key)
    }

    fn present_text(&self, key: &str) -> String {
        if let Some(text) = self.optional_text(key) {
            text
        } else {
            self.missing_unless_present(key, "a text in quotes");
            String::new()
        }
    }

    /// A text that may be left out.
    pub fn optional_text(&self, key: &str) -> Option<String> {
        self.note_form(key, Forms::of_text);
        let value = self.get(key)?;
        if let DeValue::String(s) = value.get_ref() {
            Some(self.one_line(key, value.span(), s))
        } else {
            self.wrong_type(key, value, "a text in quotes");
            Some(String::new())
        }
    }

    /// A text, or this one where the key is left out.
    pub fn text_or(&self, key: &str, default: &str) -> String {
        self.note_default(key, || Scalar::Text(default.to_owned()));
        self.optional_text(key).unwrap_or_else(|| default.to_owned())
    }

    /// A text that may go where one line is expected: layouts, job files and pages are written from it.
    fn one_line(&self, key: &str, span: Range<usize>, text: &str) -> String {
        let Some(c) = first_unprintable(text) else {
            return text.to_owned();
        };
        self.document.replace(self.place_of(key));
        self.document.fault(
            FaultKind::Unprintable,
            self.place_of(key),
            span,
            format!("`{key}` contains the character U+{:04X}", u32::from(c)),
            "write it in one line of printable characters",
        );
        String::new()
    }

    /// What `read` makes of the items of a list, without those of a wrong type; an empty list where the key is left out.
    fn list<T>(&self, key: &str, expected: &str, read: impl Fn(&Spanned<DeValue<'t>>) -> Option<T>) -> Vec<T> {
        let Some(value) = self.get(key) else { return Vec::new() };
        let DeValue::Array(items) = value.get_ref() else {
            self.wrong_type(key, value, expected);
            return Vec::new();
        };
        let item = |item: &Spanned<DeValue<'t>>| {
            let read = read(item);
            if read.is_none() {
                self.wrong_type(key, item, expected);
            }
            read
        };
        items.iter().filter_map(item).collect()
    }

    /// A list of texts; an empty one where the key is left out.
    pub fn texts(&self, key: &str) -> Vec<String> {
        self.note_form(key, || Forms::of_list(Forms::of_text(), None));
        self.list(key, "a list of texts in quotes", |item| match item.get_ref() {
            DeValue::String(s) => Some(self.one_line(key, item.span(), s)),
            _ => None,
        })
    }

    /// One of a few words; the first choice takes the place of a wrong one.
    pub fn choice<T: Copy + PartialEq>(&self, key: &str, choices: &[(&str, T)], default: Option<T>) -> T {
        self.note_form(key, || Forms::of_words(choices.iter().map(|(word, _)| *word)));
        match default {
            None => self.note_required(key),
            Some(default) => {
                if let Some((word, _)) = choices.iter().find(|(_, value)| *value == default) {
                    self.note_default(key, || Scalar::Text((*word).to_owned()));
                }
            }
        }
        let Some(value) = self.get(key) else {
            return default.unwrap_or_else(|| {
                let words = choices.iter().map(|(w, _)| *w).collect::<Vec<_>>().join(", ");
                self.missing_unless_present(key, &format!("one of: {words}"));
                choices[0].1
            });
        };
        self.word(key, value, choices, "")
    }

    /// One of a few words; `or` says what else a value may be.
    fn word<T: Copy>(&self, key: &str, value: &Spanned<DeValue<'t>>, choices: &[(&str, T)], or: &str) -> T {
        let words = choices.iter().map(|(w, _)| *w).collect::<Vec<_>>().join(", ");
        let DeValue::String(word) = value.get_ref() else {
            self.wrong_type(key, value, &format!("one of: {words}{or}"));
            return choices[0].1;
        };
        choices.iter().find(|(w, _)| *w == word.as_ref()).map_or_else(
            || {
                self.document.replace(self.place_of(key));
                if let Some(new) = self.renamed.borrow().get(word.as_ref()) {
                    let (what, hint) = renamed(word, new);
                    self.document
                        .fault(FaultKind::Renamed, self.place_of(key), value.span(), what, hint);
                    return choices[0].1;
                }
                self.document.fault(
                    FaultKind::UnknownChoice,
                    self.place_of(key),
                    value.span(),
                    format!("`{key}` cannot be \"{}\"", quoted(word)),
                    format!(
                        "use one of: {words}{or}{}",
                        did_you_mean(word, choices.iter().map(|c| c.0))
                    ),
                );
                choices[0].1
            },
            |(_, v)| *v,
        )
    }

    /// One of a few words, or a number; nothing where the key is left out.
    pub fn optional_choice_or_float<T: Copy>(
        &self,
        key: &str,
        choices: &[(&str, T)],
        limits: Limits,
        of_number: impl Fn(f64) -> T,
    ) -> Option<T> {
        self.note_form(key, || Forms::of_words(choices.iter().map(|(word, _)| *word)));
        self.note_form(key, || Forms::of_number(&limits));
        let value = self.get(key)?;
        match value.get_ref() {
            DeValue::Integer(_) | DeValue::Float(_) => self.optional_float(key, limits).map(of_number),
            _ => Some(self.word(key, value, choices, &format!(", or a number{}", describe(&limits)))),
        }
    }

    /// A list of numbers, each within the limits; an empty one where the key is left out.
    pub fn floats(&self, key: &str, limits: Limits) -> Vec<f64> {
        self.note_form(key, || Forms::of_list(Forms::of_number(&limits), None));
        self.floats_within(key, &limits)
    }

    fn floats_within(&self, key: &str, limits: &Limits) -> Vec<f64> {
        let expected = format!("a list of numbers{}", describe(limits));
        self.list(key, &expected, |item| {
            if let Some(v) = number(item.get_ref()) {
                Some(self.limited(item.span(), key, v, limits))
            } else {
                self.wrong_type(key, item, &expected);
                Some(*limits.range.start())
            }
        })
    }

    /// A list of numbers, texts or switches; an empty one where the key is left out.
    pub fn scalars(&self, key: &str) -> Vec<Scalar> {
        const EXPECTED: &str = "a list of numbers, texts in quotes, or true and false";
        self.note_form(key, || Forms::of_list(Forms::of_scalar(), None));
        self.list(key, EXPECTED, |item| match Scalar::of(item.get_ref())? {
            Scalar::Text(text) => Some(Scalar::Text(self.one_line(key, item.span(), &text))),
            other => Some(other),
        })
    }

    /// Exactly `N` numbers that must be there, each within the limits.
    pub fn array<const N: usize>(&self, key: &str, limits: Limits) -> [f64; N] {
        self.note_required(key);
        if let Some(values) = self.optional_array(key, limits.clone()) {
            values
        } else {
            self.missing_unless_present(key, &format!("a list of {N} numbers"));
            [*limits.range.start(); N]
        }
    }

    /// Exactly `N` numbers, each within the limits, or nothing where the key is left out.
    pub fn optional_array<const N: usize>(&self, key: &str, limits: Limits) -> Option<[f64; N]> {
        self.note_form(key, || Forms::of_list(Forms::of_number(&limits), Some(N)));
        self.get(key)?;
        let values = self.floats_within(key, &limits);
        let count = values.len();
        Some(values.try_into().unwrap_or_else(|_| {
            self.fault_of(
                FaultKind::WrongLength,
                key,
                format!("`{key}` has {count} entries"),
                format!("give exactly {N} numbers"),
            );
            self.document.replace(self.place_of(key));
            [*limits.range.start(); N]
        }))
    }

    /// A path, relative ones counted from the folder of this file. The file must exist.
    pub fn file(&self, key: &str) -> PathBuf {
        self.file_else(key, RELATIVE)
    }

    /// Path of a file that may be left out, as [`Section::file`].
    pub fn optional_file(&self, key: &str) -> Option<PathBuf> {
        self.may_have(key);
        self.note_form(key, Forms::of_text);
        self.has(key).then(|| self.path_of_file(key, RELATIVE))
    }

    /// Variant of the path of a file for a file that is made by what `hint` says.
    pub fn file_else(&self, key: &str, hint: &str) -> PathBuf {
        self.note_required(key);
        self.path_of_file(key, hint)
    }

    fn path_of_file(&self, key: &str, hint: &str) -> PathBuf {
        let text = self.present_text(key);
        let path = self.document.folder().join(&text);
        if !text.is_empty() && !path.is_file() {
            self.fault_of(
                FaultKind::NoFile,
                key,
                format!("there is no file {}", path.display()),
                hint,
            );
        }
        self.names(key, &path);
        path
    }

    /// Record that a key names a file.
    fn names(&self, key: &str, path: &Path) {
        let named = (self.place_of(key), self.span_of(key), path.to_owned());
        self.document.named.borrow_mut().push(named);
    }

    /// File that a key names, as [`Section::file`], and what `read` reads in it; `None` if it is not there or cannot be used, which is
    /// then a fault of the key.
    pub fn contents<T, E: Into<Error>>(
        &self,
        key: &str,
        read: impl FnOnce(&Path) -> Result<T, E>,
    ) -> Option<(PathBuf, T)> {
        let path = self.file(key);
        if !path.is_file() {
            return None;
        }
        match read(&path) {
            Ok(contents) => Some((path, contents)),
            Err(error) => {
                let (place, span) = (self.place_of(key), self.span_of(key));
                self.document.unusable_file(&place, span, &error.into());
                None
            }
        }
    }

    /// Record a fault at each key of the document that names the file that an error is about.
    ///
    /// # Errors
    /// The error itself, if it is about something else.
    pub fn unusable_file(&self, error: Error) -> Result<()> {
        let (Error::Table { path: file, .. } | Error::Io { path: file, .. }) = &error else {
            return Err(error);
        };
        let named = self.document.named.borrow();
        let mut keys = named.iter().filter(|(.., path)| path == file).peekable();
        if keys.peek().is_none() {
            return Err(error);
        }
        for (key, span, _) in keys {
            self.document.unusable_file(key, span.clone(), &error);
        }
        Ok(())
    }

    /// True if no value in these sections of the document has a fault so far, by their paths from the top of the file. Names of files do
    /// not count: what other values must be does not depend on them.
    pub fn sound_within(&self, sections: &[&str]) -> bool {
        sections.iter().all(|section| self.document.is_sound_within(section))
    }

    /// A path, relative ones counted from the folder of this file. Nothing need be there.
    pub fn path(&self, key: &str) -> PathBuf {
        self.document.folder().join(self.text(key))
    }

    fn limited(&self, span: Range<usize>, key: &str, value: f64, limits: &Limits) -> f64 {
        if limits.range.contains(&value) {
            return value;
        }
        self.out_of_range(span, key, &value.to_string(), limits);
        *limits.range.start()
    }
}

/// Number that a TOML value is, if it is one.
pub(in crate::document) fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(|v| v as f64),
        DeValue::Float(f) => f.as_str().parse().ok(),
        _ => None,
    }
}
