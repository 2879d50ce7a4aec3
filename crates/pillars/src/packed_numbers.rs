//! Numbers in a byte each, as long as few of them differ.

/// Numbers that a byte tells apart; the first is zero.
const KINDS: usize = 256;

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

    pub(crate) fn bytes_of_one(&self) -> u64 {
        match self {
            Self::Few { .. } => 1,
            Self::Many(_) => 2,
        }
    }

    #[inline]
    pub(crate) fn get(&self, place: usize) -> u16 {
        match self {
            Self::Few { numbers, packed, .. } => numbers[usize::from(packed[place])],
            Self::Many(numbers) => numbers[place],
        }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = u16> {
        let count = match self {
            Self::Few { packed, .. } => packed.len(),
            Self::Many(numbers) => numbers.len(),
        };
        (0..count).map(|place| self.get(place))
    }

    #[inline]
    pub(crate) fn set(&mut self, place: usize, number: u16) {
        match self {
            Self::Few { kind_of, packed, .. } => match kind_of.get(usize::from(number)) {
                Some(&kind) if kind != 0 || number == 0 => packed[place] = kind,
                _ => self.set_new(place, number),
            },
            Self::Many(numbers) => numbers[place] = number,
        }
    }

    /// Variant of [`PackedNumbers::set`] for a number that there may not be yet.
    #[cold]
    fn set_new(&mut self, place: usize, number: u16) {
        if let Self::Few {
            numbers,
            kinds,
            kind_of,
            packed,
        } = self
        {
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
            assert_eq!(packed.bytes_of_one(), if kinds <= KINDS { 1 } else { 2 });
            let mut column = [0; 40];
            packed.copy(5, 9, &mut column);
            assert!((0..40).all(|k| column[k] == number(5 + 9 * k, kinds)));
        }
    }
}
