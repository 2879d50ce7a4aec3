//! Response of margins to what varies: a quadratic fit, and its statements on variances and on tighter tolerances.
//!
//! The fit serves to divide and to extrapolate inwards; yields themselves are counted, never fitted. How much of the
//! variance it predicts, on draws that it was not fitted to, is reported beside everything that rests on it.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::record::{DrawRecord, LimitStatement};

/// Draws for each coefficient of a fit at the least.
const DRAWS_PER_TERM: usize = 4;

/// A margin that varies by less than this of its size does not depend on the draw.
const CONSTANT: f64 = 1e-12;

/// Response of the margin of one limit to the quantities.
#[derive(Clone, Debug, Serialize)]
pub struct Response {
    /// Key of the limit.
    pub key: String,
    /// Share of the variance of the margin that the fit predicts on draws that it was not fitted to; can be negative.
    pub predicted: f64,
    /// Share of the variance by each quantity alone.
    pub shares: Vec<f64>,
    /// Share by pairs of quantities.
    pub pairs: f64,
    /// Share that no quadratic explains.
    pub rest: f64,
    #[serde(skip)]
    fit: Quadratic,
    #[serde(skip)]
    limit: usize,
}

/// Tightening of one quantity, or of all of them, that a yield needs.
#[derive(Clone, Debug, Serialize)]
pub struct Tightening {
    /// Name of the quantity; `all` for all that are drawn.
    pub quantity: String,
    /// Factor on its spread for the yield that was asked for; `None` if even zero is not enough.
    pub factor: Option<f64>,
    /// Yield by the fit with no spread of it left.
    pub best_yield: f64,
}

/// A polynomial of second order in scaled quantities.
#[derive(Clone, Debug)]
struct Quadratic {
    terms: Vec<Term>,
    coefficients: Vec<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Term {
    One,
    Linear(usize),
    Square(usize),
    Pair(usize, usize),
}

impl Term {
    fn value(self, x: &[f64]) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Linear(i) => x[i],
            Self::Square(i) => x[i] * x[i],
            Self::Pair(i, j) => x[i] * x[j],
        }
    }

    /// Power of a factor on some quantities in this term.
    fn degree(self, which: &[bool]) -> usize {
        let of = |i: usize| usize::from(which[i]);
        match self {
            Self::One => 0,
            Self::Linear(i) => of(i),
            Self::Square(i) => 2 * of(i),
            Self::Pair(i, j) => of(i) + of(j),
        }
    }
}

impl Quadratic {
    fn value(&self, x: &[f64]) -> f64 {
        self.terms
            .iter()
            .zip(&self.coefficients)
            .map(|(t, c)| c * t.value(x))
            .sum()
    }

    /// Least squares; none if the matrix has no solution.
    fn fit(terms: &[Term], rows: &[(&[f64], f64)]) -> Option<Self> {
        let n = terms.len();
        let mut normal = DMatrix::<f64>::zeros(n, n);
        let mut right = DVector::<f64>::zeros(n);
        for (x, y) in rows {
            let row: Vec<f64> = terms.iter().map(|t| t.value(x)).collect();
            for i in 0..n {
                right[i] += row[i] * y;
                for j in 0..n {
                    normal[(i, j)] += row[i] * row[j];
                }
            }
        }
        // Two values of a grid have no square apart from the constant: the least solution is taken.
        const SINGULAR: f64 = 1e-10;
        let solved = normal
            .svd(true, true)
            .solve(&right, SINGULAR * rows.len() as f64)
            .ok()?;
        Some(Self {
            terms: terms.to_vec(),
            coefficients: solved.iter().copied().collect(),
        })
    }
}

/// Quantities of all draws, scaled to a spread of one about their middles, and the margins.
pub(crate) struct Table {
    names: Vec<String>,
    x: Vec<Vec<f64>>,
    /// Quantities that are drawn at random, and can be tightened.
    random: Vec<bool>,
}

impl Table {
    /// `middles`: of each quantity.
    pub(crate) fn new(names: Vec<String>, middles: &[f64], random: Vec<bool>, records: &[DrawRecord]) -> Self {
        let spread = |i: usize| {
            let squares = records.iter().map(|r| (r.amounts[i] - middles[i]).powi(2));
            (squares.sum::<f64>() / records.len().max(1) as f64).sqrt()
        };
        let spreads: Vec<f64> = (0..names.len()).map(spread).collect();
        let scaled = |r: &DrawRecord| {
            let each = r.amounts.iter().zip(middles).zip(&spreads);
            each.map(|((a, m), s)| if *s > 0.0 { (a - m) / s } else { 0.0 })
                .collect()
        };
        Self {
            x: records.iter().map(scaled).collect(),
            names,
            random,
        }
    }

