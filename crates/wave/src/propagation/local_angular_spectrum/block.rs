//! The light of neighbouring tiles by direction, few directions for most of it.

use metalith_pillars::Lattice;

use super::super::tiles::Tiling;

/// Neighbouring tiles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Block {
    /// Directions that most of the light leaves in.
    pub strong: Vec<Bin>,
    /// The others, gathered more coarsely.
    pub weak: Vec<Bin>,
    /// Power that was left out (um^2), taken to be distributed as the rest.
    pub rest_um2: f64,
}

/// The light of a block that leaves in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bin {
    /// Pair of directions along x times the pairs an axis, and along y: [`Pairs`].
    pub pair: u16,
    /// Mean place from which the middle direction of the pair leads where the light lands (um).
    pub place_um: [f32; 2],
    /// Edges of the rectangle about it whose moments are those of the light (um).
    pub edges_um: [f32; 2],
    pub power_um2: f32,
}

/// Share of the power of a block that its weak directions have.
const WEAK: f64 = 0.12;
/// Directions along an axis that are taken together.
const PAIR: usize = 2;
/// Pairs along an axis that are gathered where they are weak.
const GROUP: usize = 4;
/// Share of the power of a block that may be left out with its weakest groups.
const LEFT_OUT: f64 = 2e-3;

/// Directions of tiles in pairs along both axes: squares of the plane distinguish no finer ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pairs {
    /// Along an axis.
    pub across: usize,
    /// Distance at which neighbouring directions land from one another (um).
    landing_um: [f64; 2],
}

impl Pairs {
    pub(crate) fn new(tiling: Tiling, lattice: &Lattice) -> Self {
        Self {
            across: tiling.side / PAIR,
            landing_um: tiling.landing_um(lattice),
        }
    }

    /// All of them.
    pub(crate) fn count(self) -> usize {
        self.across * self.across
    }

    /// Index of the direction in the middle of a pair, along an axis.
    pub(crate) fn middle(pair: usize) -> usize {
        pair * PAIR + PAIR / 2
    }

    /// Add the power of each direction of a tile that is at a place of its block (um); columns first.
    pub(crate) fn add(self, powers: impl Iterator<Item = f32>, place_um: [f32; 2], sums: &mut [Moments]) {
        let side = self.across * PAIR;
        let step = self.landing_um.map(|um| um as f32);
        let beyond = |k: usize, a: usize| (k as f32 - Self::middle(k / PAIR) as f32) * step[a];
        // By index along an axis: where it lands from where the middle of its pair does.
        let places: [Vec<f32>; 2] = [0, 1].map(|a| (0..side).map(|k| place_um[a] + beyond(k, a)).collect());
        for (i, power) in powers.enumerate() {
            let [column, row] = [i / side, i % side];
            let to = &mut sums[column / PAIR * self.across + row / PAIR];
            to.add(power, [places[0][column], places[1][row]]);
        }
    }

    /// The pair in the middle of a group, whose direction stands for it.
    fn of_group(self, group: usize) -> usize {
        let across = self.across / GROUP;
        let [column, row] = [group / across, group % across].map(|k| k * GROUP + GROUP / 2);
        column * self.across + row
    }
}

/// Power that leaves in directions near one another, and where it lands from where one of them does.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    power_um2: f32,
    /// Power times place along x and y, from the middle of the block (um).
    first: [f32; 2],
    /// Power times the square of the place.
    second: [f32; 2],
}

impl Moments {
    #[inline]
    fn add(&mut self, power_um2: f32, place_um: [f32; 2]) {
        self.power_um2 += power_um2;
        for (a, place) in place_um.into_iter().enumerate() {
            self.first[a] += power_um2 * place;
            self.second[a] += power_um2 * place * place;
        }
    }

    /// Add others, all of whose places are so much farther.
    fn gather(&mut self, other: &Self, farther_um: [f32; 2]) {
        self.power_um2 += other.power_um2;
        for (a, d) in farther_um.into_iter().enumerate() {
            self.first[a] += other.first[a] + other.power_um2 * d;
            self.second[a] += other.second[a] + (2.0 * other.first[a] + other.power_um2 * d) * d;
        }
    }

    /// Light of a block about a place, as light in the direction of a pair.
    fn bin(&self, pair: usize, middle_um: [f64; 2], pairs: Pairs) -> Bin {
        let mean = self.first.map(|v| v / self.power_um2);
        let edge = |a: usize| {
            let variance = (self.second[a] / self.power_um2 - mean[a] * mean[a]).max(0.0);
            // Each direction stands for all between it and the next.
            (12.0 * f64::from(variance) + pairs.landing_um[a].powi(2)).sqrt() as f32
        };
        Bin {
            pair: pair as u16,
            place_um: [0, 1].map(|a| (middle_um[a] + f64::from(mean[a])) as f32),
            edges_um: [edge(0), edge(1)],
            power_um2: self.power_um2,
        }
    }
}

impl Block {
    /// Block from the power of each pair of directions, columns first; `None` for a block without light.
    pub(crate) fn of(sums: &[Moments], pairs: Pairs, middle_um: [f64; 2]) -> Option<Self> {
        let power = |i: usize| sums[i].power_um2;
        let total: f64 = (0..sums.len()).map(|i| f64::from(power(i))).sum();
        if total <= 0.0 {
            return None;
        }
        let (kept, others) = strongest(total, 1.0 - WEAK, power, sums.len());
        let strong = kept.into_iter().map(|i| sums[i].bin(i, middle_um, pairs)).collect();
        let across = pairs.across / GROUP;
        let mut groups = vec![Moments::default(); across * across];
        for i in others {
            let own = [i / pairs.across, i % pairs.across];
            let group = own[0] / GROUP * across + own[1] / GROUP;
            let of = pairs.of_group(group);
            let of = [of / pairs.across, of % pairs.across];
            let farther = |a: usize| (own[a] as f64 - of[a] as f64) * PAIR as f64 * pairs.landing_um[a];
            groups[group].gather(&sums[i], [farther(0) as f32, farther(1) as f32]);
        }
        let all: f64 = groups.iter().map(|g| f64::from(g.power_um2)).sum();
        let share = 1.0 - LEFT_OUT * total / all.max(f64::MIN_POSITIVE);
        let (kept, left_out) = strongest(all, share, |i| groups[i].power_um2, groups.len());
        let weak = kept.into_iter();
        Some(Self {
            strong,
            weak: weak
                .map(|i| groups[i].bin(pairs.of_group(i), middle_um, pairs))
                .collect(),
            rest_um2: left_out.into_iter().map(|i| f64::from(groups[i].power_um2)).sum(),
        })
    }

    /// All its light but what was left out.
    pub(crate) fn bins(&self) -> impl Iterator<Item = &Bin> {
        self.strong.iter().chain(&self.weak)
    }

    /// All its power (um^2).
    pub(crate) fn power_um2(&self) -> f64 {
        self.bins().map(|b| f64::from(b.power_um2)).sum::<f64>() + self.rest_um2
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
