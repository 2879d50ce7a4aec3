//! Expressions that a person declares an effect by, such as `a * (x^2 - y^2) / R^2`: parsed once, evaluated over rows
//! of sites.
//!
//! | written | means |
//! | --- | --- |
//! | `+ - * /`, `^` | as usual; `^` binds most tightly and to the right: `-x^2` is `-(x^2)` |
//! | `sin cos tan asin acos atan exp log sqrt abs` | of one value, angles in rad, `log` to the base e |
//! | `step(v)` | 1 where v is zero or more, else 0 |
//! | `min max hypot atan2` | of two values |
//! | `zernike(j, x, y)` | Noll's polynomial j, a whole number from 1 to 36, on the unit disc, rms of one |
//! | `pi` | 3.14159... |

mod evaluate;
mod parse;

pub use evaluate::Input;

/// An expression in postfix order.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    steps: Vec<Step>,
}

/// Fault in the text of an expression.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpressionFault {
    /// Byte of the text at which it is found.
    pub at: usize,
    pub what: String,
    pub hint: String,
}

/// One step of an evaluation on a stack.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    /// A variable by its place among the names.
    Variable(usize),
    One(One),
    Two(Two),
    /// Noll's polynomial of the two values on the stack.
    Zernike(u32),
}

/// Functions of one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum One {
    Negative,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Exp,
    Log,
    Sqrt,
    Abs,
    Step,
}

/// Functions of two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Two {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Min,
    Max,
    Hypot,
    Atan2,
}

const OF_ONE: [(&str, One); 11] = [
    ("sin", One::Sin),
    ("cos", One::Cos),
    ("tan", One::Tan),
    ("asin", One::Asin),
    ("acos", One::Acos),
    ("atan", One::Atan),
    ("exp", One::Exp),
    ("log", One::Log),
    ("sqrt", One::Sqrt),
    ("abs", One::Abs),
    ("step", One::Step),
];

const OF_TWO: [(&str, Two); 4] = [
    ("min", Two::Min),
    ("max", Two::Max),
    ("hypot", Two::Hypot),
    ("atan2", Two::Atan2),
];

impl Expression {
    /// True if the value depends on a variable, by its place among the names that the text was parsed with.
    pub fn uses(&self, variable: usize) -> bool {
        self.steps.contains(&Step::Variable(variable))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 3] = ["x", "y", "a"];

    fn value(text: &str, at: [f64; 3]) -> f64 {
        Expression::parse(text, &NAMES).unwrap().value(&at)
    }

    #[test]
    fn values_are_those_of_the_same_formula_in_rust() {
        let (x, y, a): (f64, f64, f64) = (0.3, -0.7, 2.5);
        // The same operations in the same order.
        for (text, want) in [
            ("a * (x^2 - y^2)", a * (x.powf(2.0) - y.powf(2.0))),
            ("-x^2", -(x.powf(2.0))),
            ("2^3^2", 512.0),
            ("1 - 2 - 3", -4.0),
            ("8 / 4 / 2", 1.0),
            ("x*-y", x * -y),
            ("atan2(y, x) + hypot(x, y)", y.atan2(x) + x.hypot(y)),
            ("step(x) - step(y) + step(0)", 2.0),
            ("1.5e-1 * exp(-x/a)", 1.5e-1 * (-x / a).exp()),
            (
                "min(x, y) + max(x, y) + abs(y) + pi",
                y + x + y.abs() + std::f64::consts::PI,
            ),
            ("zernike(6, x, y)", evaluate::zernike(6, x, y)),
        ] {
            assert_eq!(value(text, [x, y, a]), want, "{text}");
        }
    }

    #[test]
    fn rows_are_evaluated_as_single_values_are() {
        let text = "a * sin(x * y) / (1 + x^2) + zernike(7, x, y)";
        let expression = Expression::parse(text, &NAMES).unwrap();
        let row: Vec<f64> = (0..50).map(|i| -0.9 + 0.03 * f64::from(i)).collect();
        let mut out = vec![0.0; row.len()];
        expression.row(&[Input::Row(&row), Input::Scalar(0.4), Input::Scalar(-2.0)], &mut out);
        for (x, v) in row.iter().zip(&out) {
            assert_eq!(*v, expression.value(&[*x, 0.4, -2.0]));
        }
        let constant = Expression::parse("2 * a", &NAMES).unwrap();
        constant.row(&[Input::Row(&row), Input::Scalar(0.4), Input::Scalar(-2.0)], &mut out);
        assert!(out.iter().all(|v| *v == -4.0) && !constant.uses(0) && constant.uses(2));
    }

    #[test]
    fn faults_say_where_and_what() {
        let deep = format!("{}x{}", "(".repeat(500), ")".repeat(500));
        let mut said = Vec::new();
        for (text, at) in [
            ("a * (x + y", 10),
            ("a * ", 4),
            ("a * z", 4),
            ("sine(x)", 0),
            ("sin(x, y)", 0),
            ("sin x", 4),
            ("x y", 2),
            ("x + $", 4),
            ("1.2.3", 0),
            ("", 0),
            ("x) + 1", 1),
            ("zernike(x, x, y)", 8),
        ] {
            let fault = Expression::parse(text, &NAMES).unwrap_err();
            assert_eq!(fault.at, at, "{text}: {fault:?}");
            said.push(format!("{text}: {}", fault.what));
        }
        said.push(format!(
            "500 brackets: {}",
            Expression::parse(&deep, &NAMES).unwrap_err().what
        ));
        insta::assert_snapshot!(said.join("\n"), @"
        a * (x + y: a `)` is missing
        a * : a value is missing here
        a * z: `z` is not known
        sine(x): `sine` is not known
        sin(x, y): `sin` takes 1 value, not 2
        sin x: an operator is missing here
        x y: an operator is missing here
        x + $: `$` has no meaning here
        1.2.3: `1.2.3` is no number
        : a value is missing here
        x) + 1: this `)` has no `(`
        zernike(x, x, y): the first value of `zernike` is a whole number from 1 to 36
        500 brackets: parentheses are nested too deeply
        ");
    }
}
