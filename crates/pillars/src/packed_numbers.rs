//! Numbers in a byte each, as long as few of them differ, or in a bit each where they are like others.

use std::sync::Arc;

use crate::like_numbers::LikeNumbers;

/// Numbers that a byte tells apart; the first is zero.
pub(crate) const KINDS: usize = 256;

/// Many numbers, a byte each while no more than [`KINDS`] differ, two bytes after that.
#[derive(Clone, Debug)]
pub(crate) enum PackedNumbers {
    Few {
        /// Number of each kind.
        numbers: Box<[u16; KINDS]>,
        /// Kinds that there are.
        kinds: usize,
        /// Kind of each number that there is; zero of all others.
        kind_of: Vec<u8>,
        packed: Vec<u8>,
    },
    Many(Vec<u16>),
    /// Numbers that others are held against.
    Shared(Arc<Self>),
    /// Numbers that follow from others, but for a few.
    Like(LikeNumbers),
}

impl PackedNumbers {
    /// So many zeros.
    pub(crate) fn zero(count: usize) -> Self {
        Self::Few {
            numbers: Box::new([0; KINDS]),
            kinds: 1,
            kind_of: Vec::new(),
            packed: vec![0; count],
        }
    }

    /// Zeros of the same number, to be replaced by numbers that are mostly like these.
    pub(crate) fn zero_like(&mut self) -> Self {
        let others = match self {
            Self::Shared(others) => others.clone(),
            own => {
                let others = Arc::new(std::mem::replace(own, Self::zero(0)));
                *own = Self::Shared(others.clone());
                others
            }
        };
        Self::Like(LikeNumbers::new(others))
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Few { packed, .. } => packed.len(),
            Self::Many(numbers) => numbers.len(),
            Self::Shared(numbers) => numbers.len(),
            Self::Like(numbers) => numbers.len(),
        }
    }

    /// Memory of the numbers (bytes), without that of others that they are like.
    pub(crate) fn bytes(&self) -> u64 {
        match self {
            Self::Few { packed, .. } => packed.len() as u64,
            Self::Many(numbers) => 2 * numbers.len() as u64,
            Self::Shared(numbers) => numbers.bytes(),
            Self::Like(numbers) => numbers.bytes(),
        }
    }

    #[inline]
    pub(crate) fn get(&self, place: usize) -> u16 {
        match self {
            Self::Few { numbers, packed, .. } => numbers[usize::from(packed[place])],
            Self::Many(numbers) => numbers[place],
            Self::Shared(numbers) => numbers.get(place),
            Self::Like(numbers) => numbers.get(place),
        }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = u16> {
        (0..self.len()).map(|place| self.get(place))
    }

    #[inline]
    pub(crate) fn set(&mut self, place: usize, number: u16) {
        match self {
            Self::Few { kind_of, packed, .. } => match kind_of.get(usize::from(number)) {
                Some(&kind) if kind != 0 || number == 0 => packed[place] = kind,
                _ => self.set_new(place, number),
            },
            Self::Many(numbers) => numbers[place] = number,
            Self::Shared(_) => self.set_new(place, number),
            Self::Like(numbers) => {
                if !numbers.set(place, number) {
                    self.set_new(place, number);
                }
            }
        }
    }

    /// Variant of [`PackedNumbers::set`] for a number that there is no room for, as the numbers are held.
    #[cold]
    fn set_new(&mut self, place: usize, number: u16) {
        match self {
            Self::Few {
                numbers,
                kinds,
                kind_of,
                packed,
            } => {
                let index = usize::from(number);
                kind_of.resize(kind_of.len().max(index + 1), 0);
                if number == 0 {
                    packed[place] = 0;
                    return;
                }
                if *kinds < KINDS {
                    (numbers[*kinds], kind_of[index], packed[place]) = (number, *kinds as u8, *kinds as u8);
                    *kinds += 1;
                    return;
                }
                *self = Self::Many(packed.iter().map(|kind| numbers[usize::from(*kind)]).collect());
            }
            Self::Shared(numbers) => *self = Self::clone(numbers),
            Self::Like(_) => {
                let mut own = Self::zero(self.len());
                for (place, number) in self.iter().enumerate().filter(|(_, number)| *number != 0) {
                    own.set(place, number);
                }
                *self = own;
            }
            Self::Many(_) => {}
        }
        self.set(place, number);
    }

    /// Copy the numbers at `first`, `first + step`, ...
    #[inline]
    pub(crate) fn copy(&self, first: usize, step: usize, to: &mut [u16]) {
        match self {
            Self::Few { numbers, packed, .. } => {
                let from = packed[first..].iter().step_by(step);
                to.iter_mut()
                    .zip(from)
                    .for_each(|(to, kind)| *to = numbers[usize::from(*kind)]);
            }
            Self::Many(numbers) => {
                let from = numbers[first..].iter().step_by(step);
                to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
            }
            Self::Shared(numbers) => numbers.copy(first, step, to),
            Self::Like(numbers) => numbers.copy(first, step, to),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers stay what they are while more and more of them differ.
    #[test]
    fn numbers_are_kept_in_one_byte_and_in_two() {
        let count = 2000;
        let number = |place: usize, kinds: usize| (place * 7 % kinds * 31) as u16;
        for kinds in [1, 2, 255, 256, 257, 1000] {
            let mut packed = PackedNumbers::zero(count);
            // Twice: what is there is replaced.
            for shift in [3, 0] {
                (0..count).for_each(|place| packed.set(place, number(place + shift, kinds)));
            }
            assert!(
                packed.iter().eq((0..count).map(|place| number(place, kinds))),
                "{kinds}"
            );
            // Zero is one of them.
            assert_eq!(packed.bytes(), if kinds <= KINDS { 2000 } else { 4000 });
            let mut column = [0; 40];
            packed.copy(5, 9, &mut column);
            assert!((0..40).all(|k| column[k] == number(5 + 9 * k, kinds)));
        }
    }

    /// Numbers that are held against others are what they were set to: the same, wider ones, some others, all others, and in what
    /// is changed after that.
    #[test]
    fn numbers_like_others_are_what_they_were_set_to() {
        let count = 1_000_000;
        let mut first = PackedNumbers::zero(count);
        (0..count).for_each(|place| first.set(place, (place % 5 * (100 + place / 5 % 9)) as u16));
        let plain: Vec<u16> = first.iter().collect();
        let same = |_: usize, n: u16| n;
        let wider = |place: usize, n: u16| {
            if place % 7000 == 6 {
                13
            } else {
                n + 2 * u16::from(n > 0)
            }
        };
        let apart = |place: usize, n: u16| if place % 900 == 8 { 0 } else { n + (place % 3) as u16 };
        let rules: [&dyn Fn(usize, u16) -> u16; 3] = [&same, &wider, &apart];
        for (number, least) in rules.into_iter().zip([8, 6, 1]) {
            let mut like = first.zero_like();
            assert!(like.iter().all(|n| n == 0) && first.iter().eq(plain.iter().copied()));
            (0..count).for_each(|place| like.set(place, number(place, plain[place])));
            assert!(like.iter().eq((0..count).map(|place| number(place, plain[place]))));
            assert!(like.bytes() * least <= first.bytes(), "{}", like.bytes());
            let mut row = [0; 50];
            like.copy(30, 11, &mut row);
            assert!((0..50).all(|k| row[k] == like.get(30 + 11 * k)));
            for (place, n) in [(8, 0), (8, 77), (6, plain[6]), (6, 0)] {
                like.set(place, n);
                assert_eq!(like.get(place), n);
            }
        }
        first.set(3, 9);
        assert_eq!((first.get(3), first.get(4)), (9, plain[4]));
    }
}
