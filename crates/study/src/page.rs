//! The page of a study.

use std::path::Path;

use metalith_core::Result;
use metalith_imaging::pictures_side_by_side;
use metalith_report::{
    Axis, Cell, Chart, Column, Figure, ImageGrid, Page, Ranking, Table, count, fixed, sig, write_json,
};

use crate::grid_page::over_grid;
use crate::merge::StudyResult;
use crate::yields::{Yield, wilson};

/// Bins of draws over one quantity.
const BINS: usize = 8;

/// Below this, what rests on the fit is not to be trusted.
const TRUSTED: f64 = 0.8;

/// Limits whose shares of variance are drawn.
const MOST_DRAWN: usize = 6;

/// Names of the page of a study and of its numbers, of which the table of draws has this name: `report.html` and `report.json` beside
/// `result.csv`, `draws_report.html` and `draws_report.json` beside `draws.csv`, so that tables of several studies have a folder in
/// common.
pub fn report_files(table: &str) -> [String; 2] {
    let stem = Path::new(table).file_stem().unwrap_or_default().to_string_lossy();
    ["html", "json"].map(|ending| match &*stem {
        DEFAULT_STEM => format!("report.{ending}"),
        stem => format!("{stem}_report.{ending}"),
    })
}

/// Name of a table of draws without its ending, where nobody has named it.
const DEFAULT_STEM: &str = "result";

/// Write the page of a study and its numbers into a folder, under the names of [`report_files`].
///
/// # Errors
/// If a file cannot be written.
pub fn write_page(result: &StudyResult, files: &[String; 2], folder: &Path) -> Result<()> {
    let [html, json] = files.each_ref().map(|name| folder.join(name));
    write_json(&json, "study", result)?;
    page(result).write(&html)
}

fn page(result: &StudyResult) -> Page {
    let plan = &result.plan;
    let name = plan
        .tolerance
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let mut page = Page::new(
        format!("Study of {name}"),
        "Many simulated chips with the tolerances of a process",
    );
    let all = result.yields.last().expect("the yield over all limits is always there");
    page.facts(&[
        ("Draws", count(plan.draws)),
        ("Shards", count(plan.cut().shards())),
        ("Yield over all limits", share(all)),
        (
            "Varied",
            plan.quantities
                .iter()
                .map(|q| q.0.as_str())
                .collect::<Vec<_>>()
                .join(", "),
        ),
        ("Key", plan.key[..16].to_owned()),
    ]);
    page.section("Yield");
    page.paragraph("Number of draws that hold each limit, with Wilson's 95 % interval for the finite number of draws.");
    page.table(yields(result));
    if !result.responses.is_empty() {
        page.section("What contributes");
        page.paragraph(
            "Shares of the variance of each limit's margin, from a polynomial of second order fitted to the draws. \
             \"Predicted\" is the share of the variance that such a fit predicts on draws that it was not fitted to; shares \
             mean little where that is far below one.",
        );
        page.table(shares(result));
        page.row(result.responses.iter().take(MOST_DRAWN).map(|r| {
            let mut bars = Ranking::new(format!("Variance of `{}`", r.key), Axis::linear("share", ""));
            for (quantity, share) in plan.quantities.iter().zip(&r.shares) {
                bars.bar(quantity.0.clone(), *share, None, String::new(), false);
            }
            bars.caption(format!(
                "Pairs of quantities: {}; not explained: {}.",
                sig(r.pairs, 2),
                sig(r.rest, 2)
            ))
        }));
        page.section("How tight for a yield of 90 %");
        page.paragraph(
            "Factor for the spread of each quantity that gives this yield, with the spread of the others as stated; last, one factor for all. \
             Draws are moved by the fit above and keep what it misses of them.",
        );
        let worst = result.responses.iter().map(|r| r.predicted).fold(1.0, f64::min);
        if worst < TRUSTED {
            page.note(format!(
                "The fit predicts only {} of the variance of one limit: take these factors as a hint, and run a study with \
                 tighter distributions to see.",
                sig(worst, 2)
            ));
        }
        page.table(tightenings(result));
    }
    page.section("Over one quantity");
    // A choice has no axis.
    let is_number = |q: &usize| {
        let points = result.grid.iter().filter(|p| p.at[0].0 == plan.quantities[*q].0);
        points.into_iter().all(|p| p.at[0].1.number().is_some())
    };
    let figures: Vec<Figure> = (0..plan.quantities.len())
        .filter(is_number)
        .map(|q| over_one(result, q))
        .collect();
    page.row(figures);
    over_grid(&mut page, result);
    if !result.shown.is_empty() {
        page.section("Worst draws");
        page.paragraph("Draws with the smallest margin to a limit, in units of the standard deviation of that margin.");
        page.table(worst(result));
        for draw in &result.shown {
            let k = draw.record.draw;
            if let Some(taken) = &draw.picture {
                let row = pictures_side_by_side(&taken.truth, &taken.frame, &taken.restored, &taken.channels);
                let whole = &taken.scores[0];
                page.figure(row.caption(format!(
                    "Draw {k}: PSNR {} dB, SSIM {}.",
                    fixed(whole.psnr_db, 1),
                    fixed(whole.ssim, 2)
                )));
                if let Some(note) = &taken.note {
                    page.note(format!("Draw {k}: {note}"));
                }
            }
            let Some(element) = draw.found.distinct.first() else {
                continue;
            };
            let mut grid = ImageGrid::new(format!("Draw {k}, element {}", element.element.label()), 3);
            let mut step_um = 1.0;
            for spot in &element.spots {
                if let Some(images) = spot.images() {
                    step_um = images.step_um;
                    grid.image(spot.place(), images.extracted.mapv(f64::from));
                }
            }
            page.figure(
                grid.pixel_um(step_um)
                    .caption("PSFs as fabricated, middle of the field."),
            );
        }
    }
    page
}

