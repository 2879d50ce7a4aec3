//! Conditions of a frame by the name of its file: colour, distance, element, angle and exposure.

/// Wavelengths that a number without a unit may be (nm): distances and numbers of frames have fewer digits.
const WAVELENGTHS_NM: std::ops::RangeInclusive<f64> = 350.0..=2500.0;

/// A number behind a `z` or `d` is a distance from this on (um); smaller ones count planes.
const LEAST_DISTANCE_UM: f64 = 10.0;

/// Conditions that the name of a frame states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NamedConditions {
    pub element: Option<[i64; 2]>,
    pub led_nm: Option<f64>,
    pub distance_um: Option<f64>,
    /// Number of a plane, where the name counts planes.
    pub plane: Option<u32>,
    /// Angle along x and y (degrees).
    pub aoi_deg: Option<[f64; 2]>,
    pub exposure_ms: Option<f64>,
}

/// A piece of a name: letters, a number, letters.
struct Token {
    before: String,
    /// As written, with its sign.
    digits: String,
    after: String,
}

impl Token {
    fn number(&self) -> Option<f64> {
        self.digits.replace('p', ".").parse().ok()
    }
}

/// The pieces of a name between `_`, spaces and `,`; a `-` before a digit is a sign where letters come before it.
fn tokens(stem: &str) -> Vec<Token> {
    let mut out = Vec::new();
    for part in stem.split(['_', ' ', ',', '(', ')', '[', ']']) {
        let mut rest = part;
        while !rest.is_empty() {
            let is_sign = |c: char| c == '+' || c == '-';
            let first = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
            let signed = rest[..first].ends_with(is_sign);
            let (before, tail) = rest.split_at(if signed { first - 1 } else { first });
            // A decimal point is a point, or a `p` between digits.
            let inside = |(k, c): (usize, char)| {
                let digit_after = tail[k + c.len_utf8()..].starts_with(|c: char| c.is_ascii_digit());
                c.is_ascii_digit() || (k == 0 && is_sign(c)) || (k > 0 && matches!(c, '.' | 'p') && digit_after)
            };
            let end = tail.char_indices().find(|c| !inside(*c)).map_or(tail.len(), |c| c.0);
            let (digits, tail) = tail.split_at(end);
            // Letters up to the next number are a unit; what comes before a sign or number is a word of its own.
            let letters = tail.find(|c: char| !c.is_alphabetic()).unwrap_or(tail.len());
            let (after, tail) = tail.split_at(letters);
            if digits.is_empty() && before.is_empty() && after.is_empty() {
                break;
            }
            out.push(Token {
                before: before.trim_matches(['-', '.']).to_lowercase(),
                digits: digits.into(),
                after: after.to_lowercase(),
            });
            rest = tail;
        }
    }
    out
}

/// Units that may stand apart from their number.
const UNITS: [&str; 6] = ["nm", "um", "mm", "ms", "us", "deg"];

/// A name in which units follow their numbers at once, and a micrometre is `um`.
fn with_units_joined(stem: &str) -> String {
    let mut out = stem.replace(['\u{b5}', '\u{3bc}'], "u");
    for (unit, gap) in UNITS.iter().flat_map(|unit| [' ', '_', '-'].map(|gap| (unit, gap))) {
        let apart = format!("{gap}{unit}");
        let mut from = 0;
        while let Some(at) = out[from..].find(&apart).map(|at| from + at) {
            let ends = !out[at + apart.len()..].starts_with(char::is_alphanumeric);
            if ends && out[..at].ends_with(|c: char| c.is_ascii_digit()) {
                out.remove(at);
            }
            from = at + unit.len();
        }
    }
    out
}

