//! Parser from text to postfix order, by recursive descent.

use super::{Expression, ExpressionFault, OF_ONE, OF_TWO, One, Step, Two};

/// Parentheses and signs inside one another that are followed; deeper ones would exhaust the stack.
const DEEPEST: usize = 64;

/// Longest text of an expression (bytes).
const LONGEST: usize = 4096;

/// Highest polynomial of `zernike`: of the seventh order.
const HIGHEST_NOLL: u32 = 36;

const VALUES: &str = "write numbers, variables, functions and parentheses joined by + - * / ^";

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(f64),
    Name(String),
    Sign(char),
}

struct Parser<'n> {
    tokens: Vec<(usize, Token)>,
    next: usize,
    /// Length of the text: where what is missing at its end is missing.
    end: usize,
    names: &'n [&'n str],
    steps: Vec<Step>,
    depth: usize,
}

impl Expression {
    /// Parse a text whose variables have these names.
    ///
    /// # Errors
    /// What is wrong first, and where.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, ExpressionFault> {
        if text.len() > LONGEST {
            return Err(fault(
                LONGEST,
                "the expression is too long",
                "split it into two effects",
            ));
        }
        let mut parser = Parser {
            tokens: tokens(text)?,
            next: 0,
            end: text.len(),
            names,
            steps: Vec::new(),
            depth: 0,
        };
        parser.sum()?;
        match parser.tokens.get(parser.next) {
            None => Ok(Self { steps: parser.steps }),
            Some((at, Token::Sign(')'))) => Err(fault(*at, "this `)` has no `(`", "remove it, or open it before")),
            Some((at, _)) => Err(fault(*at, "an operator is missing here", VALUES)),
        }
    }
}

impl Parser<'_> {
    fn sum(&mut self) -> Result<(), ExpressionFault> {
        self.product()?;
        while let Some(sign) = self.take(&['+', '-']) {
            self.product()?;
            let two = if sign == '+' { Two::Add } else { Two::Subtract };
            self.steps.push(Step::Two(two));
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), ExpressionFault> {
        self.signed()?;
        while let Some(sign) = self.take(&['*', '/']) {
            self.signed()?;
            let two = if sign == '*' { Two::Multiply } else { Two::Divide };
            self.steps.push(Step::Two(two));
        }
        Ok(())
    }

    fn signed(&mut self) -> Result<(), ExpressionFault> {
        self.deeper(|parser| match parser.take(&['+', '-']) {
            None => parser.power(),
            Some(sign) => {
                parser.signed()?;
                if sign == '-' {
                    parser.steps.push(Step::One(One::Negative));
                }
                Ok(())
            }
        })
    }

    fn power(&mut self) -> Result<(), ExpressionFault> {
        self.value()?;
        if self.take(&['^']).is_some() {
            self.signed()?;
            self.steps.push(Step::Two(Two::Power));
        }
        Ok(())
    }

    fn value(&mut self) -> Result<(), ExpressionFault> {
        let at = self.at();
        match self.tokens.get(self.next).map(|t| t.1.clone()) {
            Some(Token::Number(number)) => {
                self.next += 1;
                self.steps.push(Step::Number(number));
                Ok(())
            }
            Some(Token::Name(name)) => {
                self.next += 1;
                self.named(at, &name)
            }
            Some(Token::Sign('(')) => {
                self.next += 1;
                self.deeper(Self::sum)?;
                self.close()
            }
            _ => Err(fault(at, "a value is missing here", VALUES)),
        }
    }

    /// A variable, `pi`, or a function with its values.
    fn named(&mut self, at: usize, name: &str) -> Result<(), ExpressionFault> {
        if let Some(place) = self.names.iter().position(|n| *n == name) {
            self.steps.push(Step::Variable(place));
            return Ok(());
        }
        if name == "pi" {
            self.steps.push(Step::Number(std::f64::consts::PI));
            return Ok(());
        }
        let one = OF_ONE.iter().find(|f| f.0 == name);
        let two = OF_TWO.iter().find(|f| f.0 == name);
        if one.is_none() && two.is_none() && name != "zernike" {
            let what = format!("`{name}` is not known");
            let functions: Vec<&str> = OF_ONE.iter().map(|f| f.0).chain(OF_TWO.iter().map(|f| f.0)).collect();
            let hint = format!(
                "variables here are {}; functions are {}, zernike",
                self.names.join(", "),
                functions.join(", ")
            );
            return Err(ExpressionFault { at, what, hint });
        }
        if self.take(&['(']).is_none() {
            return Err(fault(
                self.at(),
                "an operator is missing here",
                "write the values of a function in parentheses",
            ));
        }
        let noll = if name == "zernike" { Some(self.noll()?) } else { None };
        let mut count = 0;
        loop {
            self.deeper(Self::sum)?;
            count += 1;
            if self.take(&[',']).is_none() {
                break;
            }
        }
        self.close()?;
        let (wanted, step) = match (one, two, noll) {
            (Some((_, one)), ..) => (1, Step::One(*one)),
            (_, Some((_, two)), _) => (2, Step::Two(*two)),
            (.., noll) => (2, Step::Zernike(noll.unwrap_or(1))),
        };
        if count != wanted {
            let what = format!(
                "`{name}` takes {wanted} value{}, not {count}",
                if wanted == 1 { "" } else { "s" }
            );
            return Err(fault(at, &what, "separate values by commas"));
        }
        self.steps.push(step);
        Ok(())
    }

    /// The number of a polynomial and the comma after it.
    fn noll(&mut self) -> Result<u32, ExpressionFault> {
        let at = self.at();
        if let Some((_, Token::Number(j))) = self.tokens.get(self.next)
            && j.fract() == 0.0
            && (1.0..=f64::from(HIGHEST_NOLL)).contains(j)
        {
            let j = *j as u32;
            self.next += 1;
            if self.take(&[',']).is_some() {
                return Ok(j);
            }
        }
        let what = format!("the first value of `zernike` is a whole number from 1 to {HIGHEST_NOLL}");
        Err(fault(at, &what, "write zernike(6, x/R, y/R)"))
    }

    fn close(&mut self) -> Result<(), ExpressionFault> {
        match self.take(&[')']) {
            Some(_) => Ok(()),
            None if self.next == self.tokens.len() => Err(fault(self.at(), "a `)` is missing", "close every `(`")),
            None => Err(fault(self.at(), "an operator is missing here", VALUES)),
        }
    }

    fn deeper(&mut self, inner: impl FnOnce(&mut Self) -> Result<(), ExpressionFault>) -> Result<(), ExpressionFault> {
        if self.depth >= DEEPEST {
            return Err(fault(
                self.at(),
                "parentheses are nested too deeply",
                "split it into two effects",
            ));
        }
        self.depth += 1;
        let done = inner(self);
        self.depth -= 1;
        done
    }

    /// Place of the next token.
    fn at(&self) -> usize {
        self.tokens.get(self.next).map_or(self.end, |t| t.0)
    }

    /// The next sign if it is one of these.
    fn take(&mut self, signs: &[char]) -> Option<char> {
        match self.tokens.get(self.next) {
            Some((_, Token::Sign(sign))) if signs.contains(sign) => {
                self.next += 1;
                Some(*sign)
            }
            _ => None,
        }
    }
}