fn share(y: &Yield) -> String {
    let [low, high] = y.interval;
    format!(
        "{} % ({} to {} %)",
        sig(y.share * 100.0, 3),
        sig(low * 100.0, 3),
        sig(high * 100.0, 3)
    )
}

fn yields(result: &StudyResult) -> Table {
    let mut table = Table::new([
        Column::text("Limit"),
        Column::text(""),
        Column::number("Draws that hold it", ""),
        Column::text("Yield"),
    ]);
    for (k, y) in result.yields.iter().enumerate() {
        let limit = result.plan.limits.get(k).map_or_else(String::new, |l| {
            format!(
                "{} {}",
                if l.at_least { "at least" } else { "at most" },
                sig(l.limit, 4)
            )
        });
        table.row([
            Cell::from(y.key.as_str()),
            Cell::from(limit),
            Cell::from(count(y.held)),
            Cell::from(share(y)),
        ]);
    }
    table
}

fn shares(result: &StudyResult) -> Table {
    let names = result.plan.quantities.iter().map(|q| Column::number(q.0.clone(), ""));
    let ends = ["pairs", "not explained", "predicted"].map(|n| Column::number(n, ""));
    let mut table = Table::new(std::iter::once(Column::text("Limit")).chain(names).chain(ends));
    for r in &result.responses {
        let numbers = r.shares.iter().chain([&r.pairs, &r.rest, &r.predicted]);
        table.row(std::iter::once(Cell::from(r.key.as_str())).chain(numbers.map(|v| Cell::fixed(*v, 3))));
    }
    table
}

fn tightenings(result: &StudyResult) -> Table {
    let mut table = Table::new([
        Column::text("Quantity"),
        Column::text("Factor for the spread"),
        Column::number("Yield without this spread", "%"),
    ]);
    for t in &result.tightenings {
        let factor = match t.factor {
            Some(f) if f >= 1.0 => "as it is".to_owned(),
            Some(f) => sig(f, 2),
            None => "not by this alone".to_owned(),
        };
        table.row([
            Cell::from(t.quantity.as_str()),
            Cell::from(factor),
            Cell::sig(t.best_yield * 100.0, 3),
        ]);
    }
    table
}

/// Yield over one quantity, in bins of equal numbers of draws or at the values of a grid.
fn over_one(result: &StudyResult, q: usize) -> Figure {
    let (name, unit) = &result.plan.quantities[q];
    let mut draws: Vec<(f64, bool)> = result.draws.iter().map(|d| (d.amounts[q], d.passed)).collect();
    draws.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut values: Vec<f64> = draws.iter().map(|d| d.0).collect();
    values.dedup();
    let bins: Vec<&[(f64, bool)]> = if values.len() <= BINS {
        draws.chunk_by(|a, b| a.0 == b.0).collect()
    } else {
        draws.chunks(draws.len().div_ceil(BINS)).collect()
    };
    let points = bins.into_iter().map(|bin| {
        let held = bin.iter().filter(|d| d.1).count() as u64;
        let of = bin.len() as u64;
        let middle = bin.iter().map(|d| d.0).sum::<f64>() / of as f64;
        let share = held as f64 / of as f64;
        let [low, high] = wilson(held, of);
        (middle, share, 0.5 * (high - low).max(0.0))
    });
    let x = Axis::linear(name.clone(), unit.clone());
    let mut chart = Chart::new(
        format!("Yield over {name}"),
        x,
        Axis::linear("yield", "").range(0.0, 1.0),
    );
    chart.points_with_errors("all limits", points.collect::<Vec<_>>());
    chart.caption("Bins of equal numbers of draws; bars are half the width of Wilson's 95 % interval.")
}

fn worst(result: &StudyResult) -> Table {
    let plan = &result.plan;
    let names = plan
        .quantities
        .iter()
        .map(|(n, u)| Column::number(n.clone(), u.clone()));
    let limits = result.plan.limits.iter().map(|l| Column::number(l.key.clone(), ""));
    let mut table = Table::new(std::iter::once(Column::text("Draw")).chain(names).chain(limits));
    for k in result.worst.iter().take(10) {
        let d = &result.draws[*k as usize];
        let reached = d.reached.iter().map(|r| r.map_or_else(Cell::none, |r| Cell::sig(r, 4)));
        let amounts = plan.quantities.iter().zip(&d.amounts).map(|((name, _), amount)| {
            let value = d.design.get(name);
            value.map_or_else(|| Cell::sig(*amount, 3), |value| Cell::from(value.to_string()))
        });
        table.row(std::iter::once(Cell::from(k.to_string())).chain(amounts).chain(reached));
    }
    table
}
