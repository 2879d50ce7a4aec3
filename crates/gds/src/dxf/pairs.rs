//! Pairs of a code and a value, of which a drawing in DXF consists: two lines each.

use super::Fault;

/// A code, its value without white space around it, and the line of the code.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair<'a> {
    pub code: i32,
    pub value: &'a [u8],
    pub line: u64,
}

impl Pair<'_> {
    /// The value as a number.
    pub(super) fn number(&self) -> Result<f64, Fault> {
        let number = std::str::from_utf8(self.value).ok().and_then(|v| v.parse().ok());
        number
            .filter(|v: &f64| v.is_finite())
            .ok_or(self.fault("a value is no number"))
    }

    pub(super) fn fault(&self, what: &'static str) -> Fault {
        Fault { line: self.line, what }
    }
}

/// Reader of pairs.
#[derive(Clone, Debug)]
pub(super) struct Pairs<'a> {
    bytes: &'a [u8],
    /// Byte and line that come next.
    pub at: usize,
    pub line: u64,
}

impl<'a> Pairs<'a> {
    /// Pairs from a byte on, which stands in a line.
    pub(super) fn from(bytes: &'a [u8], at: usize, line: u64) -> Self {
        Self { bytes, at, line }
    }

    fn next_line(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (length + 1).min(rest.len());
        self.line += 1;
        Some(rest[..length].trim_ascii())
    }

    /// The next pair; none at the end of the file. Comments are passed over.
    pub(super) fn next(&mut self) -> Result<Option<Pair<'a>>, Fault> {
        loop {
            let line = self.line;
            let Some(code) = self.next_line() else {
                return Ok(None);
            };
            let fault = |what| Fault { line, what };
            let Some(value) = self.next_line() else {
                // White space behind the end.
                return match code {
                    [] => Ok(None),
                    _ => Err(fault("it ends between a code and its value")),
                };
            };
            let code = std::str::from_utf8(code).ok().and_then(|c| c.parse().ok());
            match code.ok_or(fault("a code is no whole number"))? {
                999 => {}
                code => return Ok(Some(Pair { code, value, line })),
            }
        }
    }
}
