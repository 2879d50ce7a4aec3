//! Errors of cells on steep phases, by the truth of blazed rows (`golden/truth`).

use metalith_core::numerical_aperture;
use metalith_design::{Design, Element};
use metalith_report::fixed;

/// Results of a row of unlike pillars of the shipped mapping at 455, 530 and 660 nm, after the waves of its phase a
/// pitch.
type Row = (f64, [f64; 3]);

/// Share by which a cell in an infinite lattice of equal pillars overstates the first order of a blazed row at 455,
/// 530 and 660 nm, by the turns of phase a pitch: rows of 18, 6, 3 and 2.5 pillars a turn of the shipped mapping,
/// solved as supercells (`golden/truth`), mean over offsets and polarisations, light as a steered element sees it.
const OVERSTATED: [Row; 5] = [
    (0.0, [0.0, 0.0, 0.0]),
    (1.0 / 18.0, [0.011, 0.023, 0.041]),
    (1.0 / 6.0, [0.070, 0.044, 0.063]),
    (1.0 / 3.0, [0.493, 0.326, 0.328]),
    (0.4, [0.929, 0.540, 0.488]),
];

/// Share of the light that passes a blazed row and is not counted by the sum over pairs: what leaves more steeply than at half the
/// wavelength over the pitch, what is turned into the other polarisation, and what pairs cannot explain. Transmitted light of rows of
/// 18, 9, 6, 3 and 2.5 pillars a turn by the same supercells, light along the normal, mean over offsets and polarisations, against
/// that by the tables of `designs/prototype_3x3.toml`; see the test. Shares below zero stand as zero. As a steered element looks
/// it is about as much, but for rows of 2.5 pillars at 455 nm, which lose 0.36 in steep orders alone.
const NOT_COUNTED: [Row; 6] = [
    (0.0, [0.0, 0.0, 0.0]),
    (1.0 / 18.0, [0.019, 0.000, 0.015]),
    (1.0 / 9.0, [0.019, 0.011, 0.000]),
    (1.0 / 6.0, [0.086, 0.064, 0.037]),
    (1.0 / 3.0, [0.275, 0.068, 0.018]),
    (0.4, [0.291, 0.289, 0.029]),
];

/// Steepness of the phases of a design.
pub(super) struct Slopes {
    /// Slope of the steepest wedge alone, in the middle of its element (waves a pitch).
    middle: f64,
    /// Slope with the slope of the steepest lens at its rim added.
    rim: f64,
}

impl Slopes {
    pub(crate) fn of(design: &Design) -> Self {
        let pitch_um = design.lattice().pitch_um();
        let wedge = |e: &Element| e.wedge.sin_x.hypot(e.wedge.sin_y) / e.wedge.wavelength_um * pitch_um;
        // The lens adds its own slope, at its rim as much as sin(atan(R / f)) / wavelength.
        let lens = |e: &Element| {
            let lens = design.lens_of(e);
            numerical_aperture(lens.radius_um(), lens.focal_length_um) / design.mapping.wavelength_um * pitch_um
        };
        let elements = design.elements();
        let middle = elements.iter().map(wedge).fold(0.0, f64::max);
        Self {
            middle,
            rim: middle + elements.iter().map(lens).fold(0.0, f64::max),
        }
    }

    /// Excess by which the local periodic approximation overstates the first order, in words.
    pub(crate) fn overstated(&self) -> String {
        let worst = |turns: f64| percent(between(&OVERSTATED, turns).into_iter().fold(0.0, f64::max));
        format!(
            "first order too high by up to {} % in the middle of the outermost element, {}{} % at its steepest rim",
            worst(self.middle),
            beyond(&OVERSTATED, self.rim),
            worst(self.rim),
        )
    }

    /// Share of the light that passes which the sum over pairs does not count, in words.
    pub(crate) fn not_counted(&self) -> String {
        let shares = |turns: f64| up_to(&NOT_COUNTED, turns).map(percent).join(", ");
        format!(
            "up to {} % of what passes in the middle of the outermost element, {}{} % at its steepest rim, at 455, 530, 660 nm; contrast \
             is too high by up to as much",
            shares(self.middle),
            beyond(&NOT_COUNTED, self.rim),
            shares(self.rim),
        )
    }
}

fn percent(share: f64) -> String {
    fixed(share * 100.0, 0)
}

/// Words before a number of the steepest row, where a phase is steeper.
fn beyond(rows: &[Row], turns: f64) -> &'static str {
    if turns > rows[rows.len() - 1].0 { "over " } else { "" }
}