    /// The response of one limit; none if it does not vary, is not always a number, or draws are too few.
    pub(crate) fn response(
        &self,
        limit: usize,
        statement: &LimitStatement,
        records: &[DrawRecord],
    ) -> Option<Response> {
        let margins: Vec<f64> = records
            .iter()
            .map(|r| r.reached[limit].map(|v| statement.margin(v)))
            .collect::<Option<_>>()?;
        let variance = variance(margins.iter().copied());
        let size = margins.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        if variance.sqrt() <= CONSTANT * size {
            return None;
        }
        let rows: Vec<(&[f64], f64)> = self.x.iter().map(Vec::as_slice).zip(margins.iter().copied()).collect();
        let terms = self.terms(rows.len())?;
        let fit = Quadratic::fit(&terms, &rows)?;
        // Every other draw is predicted by a fit to the others.
        let half = |odd: usize| rows.iter().copied().skip(odd).step_by(2).collect::<Vec<_>>();
        let halves = [half(0), half(1)];
        let mut missed = 0.0;
        for (fitted, left_out) in [(0, 1), (1, 0)] {
            let fit = Quadratic::fit(&terms, &halves[fitted])?;
            missed += halves[left_out]
                .iter()
                .map(|(x, y)| (fit.value(x) - y).powi(2))
                .sum::<f64>();
        }
        let part = |of: &dyn Fn(Term) -> bool| {
            let own = self.x.iter().map(|x| {
                let pairs = fit.terms.iter().zip(&fit.coefficients).filter(|(t, _)| of(**t));
                pairs.map(|(t, c)| c * t.value(x)).sum::<f64>()
            });
            self::variance(own) / variance
        };
        let own = |i: usize| part(&|t| t == Term::Linear(i) || t == Term::Square(i));
        let rest = rows.iter().map(|(x, y)| (fit.value(x) - y).powi(2)).sum::<f64>() / rows.len() as f64;
        Some(Response {
            key: statement.key.clone(),
            predicted: 1.0 - missed / (variance * rows.len() as f64),
            shares: (0..self.names.len()).map(own).collect(),
            pairs: part(&|t| matches!(t, Term::Pair(..))),
            rest: rest / variance,
            fit,
            limit,
        })
    }

    /// Terms of the fit, as many as the draws allow.
    fn terms(&self, draws: usize) -> Option<Vec<Term>> {
        let n = self.names.len();
        let linear = std::iter::once(Term::One).chain((0..n).map(Term::Linear));
        let squares: Vec<Term> = linear.clone().chain((0..n).map(Term::Square)).collect();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| Term::Pair(i, j)));
        let all: Vec<Term> = squares.iter().copied().chain(pairs).collect();
        // Both halves are fitted on their own.
        let choices = [all, squares, linear.collect()];
        choices.into_iter().find(|t| 2 * t.len() * DRAWS_PER_TERM <= draws)
    }

    /// Tightening of each quantity alone, and of all together, for a yield over all limits.
    pub(crate) fn tightenings(
        &self,
        wanted: f64,
        limits: &[LimitStatement],
        responses: &[Response],
        records: &[DrawRecord],
    ) -> Vec<Tightening> {
        let mut cases: Vec<(String, Vec<bool>)> = vec![("all".into(), self.random.clone())];
        for i in (0..self.names.len()).filter(|i| self.random[*i]) {
            let only = (0..self.names.len()).map(|k| k == i).collect();
            cases.push((self.names[i].clone(), only));
        }
        cases
            .into_iter()
            .map(|(quantity, which)| {
                let draws = self.scaled_margins(&which, limits, responses, records);
                let held = |factor: f64| {
                    draws
                        .iter()
                        .filter(|draw| draw.iter().all(|m| m.at(factor) >= 0.0))
                        .count()
                };
                let yield_at = |factor: f64| held(factor) as f64 / records.len().max(1) as f64;
                let mut steps = (0..=100).rev().map(|p| f64::from(p) / 100.0);
                Tightening {
                    quantity,
                    factor: steps.find(|factor| yield_at(*factor) >= wanted),
                    best_yield: yield_at(0.0),
                }
            })
            .collect()
    }

    /// Margins of the limits that depend on the draw, over the spread of some quantities: each draw keeps what the fit misses of it, so
    /// that a factor of one gives what was counted. Draws that miss another limit are left out: they hold at no factor.
    fn scaled_margins(
        &self,
        which: &[bool],
        limits: &[LimitStatement],
        responses: &[Response],
        records: &[DrawRecord],
    ) -> Vec<Vec<ScaledMargin>> {
        let moved: Vec<Option<&Quadratic>> = (0..limits.len())
            .map(|k| responses.iter().find(|r| r.limit == k).map(|r| &r.fit))
            .collect();
        let margins = |(record, x): (&DrawRecord, &Vec<f64>)| {
            let mut margins = Vec::new();
            for (k, limit) in limits.iter().enumerate() {
                let margin = limit.margin(record.reached[k]?);
                match moved[k] {
                    Some(fit) => margins.push(ScaledMargin::new(margin, fit, x, which)),
                    None if margin >= 0.0 => {}
                    None => return None,
                }
            }
            Some(margins)
        };
        records.iter().zip(&self.x).filter_map(margins).collect()
    }
}

