//! Polarisation of source and detector, before and behind pillars that change it.

use std::f64::consts::FRAC_1_SQRT_2;
use std::fmt;
use std::str::FromStr;

use num_complex::Complex64;
use serde::Serialize;

use metalith_core::{Error, Result};

use super::Handedness;

/// Polarisation of light that arrives, with exp(-i w t) and a wave along +z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarisation {
    Circular(Handedness),
    /// Electric field at this angle from x towards y (degrees).
    Linear(f64),
    /// As much of every polarisation, without a fixed phase between any two that are orthogonal.
    Unpolarised,
}

impl Polarisation {
    /// Name and value of each, as design files and options have them; other angles are numbers.
    pub const CHOICES: [(&'static str, Self); 5] = [
        ("left", Self::Circular(Handedness::Left)),
        ("right", Self::Circular(Handedness::Right)),
        ("x", Self::Linear(0.0)),
        ("y", Self::Linear(90.0)),
        ("unpolarised", Self::Unpolarised),
    ];

    /// Largest angle of linear polarisation (degrees), either way.
    pub const MOST_DEG: f64 = 180.0;

    /// Of the energy that arrives, what is in light of a hand.
    pub fn share(self, hand: Handedness) -> f64 {
        match self {
            Self::Circular(own) => f64::from(u8::from(own == hand)),
            Self::Linear(_) | Self::Unpolarised => 0.5,
        }
    }

    /// Parts of the light that do not interfere, all together of unit energy: amplitudes of left and of right.
    fn parts(self) -> Vec<[Complex64; 2]> {
        let (none, all) = (Complex64::ZERO, Complex64::ONE);
        match self {
            Self::Circular(Handedness::Left) => vec![[all, none]],
            Self::Circular(Handedness::Right) => vec![[none, all]],
            Self::Linear(deg) => {
                let turned = Complex64::cis(deg.to_radians()) * FRAC_1_SQRT_2;
                vec![[turned.conj(), turned]]
            }
            Self::Unpolarised => {
                let half = Complex64::from(FRAC_1_SQRT_2);
                vec![[half, none], [none, half]]
            }
        }
    }
}

/// In words, as after "light arrives".
impl fmt::Display for Polarisation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Circular(hand) => write!(f, "{hand} circularly polarised"),
            Self::Linear(0.0) => f.write_str("linearly polarised along x"),
            Self::Linear(90.0) => f.write_str("linearly polarised along y"),
            Self::Linear(deg) => write!(f, "linearly polarised at {deg} degrees from x towards y"),
            Self::Unpolarised => f.write_str("unpolarised"),
        }
    }
}

impl FromStr for Polarisation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        named_or_linear(text, &Self::CHOICES, Self::Linear)
            .ok_or_else(|| refusal(format!("there is no light of polarisation `{text}`"), &Self::CHOICES))
    }
}

/// What of the light behind the pillars passes to the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Analyser {
    /// The hand that focused light is converted to, whatever arrives.
    Circular,
    /// What is polarised linearly at this angle from x towards y (degrees).
    Linear(f64),
}

impl Analyser {
    /// Name and value of each, as design files and options have them; other angles are numbers.
    pub const CHOICES: [(&'static str, Self); 3] = [
        ("circular", Self::Circular),
        ("x", Self::Linear(0.0)),
        ("y", Self::Linear(90.0)),
    ];
}

/// In words, as of a thing before the sensor.
impl fmt::Display for Analyser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Circular => f.write_str("a circular analyser"),
            Self::Linear(0.0) => f.write_str("a linear analyser along x"),
            Self::Linear(90.0) => f.write_str("a linear analyser along y"),
            Self::Linear(deg) => write!(f, "a linear analyser at {deg} degrees from x towards y"),
        }
    }
}

impl FromStr for Analyser {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        named_or_linear(text, &Self::CHOICES, Self::Linear)
            .ok_or_else(|| refusal(format!("there is no analyser `{text}`"), &Self::CHOICES))
    }
}

