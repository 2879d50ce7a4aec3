//! Phase surfaces out of lens files of OpticStudio (`.zmx`).
//!
//! A surface begins with `SURF n`; its `TYPE` is `BINARY_1` or `BINARY_2`. `PARM 0` is the order of diffraction, which the
//! phase is multiplied by. Of the extra data, `XDAT 1` is the number of coefficients, `XDAT 2` the radius that lengths are
//! divided by (in the unit of `UNIT`), and those after are coefficients (rad): of x, y, x^2, xy, y^2, x^3, ... for Binary 1,
//! of r^2, r^4, ... for Binary 2.

use std::path::{Path, PathBuf};

use super::TermForm;
use crate::phase::RadialPhase;
use metalith_core::file::read_at_most;
use metalith_core::{Error, Result};

/// Longest file that is read (bytes).
const LONGEST: u64 = 16 << 20;

/// What is known of one surface.
#[derive(Default)]
struct Surface {
    number: u32,
    kind: Option<Kind>,
    order: Option<f64>,
    /// Extra data by number, from one.
    data: Vec<f64>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Binary1,
    Binary2,
}

/// The phase of a surface of a file; the only one that has a phase if none is named.
///
/// # Errors
/// If the file cannot be read, or has no such surface or several.
pub(super) fn read(path: &Path, wanted: Option<u32>) -> Result<TermForm> {
    let bytes = read_at_most(path, LONGEST, "a lens file")?;
    let fault = Fault(path);
    let text = decoded(&bytes);
    let (mut unit_um, mut surfaces) = (1e3, Vec::<Surface>::new());
    for (line, text) in text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())) {
        let mut words = text.split_ascii_whitespace();
        let Some(key) = words.next() else { continue };
        let mut number = |what: &str| {
            let word = words.next().unwrap_or_default();
            word.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                fault.at(
                    line,
                    format!("`{key}` needs {what}, not `{}`", metalith_core::text::quoted(word)),
                )
            })
        };
        match key {
            "UNIT" => unit_um = unit(words.next()).ok_or_else(|| fault.at(line, "an unknown unit of length".into()))?,
            "SURF" => surfaces.push(Surface {
                number: number("the number of the surface")? as u32,
                ..Surface::default()
            }),
            _ => {
                let Some(surface) = surfaces.last_mut() else { continue };
                match key {
                    "TYPE" => {
                        surface.kind = match words.next() {
                            Some("BINARY_1") => Some(Kind::Binary1),
                            Some("BINARY_2") => Some(Kind::Binary2),
                            _ => None,
                        }
                    }
                    "PARM" if surface.kind.is_some() && number("the number of the parameter")? == 0.0 => {
                        surface.order = Some(number("a value")?);
                    }
                    "XDAT" if surface.kind.is_some() => {
                        let at = number("the number of the entry")?;
                        let value = number("a value")?;
                        if !(1.0..=MOST_DATA as f64).contains(&at) || at.fract() != 0.0 {
                            return Err(fault.at(line, format!("entry {at} of the extra data")));
                        }
                        let at = at as usize;
                        if surface.data.len() < at {
                            surface.data.resize(at, 0.0);
                        }
                        surface.data[at - 1] = value;
                    }
                    _ => {}
                }
            }
        }
    }
    let known: Vec<&Surface> = surfaces.iter().filter(|s| s.kind.is_some()).collect();
    let chosen = match (wanted, known.as_slice()) {
        (None, [one]) => *one,
        (Some(number), _) => known
            .iter()
            .find(|s| s.number == number)
            .ok_or_else(|| fault.whole(format!("surface {number} has no phase; {}", list(&known))))?,
        (None, _) => return Err(fault.whole(list(&known))),
    };
    chosen.form(unit_um, &fault)
}

/// Most entries of the extra data: Binary 1 has 230 coefficients.
const MOST_DATA: usize = 242;

impl Surface {
    fn form(&self, unit_um: f64, fault: &Fault<'_>) -> Result<TermForm> {
        let count = self.data.first().copied().unwrap_or(0.0).max(0.0) as usize;
        let radius_um = self.data.get(1).copied().unwrap_or(0.0) * unit_um;
        let coefficients = self.data.get(2..2 + count).unwrap_or_default();
        if count == 0 || coefficients.len() < count || radius_um <= 0.0 {
            return Err(fault.whole(format!(
                "surface {} has {count} coefficients over a radius of {radius_um} um, and {} are there",
                self.number,
                self.data.len().saturating_sub(2)
            )));
        }
        let order = self.order.unwrap_or(1.0);
        let coefficients = coefficients.iter().map(|a| a * order);
        Ok(match self.kind {
            Some(Kind::Binary1) => TermForm::Polynomial {
                terms: powers().zip(coefficients).map(|((i, j), a)| (i, j, a)).collect(),
                radius_um,
            },
            _ => TermForm::Radial(RadialPhase::EvenPowers {
                coefficients_rad: coefficients.collect(),
                normalisation_um: radius_um,
            }),
        })
    }
}

