//! Evaluation of an expression, for one site or for a row of them at once.

use super::{Expression, One, Step, Two};
use crate::Zernike;

/// Values of a variable along a row.
#[derive(Clone, Copy)]
pub enum Input<'a> {
    /// Single value for all of the row.
    Scalar(f64),
    /// One value for each site.
    Row(&'a [f64]),
}

/// An entry of the stack.
enum Entry {
    Scalar(f64),
    Row(Vec<f64>),
}

/// Noll's polynomial of a number at a place of the unit disc, with an rms of one.
pub(super) fn zernike(j: u32, x: f64, y: f64) -> f64 {
    let polynomial = Zernike::noll(j);
    polynomial.norm() * polynomial.value(x, y)
}

impl One {
    fn of(self, v: f64) -> f64 {
        match self {
            Self::Negative => -v,
            Self::Sin => v.sin(),
            Self::Cos => v.cos(),
            Self::Tan => v.tan(),
            Self::Asin => v.asin(),
            Self::Acos => v.acos(),
            Self::Atan => v.atan(),
            Self::Exp => v.exp(),
            Self::Log => v.ln(),
            Self::Sqrt => v.sqrt(),
            Self::Abs => v.abs(),
            Self::Step => f64::from(u8::from(v >= 0.0)),
        }
    }
}

impl Two {
    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Power => a.powf(b),
            Self::Min => a.min(b),
            Self::Max => a.max(b),
            Self::Hypot => a.hypot(b),
            Self::Atan2 => a.atan2(b),
        }
    }
}

impl Entry {
    fn one(self, f: impl Fn(f64) -> f64) -> Self {
        match self {
            Self::Scalar(v) => Self::Scalar(f(v)),
            Self::Row(mut row) => {
                row.iter_mut().for_each(|v| *v = f(*v));
                Self::Row(row)
            }
        }
    }

    fn two(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        match (self, other) {
            (Self::Scalar(a), Self::Scalar(b)) => Self::Scalar(f(a, b)),
            (Self::Scalar(a), row) => row.one(|b| f(a, b)),
            (row, Self::Scalar(b)) => row.one(|a| f(a, b)),
            (Self::Row(mut a), Self::Row(b)) => {
                a.iter_mut().zip(&b).for_each(|(a, b)| *a = f(*a, *b));
                Self::Row(a)
            }
        }
    }
}

impl Expression {
    /// The value where the variables have these values, in the order of their names.
    pub fn value(&self, variables: &[f64]) -> f64 {
        let inputs: Vec<Input<'_>> = variables.iter().map(|v| Input::Scalar(*v)).collect();
        match self.entry(&inputs) {
            Entry::Scalar(v) => v,
            Entry::Row(row) => row.first().copied().unwrap_or(f64::NAN),
        }
    }

    /// The values along a row, all variables given in the order of their names; rows are as long as `out`.
    pub fn row(&self, inputs: &[Input<'_>], out: &mut [f64]) {
        match self.entry(inputs) {
            Entry::Scalar(v) => out.fill(v),
            Entry::Row(row) => out.copy_from_slice(&row),
        }
    }

    fn entry(&self, inputs: &[Input<'_>]) -> Entry {
        let mut stack: Vec<Entry> = Vec::new();
        // The parser leaves enough values for every step, and one in the end.
        let pop = |stack: &mut Vec<Entry>| stack.pop().unwrap_or(Entry::Scalar(f64::NAN));
        for step in &self.steps {
            let entry = match *step {
                Step::Number(v) => Entry::Scalar(v),
                Step::Variable(k) => match inputs[k] {
                    Input::Scalar(v) => Entry::Scalar(v),
                    Input::Row(row) => Entry::Row(row.to_vec()),
                },
                Step::One(one) => pop(&mut stack).one(|v| one.of(v)),
                Step::Two(Two::Power) => {
                    let (b, a) = (pop(&mut stack), pop(&mut stack));
                    match b {
                        // Squares are common, and a product is much faster than a power.
                        Entry::Scalar(2.0) => a.one(|v| v * v),
                        b => a.two(b, |a, b| Two::Power.of(a, b)),
                    }
                }
                Step::Two(two) => {
                    let (b, a) = (pop(&mut stack), pop(&mut stack));
                    a.two(b, |a, b| two.of(a, b))
                }
                Step::Zernike(j) => {
                    let (b, a) = (pop(&mut stack), pop(&mut stack));
                    a.two(b, |x, y| zernike(j, x, y))
                }
            };
            stack.push(entry);
        }
        pop(&mut stack)
    }
}
