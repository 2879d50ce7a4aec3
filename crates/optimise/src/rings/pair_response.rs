//! Transmission of the rings of a lens by the coupled model, at one wavelength, in light along the axis.
//!
//! The sum over pairs of [`SiteResponse`] is one of products of a function of the own width and one of the neighbour's. In a lens of
//! rings the neighbours of a site are in its own ring and those about it.

use std::collections::BTreeSet;

use num_complex::Complex64;

use crate::rings::kernel::RingField;
use crate::rings::neighbour_links::{DISTANCES, distance_of};
use crate::rings::sites::Rings;
use metalith_cell::{
    CellModel, CellResponse, Illumination, NEIGHBOUR_DEGREE, NEIGHBOURS, NeighbourTables, SiteResponse,
};
use metalith_core::{Result, Silent};

/// Products that a pair at any distance is a sum of: for each distance those of [`SiteResponse::pair_factors`].
pub(crate) const PRODUCTS: usize = DISTANCES * NEIGHBOUR_DEGREE;

/// The sum over pairs at one wavelength, by width (nm); of widths that were not asked for it knows nothing.
#[derive(Clone, Debug)]
pub(crate) struct PairResponse {
    /// Mean transmission of a pillar over its neighbours.
    pub own: Vec<Complex64>,
    /// Factors of the own width, mean over the neighbours at a distance: in a ring there are equally many on all sides.
    pub factors: Vec<[Complex64; PRODUCTS]>,
    /// Factors of a neighbour's width, equal at all wavelengths.
    pub neighbour: Vec<[f64; NEIGHBOUR_DEGREE]>,
}

impl PairResponse {
    /// Response of pillars of these widths (nm); `None` if the cell takes neighbours for equals.
    ///
    /// # Errors
    /// As [`CellModel::response`].
    pub(crate) fn of(
        cell: &dyn CellModel,
        wavelength_um: f64,
        widths_nm: impl IntoIterator<Item = u16>,
    ) -> Result<Option<Self>> {
        if cell.uncoupled().is_none() {
            return Ok(None);
        }
        let light = Illumination::normal(wavelength_um).in_band();
        let CellResponse::Neighbours(NeighbourTables::Band(response)) = cell.response(&light, 0, &Silent)? else {
            return Ok(None);
        };
        let widths: BTreeSet<u16> = widths_nm.into_iter().filter(|w| *w > 0).collect();
        let length = widths.last().map_or(0, |w| usize::from(*w) + 1);
        let mut all = Self {
            own: vec![Complex64::ZERO; length],
            factors: vec![[Complex64::ZERO; PRODUCTS]; length],
            neighbour: vec![[0.0; NEIGHBOUR_DEGREE]; length],
        };
        for width in widths {
            let (at, nm) = (usize::from(width), f64::from(width));
            all.own[at] = response.own(nm);
            all.neighbour[at] = response.neighbour_factors(nm);
            for (number, offset) in NEIGHBOURS.into_iter().enumerate() {
                let first = distance_of(offset) * NEIGHBOUR_DEGREE;
                for (b, factor) in response.pair_factors(number, nm).into_iter().enumerate() {
                    all.factors[at][first + b] += factor / SAME_DISTANCE;
                }
            }
        }
        Ok(Some(all))
    }

    /// Term that a neighbour at a distance adds.
    pub(crate) fn pair(&self, distance: usize, own_nm: u16, neighbour_nm: u16) -> Complex64 {
        let factors = &self.factors[usize::from(own_nm)][distance * NEIGHBOUR_DEGREE..][..NEIGHBOUR_DEGREE];
        let neighbour = &self.neighbour[usize::from(neighbour_nm)];
        factors.iter().zip(neighbour).map(|(a, b)| a * b).sum()
    }

    /// Field on the axis of a lens with pillars of `widths_nm[k]` in ring `k`.
    pub(crate) fn on_axis(&self, rings: &Rings, field: &RingField<'_>, widths_nm: &[u16]) -> Complex64 {
        let links = rings.links();
        let of_ring = |ring: usize| {
            let linked = links.all()[links.of_ring(ring)].iter().zip(field.on_axis_by_link(ring));
            let pairs = linked.map(|(link, e)| e * self.pair(link.distance, widths_nm[ring], widths_nm[link.other]));
            field.on_axis(ring) * self.own[usize::from(widths_nm[ring])] + pairs.sum::<Complex64>()
        };
        (0..rings.len()).map(of_ring).sum()
    }

    /// The mean transmission of the sites of each ring.
    pub(crate) fn of_rings(&self, rings: &Rings, widths_nm: &[u16]) -> Vec<Complex64> {
        let links = rings.links();
        let of_ring = |ring: usize| {
            let share = 1.0 / f64::from(rings.sites_of(ring));
            let pairs = links.all()[links.of_ring(ring)].iter();
            let pairs = pairs.map(|l| share * l.count() * self.pair(l.distance, widths_nm[ring], widths_nm[l.other]));
            self.own[usize::from(widths_nm[ring])] + pairs.sum::<Complex64>()
        };
        (0..rings.len()).map(of_ring).collect()
    }
}

/// Neighbours at each distance.
const SAME_DISTANCE: f64 = (NEIGHBOURS.len() / DISTANCES) as f64;
