//! A small clean chip that every rule of the standard deck accepts, and ways to break it.

use crate::gds::Gds;
use metalith_core::cross_corners;

/// Sites an axis of the lens: 42 um, so that it holds one window of 31 um.
pub const SITES: i32 = 120;
pub const PITCH: i32 = 350;

/// Centre of a site from the lens's centre (nm).
pub fn site(i: i32) -> i32 {
    (2 * i - (SITES - 1)) * PITCH / 2
}

/// Width of the pillar at a site (nm): neighbours differ, and every even width from 160 to 240 occurs.
pub fn width(ix: i32, iy: i32) -> i32 {
    160 + 2 * ((ix * 7 + iy * 11) % 41)
}

/// Contents of a chip; change it, then write it.
pub struct Chip {
    /// (column, row, x from its site, y from its site, width) of each pillar.
    pub pillars: Vec<(i32, i32, i32, i32, i32)>,
    /// Records of the top cell behind all that is in order.
    pub extra: Gds,
    /// Cells before the top cell.
    pub before: Gds,
    /// Cells behind the top cell.
    pub after: Gds,
    pub marks: bool,
    pub unit_m: f64,
    pub top: &'static str,
}

impl Chip {
    pub fn clean() -> Self {
        let pillar = |k: i32| (k % SITES, k / SITES, 0, 0, width(k % SITES, k / SITES));
        Self {
            pillars: (0..SITES * SITES).map(pillar).collect(),
            extra: Gds::default(),
            before: Gds::default(),
            after: Gds::default(),
            marks: true,
            unit_m: 1e-9,
            top: "CHIP",
        }
    }

    /// The pillar at a site.
    pub fn at(&mut self, ix: i32, iy: i32) -> &mut (i32, i32, i32, i32, i32) {
        &mut self.pillars[(iy * SITES + ix) as usize]
    }

    /// The bytes. Pillars are drawn in the top cell.
    pub fn bytes(&self) -> Vec<u8> {
        let scale = (1e-9 / self.unit_m).round() as i32;
        let mut gds = Gds::library_with_unit(self.unit_m);
        gds.0.extend(&self.before.0);
        gds.cell(self.top);
        for &(ix, iy, dx, dy, w) in &self.pillars {
            let (x, y) = ((site(ix) + dx) * scale, (site(iy) + dy) * scale);
            gds.square(1, x, y, w * scale);
        }
        if self.marks {
            for (length, at) in [(1_000_000, 4_300_000), (200_000, 3_400_000)] {
                for (sx, sy) in [(-1, -1), (1, -1), (-1, 1), (1, 1)] {
                    cross(
                        &mut gds,
                        sx * at * scale,
                        sy * at * scale,
                        length * scale,
                        length / 100 * scale,
                    );
                }
            }
        }
        let edge = 5_000_000 * scale;
        gds.rect(10, -edge, -edge, edge, edge);
        gds.text(11, "clean", 0, -4_600_000 * scale);
        gds.0.extend(&self.extra.0);
        gds.end_cell();
        gds.0.extend(&self.after.0);
        gds.end()
    }
}

/// An alignment cross on 3/0, drawn counter-clockwise.
pub fn cross(gds: &mut Gds, x: i32, y: i32, length: i32, width: i32) {
    cross_on(gds, 3, x, y, length, width);
}

/// Cross on any layer.
pub fn cross_on(gds: &mut Gds, layer: i16, x: i32, y: i32, length: i32, width: i32) {
    let corners = cross_corners(length / 2, width / 2);
    let closed = corners.iter().chain(&corners[..1]);
    let points: Vec<_> = closed.map(|&(dx, dy)| (x + dx, y + dy)).collect();
    gds.polygon(layer, &points);
}
