//! Violations that someone has looked at and accepted, with a name and a date.

use std::path::{Path, PathBuf};

use serde::Serialize;

use metalith_core::Result;
use metalith_core::document::{Document, KeyTable, Section, explore, load};

/// A day of the calendar, ordered by time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Date {
    pub year: i64,
    pub month: u32,
    pub day: u32,
}

impl Date {
    /// `2027-01-31`; none if it is not a date.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split('-');
        let date = Self {
            year: parts.next()?.parse().ok()?,
            month: parts.next()?.parse().ok()?,
            day: parts.next()?.parse().ok()?,
        };
        let legal = (1..=12).contains(&date.month) && (1..=31).contains(&date.day) && parts.next().is_none();
        legal.then_some(date)
    }

    /// Today in UTC.
    pub fn today() -> Self {
        let seconds = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .map_or(0, |d| d.as_secs());
        Self::of_day((seconds / 86_400) as i64)
    }

    /// The date so many days after 1970-01-01: months counted from March, so that the leap day is last.
    fn of_day(day: i64) -> Self {
        let day = day + 719_468;
        let era = day.div_euclid(146_097);
        let of_era = day.rem_euclid(146_097);
        let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
        let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let month = (5 * of_year + 2) / 153;
        let (month_of_year, day) = (
            if month < 10 { month + 3 } else { month - 9 },
            of_year - (153 * month + 2) / 5 + 1,
        );
        Self {
            year: year_of_era + 400 * era + i64::from(month_of_year <= 2),
            month: month_of_year as u32,
            day: day as u32,
        }
    }
}

impl std::fmt::Display for Date {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:04}-{:02}-{:02}", self.year, self.month, self.day)
    }
}

/// One accepted violation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Waiver {
    pub rule: String,
    /// Hash of the marker it covers.
    pub hash: String,
    pub reason: String,
    pub author: String,
    /// Last day on which it holds.
    pub expires: Date,
    #[serde(skip)]
    pub index: usize,
}

/// The waivers of one file.
#[derive(Clone, Debug)]
pub struct Waivers {
    pub path: PathBuf,
    /// The text that was read.
    pub text: String,
    pub list: Vec<Waiver>,
}

impl Waivers {
    /// Read a file of `[[waiver]]` sections.
    ///
    /// # Errors
    /// With every mistake of the file, each with its place.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        let list = Document::read(path, &text, sections)?;
        Ok(Self {
            path: path.to_owned(),
            text,
            list,
        })
    }

    /// The keys of a file of waivers.
    pub fn keys() -> KeyTable {
        explore(&[], |root, _| sections(root))
    }

    /// Waivers for a rule that have not expired.
    pub(super) fn valid(&self, rule: &str, today: Date) -> Vec<Waiver> {
        let holds = |w: &&Waiver| w.rule == rule && w.expires >= today;
        self.list.iter().filter(holds).cloned().collect()
    }
}

fn sections(root: &Section<'_, '_>) -> Vec<Waiver> {
    let sections = root.sections("waiver");
    sections.iter().enumerate().map(|(k, s)| Waiver::read(s, k)).collect()
}

impl Waivers {
    /// These and those of another file.
    #[must_use]
    pub fn and(mut self, other: &Self) -> Self {
        self.list.extend(other.list.iter().cloned());
        self.list.iter_mut().enumerate().for_each(|(k, w)| w.index = k);
        self
    }
}

impl Waiver {
    /// Section of the waiver in a file of waivers.
    pub fn text(&self) -> String {
        format!(
            "[[waiver]]\nrule = {:?}\nhash = {:?}\nreason = {:?}\nauthor = {:?}\nexpires = \"{}\"\n",
            self.rule, self.hash, self.reason, self.author, self.expires
        )
    }

    fn read(s: &Section<'_, '_>, index: usize) -> Self {
        let expires = s.text("expires");
        let date = Date::parse(&expires).unwrap_or_else(|| {
            if s.has("expires") {
                s.fault(
                    "expires",
                    format!("\"{expires}\" is not a date"),
                    "write it as \"2027-01-31\"",
                );
            }
            Date::default()
        });
        let waiver = Self {
            rule: s.text("rule"),
            hash: s.text("hash"),
            reason: s.text("reason"),
            author: s.text("author"),
            expires: date,
            index,
        };
        for (key, value) in [("reason", &waiver.reason), ("author", &waiver.author)] {
            if s.has(key) && value.trim().is_empty() {
                s.fault(key, format!("`{key}` is empty"), "say who accepts this and why");
            }
        }
        s.finish();
        waiver
    }
}

#[cfg(test)]
mod tests {
    use super::Date;

    #[test]
    fn days_of_the_calendar() {
        assert_eq!(Date::of_day(0).to_string(), "1970-01-01");
        assert_eq!(Date::of_day(19_782).to_string(), "2024-02-29");
        assert_eq!(Date::of_day(20_778).to_string(), "2026-11-21");
        assert!(Date::parse("2026-11-21") < Date::parse("2027-01-01"));
        assert_eq!(Date::parse("2026-13-01"), None);
    }
}
