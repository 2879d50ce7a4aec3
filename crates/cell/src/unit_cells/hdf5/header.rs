//! Headers of objects: their messages, and the members of groups.

use super::bytes::Bytes;
use super::{DEEPEST, File, Parsed};

/// Longest name (bytes).
const LONGEST_NAME: usize = 1 << 10;

/// Address that names nothing.
pub(super) const NOWHERE: u64 = u64::MAX;

/// Message of the header of an object: its number and its data.
pub(super) type Message<'a> = (u64, Bytes<'a>);

impl<'a> File<'a> {
    /// Messages of the header of an object.
    pub(super) fn messages(&self, address: u64) -> Parsed<Vec<Message<'a>>> {
        let mut at = self.at(address)?;
        let is_new = at.0.starts_with(b"OHDR");
        let (flags, mut blocks);
        if is_new {
            at.take(5)?;
            flags = at.number(1)?;
            at.take(if flags & 0x20 > 0 { 16 } else { 0 })?;
            at.take(if flags & 0x10 > 0 { 4 } else { 0 })?;
            let size = at.number(1 << (flags & 3))?;
            blocks = vec![at.take(size as usize)?];
        } else {
            flags = 0;
            if at.number(1)? != 1 {
                return Err("an object with an unknown header".into());
            }
            at.take(7)?;
            let size = at.number(4)?;
            at.take(4)?;
            blocks = vec![at.take(size as usize)?];
        }
        let mut found = Vec::new();
        let mut next = 0;
        while let Some(block) = blocks.get(next) {
            let mut at = Bytes(block);
            let head = if is_new { 4 + (flags >> 1 & 2) as usize } else { 8 };
            while at.0.len() >= head {
                self.visit()?;
                let (kind, size, rest) = if is_new { (1, 2, head - 3) } else { (2, 2, 4) };
                let (kind, size) = (at.number(kind)?, at.number(size)?);
                at.take(rest)?;
                let mut data = Bytes(at.take(size as usize)?);
                if kind == 0x10 {
                    let (address, size) = (data.number(8)?, data.number(8)?);
                    let mut more = self.at(address)?;
                    let size = usize::try_from(size)
                        .ok()
                        .and_then(|size| size.checked_sub(if is_new { 8 } else { 0 }));
                    if is_new {
                        more.is(b"OCHK")?;
                    }
                    blocks.push(more.take(size.ok_or("a header that goes on nowhere")?)?);
                } else {
                    found.push((kind, data));
                }
            }
            next += 1;
        }
        Ok(found)
    }

    /// Names and addresses of the members of a group.
    pub(super) fn links(&self, messages: &[Message<'a>]) -> Parsed<Vec<(String, u64)>> {
        let mut found = Vec::new();
        for (kind, mut at) in messages.iter().copied() {
            match kind {
                0x11 => {
                    let (tree, heap) = (at.number(8)?, at.number(8)?);
                    let mut heap = self.at(heap)?;
                    heap.is(b"HEAP")?;
                    heap.take(20)?;
                    let names = self.at(heap.number(8)?)?;
                    self.symbols(tree, names, 0, &mut found)?;
                }
                0x02 => {
                    at.take(1)?;
                    let flags = at.number(1)?;
                    at.take(if flags & 1 > 0 { 8 } else { 0 })?;
                    if at.number(8)? != NOWHERE {
                        return Err("a group with more members than its header holds".into());
                    }
                }
                0x06 => {
                    at.take(1)?;
                    let flags = at.number(1)?;
                    let kind = if flags & 0x08 > 0 { at.number(1)? } else { 0 };
                    at.take(if flags & 0x04 > 0 { 8 } else { 0 })?;
                    at.take(usize::from(flags & 0x10 > 0))?;
                    let length = at.number(1 << (flags & 3))?;
                    let name = String::from_utf8_lossy(at.take((length as usize).min(LONGEST_NAME))?).into_owned();
                    // Links to other files and by name lead to no data of this one.
                    if kind == 0 {
                        found.push((name, at.number(8)?));
                    }
                }
                _ => {}
            }
        }
        Ok(found)
    }

    /// Adds the members of a tree of symbol tables.
    fn symbols(&self, address: u64, names: Bytes<'a>, depth: u32, found: &mut Vec<(String, u64)>) -> Parsed<()> {
        self.visit()?;
        let mut at = self.at(address)?;
        if at.0.starts_with(b"SNOD") {
            at.take(6)?;
            for _ in 0..at.number(2)? {
                self.visit()?;
                let (name, header) = (at.number(8)?, at.number(8)?);
                at.take(24)?;
                let name = names.0.get(name as usize..).ok_or("a name beyond the end")?;
                found.push((Bytes(&name[..name.len().min(LONGEST_NAME)]).text()?, header));
            }
            return Ok(());
        }
        let count = Self::node(&mut at, 0, depth)?;
        for _ in 0..count {
            at.take(8)?;
            self.symbols(at.number(8)?, names, depth + 1, found)?;
        }
        Ok(())
    }

    /// Head of a node of a tree: number of its children.
    pub(super) fn node(at: &mut Bytes<'a>, kind: u64, depth: u32) -> Parsed<u64> {
        at.is(b"TREE")?;
        if at.number(1)? != kind || depth > DEEPEST {
            return Err("a tree of another kind".into());
        }
        at.take(1)?;
        let count = at.number(2)?;
        at.take(16)?;
        Ok(count)
    }
}
