//! Where a phase is too steep for its lattice.

use serde::Serialize;

/// Where a phase is too steep for its lattice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Steepness {
    /// Largest step of the phase from a site to the next along x or y (rad).
    pub largest_step_rad: f64,
    /// Sites with a step of more than pi to a neighbour at larger x or y: there the lattice cannot tell the phase from
    /// one that falls.
    pub steep_sites: u64,
    /// All sites with a phase.
    pub sites: u64,
    /// Distance of the first steep site from the element's centre, in pitches; none if there is none.
    pub from_pitches: Option<f64>,
}

impl Steepness {
    /// Of a phase (turns), not reduced, at sites `(ix, iy)` of a square lattice of `sites` an axis; none where there is
    /// no pillar.
    pub fn of(sites: usize, turns: impl Fn(usize, usize) -> Option<f64>) -> Self {
        let mut found = Self::default();
        let mut nearest2 = i64::MAX;
        let half = |i: usize| 2 * i as i64 - (sites as i64 - 1);
        // NaN where there is no phase, beyond the last row and column too: `f64::max` leaves it out.
        let fill = |line: &mut [f64], iy: usize| {
            for (ix, value) in line[..sites].iter_mut().enumerate() {
                *value = turns(ix, iy).unwrap_or(f64::NAN);
            }
        };
        let mut here = vec![f64::NAN; sites + 1];
        let mut above = here.clone();
        let mut largest_step: f64 = 0.0;
        if sites > 0 {
            fill(&mut here, 0);
        }
        for iy in 0..sites {
            if iy + 1 < sites {
                fill(&mut above, iy + 1);
            } else {
                above.fill(f64::NAN);
            }
            for ix in 0..sites {
                let phase = here[ix];
                if phase.is_nan() {
                    continue;
                }
                found.sites += 1;
                let step = (here[ix + 1] - phase).abs().max((above[ix] - phase).abs());
                largest_step = largest_step.max(step);
                if step > 0.5 {
                    found.steep_sites += 1;
                    nearest2 = nearest2.min(half(ix).pow(2) + half(iy).pow(2));
                }
            }
            std::mem::swap(&mut here, &mut above);
        }
        found.largest_step_rad = largest_step * std::f64::consts::TAU;
        found.from_pitches = (found.steep_sites > 0).then(|| 0.5 * (nearest2 as f64).sqrt());
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
        let steep = Steepness::of(sites, lens);
        assert_eq!(steep.sites, 40_000);
        // Sites are whole pitches.
        assert!((steep.from_pitches.unwrap() - rim).abs() < 1.0);
        const ROUNDING: f64 = 1e-9;
        assert!((steep.largest_step_rad - std::f64::consts::PI * 99.0 / rim).abs() < ROUNDING);
        // All but a square of twice the radius, to a site at each of its edges.
        let flat = 2.0 * rim;
        assert!((steep.steep_sites as f64 - (40_000.0 - flat * flat)).abs() < 4.0 * flat);
        assert_eq!(Steepness::of(sites, |_, _| Some(0.0)).from_pitches, None);
    }
}
