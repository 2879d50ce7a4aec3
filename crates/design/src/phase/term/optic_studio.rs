//! Phase surfaces out of lens files of OpticStudio (`.zmx`).
//!
//! A surface begins with `SURF n`; its `TYPE` is `BINARY_1`, `BINARY_2`, `SZERNPHA` or `FZERNPHA`, and stands before or behind its other lines. `PARM 0` is
//! the order of diffraction, which the phase is multiplied by. Of the extra data, `XDAT 1` is the number of coefficients, `XDAT 2`
//! the radius that lengths are divided by (in the unit of `UNIT`), and those after are coefficients (rad): of x, y, x^2, xy, y^2,
//! x^3, ... for Binary 1, of r^2, r^4, ... for Binary 2; or coefficients (waves) of Zernike polynomials, standard or fringe. `CURV`, `CONI` and `PARM 1` to `PARM 8` bend the surface; a chip is flat.

use std::path::Path;

use super::{TermForm, ZernikeOrder, grid_phase};
use crate::phase::RadialPhase;
use metalith_core::file::read_at_most;
use metalith_core::text::without_mark;
use metalith_core::{Error, Result, Zernike};

/// Longest file that is read (bytes).
const LONGEST: u64 = 16 << 20;

/// Surface of the file, as far as it was read.
#[derive(Default)]
struct Surface<'t> {
    number: u32,
    /// The word of its `TYPE`; none where it is left out, as makers of lenses do.
    kind: Option<&'t str>,
    order: Option<f64>,
    /// Extra data by number, from one.
    data: Vec<f64>,
    /// The line that bends it.
    bent: Option<(usize, &'t str)>,
    /// Line that shifts its polynomials.
    moved: Option<(usize, &'t str)>,
    /// Other lines with their numbers.
    lines: Vec<(usize, &'t str)>,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Binary1,
    Binary2,
    Zernike(ZernikeOrder),
}

/// The phase of a surface of a file; the only one that has a phase if none is named.
///
/// # Errors
/// If the file cannot be read, or has no such surface or several, or it is not flat.
pub(super) fn read(path: &Path, wanted: Option<u32>) -> Result<TermForm> {
    let bytes = read_at_most(path, LONGEST, "a lens file")?;
    let fault = Fault(path);
    let text = decoded(&bytes);
    if let Some(grid) = grid_phase::read(path, &text) {
        return grid.map(TermForm::Map);
    }
    let (mut unit_um, mut surfaces) = (1e3, Vec::<Surface<'_>>::new());
    for (line, text) in text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())) {
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("UNIT") => {
                unit_um = unit(words.next()).ok_or_else(|| fault.at(line, "an unknown unit of length".into()))?;
            }
            Some("SURF") => surfaces.push(Surface {
                number: fault.number(line, "SURF", words.next(), "the number of the surface")? as u32,
                ..Surface::default()
            }),
            Some("TYPE") => {
                if let Some(surface) = surfaces.last_mut() {
                    surface.kind = words.next();
                }
            }
            Some("PARM" | "XDAT" | "CURV" | "CONI") => {
                if let Some(surface) = surfaces.last_mut() {
                    surface.lines.push((line, text));
                }
            }
            _ => {}
        }
    }
    let (mut known, others): (Vec<_>, Vec<_>) = surfaces.into_iter().partition(|s| s.phase().is_some());
    let place = match (wanted, known.as_slice()) {
        (None, [_]) => 0,
        (Some(number), _) => known
            .iter()
            .position(|s| s.number == number)
            .ok_or_else(|| fault.whole(format!("surface {number} has no phase; {}", list(&known, &others))))?,
        (None, _) => return Err(fault.whole(list(&known, &others))),
    };
    let mut chosen = known.swap_remove(place);
    chosen.read(&fault)?;
    chosen.form(unit_um, &fault)
}

/// Parameters from one to this are coefficients of an asphere.
const LAST_ASPHERE: f64 = 8.0;

/// Parameters that move the polynomials of a Zernike surface.
const DECENTRES: [f64; 2] = [9.0, 10.0];

/// Most entries of the extra data: Binary 1 has 230 coefficients.
const MOST_DATA: usize = 242;

