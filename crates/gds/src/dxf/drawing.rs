//! A drawing in DXF after its first reading: where its entities are, and what its units and layers are.

use std::collections::{BTreeSet, HashMap};

use super::Fault;
use super::pairs::{Pair, Pairs};
use metalith_core::text::printable_bytes;

/// Kinds of entities. Of those that draw nothing none is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    LightPolyline,
    /// With its vertices behind it.
    Polyline,
    Circle,
    Arc,
    Ellipse,
    Line,
    /// Four corners, the last two exchanged.
    Solid,
    Face,
    Insert,
    Text,
    Hatch,
    Unread,
}

/// Entities that draw nothing, or belong to the one before.
const SILENT: [&[u8]; 7] = [
    b"SEQEND",
    b"VERTEX",
    b"ATTRIB",
    b"ATTDEF",
    b"VIEWPORT",
    b"POINT",
    b"DIMENSION",
];

impl Kind {
    fn of(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"LWPOLYLINE" => Self::LightPolyline,
            b"POLYLINE" => Self::Polyline,
            b"CIRCLE" => Self::Circle,
            b"ARC" => Self::Arc,
            b"ELLIPSE" => Self::Ellipse,
            b"LINE" => Self::Line,
            b"SOLID" | b"TRACE" => Self::Solid,
            b"3DFACE" => Self::Face,
            b"INSERT" => Self::Insert,
            b"TEXT" | b"MTEXT" => Self::Text,
            other if SILENT.contains(&other) => return None,
            b"HATCH" => Self::Hatch,
            _ => Self::Unread,
        })
    }
}

/// Place of an entity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entity {
    pub kind: Kind,
    /// Place behind its name.
    at: u32,
    line: u32,
}

impl Entity {
    /// Line that it begins in.
    pub(super) fn line(&self) -> u64 {
        self.line.into()
    }
}

/// Most pairs of an entity: two for each vertex of the largest polygon that layouts have.
const MOST_PAIRS: usize = 1 << 22;

#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    pub name: Vec<u8>,
    pub base: [f64; 2],
    pub entities: Vec<Entity>,
}

/// A drawing; its entities are read again from its bytes.
pub(super) struct Drawing<'a> {
    pub bytes: &'a [u8],
    /// Number that $INSUNITS has.
    pub units: Option<i32>,
    /// Version of the format in $ACADVER, such as AC1015.
    pub version: Option<String>,
    pub blocks: Vec<Block>,
    /// Blocks by name, in capital letters: names are the same in either.
    pub by_name: HashMap<Vec<u8>, usize>,
    /// What is drawn outside of blocks.
    pub model: Vec<Entity>,
    pub layers: BTreeSet<Vec<u8>>,
    /// Largest coordinate of any entity.
    pub farthest: f64,
}

/// Part of a drawing that is read.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    Header,
    Blocks,
    Entities,
    Other,
}

impl<'a> Drawing<'a> {
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, Fault> {
        let mut drawing = Self {
            bytes,
            units: None,
            version: None,
            blocks: Vec::new(),
            by_name: HashMap::new(),
            model: Vec::new(),
            layers: BTreeSet::new(),
            farthest: 0.0,
        };
        let mut pairs = Pairs::from(bytes, 0, 1);
        let (mut section, mut block, mut in_block_head) = (Section::Other, None::<usize>, false);
        let (mut last, mut variable): (&[u8], &[u8]) = (b"", b"");
        // The entity that pairs belong to is on paper, not in the model.
        let mut held = false;
        while let Some(pair) = pairs.next()? {
            let Pair { code, value, line } = pair;
            match (code, value) {
                (0, b"EOF") => break,
                (0, b"ENDSEC") => (section, block, held) = (Section::Other, None, false),
                (0, b"BLOCK") if section == Section::Blocks => {
                    block = Some(drawing.blocks.len());
                    drawing.blocks.push(Block::default());
                    in_block_head = true;
                }
                (0, b"ENDBLK") => (block, held) = (None, false),
                (0, name) if section == Section::Entities || block.is_some() => {
                    in_block_head = false;
                    held = false;
                    if let Some(kind) = Kind::of(name) {
                        let entity = Entity {
                            kind,
                            at: pairs.at as u32,
                            line: line as u32,
                        };
                        held = true;
                        match block {
                            Some(block) => drawing.blocks[block].entities.push(entity),
                            None => drawing.model.push(entity),
                        }
                    }
                    held |= name == b"VERTEX";
                }
                (2, name) if last == b"SECTION" => {
                    section = match name {
                        b"HEADER" => Section::Header,
                        b"BLOCKS" => Section::Blocks,
                        b"ENTITIES" => Section::Entities,
                        _ => Section::Other,
                    };
                    last = b"";
                }
                (9, name) => variable = name,
                (70, _) if section == Section::Header && variable == b"$INSUNITS" => {
                    drawing.units = Some(pair.number()? as i32);
                }
                (1, version) if section == Section::Header && variable == b"$ACADVER" => {
                    drawing.version = Some(printable_bytes(version));
                }
                _ if in_block_head => drawing.block_head(block, pair)?,
                (67, b"1") if held && block.is_none() => {
                    drawing.model.pop();
                    held = false;
                }
                (8, name) if held => {
                    drawing.layers.insert(name.to_vec());
                }
                (10..=13 | 20..=23, _) if held => {
                    drawing.farthest = drawing.farthest.max(pair.number()?.abs());
                }
                _ => {}
            }
            if code == 0 {
                last = value;
            }
        }
        Ok(drawing)
    }

    fn block_head(&mut self, block: Option<usize>, pair: Pair<'_>) -> Result<(), Fault> {
        let Some(number) = block else { return Ok(()) };
        let block = &mut self.blocks[number];
        match pair.code {
            2 => {
                block.name = pair.value.to_vec();
                self.by_name.insert(pair.value.to_ascii_uppercase(), number);
            }
            10 => block.base[0] = pair.number()?,
            20 => block.base[1] = pair.number()?,
            _ => {}
        }
        Ok(())
    }

    /// The block with a name.
    pub(super) fn block(&self, name: &[u8]) -> Option<usize> {
        self.by_name.get(&name.to_ascii_uppercase()).copied()
    }

    /// Pairs of an entity, and with a polyline those of its vertices.
    pub(super) fn pairs(&self, entity: &Entity) -> Result<Vec<Pair<'a>>, Fault> {
        let mut pairs = Pairs::from(self.bytes, entity.at as usize, entity.line() + 2);
        let mut out = Vec::new();
        while let Some(pair) = pairs.next()? {
            if pair.code == 0 && (entity.kind != Kind::Polyline || pair.value != b"VERTEX") {
                break;
            }
            if out.len() == MOST_PAIRS {
                return Err(pair.fault("an entity of more than two million vertices"));
            }
            out.push(pair);
        }
        Ok(out)
    }
}
