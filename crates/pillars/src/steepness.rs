//! Steepness: places where a phase is too steep for its lattice.

use serde::Serialize;

use crate::Lattice;

/// Sites at which a phase is too steep for its lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Steepness {
    /// Largest step of the phase from a site to a neighbour (rad).
    pub largest_step_rad: f64,
    /// Sites with a step of more than pi to a neighbour in the same row at larger x, or in the next row at larger y: there the lattice cannot tell the phase from
    /// one that falls.
    pub steep_sites: u64,
    /// All sites with a phase.
    pub sites: u64,
    /// Distance of the first steep site from the element's centre, in pitches; none if there is none.
    pub from_pitches: Option<f64>,
}

/// Columns from a site to its farthest neighbour.
const BESIDE: usize = 2;

impl Steepness {
    /// Steepness of a phase (waves), not reduced, at sites `(ix, iy)` of a lattice; `None` where there is no pillar.
    pub fn of(lattice: &Lattice, turns: impl Fn(usize, usize) -> Option<f64>) -> Self {
        Self::of_rows(lattice, 1, turns)
    }

    /// Variant of [`Steepness::of`] for the sites of one row in so many.
    ///
    /// # Panics
    /// If that is none.
    pub fn of_rows(lattice: &Lattice, one_in: usize, turns: impl Fn(usize, usize) -> Option<f64>) -> Self {
        let mut found = Self::default();
        let mut nearest2 = f64::MAX;
        let [columns, rows] = lattice.reach();
        // Neighbours are in the same row or in the next one, this far along it; columns are counted from as many before the
        // first as the farthest is away.
        let neighbours: Vec<(usize, bool)> = lattice
            .neighbours()
            .iter()
            .map(|[dx, dy]| ((dx + BESIDE as i64) as usize, *dy == 0))
            .collect();
        // NaN where there is no phase, beyond the last row and column too: `f64::max` leaves it out.
        let fill = |line: &mut [f64], iy: usize| {
            for ix in columns.clone() {
                let turns = lattice.has(ix, iy).then(|| turns(ix, iy)).flatten();
                line[ix + BESIDE] = turns.unwrap_or(f64::NAN);
            }
        };
        let mut here = vec![f64::NAN; lattice.sites() + 2 * BESIDE];
        let mut above = here.clone();
        let mut largest_step: f64 = 0.0;
        for (count, iy) in rows.clone().step_by(one_in).enumerate() {
            if count == 0 || one_in > 1 {
                fill(&mut here, iy);
            }
            if iy + 1 < rows.end {
                fill(&mut above, iy + 1);
            } else {
                above.fill(f64::NAN);
            }
            for ix in columns.clone() {
                let phase = here[ix + BESIDE];
                if phase.is_nan() {
                    continue;
                }
                found.sites += 1;
                let step = neighbours.iter().fold(f64::NAN, |largest, &(dx, same_row)| {
                    let line = if same_row { &here } else { &above };
                    largest.max((line[ix + dx] - phase).abs())
                });
                largest_step = largest_step.max(step);
                if step > 0.5 {
                    found.steep_sites += 1;
                    nearest2 = nearest2.min(lattice.radius2_nm2(ix, iy));
                }
            }
            std::mem::swap(&mut here, &mut above);
        }
        found.largest_step_rad = largest_step * std::f64::consts::TAU;
        let pitch2 = lattice.pitch_nm().nm().powi(2);
        found.from_pitches = (found.steep_sites > 0).then(|| (nearest2 / pitch2).sqrt());
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lens_is_steep_where_its_rays_are() {
        // A parabola that steps by pi a pitch at the radius of 80 pitches.
        let (sites, rim) = (200, 80.0);
        let half = |i: usize| 0.5 * (2.0 * i as f64 - 199.0);
        let lens = |ix: usize, iy: usize| Some(-0.25 * (half(ix).powi(2) + half(iy).powi(2)) / rim);
        let lattice = Lattice::new(350, sites).unwrap();
        let steep = Steepness::of(&lattice, lens);
        assert_eq!(steep.sites, 40_000);
        // Sites are whole pitches.
        assert!((steep.from_pitches.unwrap() - rim).abs() < 1.0);
        const ROUNDING: f64 = 1e-9;
        assert!((steep.largest_step_rad - std::f64::consts::PI * 99.0 / rim).abs() < ROUNDING);
        // All but a square of twice the radius, to a site at each of its edges.
        let flat = 2.0 * rim;
        assert!((steep.steep_sites as f64 - (40_000.0 - flat * flat)).abs() < 4.0 * flat);
        assert_eq!(Steepness::of(&lattice, |_, _| Some(0.0)).from_pitches, None);
        // Some of its rows have about the same share.
        let some = Steepness::of_rows(&lattice, 7, lens);
        let share = |s: &Steepness| s.steep_sites as f64 / s.sites as f64;
        assert!((share(&some) - share(&steep)).abs() < 0.02 && some.sites < steep.sites / 6);
    }
}
