//! Values of the grid on the page of a study.

use std::collections::BTreeSet;

use metalith_report::{Axis, Cell, Chart, Column, Figure, Page, Table, count, sig};

use crate::grid_points::{GridPoint, Spread};
use crate::merge::StudyResult;

/// Room beside the outer points of a chart, so that these are seen whole, over the distance of the two.
const BESIDE: f64 = 0.05;

/// Limited figures that are drawn over a grid.
const MOST_DRAWN: usize = 6;

/// Yields and figures at each value; nothing where there is no grid.
pub(crate) fn over_grid(page: &mut Page, result: &StudyResult) {
    if result.grid.is_empty() {
        return;
    }
    page.section("Over the grid");
    page.paragraph("Mean and standard deviation of each figure over the draws at each value.");
    for of_one in result.grid.chunk_by(|a, b| name(a) == name(b)) {
        page.subsection(match unit(result, &of_one[0]) {
            "" => name(&of_one[0]).to_owned(),
            unit => format!("{} [{unit}]", name(&of_one[0])),
        });
        page.table(yields(of_one));
        let charts = charts(result, of_one);
        if !charts.is_empty() {
            page.row(charts);
        }
        page.table(figures(of_one));
    }
    if !result.combinations.is_empty() {
        page.subsection("Combinations");
        page.table(yields(&result.combinations));
    }
}

fn name(point: &GridPoint) -> &str {
    &point.at[0].0
}

/// Unit of the quantity that a point holds first; empty for keys of a design, whose names say it.
fn unit<'r>(result: &'r StudyResult, point: &GridPoint) -> &'r str {
    let known = result.plan.quantities.iter().find(|(n, _)| n == name(point));
    known.map_or("", |(_, unit)| unit.as_str())
}

fn yields(points: &[GridPoint]) -> Table {
    let names = points[0].at.iter().map(|(name, _)| Column::text(name.clone()));
    let ends = [
        Column::number("Draws", ""),
        Column::number("That hold all limits", ""),
        Column::text("Yield"),
    ];
    let mut table = Table::new(names.chain(ends));
    for p in points {
        let [low, high] = p.interval.map(|v| sig(100.0 * v, 3));
        let share = 100.0 * p.held as f64 / p.draws.max(1) as f64;
        let values = p.at.iter().map(|(_, value)| Cell::from(value.to_string()));
        table.row(values.chain([
            Cell::from(count(p.draws)),
            Cell::from(count(p.held)),
            Cell::from(format!("{} % ({low} to {high} %)", sig(share, 3))),
        ]));
    }
    table
}

fn figures(points: &[GridPoint]) -> Table {
    let keys: BTreeSet<&String> = points.iter().flat_map(|p| p.figures.keys()).collect();
    let values = points.iter().map(|p| Column::text(p.at[0].1.to_string()));
    let mut table = Table::new(std::iter::once(Column::text("Figure")).chain(values));
    for key in keys {
        let each = points.iter().map(|p| p.figures.get(key).map_or_else(Cell::none, words));
        table.row(std::iter::once(Cell::code(key)).chain(each));
    }
    table
}

fn words(spread: &Spread) -> Cell {
    Cell::from(format!("{} \u{b1} {}", sig(spread.mean, 4), sig(spread.sd, 2)))
}

/// Limited figures over the values, where these are numbers.
fn charts(result: &StudyResult, points: &[GridPoint]) -> Vec<Figure> {
    let numbers: Option<Vec<f64>> = points.iter().map(|p| p.at[0].1.number()).collect();
    let (Some(numbers), true) = (numbers, points.len() > 1) else {
        return Vec::new();
    };
    let (low, high) = numbers
        .iter()
        .fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
    let beside = BESIDE * (high - low);
    let limited = result.plan.limits.iter();
    let limited = limited.filter(|l| points.iter().all(|p| p.figures.contains_key(&l.key)));
    limited
        .take(MOST_DRAWN)
        .map(|limit| {
            let mut chart = Chart::new(
                format!("`{}` over {}", limit.key, name(&points[0])),
                Axis::linear(name(&points[0]), unit(result, &points[0])).range(low - beside, high + beside),
                Axis::linear(limit.key.clone(), ""),
            );
            let each = numbers.iter().zip(points).map(|(x, p)| {
                let spread = p.figures[&limit.key];
                (*x, spread.mean, spread.sd)
            });
            chart.points_with_errors("mean", each.collect::<Vec<_>>());
            chart.limit(limit.limit, "limit");
            chart.caption("Bars are one standard deviation over the draws.")
        })
        .collect()
}
