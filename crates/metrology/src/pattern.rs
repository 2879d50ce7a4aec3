//! Names of files by patterns: `measured/FOV{plate}{row}{column}.tif`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use metalith_core::text::quoted;

/// Values of the names in a pattern.
pub(crate) type Named = BTreeMap<String, String>;

/// Most files that one pattern may find.
const MOST_FILES: usize = 10_000;

/// A path whose last part has names in braces, each for letters, digits, `.`, `+` and `-`.
#[derive(Clone, Debug)]
pub struct NamePattern {
    folder: PathBuf,
    parts: Vec<Part>,
}

#[derive(Clone, Debug, PartialEq)]
enum Part {
    Literal(String),
    Name(String),
}

impl NamePattern {
    /// A pattern of paths that count from a folder; in words what is wrong with it.
    ///
    /// # Errors
    /// If a brace is not closed, a name is empty or given twice, or the folders have names.
    pub fn parse(text: &str, from: &Path) -> Result<Self, String> {
        let (folder, file) = text.rsplit_once('/').unwrap_or(("", text));
        if folder.contains('{') {
            return Err("a name in braces stands in a folder".into());
        }
        let mut parts = Vec::new();
        let mut rest = file;
        while let Some(open) = rest.find('{') {
            let close = rest[open..].find('}').ok_or("a brace is not closed")? + open;
            let name = &rest[open + 1..close];
            if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
                return Err(format!("{{{}}} is no name", quoted(name)));
            }
            if parts.contains(&Part::Name(name.into())) {
                return Err(format!("{{{}}} stands twice", quoted(name)));
            }
            if open > 0 {
                parts.push(Part::Literal(rest[..open].into()));
            }
            parts.push(Part::Name(name.into()));
            rest = &rest[close + 1..];
        }
        if !rest.is_empty() {
            parts.push(Part::Literal(rest.into()));
        }
        Ok(Self {
            folder: from.join(folder),
            parts,
        })
    }

    /// Names in braces.
    pub fn names(&self) -> Vec<&str> {
        self.parts
            .iter()
            .filter_map(|part| match part {
                Part::Name(name) => Some(name.as_str()),
                Part::Literal(_) => None,
            })
            .collect()
    }

    /// Path with values for the names.
    pub fn path(&self, named: &Named) -> PathBuf {
        let part = |part: &Part| match part {
            Part::Literal(text) => text.clone(),
            Part::Name(name) => named.get(name).cloned().unwrap_or_default(),
        };
        self.folder.join(self.parts.iter().map(part).collect::<String>())
    }

    /// Files of the folder that fit, by name, each with the values of its names.
    ///
    /// # Errors
    /// In words, if the folder cannot be read, no file fits, or too many do.
    pub fn files(&self) -> Result<Vec<(PathBuf, Named)>, String> {
        let shown = self.folder.display();
        let entries = std::fs::read_dir(&self.folder).map_err(|e| format!("{shown} cannot be read: {e}"))?;
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .collect();
        names.sort();
        let found: Vec<_> = names
            .iter()
            .filter_map(|name| Some((self.folder.join(name), matched(&self.parts, name)?)))
            .collect();
        match found.len() {
            0 => Err(format!("no file in {shown} fits")),
            n if n > MOST_FILES => Err(format!("{n} files in {shown} fit, more than {MOST_FILES}")),
            _ => Ok(found),
        }
    }
}

/// Values of the names in a text that fits: each as short as the rest allows.
fn matched(parts: &[Part], text: &str) -> Option<Named> {
    rest_matched(parts, text, &mut BTreeSet::new())
}

/// As [`matched`]; `failed` holds numbers of parts and bytes that are known not to fit, so that each is tried once.
fn rest_matched(parts: &[Part], text: &str, failed: &mut BTreeSet<[usize; 2]>) -> Option<Named> {
    let Some((first, rest)) = parts.split_first() else {
        return text.is_empty().then(Named::new);
    };
    let name = match first {
        Part::Literal(literal) => return rest_matched(rest, text.strip_prefix(literal.as_str())?, failed),
        Part::Name(name) => name,
    };
    let place = [parts.len(), text.len()];
    if failed.contains(&place) {
        return None;
    }
    let allowed = |c: char| c.is_ascii_alphanumeric() || ".+-".contains(c);
    let longest = text.find(|c| !allowed(c)).unwrap_or(text.len());
    for end in 1..=longest {
        if let Some(mut named) = rest_matched(rest, &text[end..], failed) {
            named.insert(name.clone(), text[..end].into());
            return Some(named);
        }
    }
    failed.insert(place);
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each way to cut the name would be tried, if places that do not fit were not known: 10^17 ways.
    #[test]
    fn a_long_name_that_fits_nothing_costs_little() {
        let pattern = NamePattern::parse("{a}{b}{c}{d}{e}{f}{g}{h}{i}{j}.tif", Path::new("set")).unwrap();
        assert!(matched(&pattern.parts, &"1".repeat(250)).is_none());
    }

    #[test]
    fn names_are_as_short_as_the_rest_allows() {
        let pattern = NamePattern::parse("measured/FOV{plate}{row}{column}.tif", Path::new("set")).unwrap();
        let found = matched(&pattern.parts, "FOV1234.tif").unwrap();
        assert_eq!([&found["plate"], &found["row"], &found["column"]], ["1", "2", "34"]);
        assert_eq!(pattern.path(&found), Path::new("set/measured/FOV1234.tif"));
        assert_eq!(matched(&pattern.parts, "FOV12.tif"), None);
        assert_eq!(matched(&pattern.parts, "FOV123.tiff"), None);
        let pattern = NamePattern::parse("{height_nm}_{repeat}.csv", Path::new("")).unwrap();
        assert_eq!(matched(&pattern.parts, "63.5_0.csv").unwrap()["height_nm"], "63.5");
    }

    #[test]
    fn wrong_patterns_are_refused() {
        for text in ["a{b", "a{}", "{a}{a}", "{a}/b", "{a b}"] {
            assert!(NamePattern::parse(text, Path::new("")).is_err(), "{text}");
        }
    }
}