/// A word, or the angle of linear polarisation.
fn named_or_linear<T: Copy>(text: &str, choices: &[(&str, T)], linear: fn(f64) -> T) -> Option<T> {
    let known = choices.iter().find(|(name, _)| *name == text);
    let angle = || {
        text.parse()
            .ok()
            .filter(|deg: &f64| deg.abs() <= Polarisation::MOST_DEG)
    };
    known.map(|(_, known)| *known).or_else(|| angle().map(linear))
}

fn refusal<T>(what: String, choices: &[(&str, T)]) -> Error {
    let names: Vec<_> = choices.iter().map(|(name, _)| *name).collect();
    Error::invalid(
        what,
        format!(
            "use {}, or the angle of linear polarisation from x towards y, from -{most} to {most} degrees",
            names.join(", "),
            most = Polarisation::MOST_DEG
        ),
    )
}

/// Which light arrives at pillars that change polarisation, and which of it reaches the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PolarisedLight {
    /// Of the light that arrives; where it is none, circular of the hand that the pillars focus.
    pub arriving: Option<Polarisation>,
    /// What is before the sensor, if anything.
    pub analyser: Option<Analyser>,
}

impl PolarisedLight {
    /// The polarisation of the light that arrives at pillars that focus this hand.
    pub fn arriving_at(self, focused: Handedness) -> Polarisation {
        self.arriving.unwrap_or(Polarisation::Circular(focused))
    }

    /// Share of the energy of light that arrives which pillars focus through the analyser, if they convert all of it.
    pub fn focused_share(self, focused: Handedness) -> f64 {
        let passed = match self.analyser {
            Some(Analyser::Linear(_)) => 0.5,
            Some(Analyser::Circular) | None => 1.0,
        };
        passed * self.arriving_at(focused).share(focused)
    }

    /// The detector in words: what reaches the sensor beside focused light, and what does not.
    pub fn detector(self, focused: Handedness) -> String {
        let own = self.arriving_at(focused) == Polarisation::Circular(focused);
        match (self.analyser, own) {
            (None, true) => "what is not converted lands as it came".into(),
            (None, false) => "what is not converted lands as it came, and the other hand diverges".into(),
            (Some(analyser @ Analyser::Circular), true) => {
                format!("{analyser} keeps what is not converted from the sensor")
            }
            (Some(analyser @ Analyser::Circular), false) => format!(
                "{analyser} passes the hand of focused light alone, with what is not converted of the other hand"
            ),
            (Some(analyser), _) => format!(
                "{analyser} passes half of the focused light, which interferes with what it passes of all other light"
            ),
        }
    }
}

/// What pillars do to light of both hands: transmissions as those of [`CellModel::transmissions`], by the number of the rotation.
/// The first of each pair is for light that arrives in the hand that is focused, the second for the other.
///
/// [`CellModel::transmissions`]: super::CellModel::transmissions
#[derive(Clone, Debug, PartialEq)]
pub struct HandTables {
    /// The hand of the light that is focused.
    pub focused: Handedness,
    /// What leaves in the other hand than it arrived in.
    pub converted: [Vec<Complex64>; 2],
    /// What leaves in the hand that it arrived in.
    pub unconverted: [Vec<Complex64>; 2],
}

/// Transmissions of light that interferes with no other. They are of the field that leaves over that of all light that arrives.
#[derive(Clone, Debug, PartialEq)]
pub struct PassedTable {
    pub table: Vec<Complex64>,
    /// How often it has the phase of the element: 1 if focused light is in it; else -1 if diverging light is; else 0.
    pub order: i32,
}

/// Some of the light that leaves in one polarisation: its amplitude, what it is multiplied by, and how often that has the phase of
/// the element.
type Part<'a> = (Complex64, &'a [Complex64], i32);

