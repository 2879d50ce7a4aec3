//! The cell that a mapping is for, as it stands in a design and at the head of a table.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::{Serialize, Serializer};

use metalith_core::text::quoted;
use metalith_core::{Error, Result};

/// Value of a key of [`MappedCell`].
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum MappedValue {
    Number(f64),
    Text(String),
}

/// The value as TOML writes it.
impl fmt::Display for MappedValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(v) => write!(f, "{v}"),
            Self::Text(v) => write!(f, "\"{v}\""),
        }
    }
}

impl From<&str> for MappedValue {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

impl From<f64> for MappedValue {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl MappedValue {
    /// The value of a text that TOML reads as a number or as a plain text in quotes.
    fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        if let Some(inner) = text.strip_prefix('"').and_then(|t| t.strip_suffix('"')) {
            return (!inner.contains(['"', '\\'])).then(|| Self::from(inner));
        }
        text.parse().ok().filter(|v: &f64| v.is_finite()).map(Self::Number)
    }

    /// True if both are the same, numbers but for their rounding.
    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Number(a), Self::Number(b)) => (a - b).abs() <= ROUNDING * a.abs().max(b.abs()),
            _ => self == other,
        }
    }
}

/// Rounding of a number that is written and read, and of nm from um.
const ROUNDING: f64 = 1e-9;

/// Bytes in which the comment lines at the head of a table are looked for.
const LONGEST_HEAD: u64 = 1 << 16;

/// A key of a cell.
pub struct MappedKey {
    pub name: &'static str,
    /// Value where the key is left out; none if it must not be.
    usual: Usual,
}

/// Value of a key that is left out.
enum Usual {
    Required,
    Text(&'static str),
    Number(f64),
    /// No such part.
    Absent,
}

/// The cell that a mapping is for, and its wavelength: key by key as in `[cell]` of a design.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MappedCell(BTreeMap<&'static str, MappedValue>);

/// A key in which two cells differ.
#[derive(Clone, Debug, PartialEq)]
pub struct MappedDifference {
    pub key: &'static str,
    /// Value of the mapping, and of the design; none where there is no such part.
    pub values: [Option<MappedValue>; 2],
}

impl fmt::Display for MappedDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let key = self.key;
        let [of_mapping, of_design] = self.values.each_ref().map(|value| match value {
            Some(value) => format!("`{key} = {value}`"),
            None => format!("no `{key}`"),
        });
        write!(f, "the mapping is for {of_mapping}, and the design has {of_design}")
    }
}

impl MappedCell {
    /// Keys of a cell, in the order in which they are written.
    pub const KEYS: [MappedKey; 14] = {
        const fn key(name: &'static str, usual: Usual) -> MappedKey {
            MappedKey { name, usual }
        }
        [
            key("shape", Usual::Text("square")),
            key("lattice", Usual::Text("square")),
            key("pitch_nm", Usual::Required),
            key("pillar_height_nm", Usual::Required),
            key("pillar_width_nm", Usual::Absent),
            key("pillar_length_nm", Usual::Absent),
            key("pillar_material", Usual::Required),
            key("substrate_material", Usual::Text("fused_silica_malitson_1965")),
            key("ambient_index", Usual::Number(1.0)),
            key("ambient_material", Usual::Absent),
            key("spacer_nm", Usual::Number(0.0)),
            key("spacer_material", Usual::Absent),
            key("residual_nm", Usual::Number(0.0)),
            key("wavelength_nm", Usual::Required),
        ]
    };

    /// Words for what to do about another cell.
    pub const REMEDY: &'static str =
        "`metalith cells` finds a mapping for this cell; `accept = \"REASON\"` in [mapping] goes on with this one";

    /// A cell of the keys that have a value; usual values are left out, but for those that every mapping states.
    pub fn new(values: impl IntoIterator<Item = (&'static str, MappedValue)>) -> Self {
        Self(values.into_iter().collect())
    }

    /// The cell of the published polynomials, and their wavelength.
    pub fn published() -> Self {
        Self::new([
            ("pitch_nm", 350.0.into()),
            ("pillar_height_nm", 700.0.into()),
            ("pillar_material", "sin_luke_2015".into()),
            ("wavelength_nm", 452.0.into()),
        ])
    }

    fn value(&self, key: &MappedKey) -> Option<MappedValue> {
        self.0.get(key.name).cloned().or(match key.usual {
            Usual::Text(text) => Some(text.into()),
            Usual::Number(number) => Some(number.into()),
            Usual::Required | Usual::Absent => None,
        })
    }

    /// Keys that every mapping states and this one does not.
    pub fn missing(&self) -> impl Iterator<Item = &'static str> {
        let lacks = |key: &MappedKey| matches!(key.usual, Usual::Required) && !self.0.contains_key(key.name);
        Self::KEYS.into_iter().filter(lacks).map(|key| key.name)
    }

    /// Keys in which the cell of a design differs from this one, which a mapping is for.
    pub fn differences(&self, of_design: &Self) -> Vec<MappedDifference> {
        let differs = |key: MappedKey| {
            let values = [self.value(&key), of_design.value(&key)];
            let same = match &values {
                [Some(a), Some(b)] => a.is(b),
                [a, b] => a == b,
            };
            (!same).then_some(MappedDifference { key: key.name, values })
        };
        Self::KEYS.into_iter().filter_map(differs).collect()
    }

