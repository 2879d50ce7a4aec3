//! Turning an element's light and grating vectors to the one of their mirror images that tables are made for.

/// A symmetry of the square lattice: axes flipped, then exchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orientation {
    flipped: [bool; 2],
    exchanged: bool,
    /// Along the normal p is x and s is y: they go with the axes.
    normal: bool,
}

impl Orientation {
    /// The one that makes both sines positive and the larger the first; where that leaves a choice, both components of
    /// `slope` positive and the larger the first.
    pub fn of(sines: [f64; 2], slope: [f64; 2]) -> Self {
        let decisive = |axis: usize| if sines[axis] == 0.0 { slope[axis] } else { sines[axis] };
        let [x, y] = [0, 1].map(|axis| (sines[axis].abs(), slope[axis].abs()));
        Self {
            flipped: [0, 1].map(|axis| decisive(axis) < 0.0),
            exchanged: y.0 > x.0 || (y.0 == x.0 && y.1 > x.1),
            normal: sines == [0.0; 2],
        }
    }

    /// Components along x and y after it.
    pub fn turned(&self, vector: [f64; 2]) -> [f64; 2] {
        let [x, y] = [0, 1].map(|axis| {
            if self.flipped[axis] {
                -vector[axis]
            } else {
                vector[axis]
            }
        });
        if self.exchanged { [y, x] } else { [x, y] }
    }

    /// The polarisation (0 for s, 1 for p) that one becomes.
    pub fn polarisation(&self, own: usize) -> usize {
        if self.exchanged && self.normal { 1 - own } else { own }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_and_slope_are_turned_alike() {
        for (sines, slope) in [
            ([-0.1, 0.3], [0.2, -0.4]),
            ([0.0, -0.3], [-0.2, 0.4]),
            ([0.2, -0.2], [0.1, 0.3]),
            ([0.0, 0.0], [0.1, -0.3]),
        ] {
            let turn = Orientation::of(sines, slope);
            let ([a, b], [p, q]) = (turn.turned(sines), turn.turned(slope));
            assert!(a >= b && b >= 0.0, "{sines:?}");
            // Scalar products stay.
            let dot = sines[0] * slope[0] + sines[1] * slope[1];
            assert!((a * p + b * q - dot).abs() < 1e-15);
            if a == b {
                assert!(p.abs() >= q.abs());
            }
        }
        assert_eq!(Orientation::of([0.0; 2], [0.1, 0.3]).polarisation(0), 1);
        assert_eq!(Orientation::of([0.0, 0.2], [0.1, 0.3]).polarisation(0), 0);
    }
}
