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
        let line = |iy: usize| (0..sites).map(|ix| turns(ix, iy)).collect::<Vec<_>>();
        let mut here = line(0);
        for iy in 0..sites {
            let above = if iy + 1 < sites {
                line(iy + 1)
            } else {
                vec![None; sites]
            };
            for (ix, phase) in here.iter().enumerate() {
                let Some(phase) = phase else { continue };
                found.sites += 1;
                let right = here.get(ix + 1).copied().flatten();
                let steps = [right, above[ix]].into_iter().flatten();
                let step = steps.map(|next| (next - phase).abs()).fold(0.0, f64::max);
                found.largest_step_rad = found.largest_step_rad.max(step * std::f64::consts::TAU);
                if step > 0.5 {
                    found.steep_sites += 1;
                    nearest2 = nearest2.min(half(ix).pow(2) + half(iy).pow(2));
                }
            }
            here = above;
        }
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
