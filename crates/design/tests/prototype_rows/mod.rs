//! Rows of real pillars of `designs/prototype_3x3.toml`, whose optimised phase jumps from ring to ring, and how far models
//! of single sites are from the supercells of these rows.

use std::f64::consts::TAU;

use metalith_cell::{
    Blaze, CellModel, CellResponse, CoarseCell, ElementRow, Illumination, JonesTables, Mapping, NeighbourTable,
    NeighbourTableSpec, PointwiseCell, RealRow, SiteGrid,
};
use metalith_core::{Silent, Wedge};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, PillarRule};
use num_complex::Complex64;

/// Places where rows begin, from the middle of the element (um).
pub(crate) const RADII_UM: [f64; 4] = [60.0, 180.0, 300.0, 440.0];

/// Share of the light that models put elsewhere than the supercell of a row, mean of s and p.
pub(crate) struct RowMisfit {
    pub radius_um: f64,
    pub direction: [i32; 2],
    /// Equal neighbours, lit along the normal.
    pub normal: f64,
    /// Equal neighbours, lit as the row is.
    pub oblique: f64,
    /// The neighbours that there are.
    pub neighbours: f64,
}

/// Rows of one light, and what the table of neighbours leaves of supercells that it was not fitted to.
pub(crate) struct Misfits {
    pub rows: Vec<RowMisfit>,
    pub left_out: f64,
    /// Share of the light in the first order of all rows together, mean of s and p: by equal neighbours lit as the rows
    /// are, by the neighbours that there are, by the supercells.
    pub first: [f64; 3],
}

impl Misfits {
    /// Mean over the rows: equal neighbours lit along the normal and as the rows are, and those that there are.
    pub(crate) fn means(&self) -> [f64; 3] {
        let mean = |of: fn(&RowMisfit) -> f64| self.rows.iter().map(of).sum::<f64>() / self.rows.len() as f64;
        [mean(|r| r.normal), mean(|r| r.oblique), mean(|r| r.neighbours)]
    }
}

/// Amplitude in an order of a blazed row, of what its sites pass. Phases are without that of the wedge at the middle of pillar 0.
pub(crate) fn order(blaze: &Blaze, sites: &[Complex64], order: f64) -> Complex64 {
    let back = |x: usize| Complex64::cis(-TAU * order * blaze.phase(x, 0));
    sites.iter().enumerate().map(|(x, t)| t * back(x)).sum::<Complex64>() / sites.len() as f64
}

pub(crate) struct Prototype {
    pub design: Design,
    pub mapping: Mapping,
}

impl Prototype {
    pub(crate) fn new() -> Self {
        let design = Design::read(&metalith_testing::design("prototype_3x3")).unwrap();
        let rule = PillarRule::new(&design.cell, &design.mapping);
        let mapping = Mapping::new(|u| rule.width_nm(u));
        Self { design, mapping }
    }

    pub(crate) fn neighbours(&self, wavelength_um: f64, sines: [f64; 2]) -> NeighbourTable {
        let spec = NeighbourTableSpec { wavelength_um, sines };
        let stack = self.design.cell_stack().unwrap();
        NeighbourTable::obtain(&spec, &stack, std::slice::from_ref(&self.mapping), None, &Silent).unwrap()
    }

    /// Rows of an element that is steered by these angles along x and y, in light from where it looks.
    pub(crate) fn misfits(&self, wavelength_nm: f64, steered_deg: [f64; 2]) -> Misfits {
        let um = wavelength_nm * 1e-3;
        // Steered towards -x and -y, so that light arrives from the other side as tables have it.
        let [sin_x, sin_y] = steered_deg.map(|deg| -deg.to_radians().sin());
        let wedge = Wedge {
            wavelength_um: 0.55,
            sin_x,
            sin_y,
        };
        let sines = [sin_x, sin_y].map(|sine| -sine * um / wedge.wavelength_um);
        let along_normal = steered_deg == [0.0; 2];
        let stack = self.design.cell_stack().unwrap();
        let coarse = CoarseCell::new(&stack, um, self.mapping.range_nm()).unwrap();
        let full = coarse.full_transmission().unwrap();
        let equal = PointwiseCell::new(stack.clone(), self.design.cell.widths_nm());
        let widest = self.design.cell.pitch_nm.nm() as u16;
        let normal = equal.transmissions(um, widest).unwrap();
        let oblique = if along_normal {
            [normal.clone(), normal.clone()]
        } else {
            let light = Illumination::from_direction(um, sines).oblique();
            match equal.response(&light, widest, &Silent).unwrap() {
                CellResponse::Jones(JonesTables::Oblique(tables)) => tables.kept,
                other => panic!("{other:?}"),
            }
        };
        let normal = [normal.clone(), normal];
        let table = self.neighbours(um, sines);

        let rule = PillarRule::new(&self.design.cell, &self.design.mapping);
        let mut rows = Vec::new();
        let mut first: [Vec<[Complex64; 2]>; 3] = Default::default();
        let directions = RealRow::directions([sin_x, sin_y]);
        let lens = LensPhase::new(
            self.design.lattice(),
            self.design.lens.diameter_nm,
            &self.design.lens.phase,
        );
        let phase = ElementPhase::new(&lens, &wedge);
        let turns = |radius: f64, direction: [i32; 2], pillars: usize| phase.row(radius, direction, pillars);
        let all = ElementRow::of_element(SiteGrid::SQUARE, &RADII_UM, &directions, turns, |u| {
            f64::from(rule.width_nm(u))
        });
        assert_eq!(all.len(), RADII_UM.len() * directions.len(), "rows within the lens");
        for ElementRow { radius_um, turns, row } in all {
            let direction = row.direction;
            let row = row.solve(&coarse, sines).unwrap();
            let single = |t: &[Vec<Complex64>; 2]| -> [Vec<Complex64>; 2] {
                t.clone()
                    .map(|t| row.widths_nm.iter().map(|w| t[*w as usize]).collect())
            };
            let (oblique, neighbours) = (single(&oblique), table.sites(&row.lattice, &row.widths_nm, full));
            for (amplitudes, found) in first.iter_mut().zip([&oblique, &neighbours, row.transmitted()]) {
                amplitudes.push(row.first_order(found, &turns));
            }
            rows.push(RowMisfit {
                radius_um,
                direction,
                normal: row.misfit(&single(&normal)),
                oblique: row.misfit(&oblique),
                neighbours: row.misfit(&neighbours),
            });
        }
        Misfits {
            left_out: table.left_out(),
            first: first.map(|amplitudes| ElementRow::share(&amplitudes)),
            rows,
        }
    }
}
