//! The light of neighbouring tiles by direction, few directions for most of it.

use super::super::tiles::Tiling;

/// Neighbouring tiles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Block {
    /// Directions that most of the light leaves in.
    pub strong: Vec<Bin>,
    /// The others, [`GROUP`] x [`GROUP`] of them gathered into one.
    pub weak: Vec<Bin>,
    /// What was left out (um^2): it is taken to be spread as the rest.
    pub rest_um2: f64,
}

/// The light of a block that leaves in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bin {
    /// Bin of frequency along x times the bins an axis, and along y (cycles a tile).
    pub direction: u16,
    /// Mean place that it comes from (um): a lens sends the light of each place of a block elsewhere.
    pub place_um: [f32; 2],
    /// Edges of the rectangle about it whose moments are those of the places it comes from (um).
    pub edges_um: [f32; 2],
    pub power_um2: f32,
}

/// Share of the power of a block that its weak directions have.
const WEAK: f64 = 0.06;
/// Directions along an axis that are gathered where they are weak.
pub(super) const GROUP: usize = 4;
/// Share of the power of a block that may be left out with its weakest groups.
const LEFT_OUT: f64 = 2e-3;

/// Power of a direction, and where it comes from.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    power_um2: f32,
    /// Power times place along x and y, from the middle of the block (um).
    first: [f32; 2],
    /// Power times the square of the place.
    second: [f32; 2],
}

impl Moments {
    /// Add power that leaves from a place.
    #[inline]
    pub fn add(&mut self, power_um2: f32, place_um: [f32; 2]) {
        self.power_um2 += power_um2;
        for (a, place) in place_um.into_iter().enumerate() {
            self.first[a] += power_um2 * place;
            self.second[a] += power_um2 * place * place;
        }
    }

    fn gather(&mut self, other: &Self) {
        self.power_um2 += other.power_um2;
        for a in 0..2 {
            self.first[a] += other.first[a];
            self.second[a] += other.second[a];
        }
    }

    /// Mean place, and the edges of a rectangle with the same second moments, of tiles that are `hop_um` wide.
    fn places(&self, middle_um: [f64; 2], hop_um: [f64; 2]) -> [[f32; 2]; 2] {
        let mean = self.first.map(|v| v / self.power_um2);
        let edge = |a: usize| {
            let variance = (self.second[a] / self.power_um2 - mean[a] * mean[a]).max(0.0);
            (12.0 * f64::from(variance) + hop_um[a] * hop_um[a]).sqrt() as f32
        };
        [
            [0, 1].map(|a| (middle_um[a] + f64::from(mean[a])) as f32),
            [edge(0), edge(1)],
        ]
    }
}

impl Block {
    /// From the power of each direction, columns first; none of a block without light.
    pub fn of(sums: &[Moments], tiling: Tiling, middle_um: [f64; 2], hop_um: [f64; 2]) -> Option<Self> {
        let power = |i: usize| sums[i].power_um2;
        let total: f64 = (0..sums.len()).map(|i| f64::from(power(i))).sum();
        if total <= 0.0 {
            return None;
        }
        let bin = |direction: usize, sums: &Moments| {
            let [place_um, edges_um] = sums.places(middle_um, hop_um);
            Bin {
                direction: direction as u16,
                place_um,
                edges_um,
                power_um2: sums.power_um2,
            }
        };
        let (kept, others) = strongest(total, 1.0 - WEAK, power, sums.len());
        let strong = kept.into_iter().map(|i| bin(i, &sums[i])).collect();
        let across = tiling.side / GROUP;
        let mut groups = vec![Group::default(); across * across];
        for i in others {
            let [column, row] = [i / tiling.side, i % tiling.side].map(|k| k / GROUP);
            groups[column * across + row].add(i, tiling, &sums[i]);
        }
        let all: f64 = groups.iter().map(|g| f64::from(g.sums.power_um2)).sum();
        let share = 1.0 - LEFT_OUT * total / all.max(f64::MIN_POSITIVE);
        let (kept, left_out) = strongest(all, share, |i| groups[i].sums.power_um2, groups.len());
        Some(Self {
            strong,
            weak: kept
                .into_iter()
                .map(|i| bin(groups[i].direction(tiling), &groups[i].sums))
                .collect(),
            rest_um2: left_out.into_iter().map(|i| f64::from(groups[i].sums.power_um2)).sum(),
        })
    }

    /// All its power (um^2).
    pub fn power_um2(&self) -> f64 {
        let bins = self.strong.iter().chain(&self.weak);
        bins.map(|b| f64::from(b.power_um2)).sum::<f64>() + self.rest_um2
    }
}

/// Weak directions beside one another.
#[derive(Clone, Copy, Debug, Default)]
struct Group {
    sums: Moments,
    /// Power times the index of the direction along x and along y.
    directions: [f32; 2],
}

impl Group {
    fn add(&mut self, direction: usize, tiling: Tiling, one: &Moments) {
        self.sums.gather(one);
        for (sum, k) in self
            .directions
            .iter_mut()
            .zip([direction / tiling.side, direction % tiling.side])
        {
            *sum += one.power_um2 * k as f32;
        }
    }

    /// The direction that is nearest to the mean.
    fn direction(&self, tiling: Tiling) -> usize {
        let [x, y] = self.directions.map(|sum| (sum / self.sums.power_um2).round() as usize);
        let last = tiling.side - 1;
        x.min(last) * tiling.side + y.min(last)
    }
}

/// The fewest of `n` that have a share of a power, and the others that have any, each in their own order.
fn strongest(total: f64, share: f64, power: impl Fn(usize) -> f32, n: usize) -> (Vec<usize>, Vec<usize>) {
    let mut order: Vec<usize> = (0..n).filter(|i| power(*i) > 0.0).collect();
    order.sort_by(|a, b| power(*b).total_cmp(&power(*a)).then(a.cmp(b)));
    let mut sum = 0.0;
    let enough = order.iter().position(|i| {
        let before = sum;
        sum += f64::from(power(*i));
        before >= share * total
    });
    let mut others = order.split_off(enough.unwrap_or(order.len()));
    // Directions beside one another land beside one another.
    order.sort_unstable();
    others.sort_unstable();
    (order, others)
}
