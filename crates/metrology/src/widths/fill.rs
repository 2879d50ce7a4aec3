//! Area fraction around a place, averaged with a Gaussian exp(-r^2 / range^2) of any range.

use rayon::prelude::*;

/// A rectangle that is filled to an area fraction.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FilledRegion {
    pub(super) name: String,
    /// Middle (um).
    pub(super) at_um: [f64; 2],
    /// Edges along x and y (um).
    pub(super) size_um: [f64; 2],
    /// Area fraction of pillars.
    pub(super) fill: f64,
}

impl FilledRegion {
    fn contains(&self, place: [f64; 2]) -> bool {
        (0..2).all(|k| 2.0 * (place[k] - self.at_um[k]).abs() <= self.size_um[k])
    }
}

/// Width of a ring of pillars (um): below it, a radius is no more than a step of a lattice.
const RING_UM: f64 = 0.25;

/// Rings about a place; pillars beyond them are not counted.
const RINGS: usize = 3600;

/// What surrounds a place.
#[derive(Clone, Debug)]
pub(super) enum Surroundings {
    /// Fraction that the table states, averaged over the range of its column.
    Stated(f64),
    /// Rectangles with their edges relative to the place (um): from and to along each axis, and the fill.
    Regions(Vec<([[f64; 2]; 2], f64)>),
    /// Pillars by ring: root mean square radius (um), and area (um^2).
    Rings(Vec<(f64, f64)>),
}

impl Surroundings {
    /// What regions are around a place.
    pub(super) fn of_regions(regions: &[FilledRegion], place: [f64; 2]) -> Self {
        let ends = |r: &FilledRegion, k: usize| {
            let middle = r.at_um[k] - place[k];
            [middle - 0.5 * r.size_um[k], middle + 0.5 * r.size_um[k]]
        };
        Self::Regions(regions.iter().map(|r| ([ends(r, 0), ends(r, 1)], r.fill)).collect())
    }

    /// Area fraction within a range (um).
    pub(super) fn fill(&self, range_um: f64) -> f64 {
        match self {
            Self::Stated(fill) => *fill,
            Self::Regions(regions) => {
                let along = |[from, to]: [f64; 2]| 0.5 * (erf(to / range_um) - erf(from / range_um));
                regions.iter().map(|([x, y], fill)| fill * along(*x) * along(*y)).sum()
            }
            Self::Rings(rings) => {
                let weighted = rings.iter().map(|(r, area)| area * (-(r / range_um).powi(2)).exp());
                weighted.sum::<f64>() / (std::f64::consts::PI * range_um * range_um)
            }
        }
    }
}

/// Fill of the region that contains a place; none between regions.
pub(super) fn own_fill(regions: &[FilledRegion], place: [f64; 2]) -> Option<f64> {
    regions.iter().find(|r| r.contains(place)).map(|r| r.fill)
}

/// Surroundings of places among pillars, given by their place and area (um, um^2).
pub(super) fn rings_around(places: &[[f64; 2]], pillars: &[([f64; 2], f64)]) -> Vec<Surroundings> {
    let around = |place: &[f64; 2]| {
        let mut sums = vec![[0.0; 2]; RINGS];
        for (at, area) in pillars {
            let radius = (at[0] - place[0]).hypot(at[1] - place[1]);
            if let Some([areas, squares]) = sums.get_mut((radius / RING_UM) as usize) {
                *areas += area;
                *squares += area * radius * radius;
            }
        }
        // Root mean square radius of the pillars of a ring: their Gaussian weight to first order.
        let filled = sums.into_iter().filter(|[area, _]| *area > 0.0);
        Surroundings::Rings(
            filled
                .map(|[area, squares]| (f64::sqrt(squares / area), area))
                .collect(),
        )
    };
    places.par_iter().map(around).collect()
}

/// The error function to 1.2e-7 (Numerical Recipes, `erfcc`): a fill of it is off by less than any measured width shows.
fn erf(x: f64) -> f64 {
    const TERMS: [f64; 10] = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    let t = 1.0 / (1.0 + 0.5 * x.abs());
    let sum = TERMS.iter().rev().fold(0.0, |sum, c| sum * t + c);
    (1.0 - t * (sum - x * x).exp()).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_function_is_that_of_tables() {
        for (x, want) in [(0.5, 0.520_499_878), (-1.0, -0.842_700_793), (2.0, 0.995_322_265)] {
            assert!((erf(x) - want).abs() < 2e-7, "{x}: {}", erf(x));
        }
    }

    /// Pillars one by one, and the rectangle that they fill.
    #[test]
    fn rings_and_regions_agree() {
        let (pitch, edge) = (0.5, 0.3);
        let places = [[0.0, 0.0], [20.0, 0.0], [23.0, -19.0], [60.0, 0.0]];
        let sites = (0..80 * 80).map(|k| [k % 80, k / 80].map(|k| (f64::from(k) - 39.5) * pitch));
        let pillars: Vec<_> = sites.map(|at| (at, edge * edge)).collect();
        let rings = rings_around(&places, &pillars);
        let region = FilledRegion {
            name: "pad".into(),
            at_um: [0.0; 2],
            size_um: [80.0 * pitch; 2],
            fill: (edge / pitch).powi(2),
        };
        for (place, rings) in places.into_iter().zip(&rings) {
            let regions = Surroundings::of_regions(std::slice::from_ref(&region), place);
            for range in [5.0, 15.0, 40.0] {
                let [a, b] = [rings.fill(range), regions.fill(range)];
                // Of a fill of 0.36; single pillars count at an edge.
                assert!((a - b).abs() < 2e-3, "{place:?}, {range}: {a} {b}");
            }
        }
    }
}