/// Powers of x and y in the order of Binary 1.
fn powers() -> impl Iterator<Item = (u32, u32)> {
    (1..).flat_map(|sum| (0..=sum).map(move |j| (sum - j, j)))
}

/// The file as text: UTF-16 with a mark of its byte order, as the program saves it, or plain.
fn decoded(bytes: &[u8]) -> String {
    let wide = |order: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes[2..]
            .chunks_exact(2)
            .map(|pair| order([pair[0], pair[1]]))
            .collect();
        String::from_utf16_lossy(&units)
    };
    match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => String::from_utf8_lossy(bytes).into_owned(),
    }
}

fn unit(name: Option<&str>) -> Option<f64> {
    Some(match name? {
        "MM" => 1e3,
        "CM" => 1e4,
        "IN" => 25.4e3,
        "METER" => 1e6,
        _ => return None,
    })
}

fn list(known: &[&Surface]) -> String {
    match known {
        [] => "no surface of type BINARY_1 or BINARY_2 is in the file".into(),
        _ => {
            let numbers: Vec<String> = known.iter().map(|s| s.number.to_string()).collect();
            format!("phases are on surfaces {}", numbers.join(", "))
        }
    }
}

/// Errors of one file.
struct Fault<'a>(&'a Path);

impl Fault<'_> {
    fn error(&self, line: Option<usize>, what: String) -> Error {
        Error::Table {
            path: PathBuf::from(self.0),
            line,
            what,
            hint: "save the lens as .zmx, and name the surface with `surface` if several have a phase".into(),
        }
    }

    fn at(&self, line: usize, what: String) -> Error {
        self.error(Some(line), what)
    }

    fn whole(&self, what: String) -> Error {
        self.error(None, what)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: &str = "VERS 190513\nUNIT MM X W X CM MR CPMM\nSURF 0\n  TYPE STANDARD\nSURF 1\n  TYPE BINARY_2\n  PARM 0 1\n  \
                        PARM 1 0\n  XDAT 1 2.0 0 0 1.0 0.0 0 \"\"\n  XDAT 2 0.5 0 0 1.0 0.0 0 \"\"\n  XDAT 3 -600.0 0 0\n  \
                        XDAT 4 25.0 0 0\nSURF 2\n  TYPE BINARY_1\n  PARM 0 2\n  XDAT 1 5\n  XDAT 2 1.0\n  XDAT 3 1\n  XDAT 4 2\n  \
                        XDAT 5 3\n  XDAT 6 4\n  XDAT 7 5\n";

    fn read_text(bytes: &[u8], surface: Option<u32>) -> Result<TermForm> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lens.zmx");
        std::fs::write(&path, bytes).unwrap();
        read(&path, surface)
    }

    #[test]
    fn both_binary_surfaces_are_read() {
        let radial = RadialPhase::EvenPowers {
            coefficients_rad: vec![-600.0, 25.0],
            normalisation_um: 500.0,
        };
        assert_eq!(
            read_text(LENS.as_bytes(), Some(1)).unwrap(),
            TermForm::Radial(radial.clone())
        );
        // As the program saves it.
        let wide: Vec<u8> = [0xfeff]
            .into_iter()
            .chain(LENS.encode_utf16())
            .flat_map(u16::to_le_bytes)
            .collect();
        assert_eq!(read_text(&wide, Some(1)).unwrap(), TermForm::Radial(radial));
        let twice = TermForm::Polynomial {
            terms: vec![(1, 0, 2.0), (0, 1, 4.0), (2, 0, 6.0), (1, 1, 8.0), (0, 2, 10.0)],
            radius_um: 1000.0,
        };
        assert_eq!(read_text(LENS.as_bytes(), Some(2)).unwrap(), twice);
    }

    #[test]
    fn what_is_missing_is_said() {
        for (text, surface, wanted) in [
            (LENS, None, "phases are on surfaces 1, 2"),
            (LENS, Some(7), "surface 7 has no phase"),
            ("SURF 0\nTYPE STANDARD\n", None, "no surface of type"),
            (
                "SURF 1\nTYPE BINARY_2\nXDAT 1 2\nXDAT 2 1\nXDAT 3 5\n",
                None,
                "2 coefficients",
            ),
            ("SURF 1\nTYPE BINARY_2\nXDAT 1 x\n", None, "needs a value"),
            ("SURF 1\nTYPE BINARY_2\nXDAT 999999999 1\n", None, "entry 999999999"),
            ("UNIT PARSEC\n", None, "unknown unit"),
        ] {
            let error = read_text(text.as_bytes(), surface).unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
