//! Numbers, steps, strings, point lists and repetitions from bytes.

use std::io::{Read, Seek};

use super::input::Input;
use crate::error::{OasisError, OasisFault, OasisLimit};
use crate::limits::OasisLimits;
use crate::number::direction;
use crate::repetition::Repetition;

type Result<T> = std::result::Result<T, OasisError>;

impl<R: Read + Seek> Input<R> {
    /// An unsigned integer of at most `most`.
    #[inline]
    pub(crate) fn at_most(&mut self, most: u64) -> Result<u64> {
        let value = self.unsigned()?;
        if value > most {
            return Err(self.fault(OasisFault::TooLarge { value, most }));
        }
        Ok(value)
    }

    /// A length or distance: not negative, no farther than coordinates may be.
    #[inline]
    pub(crate) fn distance(&mut self, limits: &OasisLimits) -> Result<i64> {
        let value = self.unsigned()?;
        self.near(value, limits)
    }

    /// A signed integer: sign in the lowest bit.
    #[inline]
    pub(crate) fn signed(&mut self, limits: &OasisLimits) -> Result<i64> {
        let value = self.unsigned()?;
        let magnitude = self.near(value >> 1, limits)?;
        Ok(if value & 1 == 0 { magnitude } else { -magnitude })
    }

    #[inline]
    fn near(&self, value: u64, limits: &OasisLimits) -> Result<i64> {
        match i64::try_from(value) {
            Ok(near) if near <= limits.farthest.saturating_mul(2) => Ok(near),
            _ => Err(self.too_far(value, limits)),
        }
    }

    #[cold]
    pub(crate) fn too_far(&self, found: u64, limits: &OasisLimits) -> OasisError {
        self.fault(OasisFault::Limit {
            limit: OasisLimit::Farthest,
            found,
            most: limits.farthest.unsigned_abs(),
        })
    }

    /// A step in the plane ("g-delta").
    #[inline]
    pub(crate) fn step(&mut self, limits: &OasisLimits) -> Result<[i64; 2]> {
        let value = self.unsigned()?;
        if value & 1 == 0 {
            let [x, y] = direction(value >> 1);
            let far = self.near(value >> 4, limits)?;
            return Ok([x * far, y * far]);
        }
        let x = self.near(value >> 2, limits)?;
        Ok([if value & 2 == 0 { x } else { -x }, self.signed(limits)?])
    }

    /// A real number.
    pub(crate) fn real(&mut self) -> Result<f64> {
        let kind = self.unsigned()?;
        self.real_of(kind)
    }

    /// A real number whose type was read.
    pub(crate) fn real_of(&mut self, kind: u64) -> Result<f64> {
        let sign = if kind.is_multiple_of(2) { 1.0 } else { -1.0 };
        let value = match kind {
            0 | 1 => sign * self.unsigned()? as f64,
            2 | 3 => sign / self.unsigned()? as f64,
            4 | 5 => sign * self.unsigned()? as f64 / self.unsigned()? as f64,
            6 => f64::from(f32::from_le_bytes(self.array()?)),
            7 => f64::from_le_bytes(self.array()?),
            other => return Err(self.fault(OasisFault::RealKind(other))),
        };
        if !value.is_finite() {
            return Err(self.fault(OasisFault::RealValue));
        }
        Ok(value)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        for byte in &mut bytes {
            *byte = self.byte()?;
        }
        Ok(bytes)
    }

    /// A string of any bytes.
    pub(crate) fn string(&mut self, limits: &OasisLimits, out: &mut Vec<u8>) -> Result<()> {
        let length = self.unsigned()?;
        if length > limits.string_bytes as u64 {
            return Err(self.fault(OasisFault::Limit {
                limit: OasisLimit::StringBytes,
                found: length,
                most: limits.string_bytes as u64,
            }));
        }
        out.clear();
        self.bytes(length as usize, out)
    }

    /// A name: printable, at least one character.
    pub(crate) fn name(&mut self, limits: &OasisLimits, out: &mut Vec<u8>) -> Result<()> {
        self.string(limits, out)?;
        if out.is_empty() {
            return Err(self.fault(OasisFault::EmptyName));
        }
        match out.iter().find(|b| **b < 0x20 || **b == 0x7F) {
            Some(&byte) => Err(self.fault(OasisFault::NameByte(byte))),
            None => Ok(()),
        }
    }

