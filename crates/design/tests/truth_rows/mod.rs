//! The blazed rows of golden/truth/supercell.csv, beside what single cells and supercells with few orders make of them.

#[path = "../blazed_orders/mod.rs"]
pub(crate) mod blazed_orders;

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use blazed_orders::{BlazeOrders, first_order_sines};
use metalith_cell::{Blaze, CoarseCell};
use metalith_design::{Design, PillarRule};
use num_complex::Complex64;

/// A line of the table; its columns are described in golden/truth/README.md.
pub(crate) struct Row {
    pub cells: usize,
    pub turns: i32,
    pub wavelength_nm: u32,
    /// Highest order of a single cell that was kept along each axis.
    #[allow(dead_code, reason = "one test solves with as many")]
    pub highest_order: usize,
    pub looks: bool,
    /// 0 for s, 1 for p.
    pub polarisation: usize,
    pub offset: f64,
    pub share_zero: f64,
    pub share_first: f64,
    pub first: Complex64,
    pub local_normal: f64,
    local_oblique: f64,
}

/// Rows of one grating and one wavelength. Differences are root mean squares over offsets, incidences and
/// polarisations.
#[derive(Clone, Default)]
pub(crate) struct Summary {
    pub rows: usize,
    /// Mean share of the first order: by the truth, by single cells at normal incidence, by single cells at the angle
    /// of arrival, by [`BlazeOrders`].
    pub shares: [f64; 4],
    /// Difference of that share from the truth: single cells at normal incidence, at oblique incidence,
    /// [`BlazeOrders`].
    pub first: [f64; 3],
    /// Difference of the share of the zero order, by [`BlazeOrders`].
    pub zero: f64,
    /// Mean of the phase of the first order less that of the truth (rad).
    pub phase_mean: f64,
    /// Difference of the phase of the first order from the truth, less its mean (rad).
    pub phase: f64,
}

/// The table.
pub(crate) fn read() -> Vec<Row> {
    let path = metalith_testing::root().join("golden/truth/supercell.csv");
    let text = std::fs::read_to_string(path).unwrap();
    text.lines()
        .skip(1)
        .map(|line| {
            let f: Vec<&str> = line.split(',').collect();
            let number = |i: usize| -> f64 { f[i].parse().unwrap() };
            Row {
                cells: f[0].parse().unwrap(),
                turns: f[1].parse().unwrap(),
                wavelength_nm: f[2].parse().unwrap(),
                highest_order: f[3].parse().unwrap(),
                looks: f[4] == "looks",
                polarisation: usize::from(f[5] == "p"),
                offset: number(6),
                share_zero: number(10),
                share_first: number(11),
                first: Complex64::new(number(14), number(15)),
                local_normal: number(16),
                local_oblique: number(17),
            }
        })
        .collect()
}

/// Solve rows of one grating and one wavelength as the design maps their phases, and compare.
fn summary(rows: &[&Row], design: &Design, cell: &CoarseCell<'_>) -> Summary {
    let rule = PillarRule::new(&design.cell, &design.mapping);
    // Both polarisations come from one solution.
    let mut solved: BTreeMap<(bool, String), BlazeOrders> = BTreeMap::new();
    let n = rows.len() as f64;
    let mut summary = Summary {
        rows: rows.len(),
        ..Summary::default()
    };
    let mut phases = Vec::new();
    for row in rows {
        let blaze = Blaze {
            turns: [row.turns, 0],
            sites: row.cells,
            offset_turns: f64::from(row.turns) * row.offset / row.cells as f64,
        };
        let wedge = first_order_sines(&blaze, cell.wavelength_over_pitch());
        let sines = if row.looks { wedge.map(|s| -s) } else { [0.0, 0.0] };
        let orders = solved
            .entry((row.looks, row.offset.to_string()))
            .or_insert_with(|| BlazeOrders::solve(&blaze, cell, |u| f64::from(rule.width_nm(u)), sines));
        let (first, zero) = (orders.order(1), orders.order(0));
        let shares = [
            row.share_first,
            row.local_normal,
            row.local_oblique,
            first.share[row.polarisation],
        ];
        for (sum, share) in summary.shares.iter_mut().zip(shares) {
            *sum += share / n;
        }
        for (sum, share) in summary.first.iter_mut().zip(&shares[1..]) {
            *sum += (share - row.share_first).powi(2) / n;
        }
        summary.zero += (zero.share[row.polarisation] - row.share_zero).powi(2) / n;
        phases.push((first.amplitude[row.polarisation] / row.first).arg());
    }
    summary.phase_mean = phases.iter().sum::<f64>() / n;
    let apart = |p: &f64| (p - summary.phase_mean + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
    summary.phase = phases.iter().map(|p| apart(p).powi(2) / n).sum::<f64>().sqrt();
    summary.first = summary.first.map(f64::sqrt);
    summary.zero = summary.zero.sqrt();
    summary
}

/// A summary for each (cells, turns, wavelength in nm).
pub(crate) fn compare(rows: &[Row]) -> BTreeMap<(usize, i32, u32), Summary> {
    let design = Design::read(&metalith_testing::design("prototype_3x3")).unwrap();
    let stack = design.cell_stack().unwrap();
    let (low, high) = design.cell.width_range_nm;
    let mut groups: BTreeMap<(usize, i32, u32), Vec<&Row>> = BTreeMap::new();
    for row in rows {
        groups
            .entry((row.cells, row.turns, row.wavelength_nm))
            .or_default()
            .push(row);
    }
    let mut cells: BTreeMap<u32, CoarseCell<'_>> = BTreeMap::new();
    groups
        .into_iter()
        .map(|(key, rows)| {
            let cell = cells.entry(key.2).or_insert_with(|| {
                let widths_nm = (f64::from(low), f64::from(high));
                CoarseCell::new(&stack, f64::from(key.2) * 1e-3, widths_nm).unwrap()
            });
            (key, summary(&rows, &design, cell))
        })
        .collect()
}

/// All groups as one.
pub(crate) fn total<'a>(groups: impl Iterator<Item = &'a Summary> + Clone) -> Summary {
    let n: usize = groups.clone().map(|s| s.rows).sum();
    let mean = |of: &dyn Fn(&Summary) -> f64| groups.clone().map(|s| s.rows as f64 * of(s)).sum::<f64>() / n as f64;
    let square = |of: &dyn Fn(&Summary) -> f64| mean(&|s| of(s).powi(2)).sqrt();
    Summary {
        rows: n,
        shares: [0, 1, 2, 3].map(|i| mean(&|s| s.shares[i])),
        first: [0, 1, 2].map(|i| square(&|s| s.first[i])),
        zero: square(&|s| s.zero),
        phase_mean: mean(&|s| s.phase_mean),
        phase: square(&|s| s.phase),
    }
}
