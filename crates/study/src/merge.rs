//! All draws of a study, and what they say together.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use metalith_core::{Error, Progress, Result, WholeFile};
use serde::Serialize;

use crate::bench::JudgedDraw;
use crate::columns::{columns, csv};
use crate::plan::Plan;
use crate::points::{GridPoint, combinations, each_value};
use crate::record::DrawRecord;
use crate::response::{Response, Table, Tightening};
use crate::shard::{FOLDER, Run, read};
use crate::yields::Yield;

/// The yield that tolerances are asked for.
const WANTED_YIELD: f64 = 0.9;

/// A study that is complete.
#[derive(Serialize)]
pub struct StudyResult {
    pub plan: Plan,
    /// Over each limit, then over all of them.
    pub yields: Vec<Yield>,
    /// Draws at each value of each grid; none where there is no grid.
    pub grid: Vec<GridPoint>,
    /// Draws at each combination of values of several grids, where these are few enough to be read.
    pub combinations: Vec<GridPoint>,
    /// Of the limits that depend on the draw.
    pub responses: Vec<Response>,
    /// What it takes for a yield of 90 %.
    pub tightenings: Vec<Tightening>,
    /// All draws, in the order of their numbers.
    #[serde(skip)]
    pub draws: Vec<DrawRecord>,
    /// Numbers of the draws with the least margin, the worst first.
    pub worst: Vec<u64>,
    /// The worst draws in full.
    #[serde(skip)]
    pub shown: Vec<JudgedDraw>,
}

/// Put the shards of a study together; `show` of its worst draws are simulated again for their PSFs.
///
/// # Errors
/// If draws are missing or there twice, all named; if a shard is of another plan; as [`Run::open`].
pub fn merge(plan: &Plan, show: usize, progress: &dyn Progress) -> Result<StudyResult> {
    let folder = plan.folder.join(FOLDER);
    let draws = whole(plan, &folder, &files(&folder)?)?;
    let run = Run::open(plan)?;
    let drawer = run.drawer();
    let count = plan.quantities.len();
    let names = plan.quantities.iter().map(|q| q.0.clone()).collect();
    let middles: Vec<f64> = (0..count).map(|q| drawer.middle(q)).collect();
    let random: Vec<bool> = (0..count).map(|q| drawer.is_random(q)).collect();
    let table = Table::new(names, &middles, random, &draws);
    let limits = plan.limits.iter().enumerate();
    let responses: Vec<Response> = limits
        .clone()
        .filter_map(|(k, l)| table.response(k, l, &draws))
        .collect();
    let mut yields: Vec<Yield> = limits
        .map(|(k, l)| {
            let held = draws.iter().filter(|d| l.holds(d.reached[k])).count();
            Yield::of(l.key.clone(), held as u64, draws.len() as u64)
        })
        .collect();
    let all = draws.iter().filter(|d| d.passed).count() as u64;
    yields.push(Yield::of("all".into(), all, draws.len() as u64));
    let worst = worst(plan, &draws);
    let mut shown = Vec::new();
    progress.begin("simulating the worst draws", show as u64);
    for k in worst.iter().take(show) {
        shown.push(run.judged(*k, progress)?);
        progress.advance(1);
    }
    Ok(StudyResult {
        tightenings: table.tightenings(WANTED_YIELD, &plan.limits, &responses, &draws),
        grid: each_value(drawer, &plan.quantities, &draws),
        combinations: combinations(drawer, &plan.quantities, &draws),
        plan: plan.clone(),
        yields,
        responses,
        draws,
        worst,
        shown,
    })
}

/// Draws by their least margin, in units of what the margin of its limit varies by.
fn worst(plan: &Plan, draws: &[DrawRecord]) -> Vec<u64> {
    let spread = |k: usize| {
        let margins = draws.iter().filter_map(|d| d.reached[k]);
        let n = margins.clone().count().max(1) as f64;
        let mean = margins.clone().sum::<f64>() / n;
        (margins.map(|m| (m - mean).powi(2)).sum::<f64>() / n).sqrt()
    };
    let limits: Vec<_> = plan.limits.iter().enumerate().map(|(k, l)| (k, l, spread(k))).collect();
    let least = |d: &DrawRecord| {
        let varied = limits.iter().filter(|(_, _, s)| *s > 0.0);
        let margins = varied.map(|(k, l, s)| d.reached[*k].map_or(f64::NEG_INFINITY, |r| l.margin(r) / s));
        margins.fold(f64::INFINITY, f64::min)
    };
    let mut order: Vec<(f64, u64)> = draws.iter().map(|d| (least(d), d.draw)).collect();
    order.retain(|(margin, _)| *margin < f64::INFINITY);
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    order.into_iter().map(|(_, k)| k).collect()
}