impl HandTables {
    /// What reaches the sensor of light of unit energy: energies of these add. Light of both hands that arrives with a fixed phase
    /// between them, as linear polarisation is, interferes where it leaves in one hand: what is converted of one, with what is
    /// not of the other. Behind a linear analyser all of it does.
    pub fn passed(&self, light: PolarisedLight) -> Vec<PassedTable> {
        let leaving = self.leaving(light).into_iter();
        leaving
            .map(|parts| PassedTable {
                order: parts
                    .iter()
                    .map(|part| part.2)
                    .max_by_key(|o| (o.abs(), *o))
                    .unwrap_or(0),
                table: sum(&parts),
            })
            .collect()
    }

    /// The same for only the light that has the phase of the element `order` times: focused light for 1, what is not converted for
    /// 0, what diverges for -1. Over whole turns of that phase these three do not interfere.
    pub fn passed_in(&self, order: i32, light: PolarisedLight) -> Vec<Vec<Complex64>> {
        let leaving = self.leaving(light).into_iter();
        let own = leaving.map(|parts| parts.into_iter().filter(|p| p.2 == order).collect::<Vec<_>>());
        own.filter(|parts| !parts.is_empty()).map(|parts| sum(&parts)).collect()
    }

    /// The same for where light goes: behind a linear analyser the light of each order apart, since they leave in other directions
    /// and interfere only where they meet.
    pub fn departing(&self, light: PolarisedLight) -> Vec<PassedTable> {
        let Some(Analyser::Linear(_)) = light.analyser else {
            return self.passed(light);
        };
        let of_order = |order: i32| {
            self.passed_in(order, light)
                .into_iter()
                .map(move |table| PassedTable { table, order })
        };
        [1, 0, -1].into_iter().flat_map(of_order).collect()
    }

    /// Parts of the light that reaches the sensor: those of one list interfere, and no others.
    fn leaving<'a>(&'a self, light: PolarisedLight) -> Vec<Vec<Part<'a>>> {
        let mut leaving = Vec::new();
        for [left, right] in light.arriving_at(self.focused).parts() {
            let [own, other] = match self.focused {
                Handedness::Left => [left, right],
                Handedness::Right => [right, left],
            };
            let there = |parts: [Part<'a>; 2]| -> Vec<Part<'a>> {
                parts.into_iter().filter(|p| p.0 != Complex64::ZERO).collect()
            };
            // In the hand that focused light is converted to, and in the other.
            let first = there([(own, &self.converted[0], 1), (other, &self.unconverted[1], 0)]);
            let second = there([(own, &self.unconverted[0], 0), (other, &self.converted[1], -1)]);
            match light.analyser {
                None => leaving.extend([first, second]),
                Some(Analyser::Circular) => leaving.push(first),
                Some(Analyser::Linear(deg)) => {
                    // Along the analyser the field of a hand is this times its amplitude, and the other's its conjugate.
                    let left = Complex64::cis(deg.to_radians()) * FRAC_1_SQRT_2;
                    let [of_first, of_second] = match self.focused {
                        Handedness::Left => [left.conj(), left],
                        Handedness::Right => [left, left.conj()],
                    };
                    let along =
                        |parts: Vec<Part<'a>>, by: Complex64| parts.into_iter().map(move |(a, t, o)| (a * by, t, o));
                    leaving.push(along(first, of_first).chain(along(second, of_second)).collect());
                }
            }
        }
        leaving
    }
}

