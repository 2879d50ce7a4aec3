//! References of cells: circles, dangling names, and how often everything stands in the layout, computed
//! before anything is expanded.

use super::cell::LayoutCell;
use super::limits::{ReadLimits, TEXT_BYTES};
use super::names::Names;
use crate::error::{LayoutError, Limit};

/// Cells larger than this are placed as a whole; smaller ones without references shape by shape.
const INLINE_SHAPES: u64 = 64;
const INLINE_VERTICES: u64 = 1024;
/// Vertices of all inline cells together: 16 MiB of coordinates.
const INLINE_TOTAL: u64 = 1 << 20;

/// The tree of a layout, beside what is written into its cells.
pub(super) struct Tree {
    /// Cells by index, each before those it refers to.
    pub order: Vec<usize>,
    /// Cells that nobody refers to, in the order of the file.
    pub tops: Vec<usize>,
    /// Cell of each name.
    pub definitions: Vec<Option<usize>>,
    /// (cell, index of its child) of references that close a circle.
    pub circles: Vec<(usize, usize)>,
    /// (cell, index of its child) of references to names without a cell.
    pub dangling: Vec<(usize, usize)>,
    /// Cells whose name another cell before them has.
    pub doubled: Vec<usize>,
}

/// Resolve names, find circles, order and count.
pub(super) fn resolve(cells: &mut [LayoutCell], names: &Names, numbers: &[u32]) -> Tree {
    let mut definitions = vec![None; names.len()];
    let mut doubled = Vec::new();
    for (index, &number) in numbers.iter().enumerate() {
        match definitions[number as usize] {
            None => definitions[number as usize] = Some(index),
            Some(_) => doubled.push(index),
        }
    }
    let mut dangling = Vec::new();
    let mut referred = vec![false; cells.len()];
    for (index, cell) in cells.iter_mut().enumerate() {
        for (k, child) in cell.children.iter_mut().enumerate() {
            child.cell = definitions[child.number as usize];
            match child.cell {
                Some(target) => referred[target] = true,
                None => dangling.push((index, k)),
            }
        }
    }
    let (order, circles) = order(cells, &referred);
    let mut referred = vec![false; cells.len()];
    for target in cells.iter().flat_map(followed) {
        referred[target.0] = true;
    }
    doubled.iter().for_each(|&second: &usize| referred[second] = true);
    let tops = (0..cells.len()).filter(|&c| !referred[c]).collect::<Vec<_>>();
    let (placements, depths) = count(cells, &order, &tops);
    let mut inline_total = 0;
    for (cell, (placements, depth)) in cells.iter_mut().zip(placements.into_iter().zip(depths)) {
        (cell.placements, cell.depth) = (placements, depth);
        let vertices = cell
            .layers
            .iter()
            .fold(0, |sum: u64, (_, t)| sum.saturating_add(t.vertices));
        cell.inline = cell.children.is_empty()
            && (1..=INLINE_SHAPES).contains(&cell.shapes())
            && cell.texts() == 0
            && vertices <= INLINE_VERTICES
            && inline_total + vertices <= INLINE_TOTAL;
        if cell.inline {
            inline_total += vertices;
        }
    }
    Tree {
        order,
        tops,
        definitions,
        circles,
        dangling,
        doubled,
    }
}

/// Children that can be followed: index of the cell and number of copies.
pub(super) fn followed(cell: &LayoutCell) -> impl Iterator<Item = (usize, u64)> + '_ {
    cell.children
        .iter()
        .filter(|c| !c.cut)
        .filter_map(|c| Some((c.cell?, c.copies)))
}

/// Depth first without recursion; a reference to a cell that is being visited closes a circle and is cut.
fn order(cells: &mut [LayoutCell], referred: &[bool]) -> (Vec<usize>, Vec<(usize, usize)>) {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut states = vec![State::New; cells.len()];
    let mut finished = Vec::with_capacity(cells.len());
    let mut circles = Vec::new();
    let roots = (0..cells.len()).filter(|&c| !referred[c]).chain(0..cells.len());
    for root in roots {
        if states[root] != State::New {
            continue;
        }
        states[root] = State::Open;
        let mut stack = vec![(root, 0)];
        while let Some((cell, next)) = stack.last_mut() {
            let (cell_index, child_index) = (*cell, *next);
            *next += 1;
            let Some(child) = cells[cell_index].children.get_mut(child_index) else {
                states[cell_index] = State::Done;
                finished.push(cell_index);
                stack.pop();
                continue;
            };
            match child.cell.map(|target| (target, states[target])) {
                Some((target, State::New)) => {
                    states[target] = State::Open;
                    stack.push((target, 0));
                }
                Some((_, State::Open)) => {
                    child.cut = true;
                    circles.push((cell_index, child_index));
                }
                _ => {}
            }
        }
    }
    finished.reverse();
    (finished, circles)
}

/// Placements of every cell below `roots`, and the longest chain of references to it.
pub(super) fn count(cells: &[LayoutCell], order: &[usize], roots: &[usize]) -> (Vec<u64>, Vec<u32>) {
    let mut placements = vec![0u64; cells.len()];
    let mut depths = vec![0u32; cells.len()];
    roots.iter().for_each(|&r| placements[r] = 1);
    for &index in order {
        if placements[index] == 0 {
            continue;
        }
        for (target, copies) in followed(&cells[index]) {
            placements[target] = placements[target].saturating_add(placements[index].saturating_mul(copies));
            depths[target] = depths[target].max(depths[index] + 1);
        }
    }
    (placements, depths)
}

/// Shapes, every reference followed, given how often each cell stands.
pub(super) fn flat_shapes(cells: &[LayoutCell], placements: &[u64]) -> u64 {
    cells.iter().zip(placements).fold(0u64, |sum, (cell, &n)| {
        sum.saturating_add(n.saturating_mul(cell.shapes()))
    })
}

/// Bytes of texts, every reference followed, and what each costs beside.
fn flat_text_bytes(cells: &[LayoutCell], placements: &[u64]) -> u64 {
    cells.iter().zip(placements).fold(0u64, |sum, (cell, &n)| {
        let texts = cell
            .layers
            .iter()
            .map(|(_, t)| t.text_bytes.saturating_add(TEXT_BYTES.saturating_mul(t.texts)))
            .fold(0, u64::saturating_add);
        sum.saturating_add(n.saturating_mul(texts))
    })
}

/// Limit that the layout exceeds, found before anything is expanded. `bytes` is the size of the file.
pub(super) fn beyond(
    cells: &[LayoutCell],
    placements: &[u64],
    depths: &[u32],
    limits: &ReadLimits,
    bytes: u64,
) -> Option<LayoutError> {
    let depth = depths.iter().copied().max().unwrap_or(0);
    // Empty cells cost copies too.
    let copies = cells
        .iter()
        .zip(placements)
        .filter(|(c, _)| !c.inline)
        .fold(0u64, |sum, (_, &n)| sum.saturating_add(n));
    let shapes = flat_shapes(cells, placements);
    [
        (Limit::Depth, u64::from(depth), u64::from(limits.depth)),
        (Limit::FlatShapes, shapes, limits.flat_shapes),
        (Limit::FlatShapesOfShortFile, shapes, limits.shapes_of(bytes)),
        (
            Limit::FlatTexts,
            flat_text_bytes(cells, placements),
            limits.text_bytes_of(bytes),
        ),
        (Limit::Placements, copies, limits.placements),
    ]
    .into_iter()
    .find(|(_, found, most)| found > most)
    .map(|(limit, found, most)| LayoutError::Limit { limit, found, most })
}
