//! Tables: text left, numbers right, units in the head, verdicts in words.

use super::number::{count, exact, fixed, sig};
use super::page::{escape, inline};

/// Verdict on a requirement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Pass,
    Fail,
    /// It could not be looked at: not the same as passing.
    NotRun,
}

impl Verdict {
    /// Pass if it holds, fail if not.
    pub fn of(holds: bool) -> Self {
        if holds { Self::Pass } else { Self::Fail }
    }

    /// The one word that a report says.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::NotRun => "not run",
        }
    }

    /// Pass if all of a residual is explained, fail if nothing is; a part of it is neither.
    pub fn of_explained(all: bool, part: bool) -> Self {
        if part { Self::NotRun } else { Self::of(all) }
    }

    pub(super) fn class(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::NotRun => "notrun",
        }
    }

    pub(super) fn html(self) -> String {
        self.labelled(self.word())
    }

    /// The sign and the colour of the verdict with other words.
    pub(super) fn labelled(self, label: &str) -> String {
        let sign = match self {
            Self::Pass => "✓",
            Self::Fail => "✗",
            Self::NotRun => "–",
        };
        format!(
            "<span class=\"verdict {}\"><span aria-hidden=\"true\">{sign}</span> {}</span>",
            self.class(),
            escape(label)
        )
    }
}

/// Letters of an entry that is not broken over lines.
const KEPT_WHOLE: usize = 28;

/// Heading of a column.
#[derive(Clone, Debug)]
pub struct Column {
    name: String,
    unit: String,
    number: bool,
}

impl Column {
    /// A column of words.
    pub fn text(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: String::new(),
            number: false,
        }
    }

    /// A column of numbers, set right, all in this unit (which may be empty).
    pub fn number(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            number: true,
        }
    }

    /// A column of verdicts.
    pub fn verdict() -> Self {
        Self::text("Verdict")
    }
}

/// One entry of a table. Words and numbers turn into one with `into()`; a number alone is written to
/// four significant digits.
#[derive(Clone, Debug)]
pub struct Cell(String);

impl Cell {
    /// A number to a given number of significant digits.
    pub fn sig(x: f64, digits: usize) -> Self {
        Self(sig(x, digits))
    }

    /// A number with a given number of decimals.
    pub fn fixed(x: f64, decimals: usize) -> Self {
        Self(fixed(x, decimals))
    }

    /// A number as a person gave it, without zeros behind the last digit that counts.
    pub fn exact(x: f64) -> Self {
        Self(exact(x))
    }

    /// No entry.
    pub fn none() -> Self {
        Self("–".into())
    }

    /// A link to a file beside the page, such as `checks/report.html`.
    pub fn link(path: impl AsRef<str>) -> Self {
        let path = escape(path.as_ref());
        Self(format!("<a href=\"{path}\">{path}</a>"))
    }

    /// Words in the type of programs: names of files, cells, keys.
    pub fn code(text: impl AsRef<str>) -> Self {
        Self(format!("<code>{}</code>", escape(text.as_ref())))
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self(escape(text))
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self(escape(&text))
    }
}

impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        Self::sig(x, 4)
    }
}

impl From<u64> for Cell {
    fn from(n: u64) -> Self {
        Self(count(n))
    }
}

impl From<usize> for Cell {
    fn from(n: usize) -> Self {
        Self(count(n as u64))
    }
}

impl From<Verdict> for Cell {
    fn from(verdict: Verdict) -> Self {
        Self(verdict.html())
    }
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(entry: Option<T>) -> Self {
        entry.map_or_else(Self::none, Into::into)
    }
}

/// Rows under columns.
#[derive(Clone, Debug)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
    caption: String,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self {
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
            caption: String::new(),
        }
    }

    /// One more row. Entries beyond the columns are dropped, missing ones stay open.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) -> &mut Self {
        let mut cells: Vec<_> = cells.into_iter().take(self.columns.len()).collect();
        cells.resize_with(self.columns.len(), Cell::none);
        self.rows.push(cells);
        self
    }

    /// Words above the table; words between back quotes are set as code.
    #[must_use]
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    pub(super) fn html(&self) -> String {
        let mut html = String::from("<div class=\"scroll\" tabindex=\"0\"><table>");
        if !self.caption.is_empty() {
            html.push_str(&format!("<caption>{}</caption>", inline(&self.caption)));
        }
        html.push_str("<thead><tr>");
        for column in &self.columns {
            let class = if column.number { " class=\"number\"" } else { "" };
            html.push_str(&format!("<th scope=\"col\"{class}>{}", escape(&column.name)));
            if !column.unit.is_empty() {
                html.push_str(&format!(" <span class=\"unit\">[{}]</span>", escape(&column.unit)));
            }
            html.push_str("</th>");
        }
        html.push_str("</tr></thead><tbody>\n");
        for row in &self.rows {
            html.push_str("<tr>");
            for (cell, column) in row.iter().zip(&self.columns) {
                let shown = cell.0.trim_start_matches("<code>").trim_end_matches("</code>");
                let class = match (column.number, shown.chars().count() <= KEPT_WHOLE) {
                    (true, _) => " class=\"number\"",
                    (false, true) => " class=\"short\"",
                    (false, false) => "",
                };
                html.push_str(&format!("<td{class}>{}</td>", cell.0));
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody></table></div>\n");
        html
    }
}
