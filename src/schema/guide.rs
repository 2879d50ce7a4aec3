//! The tables of keys in the guide: the meaning of each key, in words.

use std::collections::BTreeMap;

use super::FileKind;

/// One line of a table of keys.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    pub meaning: String,
    /// Other columns that say something, each with its head.
    others: Vec<(String, String)>,
}

impl Row {
    /// Meaning, type, range and default in one text.
    pub(super) fn description(&self) -> String {
        let others = self.others.iter().map(|(head, cell)| format!("{head}: {cell}"));
        let parts: Vec<String> = std::iter::once(self.meaning.clone())
            .filter(|meaning| !meaning.is_empty())
            .chain(others)
            .collect();
        parts.join("\n\n")
    }
}

/// The tables of keys of a chapter, by section and key.
#[derive(Debug, Default)]
pub(super) struct Guide {
    rows: BTreeMap<(String, String), Row>,
}

const DESIGN: &str = include_str!("../../docs/guide/design.md");
const OPTIMISE: &str = include_str!("../../docs/guide/optimise.md");
const VERIFY: &str = include_str!("../../docs/guide/verify.md");
const CHECK: &str = include_str!("../../docs/guide/check.md");
const HANDOFF: &str = include_str!("../../docs/guide/handoff.md");
const STUDY: &str = include_str!("../../docs/guide/study.md");
const PLAN: &str = include_str!("../../docs/guide/plan.md");
const CALIBRATE: &str = include_str!("../../docs/guide/calibrate.md");
const MEASURE: &str = include_str!("../../docs/guide/measure.md");
const SETS: &str = include_str!("../../docs/measured-sets.md");

impl Guide {
    /// The tables about a kind of file.
    pub(super) fn of(kind: FileKind) -> Self {
        let texts: &[(&str, &str)] = match kind {
            FileKind::Design => &[(DESIGN, "All keys"), (OPTIMISE, "")],
            FileKind::Camera => &[(VERIFY, "The camera file")],
            FileKind::Rules => &[(CHECK, "Rules files")],
            FileKind::Waivers => &[(CHECK, "Waivers")],
            FileKind::Process => &[(HANDOFF, "The process file")],
            FileKind::Study => &[(STUDY, "The file"), (STUDY, "Pictures"), (STUDY, "Designs over a grid")],
            FileKind::Slurm => &[(STUDY, "Slurm")],
            FileKind::Bench => &[(PLAN, "The bench file"), (SETS, "`measurement.toml`")],
            FileKind::Set => &[(SETS, "`measurement.toml`"), (SETS, "Widths by SEM")],
            FileKind::HeightSet => &[(SETS, "Heights")],
            FileKind::SpectrumSet => &[(SETS, "Spectra")],
            FileKind::WidthSet => &[(SETS, "Widths")],
            FileKind::StackSet => &[(SETS, "Stacks of objects")],
            FileKind::Effects => &[(CALIBRATE, "Effects of your own")],
            FileKind::HeightEffects | FileKind::SpectrumEffects => {
                &[(MEASURE, "Effects of your own"), (CALIBRATE, "Effects of your own")]
            }
        };
        let mut guide = Self::default();
        for (text, chapter) in texts {
            guide.read(text, chapter);
        }
        guide
    }

    /// The line about a key of a section.
    pub(super) fn row(&self, section: &str, key: &str) -> Option<&Row> {
        let of = |section: &str| self.rows.get(&(section.to_owned(), key.to_owned()));
        // A section in another one may have a table of its own: `element.phase` has the keys of `phase`.
        let ends = |of: &str| -> Vec<String> {
            let after = of.match_indices('.').map(|(dot, _)| of[dot + 1..].to_owned());
            std::iter::once(of.to_owned()).chain(after).collect()
        };
        // Or the keys of one that it is in: `element.phase.y` has those of `phase`.
        let outer = section.rmatch_indices('.').map(|(dot, _)| &section[..dot]);
        let names: Vec<String> = std::iter::once(section).chain(outer).flat_map(ends).collect();
        // Or those of a section in it: the forms of `phase` are in the table of `phase.term`.
        let inside = |name: &String| {
            let is_inside =
                |row: &&(String, String)| row.0.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'));
            let found = self.rows.keys().find(|row| row.1 == key && is_inside(row))?;
            self.rows.get(found)
        };
        let found = names.iter().find_map(|name| of(name));
        // Tables of several sections have no section in their head.
        found.or_else(|| names.iter().find_map(inside)).or_else(|| of(ANY))
    }