    /// A point list, from the first point, which is not in it. `closed` for polygons, whose last point may be implied.
    pub(crate) fn points(
        &mut self,
        kind: u8,
        closed: bool,
        limits: &OasisLimits,
        out: &mut Vec<[i64; 2]>,
    ) -> Result<()> {
        let list = self.unsigned()?;
        let found = self.unsigned()?;
        if found > limits.points as u64 {
            return Err(self.fault(OasisFault::Limit {
                limit: OasisLimit::Points,
                found,
                most: limits.points as u64,
            }));
        }
        // Alternating lists of a polygon close by one more corner.
        let fewest = if closed { 2 } else { 1 };
        if found < fewest {
            return Err(self.fault(OasisFault::Points { kind, found }));
        }
        if closed && list < 2 && !found.is_multiple_of(2) {
            self.odd(OasisFault::Points { kind, found }, "the points were taken as they are")?;
        }
        out.clear();
        out.push([0, 0]);
        let mut at = [0i64; 2];
        let mut along = [0i64; 2];
        for k in 0..found {
            let step = match list {
                0 | 1 => {
                    let far = self.signed(limits)?;
                    if (k + list).is_multiple_of(2) {
                        [far, 0]
                    } else {
                        [0, far]
                    }
                }
                2 | 3 => {
                    let value = self.unsigned()?;
                    let bits = list as u32;
                    let far = self.near(value >> bits, limits)?;
                    direction(value & ((1 << bits) - 1)).map(|d| d * far)
                }
                4 => self.step(limits)?,
                5 => {
                    let turn = self.step(limits)?;
                    along = [along[0] + turn[0], along[1] + turn[1]];
                    along
                }
                other => return Err(self.fault(OasisFault::PointListKind(other))),
            };
            at = [at[0] + step[0], at[1] + step[1]];
            let [x, y] = [0, 1].map(|axis| at[axis].abs().max(along[axis].abs()));
            let far = x.max(y);
            if far > limits.farthest.saturating_mul(2) {
                return Err(self.too_far(far.unsigned_abs(), limits));
            }
            out.push(at);
        }
        if closed && list < 2 {
            // An odd list may end on it.
            let corner = if list == 0 { [0, at[1]] } else { [at[0], 0] };
            if corner != at || found.is_multiple_of(2) {
                out.push(corner);
            }
        }
        Ok(())
    }

    /// A repetition; none if the last one is used again.
    pub(crate) fn repetition(&mut self, limits: &OasisLimits) -> Result<Option<Repetition>> {
        let kind = self.unsigned()?;
        let count = |input: &mut Self| Ok::<u64, OasisError>(input.at_most(u64::MAX - 2)? + 2);
        let grid = |count, step| Repetition::Grid { count, step };
        Ok(Some(match kind {
            0 => return Ok(None),
            1 => {
                let count = [count(self)?, count(self)?];
                grid(count, [[self.distance(limits)?, 0], [0, self.distance(limits)?]])
            }
            2 => grid([count(self)?, 1], [[self.distance(limits)?, 0], [0, 0]]),
            3 => grid([count(self)?, 1], [[0, self.distance(limits)?], [0, 0]]),
            8 => {
                let count = [count(self)?, count(self)?];
                grid(count, [self.step(limits)?, self.step(limits)?])
            }
            9 => grid([count(self)?, 1], [self.step(limits)?, [0, 0]]),
            4..=7 | 10 | 11 => self.list(kind, limits)?,
            other => return Err(self.fault(OasisFault::RepetitionKind(other))),
        }))
    }

    /// A repetition of type 4 to 7, 10 or 11.
    fn list(&mut self, kind: u64, limits: &OasisLimits) -> Result<Repetition> {
        let most = limits.list_places as u64;
        let found = self.unsigned()?.saturating_add(1);
        if found > most {
            let limit = OasisLimit::ListPlaces;
            return Err(self.fault(OasisFault::Limit { limit, found, most }));
        }
        let grid = if matches!(kind, 5 | 7 | 11) {
            self.distance(limits)?
        } else {
            1
        };
        let mut places: Vec<[i32; 2]> = Vec::with_capacity(found.min(1 << 12) as usize);
        let mut at = [0i64; 2];
        for _ in 0..found {
            let step = match kind {
                4 | 5 => [self.distance(limits)?, 0],
                6 | 7 => [0, self.distance(limits)?],
                _ => self.step(limits)?,
            };
            at = [at[0] + step[0], at[1] + step[1]];
            let [Ok(x), Ok(y)] = at.map(i32::try_from) else {
                let far = at.map(i64::unsigned_abs);
                return Err(self.too_far(far[0].max(far[1]), limits));
            };
            places.push([x, y]);
        }
        Ok(Repetition::List { grid, places })
    }
}
