//! Choice of the patches of a sample, and their pillars side by side.

use std::f64::consts::TAU;

use metalith_core::Result;
use metalith_pillars::{Lattice, PillarMap, PillarRows};

/// Sites along the side of a patch: light that interferes with that of its neighbours passes far larger parts of a lens, so small
/// patches in many places tell more than large ones in few.
pub(super) const PATCH: usize = 8;
/// Sites around a patch whose pillars are neighbours of its own.
const MARGIN: usize = 2;
/// Sites along the side of a patch with its margin.
const TILE: usize = PATCH + 2 * MARGIN;

/// Patches of each zone. The first patches of all zones are a sample of the whole lens, the second ones another: figures are
/// as sure as these agree.
pub(super) const PATCHES: usize = 32;
/// Zones of a large lens: with their patches, a million sites.
const MOST_ZONES: usize = 512;
/// Share of the sites of a small lens that is sampled at most, where that leaves a zone: patches would overlap.
const MOST_SAMPLED: f64 = 0.25;

/// Steps of the additive sequence that spreads points over a square most evenly (R2): powers of the inverse of the real root of
/// x^3 = x + 1.
const SPREAD: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];

/// Zones of a lens with so many sites.
pub(super) fn zones(sites: f64) -> usize {
    let most = MOST_SAMPLED * sites / (PATCHES * PATCH * PATCH) as f64;
    (most as usize).clamp(1, MOST_ZONES)
}

/// One patch of each zone: a sample of a whole element. Its pillars, each patch with its margin, are the tiles of a map.
pub(super) struct Tiles {
    pub map: PillarMap,
    /// Column and row of the first site of each patch on the lattice of the element; below zero beyond it.
    patches: Vec<[i64; 2]>,
    /// Tiles along a side of the map.
    side: usize,
    /// Sites along a side of the element.
    sites: usize,
}

impl Tiles {
    /// Tiles of the patches with number `part` of rings of equal area of a circle (um), their places spread evenly over radius
    /// and direction.
    pub(super) fn of(pillars: &dyn PillarRows, radius_um: f64, zones: usize, part: usize) -> Result<Self> {
        let lattice = pillars.lattice();
        let place = |zone: usize| {
            let number = (zone * PATCHES + part) as f64;
            let [within, direction] = SPREAD.map(|step| (0.5 + number * step).fract());
            let radius_um = radius_um * ((zone as f64 + within) / zones as f64).sqrt();
            let (sin, cos) = (TAU * direction).sin_cos();
            lattice.site_at([radius_um * cos, radius_um * sin])
        };
        let first = |middle: [usize; 2]| middle.map(|i| i as i64 - (PATCH / 2) as i64);
        let patches: Vec<_> = (0..zones).filter_map(place).map(first).collect();
        let side = patches.len().isqrt() + 1;
        // Numbers of pillars have no size: any square lattice holds them.
        let mut map = PillarMap::empty(Lattice::new(1, side * TILE)?);
        let sites = lattice.sites();
        let within = |i: i64| usize::try_from(i).ok().filter(|i| *i < sites);
        for (k, [x, y]) in patches.iter().map(|p| p.map(|i| i - MARGIN as i64)).enumerate() {
            for (row, column) in (0..TILE * TILE).map(|i| (i / TILE, i % TILE)) {
                // Site by site: an eighth of a lens makes no part of a row without the whole row.
                if let (Some(ix), Some(iy)) = (within(x + column as i64), within(y + row as i64)) {
                    let tile = [k / side * TILE + row, k % side * TILE + column];
                    map.number[tile] = pillars.number(ix, iy);
                }
            }
        }
        Ok(Self {
            map,
            patches,
            side,
            sites,
        })
    }

    /// Number of patches.
    pub(super) fn patches(&self) -> usize {
        self.patches.len()
    }

    /// Sites of a patch, without its margin: column and row in the map, then on the lattice of the element.
    pub(super) fn patch(&self, k: usize) -> impl Iterator<Item = ([usize; 2], [usize; 2])> + '_ {
        let corner = [k % self.side, k / self.side].map(|i| i * TILE + MARGIN);
        let places = (0..PATCH).flat_map(|y| (0..PATCH).map(move |x| [x, y]));
        places.filter_map(move |[x, y]| {
            let tile = [corner[0] + x, corner[1] + y];
            Some((tile, self.site(tile)?))
        })
    }

    /// Site of the element at a column and a row of the map; none in margins and beyond the element.
    pub(super) fn site(&self, [column, row]: [usize; 2]) -> Option<[usize; 2]> {
        let first = self.patches.get(row / TILE * self.side + column / TILE)?;
        let site = |first: i64, i: usize| {
            let within = (i % TILE).checked_sub(MARGIN).filter(|i| *i < PATCH)?;
            let site = usize::try_from(first + within as i64).ok()?;
            (site < self.sites).then_some(site)
        };
        Some([site(first[0], column)?, site(first[1], row)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map whose pillars tell their own site.
    fn numbered(sites: usize) -> PillarMap {
        let mut map = PillarMap::empty(Lattice::new(350, sites).unwrap());
        for ((iy, ix), number) in map.number.indexed_iter_mut() {
            *number = (iy * sites + ix) as u16;
        }
        map
    }

    #[test]
    fn tiles_hold_patches_of_all_zones_with_their_neighbours() {
        let (sites, zones) = (200, 16);
        let (pillars, radius_um) = (numbered(sites), 35.0);
        let mut in_zone = vec![0; zones];
        for part in 0..PATCHES {
            let tiles = Tiles::of(&pillars, radius_um, zones, part).unwrap();
            assert_eq!(tiles.patches(), zones);
            for (k, count) in in_zone.iter_mut().enumerate() {
                let middle = tiles.patches[k].map(|i| (i + 4) as usize);
                let r2 = pillars.lattice.radius2_nm2(middle[0], middle[1]) * 1e-6 / radius_um.powi(2);
                // A site is half a pitch or less from the place that is chosen.
                let zone = r2 * zones as f64;
                assert!((zone - k as f64 - 0.5).abs() < 1.0, "{k}: {zone}");
                *count += tiles.patch(k).count();
                for ([column, row], [ix, iy]) in tiles.patch(k) {
                    // The site itself, and a neighbour in the margin or the patch.
                    assert_eq!(tiles.map.number[[row, column]], pillars.number[[iy, ix]]);
                    if let Some(own) = pillars.number.get([iy + 2, ix.wrapping_sub(1)]) {
                        assert_eq!(tiles.map.number[[row + 2, column - 1]], *own);
                    }
                }
            }
            assert_eq!(tiles.site([0, 0]), None);
        }
        let full = PATCHES * PATCH * PATCH;
        assert!(in_zone[..zones - 2].iter().all(|count| *count == full), "{in_zone:?}");
        assert!(in_zone.iter().all(|count| *count > full / 2), "{in_zone:?}");
    }

    #[test]
    fn small_lenses_have_fewer_zones() {
        assert_eq!([0.0, 1e5, 6.4e6, 5.8e9].map(super::zones), [1, 12, 512, 512]);
    }
}
