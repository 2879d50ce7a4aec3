//! Numbers that follow from others, place by place, but for a few.

use std::collections::HashMap;
use std::sync::Arc;

use crate::packed_numbers::PackedNumbers;

/// Places in which one may be an exception: so many exceptions take as much memory as the bits of all.
const PLACES_OF_EXCEPTION: usize = 256;
/// Memory of an exception (bytes), with the room that its table keeps.
const BYTES_OF_EXCEPTION: usize = 24;
/// Exceptions of one number before others follow from it: of a copy whose pillars are wider, or a few that differ.
const TRIED: u32 = 16;

/// Numbers in a bit each: whether it is the one that follows from the number of the others there, which is first the same.
#[derive(Clone, Debug)]
pub(crate) struct LikeNumbers {
    others: Arc<PackedNumbers>,
    /// Number that follows from each of the others; the same where there is none.
    follows: Vec<Option<Follower>>,
    /// Places whose number is the one that follows.
    alike: Vec<u64>,
    /// Numbers that are not zero and do not follow, by place.
    exceptions: HashMap<u32, u16>,
}

/// Number that follows from another.
#[derive(Clone, Copy, Debug)]
struct Follower {
    number: u16,
    /// Exceptions so far; none are counted any more once it was met.
    tried: u32,
}

impl LikeNumbers {
    pub(crate) fn new(others: Arc<PackedNumbers>) -> Self {
        Self {
            follows: Vec::new(),
            alike: vec![0; others.len().div_ceil(64)],
            exceptions: HashMap::new(),
            others,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.others.len()
    }

    pub(crate) fn bytes(&self) -> u64 {
        (8 * self.alike.len() + BYTES_OF_EXCEPTION * self.exceptions.len()) as u64
    }

    #[inline]
    fn follower(&self, other: u16) -> u16 {
        self.follows
            .get(usize::from(other))
            .copied()
            .flatten()
            .map_or(other, |f| f.number)
    }

    #[inline]
    pub(crate) fn get(&self, place: usize) -> u16 {
        self.beside(place, self.others.get(place))
    }

    /// Copy the numbers at `first`, `first + step`, ...
    pub(crate) fn copy(&self, first: usize, step: usize, to: &mut [u16]) {
        self.others.copy(first, step, to);
        let places = (first..).step_by(step);
        to.iter_mut()
            .zip(places)
            .for_each(|(to, place)| *to = self.beside(place, *to));
    }

    /// The number at the place of another.
    #[inline]
    fn beside(&self, place: usize, other: u16) -> u16 {
        if self.alike[place / 64] >> (place % 64) & 1 == 1 {
            return self.follower(other);
        }
        if self.exceptions.is_empty() {
            return 0;
        }
        self.exceptions.get(&(place as u32)).copied().unwrap_or(0)
    }

    /// Set a number, if there is room; else nothing changes.
    #[inline]
    pub(crate) fn set(&mut self, place: usize, number: u16) -> bool {
        let other = self.others.get(place);
        if number != 0 && self.follows_from(other, number) {
            self.alike[place / 64] |= 1 << (place % 64);
            if !self.exceptions.is_empty() {
                self.exceptions.remove(&(place as u32));
            }
            return true;
        }
        if number != 0 && PLACES_OF_EXCEPTION * (self.exceptions.len() + 1) > self.len() {
            return false;
        }
        self.alike[place / 64] &= !(1 << (place % 64));
        if number == 0 {
            self.exceptions.remove(&(place as u32));
        } else {
            self.exceptions.insert(place as u32, number);
        }
        true
    }

    /// True if this number, not zero, is the one that follows from another. Of a number that was never met, the number follows that
    /// comes after some exceptions.
    #[inline]
    fn follows_from(&mut self, other: u16, number: u16) -> bool {
        let index = usize::from(other);
        if index >= self.follows.len() {
            self.follows.resize(index + 1, None);
        }
        let follower = self.follows[index].get_or_insert(Follower {
            number: other,
            tried: 0,
        });
        if follower.number == number {
            follower.tried = u32::MAX;
            return true;
        }
        if follower.tried < TRIED {
            follower.tried += 1;
        } else if follower.tried == TRIED {
            *follower = Follower {
                number,
                tried: u32::MAX,
            };
            return true;
        }
        false
    }
}