/// Files of shards, by name.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(Error::io("read", folder)(error)),
    };
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(Error::io("read", folder))?.path();
        let name = path
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        // Hidden ones are being written, or were left by a run that was killed.
        if name.ends_with(".jsonl") && !name.starts_with('.') {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// All draws, each once.
fn whole(plan: &Plan, folder: &Path, files: &[PathBuf]) -> Result<Vec<DrawRecord>> {
    let mut found: Vec<Option<(DrawRecord, usize)>> = Vec::new();
    found.resize_with(plan.draws as usize, || None);
    let mut twice = Vec::new();
    for (number, path) in files.iter().enumerate() {
        for draw in read(plan, path)? {
            let Some(place) = found.get_mut(draw.draw as usize) else {
                return Err(Error::invalid(
                    format!(
                        "{} holds draw {}, and the study has {}",
                        path.display(),
                        draw.draw,
                        plan.draws
                    ),
                    "remove the file",
                ));
            };
            match place {
                Some((_, other)) => twice.push((draw.draw, *other, number)),
                None => *place = Some((draw, number)),
            }
        }
    }
    if let Some((draw, a, b)) = twice.first() {
        return Err(Error::invalid(
            format!(
                "{} draws are there twice, the first is {draw}: in {} and in {}",
                twice.len(),
                files[*a].display(),
                files[*b].display()
            ),
            "remove one of the two files",
        ));
    }
    let missing: Vec<u64> = (0..plan.draws).filter(|k| found[*k as usize].is_none()).collect();
    if !missing.is_empty() {
        return Err(Error::invalid(
            format!(
                "{} of {} draws are missing in {}: {}",
                missing.len(),
                plan.draws,
                folder.display(),
                ranges(&missing)
            ),
            "make them with `metalith study run FOLDER --missing`",
        ));
    }
    Ok(found.into_iter().flatten().map(|(d, _)| d).collect())
}

/// Rising numbers as `0-3, 7, 9-12`, the first twenty ranges.
pub(crate) fn ranges(numbers: &[u64]) -> String {
    let mut runs: Vec<(u64, u64)> = Vec::new();
    for n in numbers {
        match runs.last_mut() {
            Some((_, end)) if *end + 1 == *n => *end = *n,
            _ => runs.push((*n, *n)),
        }
    }
    let more = runs.len() > 20;
    let words: Vec<String> = runs
        .iter()
        .take(20)
        .map(|(a, b)| if a == b { a.to_string() } else { format!("{a}-{b}") })
        .collect();
    words.join(", ") + if more { ", ..." } else { "" }
}

impl StudyResult {
    /// Write all draws as a table: CSV, JSON Lines, JSON, or Parquet by the ending of the name.
    ///
    /// # Errors
    /// If the ending is another, the program was built without Parquet, or the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let bytes = match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => csv(&columns(self), self.draws.len()).into_bytes(),
            Some("jsonl") => self.lines().into_bytes(),
            Some("json") => {
                let whole = serde_json::json!({ "study": self, "draws": self.draws });
                format!("{whole:#}\n").into_bytes()
            }
            Some("parquet") => self.parquet()?,
            _ => {
                return Err(Error::invalid(
                    format!("{}: this ending is not known", path.display()),
                    "name a file that ends in .csv, .json, .jsonl or .parquet",
                ));
            }
        };
        WholeFile::write(path, &bytes)
    }

    #[cfg(feature = "parquet")]
    fn parquet(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        crate::parquet_file::write(&columns(self), &mut bytes)?;
        Ok(bytes)
    }

    #[cfg(not(feature = "parquet"))]
    fn parquet(&self) -> Result<Vec<u8>> {
        Err(Error::invalid(
            "this program was built without Parquet",
            "build it with `--features parquet`, or name a file that ends in .csv, .json or .jsonl",
        ))
    }

    fn lines(&self) -> String {
        let mut text = String::new();
        for draw in &self.draws {
            let _ = writeln!(text, "{}", serde_json::to_string(draw).expect("plain data serialises"));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_numbers_are_named_by_their_ends() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2, 5, 7-8");
        assert_eq!(ranges(&[]), "");
    }
}
