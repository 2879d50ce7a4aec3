//! Tests of the findings of a deck on pillars of any shape on a square lattice.

use metalith_drc::Deck;
use metalith_testing::gds::Gds;

use crate::{broken, input, layout};

/// Middle of a site of a lattice about the origin (nm).
pub(crate) fn site(pitch: i32, sites: i32, column: i32, row: i32) -> (i32, i32) {
    let at = |k: i32| pitch * k - pitch * (sites - 1) / 2;
    (at(column), at(row))
}

/// Rules that are broken with their counts, and pillars on lattices, of what `draw` leaves at each site with `more` on it.
pub(crate) fn broken_on_lattice(
    deck: &Deck,
    sites: i32,
    draw: impl Fn(&mut Gds, i32, i32),
    more: impl Fn(&mut Gds),
) -> (Vec<(String, u64)>, u64) {
    let mut gds = Gds::library();
    gds.cell("TOP");
    for (column, row) in (0..sites * sites).map(|k| (k % sites, k / sites)) {
        draw(&mut gds, column, row);
    }
    more(&mut gds);
    gds.end_cell();
    let file = layout(gds.end());
    let report = metalith_drc::check(&file, deck, &input(), &metalith_core::Silent).unwrap();
    let broken = broken(&report).into_iter().map(|(id, count)| (id.to_owned(), count));
    (broken.collect(), report.pillars_on_lattices)
}