    /// Read the tables of keys below the heading of a chapter; of the whole text if the heading is empty.
    fn read(&mut self, text: &str, chapter: &str) {
        let (mut level, mut is_here) = (0, chapter.is_empty());
        let mut section = ANY.to_owned();
        let mut heads: Option<(String, Vec<String>)> = None;
        for line in text.lines() {
            let depth = line.chars().take_while(|c| *c == '#').count();
            if depth > 0 {
                if is_here && !chapter.is_empty() && depth <= level {
                    return;
                }
                let title = line[depth..].trim();
                if title == chapter {
                    (level, is_here) = (depth, true);
                }
                section = only_section(title).unwrap_or_else(|| {
                    if title == "Top level" {
                        String::new()
                    } else {
                        ANY.into()
                    }
                });
                self.read_title(title, is_here);
            } else if line.starts_with("**`[") {
                section = only_section(line).unwrap_or_else(|| ANY.into());
                self.read_title(line, is_here);
            }
            let Some(cells) = line.strip_prefix('|').map(|cells| cells.trim_end_matches('|')) else {
                heads = None;
                continue;
            };
            let cells: Vec<&str> = cells.split(" | ").map(str::trim).collect();
            match &heads {
                None if is_here && is_of_keys(cells[0]) => {
                    let own = only_section(cells[0]).unwrap_or_else(|| section.clone());
                    heads = Some((own, cells.iter().map(|cell| plain(cell)).collect()));
                }
                Some(_) if cells[0].starts_with("---") => {}
                Some((section, heads)) => {
                    let row = Row::of(heads, &cells);
                    for (section, key) in keys_of(cells[0], section) {
                        self.rows.entry((section, key)).or_insert_with(|| row.clone());
                    }
                }
                None => {}
            }
        }
    }
}

impl Guide {
    /// The meaning of sections in a title, as "`[cell]`: the pillar".
    fn read_title(&mut self, title: &str, is_here: bool) {
        let Some((sections, meaning)) = title.split_once(": ").filter(|_| is_here) else {
            return;
        };
        for (section, _) in quoted(sections).filter_map(split_section) {
            let (outer, inner) = section.rsplit_once('.').unwrap_or(("", &section));
            let row = Row {
                meaning: plain(meaning),
                others: Vec::new(),
            };
            self.rows.entry((outer.into(), inner.into())).or_insert(row);
        }
    }
}

/// Stands for sections that a table does not name.
const ANY: &str = "*";

impl Row {
    fn of(heads: &[String], cells: &[&str]) -> Self {
        let mut row = Self::default();
        for (head, cell) in heads.iter().zip(cells).skip(1) {
            let cell = plain(cell);
            if head == "meaning" {
                row.meaning = cell;
            } else if !cell.is_empty() {
                row.others.push((head.clone(), cell));
            }
        }
        row
    }
}

fn is_of_keys(head: &str) -> bool {
    head == "key" || head.starts_with("key in ") || head == "section and key"
}

/// The one section that is named in a text, as `[a.b]` or `[[a.b]]`.
fn only_section(text: &str) -> Option<String> {
    let mut sections = quoted(text).filter_map(|quoted| Some(split_section(quoted)?.0));
    let first = sections.next()?;
    sections.next().is_none().then_some(first)
}

/// The section that a text in backticks begins with, and what follows it.
fn split_section(quoted: &str) -> Option<(String, &str)> {
    let inner = quoted.strip_prefix('[')?;
    let (name, rest) = match inner.strip_prefix('[') {
        Some(inner) => inner.split_once("]]")?,
        None => inner.split_once(']')?,
    };
    Some((name.to_owned(), rest.trim()))
}

/// Sections and keys of the first cell of a line; a key after a section is in it.
fn keys_of(cell: &str, section: &str) -> Vec<(String, String)> {
    let mut section = section.to_owned();
    let mut keys = Vec::new();
    for quoted in quoted(cell) {
        let key = match split_section(quoted) {
            Some((own, rest)) => {
                section = own;
                rest
            }
            None => quoted,
        };
        let (section, key) = match (key, section.rsplit_once('.')) {
            // The section itself.
            ("", Some((outer, inner))) => (outer.to_owned(), inner.to_owned()),
            ("", None) => (String::new(), section.clone()),
            (key, _) => (section.clone(), key.to_owned()),
        };
        let key = key.split(' ').next().unwrap_or_default().to_owned();
        keys.push((section, key));
    }
    keys
}

/// The texts in backticks.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// A cell without links and backticks.
fn plain(cell: &str) -> String {
    let mut out = String::new();
    let mut rest = cell;
    while let Some((before, after)) = rest.split_once("](") {
        let (open, words) = before.rsplit_once('[').unwrap_or((before, ""));
        out.push_str(open);
        out.push_str(words);
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    out.push_str(rest);
    out.replace('`', "")
}
