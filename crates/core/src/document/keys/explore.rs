//! A reader that is given files with each of the values that it distinguishes.

use std::collections::BTreeSet;
use std::path::Path;

use toml::{Table, Value};

use super::super::{Document, FaultKind, Section};
use super::{KeyTable, OtherKeys};
use crate::error::Error;

/// Folder of files that a reader is given: no file of any disk is in it, since no path holds this character.
const NOWHERE: &str = "\0/a.toml";

/// Most rounds of adding keys that a reader misses: sections in sections in sections have fewer.
const MOST_ROUNDS: usize = 8;

/// The keys that `read` knows. It is given the texts of `seeds`, an empty file, and these with one value after the other that
/// it may distinguish. Each file in which it asks for something new is a seed too. A file with another word, or with a key that was
/// not there, is one for the section of that key alone: keys depend on others of their section, and seldom on two of others.
/// `read` must not keep anything.
pub fn explore<T>(seeds: &[&str], read: impl Fn(&Section<'_, '_>, &Path) -> T) -> KeyTable {
    let mut explorer = Explorer {
        read: |root: &Section<'_, '_>| drop(read(root, Path::new(NOWHERE))),
        known: KeyTable::default(),
        seeds: Vec::new(),
        tried: BTreeSet::new(),
        varied: BTreeSet::new(),
    };
    let given = seeds.iter().filter_map(|text| text.parse().ok());
    for seed in std::iter::once(Table::new()).chain(given) {
        explorer.try_file(&seed);
        explorer.seeds.push((seed, None));
    }
    let mut next = 0;
    while let Some((seed, scope)) = explorer.seeds.get(next).cloned() {
        // A key that must be there may hide another that stands in its place.
        explorer.vary(&seed, scope.as_deref());
        let completed = explorer.completed(seed);
        explorer.vary(&completed, scope.as_deref());
        next += 1;
    }
    explorer.known
}

struct Explorer<R> {
    read: R,
    known: KeyTable,
    /// Files to vary, each with the section at the top that is varied in it: all, if it has none.
    seeds: Vec<(Table, Option<String>)>,
    /// Files that have been read.
    tried: BTreeSet<String>,
    /// Keys with values that a seed was made of.
    varied: BTreeSet<String>,
}

impl<R: Fn(&Section<'_, '_>)> Explorer<R> {
    /// Let the reader read a file. True if it asked for something new; and the paths of keys that it missed.
    fn try_file(&mut self, file: &Table) -> (bool, Vec<String>) {
        let text = file.to_string();
        if !self.tried.insert(text.clone()) {
            return (false, Vec::new());
        }
        let (result, asked) = Document::read_noting(Path::new(NOWHERE), &text, &self.read);
        let missing = match result {
            Err(Error::Text(faults)) => {
                let missing = faults.faults().iter().filter(|f| f.kind == FaultKind::Missing);
                missing.map(|f| f.key.clone()).collect()
            }
            _ => Vec::new(),
        };
        (self.known.merge(asked), missing)
    }

    /// The file with the keys that the reader misses in it.
    fn completed(&mut self, mut file: Table) -> Table {
        for _ in 0..MOST_ROUNDS {
            // The question is asked again of a file that was read before.
            self.tried.remove(&file.to_string());
            let (_, missing) = self.try_file(&file);
            let mut has_changed = false;
            for path in missing {
                let plain = without_numbers(&path);
                let example = self.examples(&plain).into_iter().next();
                has_changed |= example.is_some_and(|example| set(&mut file, &path, example));
            }
            if !has_changed {
                break;
            }
        }
        file
    }

    /// Read the file with each value in turn that the reader may distinguish, at each key of a section at the top, or of all.
    fn vary(&mut self, seed: &Table, scope: Option<&str>) {
        for path in paths(&self.known, "") {
            let top = path.split('.').next().unwrap_or_default();
            if scope.is_some_and(|scope| scope != top) {
                continue;
            }
            for example in self.examples(&path) {
                let mut file = seed.clone();
                // Numbers seldom decide which keys there are.
                let is_branch = !matches!(example, Value::Integer(_) | Value::Float(_));
                let name = format!("{path} = {example}");
                if !set(&mut file, &path, example) {
                    continue;
                }
                if self.try_file(&file).0 {
                    self.seeds.push((file, None));
                } else if is_branch && self.varied.insert(name) {
                    self.seeds.push((file, Some(top.to_owned())));
                }
            }
        }
    }

    /// Values that the key at a path may have.
    fn examples(&self, path: &str) -> Vec<Value> {
        let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
        let table = section
            .split('.')
            .filter(|part| !part.is_empty())
            .try_fold(&self.known, |table, part| table.keys.get(part).map(|key| &key.table));
        let key = table.and_then(|table| table.keys.get(name));
        match key {
            Some(key) => key.forms.examples(),
            // A name that a user could give: its reader says more once it is there.
            None if name == KeyTable::OF_THE_USER => vec![1.into()],
            None => Vec::new(),
        }
    }
}

/// The paths of all keys of a table and of the sections in it.
fn paths(table: &KeyTable, section: &str) -> Vec<String> {
    let place = |name: &str| match section {
        "" => name.to_owned(),
        _ => format!("{section}.{name}"),
    };
    let mut all = Vec::new();
    if table.others == OtherKeys::Named && !table.keys.contains_key(KeyTable::OF_THE_USER) {
        all.push(place(KeyTable::OF_THE_USER));
    }
    for (name, key) in &table.keys {
        let path = place(name);
        let below = paths(&key.table, &path);
        all.push(path);
        all.extend(below);
    }
    all
}

/// The path of a key without the numbers of its sections.
fn without_numbers(path: &str) -> String {
    let parts = path.split('.').map(|part| part.split('#').next().unwrap_or(part));
    parts.collect::<Vec<_>>().join(".")
}

/// Put a value at a path: in the section with the number that the path has, or in the last one. False if there is no such section.
fn set(file: &mut Table, path: &str, value: Value) -> bool {
    let Some((section, name)) = path.rsplit_once('.') else {
        file.insert(path.to_owned(), value);
        return true;
    };
    let mut table = file;
    for part in section.split('.') {
        let (part, number) = match part.split_once('#') {
            Some((part, number)) => (part, number.parse::<usize>().ok()),
            None => (part, None),
        };
        let inner = match table.get_mut(part) {
            Some(Value::Table(inner)) => Some(inner),
            Some(Value::Array(items)) => {
                let last = items.len().saturating_sub(1);
                items.get_mut(number.unwrap_or(last)).and_then(Value::as_table_mut)
            }
            _ => None,
        };
        match inner {
            Some(inner) => table = inner,
            None => return false,
        }
    }
    table.insert(name.to_owned(), value);
    true
}
