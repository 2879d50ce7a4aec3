//! An aperture that the second exposure put beside its pillars.

use metalith_pillars::Lattice;

/// Least share of a drawn site that its own aperture leaves open: its middle is within.
const LEAST_DRAWN: f64 = 0.5;

/// Open part of each site under a shifted aperture.
pub(crate) struct ShiftedAperture {
    lattice: Lattice,
    radius_um: f64,
    offset_um: [f64; 2],
}

impl ShiftedAperture {
    /// Aperture of a radius (um) whose centre is off the centre of the pillars (um); `None` if it is not.
    pub(crate) fn new(lattice: Lattice, radius_um: f64, offset_um: [f64; 2]) -> Option<Self> {
        (offset_um != [0.0; 2]).then_some(Self {
            lattice,
            radius_um,
            offset_um,
        })
    }

    /// Share of what a site transmits, of its amplitude, that passes: that of its cell which was open and still is. It changes
    /// smoothly as the aperture moves: to a fit, sites that open and close as a whole would be noise.
    pub(crate) fn passes(&self, site: usize) -> f64 {
        let n = self.lattice.sites();
        let place = [self.lattice.place_um(0, site % n), self.lattice.place_um(1, site / n)];
        let shifted = [place[0] - self.offset_um[0], place[1] - self.offset_um[1]];
        (self.within(shifted) / self.within(place).max(LEAST_DRAWN)).min(1.0)
    }

    /// Share of a cell within the rim of an aperture about the origin. Over a pitch the rim is straight, and its direction does not
    /// count.
    fn within(&self, [x, y]: [f64; 2]) -> f64 {
        (0.5 + (self.radius_um - x.hypot(y)) / self.lattice.pitch_um()).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RADIUS: f64 = 30.0;

    /// Sites that pass, over the area that two circles share: what squares at their rims leave, relative.
    const AREA: f64 = 1e-3;

    /// Change by a move of 2 nm, relative to the change of the area: a jump of one site as a whole would be twice as
    /// much.
    const SLOPE: f64 = 0.1;

    fn passing(offset_um: [f64; 2]) -> f64 {
        let lattice = Lattice::new(350, 171).unwrap();
        let n = lattice.sites();
        let aperture = ShiftedAperture::new(lattice, RADIUS, offset_um).unwrap();
        let drawn = |site: &usize| lattice.place_um(0, site % n).hypot(lattice.place_um(1, site / n)) <= RADIUS;
        (0..n * n).filter(drawn).map(|site| aperture.passes(site)).sum()
    }

    /// Area that two circles share whose middles are so far apart, in sites.
    fn shared(apart: f64) -> f64 {
        let half = apart / (2.0 * RADIUS);
        let area = 2.0 * RADIUS.powi(2) * half.acos() - 0.5 * apart * (4.0 * RADIUS.powi(2) - apart.powi(2)).sqrt();
        area / 0.35_f64.powi(2)
    }

    #[test]
    fn what_passes_is_what_both_circles_share() {
        for offset in [[1e-6, 0.0], [0.5, 0.0], [-2.634, -2.22], [3.0, 4.0], [0.0, 20.0]] {
            let ratio = passing(offset) / shared(offset[0].hypot(offset[1]));
            assert!((ratio - 1.0).abs() < AREA, "{offset:?}: {ratio}");
        }
    }

    #[test]
    fn it_changes_smoothly_as_the_aperture_moves() {
        for k in 0..40 {
            let (from, to) = (1.0 + 0.05 * f64::from(k), 1.002 + 0.05 * f64::from(k));
            let ratio = (passing([from, 0.0]) - passing([to, 0.0])) / (shared(from) - shared(to));
            assert!((ratio - 1.0).abs() < SLOPE, "{from}: {ratio}");
        }
        assert!(ShiftedAperture::new(Lattice::new(350, 171).unwrap(), RADIUS, [0.0; 2]).is_none());
    }
}
