//! Rows of real pillars of `designs/prototype_3x3.toml`, whose optimised phase jumps from ring to ring, and how far models
//! of single sites are from the supercells of these rows.

use metalith_cell::{CellModel, PointwiseCell};
use metalith_core::{Silent, Wedge};
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_design::{Design, WidthRule};
use metalith_grating::{CoarseCell, Mapping, NeighbourTable, NeighbourTableSpec, RealRow};

/// Pillars of a row along x, where a mirror plane halves the unknowns, and of others.
const PILLARS: usize = 20;
const PILLARS_ACROSS: usize = 12;

/// Where rows begin, from the middle of the element (um).
pub const RADII_UM: [f64; 4] = [60.0, 180.0, 300.0, 440.0];

/// Directions away from the middle: of a centre element, whose axes are all alike, and of one that is steered along x.
const CENTRE: [[i32; 2]; 2] = [[1, 0], [1, 1]];
const STEERED: [[i32; 2]; 3] = [[1, 0], [-1, 0], [0, 1]];

/// Share of the light that models put elsewhere than the supercell of a row, mean of s and p.
pub struct RowMisfit {
    pub radius_um: f64,
    pub direction: [i32; 2],
    /// Equal neighbours, lit along the normal.
    pub normal: f64,
    /// Equal neighbours, lit as the row is.
    pub as_lit: f64,
    /// The neighbours that there are.
    pub neighbours: f64,
}

/// Rows of one light, and what the table of neighbours leaves of supercells that it was not fitted to.
pub struct Misfits {
    pub rows: Vec<RowMisfit>,
    pub left_out: f64,
}

impl Misfits {
    /// Mean over the rows: equal neighbours lit along the normal and as the rows are, and those that there are.
    pub fn means(&self) -> [f64; 3] {
        let mean = |of: fn(&RowMisfit) -> f64| self.rows.iter().map(of).sum::<f64>() / self.rows.len() as f64;
        [mean(|r| r.normal), mean(|r| r.as_lit), mean(|r| r.neighbours)]
    }
}

pub struct Prototype {
    pub design: Design,
    pub mapping: Mapping,
}

impl Prototype {
    pub fn new() -> Self {
        let design = Design::read(&metalith_testing::design("prototype_3x3")).unwrap();
        let rule = WidthRule::new(&design.cell, &design.mapping);
        let mapping = Mapping::new(|u| rule.width_nm(u));
        Self { design, mapping }
    }

    pub fn neighbours(&self, wavelength_um: f64, sines: [f64; 2]) -> NeighbourTable {
        let spec = NeighbourTableSpec { wavelength_um, sines };
        let stack = self.design.cell_stack().unwrap();
        NeighbourTable::obtain(&spec, &stack, &self.mapping, None, &Silent).unwrap()
    }

    /// Rows of an element that is steered by this angle along x, in light from where it looks.
    pub fn misfits(&self, wavelength_nm: f64, steered_deg: f64) -> Misfits {
        let um = wavelength_nm * 1e-3;
        // Steered towards -x, so that light arrives from +x as tables have it.
        let wedge = Wedge {
            wavelength_um: 0.55,
            sin_x: -steered_deg.to_radians().sin(),
            sin_y: 0.0,
        };
        let sines = [-wedge.sin_x * um / wedge.wavelength_um, 0.0];
        let stack = self.design.cell_stack().unwrap();
        let coarse = CoarseCell::new(&stack, um, self.mapping.range_nm()).unwrap();
        let full = coarse.full_transmission().unwrap();
        let equal = PointwiseCell::new(stack.clone(), self.design.cell.widths_nm());
        let widest = self.design.cell.pitch_nm as u16;
        let normal = equal.transmissions(um, widest).unwrap();
        let as_lit = if steered_deg == 0.0 {
            [normal.clone(), normal.clone()]
        } else {
            equal.oblique(um, sines, widest).unwrap().unwrap().kept
        };
        let normal = [normal.clone(), normal];
        let table = self.neighbours(um, sines);

        let mut rows = Vec::new();
        for radius_um in RADII_UM {
            let directions: &[_] = if steered_deg == 0.0 { &CENTRE } else { &STEERED };
            for &direction in directions {
                let row = RealRow {
                    direction,
                    widths_nm: self.widths_nm(&wedge, radius_um, direction),
                };
                let row = row.solve(&coarse, sines).unwrap();
                let single = |t: &[Vec<_>; 2]| {
                    let sites = t
                        .clone()
                        .map(|t| row.widths_nm.iter().map(|w| t[*w as usize]).collect());
                    row.misfit(&sites)
                };
                rows.push(RowMisfit {
                    radius_um,
                    direction,
                    normal: single(&normal),
                    as_lit: single(&as_lit),
                    neighbours: row.misfit(&table.sites(&row.lattice, &row.widths_nm, full)),
                });
            }
        }
        Misfits {
            rows,
            left_out: table.left_out(),
        }
    }

    fn widths_nm(&self, wedge: &Wedge, radius_um: f64, direction: [i32; 2]) -> Vec<f64> {
        let lattice = self.design.lattice();
        let lens = LensPhase::new(lattice, self.design.lens.diameter_nm, &self.design.lens.phase);
        let phase = ElementPhase::new(&lens, wedge);
        let rule = WidthRule::new(&self.design.cell, &self.design.mapping);
        let [dx, dy] = direction;
        let steps = radius_um / lattice.pitch_um() / f64::from(dx).hypot(f64::from(dy));
        let middle = lattice.sites() as i32 / 2;
        let [x, y] = direction.map(|d| middle + (steps * f64::from(d)) as i32);
        let pillars = if dy == 0 { PILLARS } else { PILLARS_ACROSS };
        (0..pillars as i32)
            .map(|k| {
                // A diagonal row has a site at every step of x + y.
                let (x, y) = match direction {
                    [1, 1] => (x + (k + 1) / 2, y + k / 2),
                    _ => (x + dx * k, y + dy * k),
                };
                let turns = phase.wrapped(x as usize, y as usize).expect("a site of the lens");
                f64::from(rule.width_nm(turns))
            })
            .collect()
    }
}