impl Surface<'_> {
    /// The kind of its phase, if it has one.
    fn phase(&self) -> Option<Kind> {
        match self.kind? {
            "BINARY_1" => Some(Kind::Binary1),
            "BINARY_2" => Some(Kind::Binary2),
            "SZERNPHA" => Some(Kind::Zernike(ZernikeOrder::Standard)),
            "FZERNPHA" => Some(Kind::Zernike(ZernikeOrder::Fringe)),
            _ => None,
        }
    }

    /// Reads the lines of a surface.
    fn read(&mut self, fault: &Fault<'_>) -> Result<()> {
        for (line, text) in std::mem::take(&mut self.lines) {
            let mut words = text.split_ascii_whitespace();
            let key = words.next().unwrap_or_default();
            let mut number = |what: &str| fault.number(line, key, words.next(), what);
            match key {
                "PARM" => {
                    let (at, value) = (number("the number of the parameter")?, number("a value")?);
                    if at == 0.0 {
                        self.order = Some(value);
                    } else if value != 0.0 && at <= LAST_ASPHERE {
                        self.bent.get_or_insert((line, text));
                    } else if value != 0.0 && DECENTRES.contains(&at) {
                        self.moved.get_or_insert((line, text));
                    }
                }
                "XDAT" => {
                    let (at, value) = (number("the number of the entry")?, number("a value")?);
                    if !(1.0..=MOST_DATA as f64).contains(&at) || at.fract() != 0.0 {
                        return Err(fault.at(line, format!("entry {at} of the extra data")));
                    }
                    let at = at as usize;
                    if self.data.len() < at {
                        self.data.resize(at, 0.0);
                    }
                    self.data[at - 1] = value;
                }
                // A conic constant bends what is curved alone.
                "CURV" if number("a value")? != 0.0 => {
                    self.bent.get_or_insert((line, text));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn form(&self, unit_um: f64, fault: &Fault<'_>) -> Result<TermForm> {
        if let Some((line, text)) = self.bent {
            return Err(fault.error(
                Some(line),
                format!(
                    "surface {} is not flat: `{}`",
                    self.number,
                    metalith_core::text::quoted(text)
                ),
                "a chip is flat and has the phase alone: optimise the lens with a flat surface (no curvature, parameters 1 to 8 at 0)",
            ));
        }
        if let (Some((line, text)), Some(Kind::Zernike(_))) = (self.moved, self.phase()) {
            return Err(fault.error(
                Some(line),
                format!(
                    "the polynomials of surface {} are moved: `{}`",
                    self.number,
                    metalith_core::text::quoted(text)
                ),
                "set parameters 9 and 10 to 0, and move the phase with `centre_um`",
            ));
        }
        let count = self.data.first().copied().unwrap_or(0.0).max(0.0) as usize;
        let most = Zernike::FRINGE_SET as usize;
        if self.phase() == Some(Kind::Zernike(ZernikeOrder::Fringe)) && count > most {
            let what = format!(
                "surface {} has {count} fringe polynomials, and {most} are all there are",
                self.number
            );
            return Err(fault.error(None, what, "fit it with these, or with Zernike standard polynomials"));
        }
        let radius_um = self.data.get(1).copied().unwrap_or(0.0) * unit_um;
        let coefficients = self.data.get(2..count.saturating_add(2)).unwrap_or_default();
        if count == 0 || coefficients.len() < count || radius_um <= 0.0 {
            return Err(fault.error(
                None,
                format!(
                    "surface {} has {count} coefficients over a radius of {radius_um} um, and {} are there",
                    self.number,
                    self.data.len().saturating_sub(2)
                ),
                "give the number of coefficients as XDAT 1, the radius as XDAT 2, and each coefficient after them",
            ));
        }
        let order = self.order.unwrap_or(1.0);
        if order == 0.0 {
            return Err(fault.error(
                None,
                format!(
                    "surface {} is of diffraction order 0, in which no phase is left",
                    self.number
                ),
                "give the order that is focused as PARM 0, such as 1",
            ));
        }
        let coefficients = coefficients.iter().map(|a| a * order);
        Ok(match self.phase() {
            Some(Kind::Binary1) => TermForm::Polynomial {
                terms: powers().zip(coefficients).map(|((i, j), a)| (i, j, a)).collect(),
                radius_um,
            },
            Some(Kind::Zernike(order)) => TermForm::Zernike {
                order,
                coefficients: coefficients.collect(),
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

/// The file as text: UTF-16, with a mark of its byte order as the program saves it or without one, or plain. What is no Unicode
/// stands in names and notes alone.
fn decoded(bytes: &[u8]) -> String {
    let wide = |bytes: &[u8], order: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes.as_chunks().0.iter().map(|pair| order(*pair)).collect();
        String::from_utf16_lossy(&units)
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        // Keywords are ASCII: of two bytes one is nothing.
        [key, 0, ..] if *key > 0 => wide(bytes, u16::from_le_bytes),
        [0, key, ..] if *key > 0 => wide(bytes, u16::from_be_bytes),
        _ => without_mark(&String::from_utf8_lossy(bytes)).to_owned(),
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

/// Words for the surfaces that have a phase, or for what the surfaces are if none has.
fn list(known: &[Surface<'_>], others: &[Surface<'_>]) -> String {
    if !known.is_empty() {
        let numbers: Vec<String> = known.iter().map(|s| s.number.to_string()).collect();
        return format!("phases are on surfaces {}", numbers.join(", "));
    }
    let mut kinds: Vec<String> = others
        .iter()
        .filter_map(|s| s.kind)
        .map(metalith_core::text::quoted)
        .collect();
    kinds.sort_unstable();
    kinds.dedup();
    let none = "no surface of type BINARY_1, BINARY_2, SZERNPHA or FZERNPHA is in the file";
    match (others.is_empty(), kinds.is_empty()) {
        (true, _) => format!("{none}, nor any other: it is no lens in text"),
        (false, true) => none.into(),
        (false, false) if kinds.iter().any(|kind| kind.starts_with("GRID_PHA")) => {
            format!("{none}; the phase of GRID_PHA stands in a .DAT file: give that as `file`")
        }
        (false, false) => format!("{none}; there are {}", kinds.join(", ")),
    }
}

/// Errors of one file.
struct Fault<'a>(&'a Path);

impl Fault<'_> {
    fn error(&self, line: Option<usize>, what: String, hint: &str) -> Error {
        Error::table(self.0, line, what, hint)
    }

    fn at(&self, line: usize, what: String) -> Error {
        self.error(Some(line), what, SAVE)
    }

    fn whole(&self, what: String) -> Error {
        self.error(None, what, SAVE)
    }

    /// The number that a word of a line is.
    fn number(&self, line: usize, key: &str, word: Option<&str>, what: &str) -> Result<f64> {
        let word = word.unwrap_or_default();
        word.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
            let word = metalith_core::text::quoted(word);
            self.at(line, format!("`{key}` needs {what}, not `{word}`"))
        })
    }
}

/// Remedy for a file that does not say it.
const SAVE: &str = "save the lens as .zmx, and name the surface with `surface` if several have a phase";

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: &str = "VERS 190513\nUNIT MM X W X CM MR CPMM\nSURF 0\n  TYPE STANDARD\nSURF 1\n  TYPE BINARY_2\n  PARM 0 1\n  \
                        PARM 1 0\n  XDAT 1 2.0 0 0 1.0 0.0 0 \"\"\n  XDAT 2 0.5 0 0 1.0 0.0 0 \"\"\n  XDAT 3 -600.0 0 0\n  \
                        XDAT 4 25.0 0 0\nSURF 2\n  TYPE BINARY_1\n  PARM 0 2\n  XDAT 1 5\n  XDAT 2 1.0\n  XDAT 3 1\n  XDAT 4 2\n  \
                        XDAT 5 3\n  XDAT 6 4\n  XDAT 7 5\n";

    /// A lens as the program saves it: a stop, a flat plate with the phase on its second side, the sensor; with the lines that
    /// stand about what is asked for, and text that is no ASCII.
    const SAVED: &str = include_str!("../../../../../golden/lenses/flat_lens.zmx");

    fn utf16(text: &str, order: fn(u16) -> [u8; 2], mark: bool) -> Vec<u8> {
        let mark = mark.then_some(0xfeff);
        mark.into_iter().chain(text.encode_utf16()).flat_map(order).collect()
    }

    #[test]
    fn a_lens_as_it_is_saved_is_read_in_every_coding() {
        let lines = SAVED.replace('\n', "\r\n");
        let latin: Vec<u8> = lines.chars().map(|c| c as u8).collect();
        let wanted = TermForm::Radial(RadialPhase::EvenPowers {
            coefficients_rad: vec![-2.718281828459e2, 1.25, 0.0, 3.5e-3],
            normalisation_um: 80.0,
        });
        for bytes in [
            utf16(&lines, u16::to_le_bytes, true),
            utf16(&lines, u16::to_be_bytes, true),
            utf16(&lines, u16::to_le_bytes, false),
            utf16(&lines, u16::to_be_bytes, false),
            [b"\xef\xbb\xbf", lines.as_bytes()].concat(),
            latin,
        ] {
            assert_eq!(read_text(&bytes, None).unwrap(), wanted);
        }
        // The type behind what it is the type of.
        let later = SAVED
            .replace("  TYPE BINARY_2\n", "")
            .replace("  XDAT 1 ", "  TYPE BINARY_2\n  XDAT 1 ");
        assert_eq!(read_text(later.as_bytes(), None).unwrap(), wanted);
    }

    #[test]
    fn a_surface_that_is_not_flat_is_refused() {
        let mut said = Vec::new();
        for (flat, bent) in [
            (
                "  CURV 0.0 0 0 0 0 \"\"\n  HIDE 0 1",
                "  CURV 0.02 0 0 0 0 \"\"\n  HIDE 0 1",
            ),
            ("PARM 2 0", "PARM 2 1E-5"),
        ] {
            let text = SAVED.replace(flat, bent);
            assert_ne!(text, SAVED);
            said.push(refusal(text.as_bytes(), None));
        }
        insta::assert_snapshot!(said.join("\n"), @r#"
            lens.zmx, line 58: surface 2 is not flat: `CURV 0.02 0 0 0 0 ""`
              help: a chip is flat and has the phase alone: optimise the lens with a flat surface (no curvature, parameters 1 to 8 at 0)
            lens.zmx, line 64: surface 2 is not flat: `PARM 2 1E-5`
              help: a chip is flat and has the phase alone: optimise the lens with a flat surface (no curvature, parameters 1 to 8 at 0)
            "#);
    }

    fn read_text(bytes: &[u8], surface: Option<u32>) -> Result<TermForm> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lens.zmx");
        std::fs::write(&path, bytes).unwrap();
        read(&path, surface)
    }

    /// The text of the refusal of a file, with its name alone.
    fn refusal(bytes: &[u8], surface: Option<u32>) -> String {
        let error = read_text(bytes, surface).unwrap_err();
        let Error::Table { path, .. } = &error else {
            panic!("{error:?}");
        };
        metalith_testing::without_folder(&error, path.parent().unwrap())
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

    /// Coefficients are in waves, and the order of diffraction multiplies them.
    #[test]
    fn zernike_surfaces_are_read() {
        for (kind, order) in [("SZERNPHA", ZernikeOrder::Standard), ("FZERNPHA", ZernikeOrder::Fringe)] {
            let text = format!(
                "UNIT MM\nSURF 1\n  TYPE {kind}\n  PARM 0 -1\n  XDAT 1 4\n  XDAT 2 0.03\n  XDAT 3 0\n  XDAT 4 0.5\n  XDAT 5 0\n  XDAT 6 -12.5\n"
            );
            let wanted = TermForm::Zernike {
                order,
                coefficients: vec![-0.0, -0.5, -0.0, 12.5],
                radius_um: 30.0,
            };
            assert_eq!(read_text(text.as_bytes(), None).unwrap(), wanted);
        }
    }

    #[test]
    fn what_is_missing_is_said() {
        let said = [
            (LENS, None),
            (LENS, Some(7)),
            ("SURF 0\nTYPE STANDARD\n", None),
            ("SURF 1\nTYPE BINARY_2\nXDAT 1 2\nXDAT 2 1\nXDAT 3 5\n", None),
            ("SURF 1\nTYPE BINARY_2\nXDAT 1 x\n", None),
            ("SURF 1\nTYPE BINARY_2\nXDAT 999999999 1\n", None),
            ("UNIT PARSEC\n", None),
            ("SURF 0\nTYPE BINARY_3\nSURF 1\n", None),
            ("SURF 0\nTYPE GRID_PHA\nSURF 1\n", None),
            (
                "SURF 1\nTYPE SZERNPHA\nPARM 9 0.1\nXDAT 1 1\nXDAT 2 1\nXDAT 3 1\n",
                None,
            ),
            ("SURF 1\nTYPE FZERNPHA\nXDAT 1 38\nXDAT 2 1\n", None),
            ("PK\u{3}\u{4}", None),
        ]
        .map(|(text, surface)| refusal(text.as_bytes(), surface));
        insta::assert_snapshot!(said.join("\n"), @"
            lens.zmx: phases are on surfaces 1, 2
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx: surface 7 has no phase; phases are on surfaces 1, 2
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx: no surface of type BINARY_1, BINARY_2, SZERNPHA or FZERNPHA is in the file; there are STANDARD
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx: surface 1 has 2 coefficients over a radius of 1000 um, and 1 are there
              help: give the number of coefficients as XDAT 1, the radius as XDAT 2, and each coefficient after them
            lens.zmx, line 3: `XDAT` needs a value, not `x`
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx, line 3: entry 999999999 of the extra data
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx, line 1: an unknown unit of length
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx: no surface of type BINARY_1, BINARY_2, SZERNPHA or FZERNPHA is in the file; there are BINARY_3
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx: no surface of type BINARY_1, BINARY_2, SZERNPHA or FZERNPHA is in the file; the phase of GRID_PHA stands in a .DAT file: give that as `file`
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            lens.zmx, line 3: the polynomials of surface 1 are moved: `PARM 9 0.1`
              help: set parameters 9 and 10 to 0, and move the phase with `centre_um`
            lens.zmx: surface 1 has 38 fringe polynomials, and 37 are all there are
              help: fit it with these, or with Zernike standard polynomials
            lens.zmx: no surface of type BINARY_1, BINARY_2, SZERNPHA or FZERNPHA is in the file, nor any other: it is no lens in text
              help: save the lens as .zmx, and name the surface with `surface` if several have a phase
            ");
    }
}
