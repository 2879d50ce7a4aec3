//! Distance of neighbouring pillars, and the grid of the file that they are written on.

use std::fmt;

use serde::{Serialize, Serializer};

/// Steps of a pitch in a nanometre: half a step too much moves no place of 2^20 sites by more than 0.27 nm.
const STEPS_PER_NM: u64 = 1_000_000;
/// Steps of the pitch of a design: 0.05 nm.
const STEPS_OF_DESIGNS: u64 = STEPS_PER_NM / 20;

/// Distance of neighbouring pillars, in steps of 1e-6 nm: a multiple of 0.05 nm in designs, so that 325, 351 and 433.3 nm are
/// exact, and half of each is; any that a layout from elsewhere has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Pitch(u64);

impl Pitch {
    /// A pitch of whole nanometres.
    pub const fn whole(nm: u32) -> Self {
        Self(nm as u64 * STEPS_PER_NM)
    }

    /// The pitch nearest to so many nanometres; `None` if it is no length.
    pub fn nearest(nm: f64) -> Option<Self> {
        let steps = (nm * STEPS_PER_NM as f64).round();
        (0.0..=f64::from(u32::MAX) * STEPS_PER_NM as f64)
            .contains(&steps)
            .then_some(Self(steps as u64))
    }

    /// The pitch of so many nanometres; `None` if it is no multiple of 0.05 nm.
    pub fn of_nm(nm: f64) -> Option<Self> {
        // Decimal fractions are not exact in binary.
        const ROUNDING: f64 = 1e-6;
        let steps = nm * (STEPS_PER_NM / STEPS_OF_DESIGNS) as f64;
        let fits = (steps - steps.round()).abs() < ROUNDING;
        fits.then(|| Self::nearest(nm)).flatten()
    }

    /// True if it is a multiple of 0.05 nm, as pitches of designs are.
    pub fn is_of_designs(self) -> bool {
        self.0.is_multiple_of(STEPS_OF_DESIGNS)
    }

    /// True if it differs from another by less than pitches of designs do.
    pub fn is_near(self, other: Self) -> bool {
        self.0.abs_diff(other.0) < STEPS_OF_DESIGNS
    }

    /// Pitch (nm).
    #[inline]
    pub fn nm(self) -> f64 {
        self.0 as f64 / STEPS_PER_NM as f64
    }

    /// Pitch (nm), if it is whole.
    pub fn whole_nm(self) -> Option<u32> {
        let nm = u32::try_from(self.0 / STEPS_PER_NM).ok()?;
        self.0.is_multiple_of(STEPS_PER_NM).then_some(nm)
    }

    /// Pitch as whole nanometres, rounded up.
    pub fn at_least_nm(self) -> i64 {
        self.0.div_ceil(STEPS_PER_NM) as i64
    }

    /// Half of the pitch in [`Pitch::HALVES_PER_NM`]: exact.
    #[inline]
    pub(crate) fn half(self) -> i64 {
        self.0 as i64
    }

    /// Steps of half a pitch in a nanometre.
    pub(crate) const HALVES_PER_NM: i64 = 2 * STEPS_PER_NM as i64;
}

impl From<u32> for Pitch {
    fn from(nm: u32) -> Self {
        Self::whole(nm)
    }
}

impl From<Pitch> for f64 {
    fn from(pitch: Pitch) -> Self {
        pitch.nm()
    }
}

impl fmt::Display for Pitch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.nm().fmt(f)
    }
}

impl Serialize for Pitch {
    /// A whole number where it is one.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.whole_nm() {
            Some(nm) => serializer.serialize_u32(nm),
            None => serializer.serialize_f64(self.nm()),
        }
    }
}

/// Database unit of a layout: all places and edges are whole multiples of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum DatabaseUnit {
    #[default]
    Nanometre,
    Half,
    Quarter,
    Tenth,
}

impl DatabaseUnit {
    /// All units, the largest first.
    pub const ALL: [Self; 4] = [Self::Nanometre, Self::Half, Self::Quarter, Self::Tenth];