fn sum(parts: &[Part<'_>]) -> Vec<Complex64> {
    let length = parts.iter().map(|part| part.1.len()).max().unwrap_or(0);
    let at = |k: usize| parts.iter().map(|(a, t, _)| a * t[k]).sum();
    (0..length).map(at).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use metalith_rcwa::circular;

    /// A few products of numbers of size one.
    const ROUNDING: f64 = 1e-14;

    /// Jones matrices along x and y of four pillars that have no symmetry.
    fn pillars() -> Vec<[[Complex64; 2]; 2]> {
        let entry =
            |k: usize, j: usize| Complex64::new((1.3 * (4 * k + j) as f64).sin(), (0.7 * (4 * k + j) as f64).cos());
        (0..4)
            .map(|k| [[entry(k, 0), entry(k, 1)], [entry(k, 2), entry(k, 3)]])
            .collect()
    }

    fn tables(focused: Handedness) -> HandTables {
        let of = |out: usize, input: usize| pillars().iter().map(|j| circular(*j)[out][input]).collect::<Vec<_>>();
        let [own, other] = match focused {
            Handedness::Left => [0, 1],
            Handedness::Right => [1, 0],
        };
        HandTables {
            focused,
            converted: [of(other, own), of(own, other)],
            unconverted: [of(own, own), of(other, other)],
        }
    }

    /// Energy of the sum over all pillars with these weights, as at a place of the sensor.
    fn energy(passed: &[PassedTable], weights: [Complex64; 4]) -> f64 {
        let field = |p: &PassedTable| p.table.iter().zip(weights).map(|(t, w)| t * w).sum::<Complex64>();
        passed.iter().map(|p| field(p).norm_sqr()).sum()
    }

    const WEIGHTS: [Complex64; 4] = [
        Complex64::new(0.3, 0.1),
        Complex64::new(-0.7, 0.4),
        Complex64::new(0.2, -0.9),
        Complex64::new(0.5, 0.5),
    ];

    fn of(arriving: Polarisation, analyser: Option<Analyser>, focused: Handedness) -> f64 {
        let light = PolarisedLight {
            arriving: Some(arriving),
            analyser,
        };
        energy(&tables(focused).passed(light), WEIGHTS)
    }

    /// Against the Jones matrices along x and y themselves, analysers as projections on a circular and on linear polarisations.
    #[test]
    fn light_of_any_polarisation_is_that_of_its_jones_vector() {
        let right = [Complex64::from(FRAC_1_SQRT_2), Complex64::new(0.0, -FRAC_1_SQRT_2)];
        let vector = |arriving: Polarisation| match arriving {
            Polarisation::Circular(Handedness::Left) => right.map(|c| c.conj()),
            Polarisation::Circular(Handedness::Right) => right,
            Polarisation::Linear(deg) => [deg.to_radians().cos(), deg.to_radians().sin()].map(Complex64::from),
            Polarisation::Unpolarised => unreachable!("it has none"),
        };
        let angles = [30.0, -75.0, 180.0].map(Polarisation::Linear);
        let named = Polarisation::CHOICES.map(|(_, one)| one);
        for arriving in named.into_iter().take(4).chain(angles) {
            let e = vector(arriving);
            let field = [0, 1].map(|out| {
                let one = |(j, w): (&[[Complex64; 2]; 2], Complex64)| w * (j[out][0] * e[0] + j[out][1] * e[1]);
                pillars().iter().zip(WEIGHTS).map(one).sum::<Complex64>()
            });
            let all = field[0].norm_sqr() + field[1].norm_sqr();
            // Of light that is left and focused, what leaves as right.
            let seen = (right[0].conj() * field[0] + right[1].conj() * field[1]).norm_sqr();
            for focused in [Handedness::Left, Handedness::Right] {
                assert!((of(arriving, None, focused) - all).abs() < ROUNDING * all, "{arriving}");
                for deg in [0.0, 90.0, 37.0, -110.0_f64] {
                    let (sin, cos) = deg.to_radians().sin_cos();
                    let wanted = (field[0] * cos + field[1] * sin).norm_sqr();
                    let found = of(arriving, Some(Analyser::Linear(deg)), focused);
                    assert!(
                        (found - wanted).abs() < ROUNDING * all,
                        "{arriving} {deg}: {found} {wanted}"
                    );
                }
            }
            let circular = Some(Analyser::Circular);
            let found = [Handedness::Left, Handedness::Right].map(|focused| of(arriving, circular, focused));
            assert!((found[0] - seen).abs() < ROUNDING * all, "{arriving}: {found:?} {seen}");
            assert!(
                (found[1] - (all - seen)).abs() < ROUNDING * all,
                "{arriving}: {found:?} {seen}"
            );
        }
    }

    #[test]
    fn unpolarised_light_is_the_mean_of_any_two_that_are_orthogonal() {
        let pairs = [
            Polarisation::CHOICES.map(|(_, one)| one)[0..2].to_vec(),
            Polarisation::CHOICES.map(|(_, one)| one)[2..4].to_vec(),
            [25.0, -65.0].map(Polarisation::Linear).to_vec(),
        ];
        // Some light is far from the mean, or nothing would be shown.
        let mut apart: f64 = 0.0;
        for analyser in [None, Some(Analyser::Circular), Some(Analyser::Linear(20.0))] {
            let wanted = of(Polarisation::Unpolarised, analyser, Handedness::Left);
            for pair in &pairs {
                let each: Vec<f64> = pair.iter().map(|one| of(*one, analyser, Handedness::Left)).collect();
                let mean = (each[0] + each[1]) / 2.0;
                assert!((mean - wanted).abs() < ROUNDING * wanted, "{pair:?}: {mean} {wanted}");
                apart = apart.max((each[0] - each[1]).abs() / wanted);
            }
        }
        assert!(apart > 0.1, "{apart}");
    }

    /// Where nothing is said it is the light that is focused, bit by bit.
    #[test]
    fn the_light_that_is_focused_arrives_if_no_other_is_named() {
        let tables = tables(Handedness::Right);
        let passed = tables.passed(PolarisedLight::default());
        let found: Vec<_> = passed.iter().map(|p| (&p.table, p.order)).collect();
        assert_eq!(found, [(&tables.converted[0], 1), (&tables.unconverted[0], 0)]);
    }

    /// Over whole turns of the phase of an element, the energies of focused, unconverted and diverging light are all of it.
    #[test]
    fn what_has_unlike_phases_adds_up_over_whole_turns() {
        const TURNS: usize = 12;
        for focused in [Handedness::Left, Handedness::Right] {
            let plain = tables(focused);
            let pillar = |of: &[Vec<Complex64>; 2], orders: [f64; 2]| {
                let turned = |k: usize| {
                    let each = (0..TURNS).map(|n| of[k][1] * Complex64::cis(TAU * orders[k] * n as f64 / TURNS as f64));
                    each.collect::<Vec<_>>()
                };
                [turned(0), turned(1)]
            };
            let hands = HandTables {
                focused,
                converted: pillar(&plain.converted, [1.0, -1.0]),
                unconverted: pillar(&plain.unconverted, [0.0, 0.0]),
            };
            let power = |tables: &[Vec<Complex64>]| tables.iter().flatten().map(Complex64::norm_sqr).sum::<f64>();
            for (_, arriving) in Polarisation::CHOICES {
                for analyser in [None, Some(Analyser::Circular), Some(Analyser::Linear(33.0))] {
                    let light = PolarisedLight {
                        arriving: Some(arriving),
                        analyser,
                    };
                    let all: Vec<_> = hands.passed(light).into_iter().map(|p| p.table).collect();
                    let parts: f64 = [1, 0, -1]
                        .map(|order| power(&hands.passed_in(order, light)))
                        .iter()
                        .sum();
                    let wanted = power(&all);
                    assert!(
                        (parts - wanted).abs() < ROUNDING * TURNS as f64 * (1.0 + wanted),
                        "{arriving} {analyser:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn names_and_angles_are_read() {
        for (name, wanted) in Polarisation::CHOICES {
            assert_eq!(name.parse::<Polarisation>().unwrap(), wanted);
        }
        assert_eq!("-30.5".parse::<Polarisation>().unwrap(), Polarisation::Linear(-30.5));
        for wrong in ["z", "", "NaN", "inf", "181"] {
            let error = wrong.parse::<Polarisation>().unwrap_err().to_string();
            assert!(
                error.contains("use left, right, x, y, unpolarised, or the angle"),
                "{error}"
            );
            let error = wrong.parse::<Analyser>().unwrap_err().to_string();
            assert!(error.contains("use circular, x, y, or the angle"), "{error}");
        }
        for (name, wanted) in Analyser::CHOICES {
            assert_eq!(name.parse::<Analyser>().unwrap(), wanted);
        }
        assert_eq!("15".parse::<Analyser>().unwrap(), Analyser::Linear(15.0));
    }
}
