//! Cells: names that every tool takes, a tree that every tool follows.

use super::context::Context;
use super::findings::Findings;
use super::flat_layout::FlatLayout;
use super::rule::{Needs, Rule, RuleOutcome};
use metalith_core::document::Section;
use metalith_core::text::printable;
use metalith_gds::{Faulty, Layout};

enum TreeRule {
    /// Longest name; characters are those of the format.
    Names(i64),
    Depth(i64),
    References(i64),
    OneTop,
    NoDangling,
    NoCircle,
    NamesOnce,
    NothingBehind,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, _context: &Context) -> Option<Box<dyn Rule>> {
    Some(Box::new(match check {
        "cell_names" => TreeRule::Names(s.integer("longest", 1..=1024, "characters")),
        "depth_max" => TreeRule::Depth(s.integer("levels", 1..=256, "levels")),
        "references_max" => TreeRule::References(s.integer("count", 0..=i64::MAX, "references")),
        "one_top" => TreeRule::OneTop,
        "dangling" => TreeRule::NoDangling,
        "recursive" => TreeRule::NoCircle,
        "cell_twice" => TreeRule::NamesOnce,
        "bytes_behind_end" => TreeRule::NothingBehind,
        _ => return None,
    }))
}

impl Rule for TreeRule {
    fn words(&self) -> String {
        match self {
            Self::Names(most) => format!("cell names of A-Z a-z 0-9 _ ? $, at most {most}"),
            Self::Depth(most) => format!("at most {most} levels of cells"),
            Self::References(most) => format!("at most {most} references in the file"),
            Self::OneTop => "one top cell".into(),
            Self::NoDangling => "every reference leads to a cell".into(),
            Self::NoCircle => "no cell contains itself".into(),
            Self::NamesOnce => "every cell name is there once".into(),
            Self::NothingBehind => "nothing but padding behind the end of the file".into(),
        }
    }

    fn needs(&self) -> Needs {
        Needs::Numbers
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        self.file(flat.layout, found);
        Ok(())
    }
}

impl TreeRule {
    fn file(&self, layout: &Layout, found: &mut Findings) {
        let file = layout.path().file_name().unwrap_or_default().to_string_lossy();
        let file = printable(&file);
        let mut faults = |list: Vec<Faulty>, words: &dyn Fn(&Faulty) -> String| {
            for f in &list {
                found.plain(&format!("{} {}", f.cell, f.name), || {
                    format!("{}, byte {} of {file}", words(f), f.offset)
                });
            }
        };
        match self {
            Self::NoDangling => faults(layout.dangling(), &|f| {
                format!("{} refers to {}, which is not there", f.cell, f.name)
            }),
            Self::NoCircle => faults(layout.circles(), &|f| {
                format!("{} refers to {}, which contains it", f.cell, f.name)
            }),
            Self::NamesOnce => faults(layout.doubled(), &|f| format!("a second cell {}", f.cell)),
            Self::Names(most) => {
                for cell in layout.cells() {
                    let legal = |c: char| c.is_ascii_alphanumeric() || "_?$".contains(c);
                    if cell.name.chars().count() as i64 > *most || !cell.name.chars().all(legal) {
                        found.plain(&cell.name, || format!("cell \"{}\" of {file}", cell.name));
                    }
                }
            }
            Self::Depth(most) => {
                let levels = layout.depth() + 1;
                found.facts.push((format!("levels of {file}"), f64::from(levels)));
                if i64::from(levels) > *most {
                    found.plain(&format!("{levels}"), || {
                        format!("{levels} levels in {file}, at most {most}")
                    });
                }
            }
            Self::References(most) => {
                let count: u64 = layout.cells().iter().map(metalith_gds::LayoutCell::references).sum();
                found.facts.push((format!("references in {file}"), count as f64));
                if i128::from(count) > i128::from(*most) {
                    found.plain(&format!("{count}"), || {
                        format!("{count} references in {file}, at most {most}")
                    });
                }
            }
            Self::OneTop => {
                let tops: Vec<&str> = layout.tops().iter().map(|&t| layout.cells()[t].name.as_str()).collect();
                if tops.len() != 1 {
                    let some = tops[..tops.len().min(8)].join(", ");
                    found.plain(&some, || format!("{} top cells in {file}: {some}", tops.len()));
                }
            }
            Self::NothingBehind => {
                let (bytes, nonzero) = layout.trailing();
                if nonzero {
                    found.plain(&format!("{bytes}"), || {
                        format!("{bytes} bytes behind the end of {file}, not all zero")
                    });
                }
            }
        }
    }
}