/// Straight lines through rows; beyond the last its numbers.
fn between(rows: &[Row], turns: f64) -> [f64; 3] {
    let above = rows.partition_point(|(t, _)| *t < turns).clamp(1, rows.len() - 1);
    let ((a, low), (b, high)) = (rows[above - 1], rows[above]);
    let share = ((turns - a) / (b - a)).clamp(0.0, 1.0);
    std::array::from_fn(|i| low[i] + share * (high[i] - low[i]))
}

/// The most of any phase that is no steeper: an element has gentler places too.
fn up_to(rows: &[Row], turns: f64) -> [f64; 3] {
    let gentler = rows.iter().filter(|(t, _)| *t <= turns).map(|(_, shares)| *shares);
    gentler.fold(between(rows, turns), |most, shares| {
        std::array::from_fn(|i| f64::max(most[i], shares[i]))
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use metalith_cell::{Blaze, NeighbourTable, NeighbourTableSpec};
    use metalith_core::Silent;
    use metalith_design::mappings;
    use metalith_rcwa::SiteLattice;
    use num_complex::Complex64;

    use super::*;

    /// Half of the last digit of a constant, and what tables differ by that another machine solves.
    const DIGIT: f64 = 0.0006;

    #[test]
    fn between_solved_rows_the_size_of_the_assumption_is_interpolated() {
        const ROUNDING: f64 = 1e-12;
        assert_eq!(between(&OVERSTATED, 0.0), [0.0; 3]);
        assert_eq!(between(&OVERSTATED, 1.0 / 6.0), OVERSTATED[2].1);
        assert!((between(&OVERSTATED, 0.25)[1] - 0.5 * (0.044 + 0.326)).abs() < ROUNDING);
        assert_eq!(between(&OVERSTATED, 2.0), OVERSTATED[4].1);
        // At 660 nm rows of 6 lose more than those of 3.
        assert_eq!(up_to(&NOT_COUNTED, 0.34)[2], 0.037);
        assert_eq!(up_to(&NOT_COUNTED, 0.14)[2], between(&NOT_COUNTED, 0.14)[2]);
    }

    /// Light that passes the rows of the truth along the normal, and the same by the sum over pairs.
    #[test]
    fn light_that_is_not_counted_is_what_the_truth_has_more() {
        let design = Design::read(&metalith_testing::design("prototype_3x3")).unwrap();
        let (stack, mappings) = (design.cell_stack().unwrap(), mappings(&design));
        let text = std::fs::read_to_string(metalith_testing::root().join("golden/truth/supercell.csv")).unwrap();
        for (column, nm) in ["455", "530", "660"].into_iter().enumerate() {
            let spec = NeighbourTableSpec {
                wavelength_um: nm.parse::<f64>().unwrap() * 1e-3,
                sines: [0.0; 2],
            };
            assert!(NeighbourTable::is_shipped(&spec, &stack, &mappings));
            let table = NeighbourTable::obtain(&spec, &stack, &mappings, None, &Silent).unwrap();
            // By sites a turn, in tenths: what passes by the truth and by pairs.
            let mut sums: BTreeMap<usize, [f64; 2]> = BTreeMap::new();
            let rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
            for row in rows.filter(|f| f[2] == nm && f[4] == "normal") {
                let (sites, turns): (usize, i32) = (row[0].parse().unwrap(), row[1].parse().unwrap());
                let offset: f64 = row[6].parse().unwrap();
                let blaze = Blaze {
                    turns: [turns, 0],
                    sites,
                    offset_turns: f64::from(turns) * offset / sites as f64,
                };
                let lattice = SiteLattice::row(sites).unwrap();
                let widths = blaze.widths_nm(&lattice, |u| mappings[0].width_nm(u));
                let transmitted = &table.sites(&lattice, &widths, 1.0)[usize::from(row[5] == "p")];
                let pairs = transmitted.iter().map(Complex64::norm_sqr).sum::<f64>() / sites as f64;
                let sum = sums.entry(10 * sites / turns as usize).or_default();
                sum[0] += row[8].parse::<f64>().unwrap();
                sum[1] += pairs;
            }
            assert_eq!(sums.len(), NOT_COUNTED.len() - 1);
            // The gentlest first.
            for ((sites, [truth, pairs]), (turns, shares)) in sums.into_iter().rev().zip(&NOT_COUNTED[1..]) {
                assert_eq!(sites, (10.0 / turns).round() as usize);
                let lost = (1.0 - pairs / truth).max(0.0);
                println!("{nm} nm, {} pillars a turn: {lost:.4}", sites as f64 / 10.0);
                assert!((lost - shares[column]).abs() < DIGIT, "{nm} nm, {sites}: {lost}");
            }
        }
    }
}