    /// Lines `key = value`: those that every mapping states, and what is not usual.
    fn lines(&self) -> impl Iterator<Item = String> {
        let line = |key: MappedKey| {
            let always = matches!(key.name, "shape" | "lattice" | "substrate_material");
            let value = if always {
                self.value(&key)
            } else {
                self.0.get(key.name).cloned()
            };
            Some(format!("{} = {}", key.name, value?))
        };
        Self::KEYS.into_iter().filter_map(line)
    }

    /// The section of a design that states it.
    pub fn to_toml(&self) -> String {
        self.lines()
            .fold("[mapping.cell]".into(), |text, line| text + "\n" + &line)
    }

    /// The comment lines at the head of a table that state it.
    pub fn to_comments(&self) -> String {
        self.lines().map(|line| format!("# {line}\n")).collect()
    }

    /// The cell that comment lines at the head of a table state, and the line of each of its keys; none if they state none.
    ///
    /// # Errors
    /// If the file cannot be read, or a line of it is no value, stands there twice, or is missing.
    pub fn read_comments(path: &Path) -> Result<Option<(Self, BTreeMap<&'static str, usize>)>> {
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(Error::io("read", path))?;
        file.take(LONGEST_HEAD)
            .read_to_end(&mut bytes)
            .map_err(Error::io("read", path))?;
        let text = String::from_utf8_lossy(&bytes);
        let text = text.trim_start_matches('\u{feff}');
        let fault = |line: usize, what: String| {
            let hint = "lines such as `# pitch_nm = 350` at the head of the table state the cell that it is for, as `metalith cells` \
                        writes them";
            Error::table(path, Some(line), what, hint)
        };
        let (mut cell, mut places) = (Self::default(), BTreeMap::new());
        for (line, text) in text.lines().enumerate().map(|(k, text)| (k + 1, text.trim())) {
            let Some(comment) = text.strip_prefix('#') else {
                if text.is_empty() {
                    continue;
                }
                break;
            };
            let Some((name, value)) = comment.split_once('=') else {
                continue;
            };
            let Some(key) = Self::KEYS.into_iter().find(|key| key.name == name.trim()) else {
                continue;
            };
            let value = MappedValue::parse(value)
                .ok_or_else(|| fault(line, format!("`{}` is no value", quoted(value.trim()))))?;
            let is_number = key.name.ends_with("_nm") || key.name == "ambient_index";
            if is_number != matches!(value, MappedValue::Number(_)) {
                return Err(fault(line, format!("`{}` cannot be {value}", key.name)));
            }
            if places.insert(key.name, line).is_some() {
                return Err(fault(line, format!("`{}` stands here twice", key.name)));
            }
            cell.0.insert(key.name, value);
        }
        let Some(last) = places.values().max() else {
            return Ok(None);
        };
        let missing = cell.missing().next();
        match missing {
            Some(missing) => Err(fault(*last, format!("the head of the table lacks `{missing}`"))),
            None => Ok(Some((cell, places))),
        }
    }
}

impl Serialize for MappedCell {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        self.0.serialize(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Option<(MappedCell, BTreeMap<&'static str, usize>)>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mapping.csv");
        std::fs::write(&path, text).unwrap();
        MappedCell::read_comments(&path)
    }

    #[test]
    fn what_is_written_is_read() {
        let cell = MappedCell::published();
        let head = cell.to_comments();
        let (found, places) = read(&format!("\u{feff}# a table\n{head}turns,width_nm\n"))
            .unwrap()
            .unwrap();
        assert!(found.differences(&cell).is_empty() && cell.differences(&found).is_empty());
        assert_eq!(places["pitch_nm"], 4);
        assert_eq!(read("turns,width_nm\n# pitch_nm = 350\n").unwrap(), None);
    }

    #[test]
    fn differences_have_both_values() {
        let design = MappedCell::new([
            ("pitch_nm", 350.0.into()),
            ("pillar_height_nm", 300.0.into()),
            ("pillar_material", "sin_luke_2015".into()),
            ("ambient_material", "water.csv".into()),
            // As a sum in um has it.
            ("wavelength_nm", (0.452 * 1e3).into()),
        ]);
        let found = MappedCell::published().differences(&design);
        let words: Vec<_> = found.iter().map(MappedDifference::to_string).collect();
        assert_eq!(
            words,
            [
                "the mapping is for `pillar_height_nm = 700`, and the design has `pillar_height_nm = 300`",
                "the mapping is for no `ambient_material`, and the design has `ambient_material = \"water.csv\"`",
            ]
        );
    }

    #[test]
    fn faults_are_told_by_their_lines() {
        for (text, at, word) in [
            ("# pitch_nm = 350\nturns,width_nm", 1, "lacks `pillar_height_nm`"),
            ("# a\n# pitch_nm = wide\n", 2, "is no value"),
            ("# pitch_nm = \"wide\"\n", 1, "cannot be"),
            ("# shape = 3\n", 1, "cannot be"),
            ("# pitch_nm = 350\n# pitch_nm = 350\n", 2, "twice"),
        ] {
            match read(text) {
                Err(Error::Table { line, what, .. }) => {
                    assert!(line == Some(at) && what.contains(word), "{text}: {what}");
                }
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