    /// Units in a nanometre.
    #[inline]
    pub fn per_nm(self) -> i64 {
        match self {
            Self::Nanometre => 1,
            Self::Half => 2,
            Self::Quarter => 4,
            Self::Tenth => 10,
        }
    }

    /// The unit (nm).
    pub fn nm(self) -> f64 {
        1.0 / self.per_nm() as f64
    }

    /// The unit of so many nanometres, if it is one of them.
    pub fn of_nm(nm: f64) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.nm() == nm)
    }

    /// The unit with so many in a nanometre, if it is one of them.
    pub fn of_per_nm(per_nm: i64) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.per_nm() == per_nm)
    }

    /// True if it is 1 nm, which is left out of keys and digests: the default of designs.
    pub fn is_nanometre(&self) -> bool {
        *self == Self::Nanometre
    }

    /// The largest unit of which a pitch is a multiple; `None` if it is of none.
    pub fn of_pitch(pitch: Pitch) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.divides(pitch))
    }

    /// True if a pitch is a multiple of it.
    pub fn divides(self, pitch: Pitch) -> bool {
        (2 * pitch.half() * self.per_nm()) % Pitch::HALVES_PER_NM == 0
    }

    /// True if half a pitch is a multiple of it.
    pub fn divides_half(self, pitch: Pitch) -> bool {
        (pitch.half() * self.per_nm()) % Pitch::HALVES_PER_NM == 0
    }

    /// A pitch in units, rounded.
    pub(crate) fn of(self, pitch: Pitch) -> i64 {
        self.rounded(2 * pitch.half())
    }

    /// A length in [`Pitch::HALVES_PER_NM`] as units: the nearest, of two the farther from zero, so that mirror images stay
    /// mirror images.
    #[inline]
    pub(crate) fn rounded(self, length: i64) -> i64 {
        let (scaled, half) = (length * self.per_nm(), Pitch::HALVES_PER_NM / 2);
        (scaled + scaled.signum() * half) / Pitch::HALVES_PER_NM
    }

    /// Whole nanometres as units.
    #[inline]
    pub fn units(self, nm: i64) -> i64 {
        nm * self.per_nm()
    }
}

impl fmt::Display for DatabaseUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.nm().fmt(f)
    }
}

impl Serialize for DatabaseUnit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.nm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_pitches_are_exact() {
        for (nm, unit, half) in [
            (350.0, DatabaseUnit::Nanometre, true),
            (325.0, DatabaseUnit::Nanometre, false),
            (351.0, DatabaseUnit::Nanometre, false),
            (433.25, DatabaseUnit::Quarter, false),
            (433.3, DatabaseUnit::Tenth, false),
            (433.4, DatabaseUnit::Tenth, true),
        ] {
            let pitch = Pitch::of_nm(nm).unwrap();
            assert_eq!(pitch.nm(), nm);
            assert_eq!(pitch.to_string(), nm.to_string());
            assert_eq!(DatabaseUnit::of_pitch(pitch), Some(unit), "{nm}");
            assert_eq!(unit.divides_half(pitch), half, "{nm}");
        }
        assert_eq!(Pitch::of_nm(433.33), None);
        let any = Pitch::nearest(1000.0 / 3.0).unwrap();
        assert_eq!((any.nm(), any.is_of_designs()), (333.333_333, false));
        assert!(any.is_near(Pitch::of_nm(333.35).unwrap()) && !any.is_near(Pitch::of_nm(333.25).unwrap()));
        assert_eq!([-1.0, f64::NAN, f64::INFINITY].map(Pitch::nearest), [None; 3]);
        assert_eq!(Pitch::of_nm(-1.0), None);
        assert_eq!(Pitch::of_nm(f64::NAN), None);
        let half = Pitch::HALVES_PER_NM / 2;
        let rounded: Vec<i64> = [-3 * half, 1 - 3 * half, -half, half, 3 * half - 1, 3 * half]
            .map(|n| DatabaseUnit::Nanometre.rounded(n))
            .into();
        assert_eq!(rounded, [-2, -1, -1, 1, 1, 2]);
    }
}