/// Margin of a draw over the factor on the spread of some quantities: a polynomial of second order, in closed form for a search over
/// many factors.
struct ScaledMargin {
    margin: f64,
    /// Sum of the terms with one of the quantities, and of those with two.
    linear: f64,
    square: f64,
}

impl ScaledMargin {
    fn new(margin: f64, fit: &Quadratic, x: &[f64], which: &[bool]) -> Self {
        let mut sums = [0.0; 3];
        for (term, coefficient) in fit.terms.iter().zip(&fit.coefficients) {
            sums[term.degree(which)] += coefficient * term.value(x);
        }
        let [_, linear, square] = sums;
        Self { margin, linear, square }
    }

    fn at(&self, factor: f64) -> f64 {
        self.margin + (factor - 1.0) * self.linear + (factor * factor - 1.0) * self.square
    }
}

fn variance(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / n;
    values.map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Draws of two quantities on a fixed lattice, with the margin 1 - 0.5 a^2 - 0.1 b.
    fn records() -> Vec<DrawRecord> {
        let place = |k: usize, n: usize| 2.0 * (k as f64 + 0.5) / n as f64 - 1.0;
        (0..400)
            .map(|k| {
                let (a, b) = (2.0 * place(k % 20, 20), place(k / 20, 20));
                let margin = 1.0 - 0.5 * a * a - 0.1 * b;
                DrawRecord {
                    draw: k as u64,
                    amounts: vec![a, b],
                    design: BTreeMap::new(),
                    figures: BTreeMap::new(),
                    reached: vec![Some(margin)],
                    passed: margin >= 0.0,
                }
            })
            .collect()
    }

    #[test]
    fn variances_and_tolerances_are_those_of_the_formula() {
        let records = records();
        let names = vec!["a".into(), "b".into()];
        let table = Table::new(names, &[0.0; 2], vec![true; 2], &records);
        let limit = LimitStatement {
            key: "l".into(),
            limit: 0.0,
            at_least: true,
        };
        let found = table.response(0, &limit, &records).unwrap();
        // Var of 0.5 a^2 with a even over +-2 is 0.25 * 16 * (1/5 - 1/9); of 0.1 b it is 0.01 / 3; 20 places of each.
        let (va, vb) = (0.25 * 16.0 * (1.0 / 5.0 - 1.0 / 9.0), 0.01 / 3.0);
        const LATTICE: f64 = 0.01;
        assert!((found.shares[0] - va / (va + vb)).abs() < LATTICE, "{:?}", found.shares);
        assert!(found.predicted > 0.999 && found.rest < 1e-6 && found.pairs < 1e-6);
        let tight = table.tightenings(0.9, &[limit], &[found], &records);
        let [all, a, b] = tight.as_slice() else {
            panic!("{tight:?}")
        };
        assert_eq!(all.quantity, "all");
        // The margin holds for |a| below 1.41, seven tenths of the range: 0.9 of the draws for 0.78 of the range.
        assert!((a.factor.unwrap() - 0.78).abs() < 0.05, "{a:?}");
        assert_eq!(b.factor, None);
        assert_eq!(a.best_yield, 1.0);
    }
}