fn fault(at: usize, what: &str, hint: &str) -> ExpressionFault {
    ExpressionFault {
        at,
        what: what.into(),
        hint: hint.into(),
    }
}

fn tokens(text: &str) -> Result<Vec<(usize, Token)>, ExpressionFault> {
    let bytes = text.as_bytes();
    let mut out = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        let rest = &bytes[at..];
        let run = |keep: &dyn Fn(u8) -> bool| rest.iter().take_while(|b| keep(**b)).count();
        match bytes[at] {
            b' ' => at += 1,
            b'0'..=b'9' | b'.' => {
                let mut length = run(&|b| b.is_ascii_digit() || b == b'.');
                // An exponent with its sign.
                if matches!(rest.get(length), Some(b'e' | b'E')) {
                    let sign = usize::from(matches!(rest.get(length + 1), Some(b'+' | b'-')));
                    let digits = rest[length + 1 + sign..]
                        .iter()
                        .take_while(|b| b.is_ascii_digit())
                        .count();
                    length += if digits > 0 { 1 + sign + digits } else { 0 };
                }
                at += length;
                let number = text[start..at].parse().ok().filter(|n: &f64| n.is_finite());
                let no_number = || {
                    fault(
                        start,
                        &format!("`{}` is no number", &text[start..at]),
                        "write it as 1.5e-3",
                    )
                };
                out.push((start, Token::Number(number.ok_or_else(no_number)?)));
            }
            b'a'..=b'z' | b'A'..=b'Z' | b'_' => {
                at += run(&|b| b.is_ascii_alphanumeric() || b == b'_');
                out.push((start, Token::Name(text[start..at].into())));
            }
            sign @ (b'+' | b'-' | b'*' | b'/' | b'^' | b'(' | b')' | b',') => {
                at += 1;
                out.push((start, Token::Sign(char::from(sign))));
            }
            _ => {
                let odd = text[start..].chars().next().unwrap_or(' ');
                return Err(fault(start, &format!("`{odd}` has no meaning here"), VALUES));
            }
        }
    }
    Ok(out)
}
