//! Whether a JPEG file holds all that it says: decoders fill what is missing with grey.

use std::collections::BTreeMap;

/// Bytes that [`probed`] puts before the end: more than the longest block of coefficients that they may be taken for.
const PROBE: [u8; 64] = [0x5a; 64];

/// Coefficients of a block.
const COEFFICIENTS: u8 = 64;

/// A component as the head of the frame has it: samples along both axes for each unit of the frame.
#[derive(Clone, Copy)]
struct Component {
    across: usize,
    down: usize,
}

/// What the segments of a file say.
#[derive(Default)]
struct Segments {
    rows: usize,
    columns: usize,
    components: BTreeMap<u8, Component>,
    /// Lowest bit that scans have brought of each coefficient, by component and coefficient.
    reached: BTreeMap<(u8, u8), u8>,
    /// Place of the mark that ends the picture.
    end: usize,
}

/// Check that each part of a picture is in the file. What is wrong comes back in words.
///
/// Three kinds are found: no mark of the end; scans that were never written; fewer bits than blocks, each of which has one at
/// least (ITU-T T.81, F.1.2 and G.1.2).
pub(super) fn check_whole(bytes: &[u8]) -> Result<(), String> {
    let segments = segments(bytes)?;
    if segments.components.is_empty() {
        return Err("it holds no picture".into());
    }
    let is_whole = |id: u8| (0..COEFFICIENTS).all(|k| segments.reached.get(&(id, k)) == Some(&0));
    if segments.components.keys().all(|id| is_whole(*id)) {
        Ok(())
    } else {
        Err(format!("it ends early: scans are missing before byte {}", segments.end))
    }
}

/// The file with bytes put before its end, which a decoder takes only if it has not found all blocks by then. None of a file
/// without a mark of the end.
pub(super) fn probed(bytes: &[u8]) -> Option<Vec<u8>> {
    let end = segments(bytes).ok()?.end;
    let (before, after) = bytes.split_at_checked(end)?;
    Some([before, &PROBE, after].concat())
}

fn segments(bytes: &[u8]) -> Result<Segments, String> {
    let early = || format!("it ends early: {} bytes hold no mark of the end", bytes.len());
    let mut found = Segments::default();
    let mut at = 2;
    loop {
        // Any number of filling bytes may stand before a mark.
        while bytes.get(at..at + 2) == Some(&[0xff, 0xff]) {
            at += 1;
        }
        let &[0xff, mark] = bytes.get(at..at + 2).ok_or_else(early)? else {
            return Err(format!("byte {at} is no mark of a segment"));
        };
        if mark == 0xd9 {
            found.end = at;
            return Ok(found);
        }
        at += 2;
        if matches!(mark, 0x01 | 0xd0..=0xd8) {
            continue;
        }
        let length = bytes.get(at..at + 2).ok_or_else(early)?;
        let length = usize::from(u16::from_be_bytes([length[0], length[1]])).max(2);
        let segment = bytes.get(at + 2..at + length).ok_or_else(early)?;
        at += length;
        match mark {
            0xc0..=0xc2 => found.frame(segment),
            0xda => {
                let data = entropy_coded(&bytes[at..]);
                found.scan(segment, data, at)?;
                at += data;
            }
            _ => {}
        }
    }
}

/// Bytes up to the next mark that does not belong to the data of a scan.
fn entropy_coded(bytes: &[u8]) -> usize {
    let ends = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xd0..=0xd7 | 0xff);
    bytes.windows(2).position(ends).unwrap_or(bytes.len())
}

impl Segments {
    /// Takes the head of the frame.
    fn frame(&mut self, segment: &[u8]) {
        let [_, r0, r1, c0, c1, _, components @ ..] = segment else {
            return;
        };
        self.rows = usize::from(u16::from_be_bytes([*r0, *r1]));
        self.columns = usize::from(u16::from_be_bytes([*c0, *c1]));
        for component in components.chunks_exact(3) {
            let [across, down] = [component[1] >> 4, component[1] & 15].map(|n| usize::from(n).max(1));
            self.components.insert(component[0], Component { across, down });
        }
    }

    /// Takes a scan whose data are so many bytes from `at` on.
    fn scan(&mut self, segment: &[u8], data: usize, at: usize) -> Result<(), String> {
        let count = usize::from(segment.first().copied().unwrap_or(0));
        let (Some(ids), Some(&[from, to, bits])) =
            (segment.get(1..1 + 2 * count), segment.get(1 + 2 * count..4 + 2 * count))
        else {
            return Err(format!("the scan at byte {at} has no head"));
        };
        let ids: Vec<u8> = ids.chunks_exact(2).map(|id| id[0]).collect();
        for id in &ids {
            for coefficient in from..=to.min(COEFFICIENTS - 1) {
                self.reached.insert((*id, coefficient), bits & 15);
            }
        }
        // One code may stand for many blocks without coefficients beyond the first, which each block has.
        let blocks: usize = if from == 0 {
            ids.iter().map(|id| self.blocks(*id)).sum()
        } else {
            0
        };
        if blocks > 8 * data {
            return Err(format!(
                "it ends early: {data} bytes from byte {at} on are too few for the {blocks} blocks of {} x {} pixels",
                self.columns, self.rows
            ));
        }
        Ok(())
    }

    /// Blocks of a component.
    fn blocks(&self, id: u8) -> usize {
        /// Pixels along each side of a block.
        const SIDE: usize = 8;
        let most = |along: fn(&Component) -> usize| self.components.values().map(along).max().unwrap_or(1);
        self.components.get(&id).map_or(0, |own| {
            let across = (self.columns * own.across).div_ceil(SIDE * most(|c| c.across));
            let down = (self.rows * own.down).div_ceil(SIDE * most(|c| c.down));
            across * down
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::read::read_picture;

    /// A photograph of 33 x 33 pixels.
    const WHOLE: &[u8] = include_bytes!("../../../../tests/mutants/small.jpg");

    /// Every tenth cut of a file, with and without a mark of the end behind it, is found.
    #[test]
    fn a_file_that_was_cut_is_no_picture() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.jpg");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read_picture(&path)
        };
        read(WHOLE).unwrap();
        for kept in (2..WHOLE.len() - 2).step_by(10) {
            let cut = &WHOLE[..kept];
            read(cut).unwrap_err();
            read(&[cut, &[0xff, 0xd9]].concat()).unwrap_err();
        }
    }

    /// A file of few bytes that says that it is large.
    #[test]
    fn a_size_needs_its_blocks() {
        let mut claims = WHOLE.to_vec();
        let head = claims
            .windows(2)
            .position(|pair| matches!(pair, [0xff, 0xc0..=0xc2]))
            .unwrap();
        claims[head + 5..head + 9].copy_from_slice(&[0x10, 0, 0x10, 0]);
        super::check_whole(WHOLE).unwrap();
        super::check_whole(&claims).unwrap_err();
    }
}