/// Conditions that the name of a file without its ending states.
pub(crate) fn conditions(stem: &str) -> NamedConditions {
    let mut found = NamedConditions::default();
    let tokens = tokens(&with_units_joined(stem));
    let mut k = 0;
    while k < tokens.len() {
        let token = &tokens[k];
        k += 1;
        let Some(number) = token.number() else { continue };
        let bare = token.digits.trim_start_matches(['+', '-']);
        // A word may stand apart from its number.
        let word = k.checked_sub(2).map(|w| &tokens[w]).filter(|w| w.digits.is_empty());
        let before = match word {
            Some(word) if token.before.is_empty() => format!("{}{}", word.before, word.after),
            _ => token.before.clone(),
        };
        // A `-` behind no word separates; a length behind a word that is negative is no distance.
        let length = if before.is_empty() { number.abs() } else { number };
        let distance = |um: f64| Some(um).filter(|um| *um > 0.0);
        match (before.as_str(), token.after.as_str()) {
            (_, "ms") => found.exposure_ms = Some(number),
            (_, "us") => found.exposure_ms = Some(number * 1e-3),
            ("exp" | "t", "s") | (_, "s" | "sec") => found.exposure_ms = Some(number * 1e3),
            (_, "nm") => found.led_nm = Some(length),
            (_, "mm") => found.distance_um = distance(length * 1e3),
            ("" | "led" | "l" | "w" | "wl" | "lambda", "um") if WAVELENGTHS_NM.contains(&(length * 1e3)) => {
                found.led_nm = Some((length * 1e6).round() * 1e-3);
            }
            ("a" | "aoi" | "angle", _) | (_, "deg") => {
                // A second angle follows at once: `a-15+00`.
                let second = tokens
                    .get(k)
                    .filter(|t| t.before.is_empty() && t.digits.starts_with(['+', '-']));
                let along_y = second.and_then(Token::number);
                k += usize::from(along_y.is_some());
                found.aoi_deg = Some([number, along_y.unwrap_or(0.0)]);
            }
            ("z" | "d" | "dist" | "distance", "" | "um") | (_, "um") => {
                if token.after == "um" || number >= LEAST_DISTANCE_UM {
                    found.distance_um = distance(length);
                } else {
                    found.plane = Some(number as u32);
                }
            }
            ("e" | "el" | "elem" | "element" | "lens", "") => {
                let mut all: Vec<i64> = if bare.len() == 2 && bare == token.digits {
                    // One digit for each axis.
                    bare.chars().filter_map(|c| c.to_digit(10)).map(i64::from).collect()
                } else {
                    vec![number as i64]
                };
                if let Some(next) = tokens.get(k).filter(|t| all.len() == 1 && is_index(t)) {
                    all.extend(next.number().map(|n| n as i64));
                    k += 1;
                }
                found.element = Some([all[0], all.get(1).copied().unwrap_or(0)]);
            }
            ("" | "led" | "l" | "w" | "wl" | "lambda", "") if WAVELENGTHS_NM.contains(&number) => {
                found.led_nm = found.led_nm.or(Some(number));
            }
            _ => {}
        }
    }
    found
}

/// True if a piece may be the second index of an element: a number of one digit.
fn is_index(token: &Token) -> bool {
    token.before.is_empty() && token.after.is_empty() && token.digits.trim_start_matches(['+', '-']).len() == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_recognised_in_names() {
        let of = |element, led_nm, distance_um, plane, aoi_deg, exposure_ms| NamedConditions {
            element,
            led_nm,
            distance_um,
            plane,
            aoi_deg,
            exposure_ms,
        };
        let (nm, um) = (Some(530.0), Some(336.0));
        for (name, expected) in [
            ("e00_530_z0", of(Some([0, 0]), nm, None, Some(0), None, None)),
            ("e1_500_z1", of(Some([1, 0]), Some(500.0), None, Some(1), None, None)),
            (
                "e10_a-15_530_z2",
                of(Some([1, 0]), nm, None, Some(2), Some([-15.0, 0.0]), None),
            ),
            (
                "e10_a-15+00_530_z2",
                of(Some([1, 0]), nm, None, Some(2), Some([-15.0, 0.0]), None),
            ),
            ("lens_530nm_336um_20ms", of(None, nm, um, None, None, Some(20.0))),
            ("element_1_-2_530nm_z336", of(Some([1, -2]), nm, um, None, None, None)),
            (
                "e1_-2_530nm_z336.5",
                of(Some([1, -2]), nm, Some(336.5), None, None, None),
            ),
            (
                "E0_530nm_d336p5um_exp0.5s",
                of(Some([0, 0]), nm, Some(336.5), None, None, Some(500.0)),
            ),
            ("el1.0-530 nm-336.0um", of(Some([1, 0]), nm, um, None, None, None)),
            ("e00_0.530um_z336_um", of(Some([0, 0]), nm, um, None, None, None)),
            ("green", NamedConditions::default()),
        ] {
            assert_eq!(conditions(name), expected, "{name}");
        }
    }
}
