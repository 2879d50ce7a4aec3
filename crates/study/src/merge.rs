//! All draws of a study, and what they say together.

use std::fmt::Write as _;
use std::path::Path;

use metalith_core::{AtomicFile, Error, Progress, Result};
use serde::Serialize;

use crate::bench::JudgedDraw;
use crate::columns::{columns, csv};
use crate::grid_points::{GridPoint, combinations, each_value};
use crate::plan::Plan;
use crate::record::DrawRecord;
use crate::response::{Response, Table, Tightening};
use crate::shard::Run;
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
    /// Responses of the limits that depend on the draw.
    pub responses: Vec<Response>,
    /// Tightening of tolerances for a yield of 90 %.
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
/// If shards are missing, damaged or of another plan, all named; if amounts are not those that the plan draws; as
/// [`Run::open`].
pub fn merge(plan: &Plan, show: usize, progress: &dyn Progress) -> Result<StudyResult> {
    let draws = plan.cut().whole(&|d: &DrawRecord| Some(d.draw), progress)?;
    check_counts(plan, &draws)?;
    let run = Run::open(plan, progress)?;
    run.check(&draws)?;
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

/// Refuse draws with another number of amounts or of limits than the plan has.
fn check_counts(plan: &Plan, draws: &[DrawRecord]) -> Result<()> {
    let wanted = (plan.quantities.len(), plan.limits.len());
    let other = draws.iter().find(|d| (d.amounts.len(), d.reached.len()) != wanted);
    other.map_or(Ok(()), |d| {
        Err(Error::refused(
            "study/damaged-draw",
            format!(
                "draw {} has {} amounts and {} limits, of {} and {}",
                d.draw,
                d.amounts.len(),
                d.reached.len(),
                wanted.0,
                wanted.1
            ),
            "remove the shard that holds it, and run what is missing",
        ))
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

impl StudyResult {
    /// Write all draws as a table: CSV, JSON Lines, JSON, or Parquet by the ending of the name.
    ///
    /// # Errors
    /// As [`TableFormat::of`], or if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let bytes = match TableFormat::of(path)? {
            TableFormat::Csv => csv(&columns(self), self.draws.len()).into_bytes(),
            TableFormat::JsonLines => self.lines().into_bytes(),
            TableFormat::Json => {
                let whole = serde_json::json!({ "study": self, "draws": self.draws });
                format!("{whole:#}\n").into_bytes()
            }
            #[cfg(feature = "parquet")]
            TableFormat::Parquet => {
                let mut bytes = Vec::new();
                crate::parquet_file::write(&columns(self), &mut bytes)?;
                bytes
            }
        };
        AtomicFile::write(path, &bytes)
    }

    fn lines(&self) -> String {
        let mut text = String::new();
        for draw in &self.draws {
            let _ = writeln!(text, "{}", serde_json::to_string(draw).expect("plain data serialises"));
        }
        text
    }
}

/// Format of a table of draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    Csv,
    JsonLines,
    Json,
    #[cfg(feature = "parquet")]
    Parquet,
}

impl TableFormat {
    /// Format by the ending of the name of a file.
    ///
    /// # Errors
    /// If the ending is another, or the program was built without Parquet.
    pub fn of(path: &Path) -> Result<Self> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => Ok(Self::Csv),
            Some("jsonl") => Ok(Self::JsonLines),
            Some("json") => Ok(Self::Json),
            #[cfg(feature = "parquet")]
            Some("parquet") => Ok(Self::Parquet),
            #[cfg(not(feature = "parquet"))]
            Some("parquet") => Err(Error::refused(
                "study/no-parquet",
                "this program was built without Parquet",
                "build it with `--features parquet`, or name a file that ends in .csv, .json or .jsonl",
            )),
            _ => Err(Error::refused(
                "study/unknown-ending",
                format!("{}: this ending is not known", path.display()),
                "name a file that ends in .csv, .json, .jsonl or .parquet",
            )),
        }
    }
}
