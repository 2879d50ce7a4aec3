#![doc = include_str!("../README.md")]

mod basis;
mod error;
mod jones;
mod layer;
mod material;
mod mode_cache;
mod outline;
mod permittivity;
mod propagate;
mod response;
mod scalar;
mod stack;
mod supercell;

use std::f64::consts::TAU;

use faer::Mat;
use num_complex::Complex64;

use basis::{Family, FieldBasis, Space};
pub use jones::circular;
use layer::Modes;
pub use material::Material;
use mode_cache::{KnownModes, Section};
pub use outline::Outline;
use permittivity::CrossSection;
use propagate::{Ends, propagate_wave};
pub use response::{Convergence, DiffractionOrder, Response, converge};
pub use stack::{CellLattice, Layer, LayerStack, Orders};
pub use supercell::{SiteLattice, SiteLayer, Supercell, SupercellOrder, SupercellResponse, solve_supercell};

pub use error::{Error, Result, TableError};

/// Side that a wave comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// Incidence from below: the substrate of the cell.
    Below,
    /// Incidence from above: the air over the pillars.
    Above,
}

/// A plane wave that arrives at the stack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incidence {
    /// Wavelength in vacuum (um).
    pub wavelength_um: f64,
    /// Half-space it comes from.
    pub side: Side,
    /// Components of the wave vector along x and y over that in vacuum: the sines of the angles in air.
    pub sines: [f64; 2],
    /// Azimuth of the plane of incidence (rad) where the sines are zero; else their direction counts.
    azimuth: f64,
}

impl Incidence {
    /// Along the normal, p along x and s along y.
    pub fn normal(wavelength_um: f64, side: Side) -> Self {
        Self {
            wavelength_um,
            side,
            sines: [0.0, 0.0],
            azimuth: 0.0,
        }
    }

    /// Wave at an angle measured in air, the plane of incidence at an azimuth from x (rad).
    pub fn in_air(wavelength_um: f64, side: Side, theta: f64, azimuth: f64) -> Self {
        let sin = theta.sin();
        Self {
            azimuth,
            ..Self::of_sines(wavelength_um, side, [sin * azimuth.cos(), sin * azimuth.sin()])
        }
    }

    /// Wave with these sines: the components of the wave vector along x and y over the wave number in vacuum.
    pub fn of_sines(wavelength_um: f64, side: Side, sines: [f64; 2]) -> Self {
        Self {
            wavelength_um,
            side,
            sines: sines.map(|v| if v.abs() < ALONG_AXIS { 0.0 } else { v }),
            azimuth: 0.0,
        }
    }

    /// Unit vector of the plane of incidence.
    fn direction(&self) -> [f64; 2] {
        let [x, y] = self.sines;
        let length = x.hypot(y);
        if length > 0.0 {
            [x / length, y / length]
        } else {
            [self.azimuth.cos(), self.azimuth.sin()]
        }
    }

    fn check(&self) -> Result<()> {
        if !(self.wavelength_um.is_finite() && self.wavelength_um > 0.0) {
            return Err(Error::Wavelength {
                wavelength_um: self.wavelength_um,
            });
        }
        if !self.sines.iter().all(|s| s.is_finite()) {
            return Err(Error::Angle);
        }
        Ok(())
    }

    /// Refuses a wave that does not travel in the medium it comes from.
    fn check_medium(&self, index: Complex64) -> Result<()> {
        let sine = self.sines[0].hypot(self.sines[1]);
        if index.im != 0.0 || sine >= index.re {
            return Err(Error::NoIncidentWave { sine, index });
        }
        Ok(())
    }
}

/// Sines below this are zero: so close to an axis of symmetry the modes come in pairs of equal constants,
/// and their vectors lose half their digits. The field changes by about as much as the sine.
const ALONG_AXIS: f64 = 1e-6;

/// Largest number of unknown field components; a complex matrix of this size takes half a gigabyte.
const MOST_UNKNOWNS: usize = 6000;

/// Everything known of how the stack answers a plane wave.
///
/// At normal incidence, and where the plane of incidence is along an axis, only fields of the symmetry
/// of the incident one are solved for: matrices a quarter or half as wide. Of rotated rectangles half a turn is the symmetry,
/// along the normal.
///
/// # Errors
/// If a number of the stack or the incidence is not physical, the incident wave does not propagate in
/// a medium without loss, or the problem is too large.
pub fn solve(stack: &LayerStack, incidence: &Incidence, orders: Orders) -> Result<Response> {
    solve_with(stack, incidence, orders, true, &mut KnownModes::default())
}

/// The answers of several stacks. Those after one another that differ in the heights of their layers alone have their modes in common, which
/// are most of the work; the answers are those of [`solve`].
///
/// # Errors
/// As [`solve`].
pub fn solve_each(stacks: &[LayerStack], incidence: &Incidence, orders: Orders) -> Result<Vec<Response>> {
    let layers = stacks.iter().map(|stack| stack.layers.len()).max();
    let mut known = KnownModes::of_layers(layers.unwrap_or(0));
    let solved = stacks.iter();
    solved
        .map(|stack| solve_with(stack, incidence, orders, true, &mut known))
        .collect()
}

/// Solves without use of symmetry: the slow way, which the fast one is tested against. A wave along the normal is
/// turned off it by a millionth, where the modes still differ.
#[doc(hidden)]
pub fn solve_without_symmetry(stack: &LayerStack, incidence: &Incidence, orders: Orders) -> Result<Response> {
    solve_with(stack, incidence, orders, false, &mut KnownModes::default())
}

fn solve_with(
    stack: &LayerStack,
    incidence: &Incidence,
    orders: Orders,
    symmetric: bool,
    known: &mut KnownModes,
) -> Result<Response> {
    off_cutoff(incidence.wavelength_um, |wavelength_um| {
        let incidence = Incidence {
            wavelength_um,
            ..*incidence
        };
        solve_once(stack, &incidence, orders, symmetric, known)
    })
}

fn solve_once(
    stack: &LayerStack,
    incidence: &Incidence,
    orders: Orders,
    symmetric: bool,
    known: &mut KnownModes,
) -> Result<Response> {
    let mut problem = Problem::new(stack, incidence, orders)?;
    let [kx, ky] = incidence.sines;
    let along_normal = kx == 0.0 && ky == 0.0;
    let unit = [[Complex64::ONE, Complex64::ZERO], [Complex64::ZERO, Complex64::ONE]];
    let mirrored = symmetric && problem.stack.is_mirrored();
    let parts = match (mirrored && kx == 0.0, mirrored && ky == 0.0) {
        (false, false) if symmetric && along_normal && !problem.stack.has_upright() => {
            vec![problem.part(Family::Alike, &unit, known)?]
        }
        (false, false) => {
            if along_normal {
                problem.k[0] = ALONG_AXIS;
            }
            vec![problem.part(Family::Product(Space::Full, Space::Full), &unit, known)?]
        }
        (split_x, split_y) => {
            let space = |split: bool, even: bool| match (split, even) {
                (false, _) => Space::Full,
                (true, true) => Space::Even,
                (true, false) => Space::Odd,
            };
            let family = |even: bool| Family::Product(space(split_x, even), space(split_y, even));
            // A wave polarised along x has Ex even about both axes; along y, Ey is, and Ex is odd.
            let along_x = problem.part(family(true), &unit[..1], known)?;
            let along_y = if split_x && split_y && problem.stack.is_square() {
                along_x.turned()
            } else {
                problem.part(family(false), &unit[1..], known)?
            };
            vec![along_x, along_y]
        }
    };
    Response::new(&problem, incidence, parts)
}

/// Zero-order transmission of a cell along the normal, where it is the same for both polarisations: Ex where the stack ends
/// over the incident Ex where it begins. One polarisation is solved for, the other is alike. Of staggered rows that are
/// not quite a hexagonal lattice, it is the mean of both.
///
/// # Errors
/// As [`solve`]; also if a pillar tells x from y.
pub fn transmit(stack: &LayerStack, wavelength_um: f64, side: Side, orders: Orders) -> Result<Complex64> {
    transmit_with(stack, wavelength_um, side, orders, &mut KnownModes::default())
}

/// The transmissions of several stacks. Those that have layers in common, whatever their heights, have the modes of these in common,
/// which are most of the work; the answers are those of [`transmit`].
///
/// # Errors
/// As [`transmit`].
pub fn transmit_each(stacks: &[LayerStack], wavelength_um: f64, side: Side, orders: Orders) -> Result<Vec<Complex64>> {
    let layers = stacks.iter().map(|stack| stack.layers.len()).max();
    let mut known = KnownModes::of_layers(layers.unwrap_or(0));
    let each = stacks.iter();
    each.map(|stack| transmit_with(stack, wavelength_um, side, orders, &mut known))
        .collect()
}

fn transmit_with(
    stack: &LayerStack,
    wavelength_um: f64,
    side: Side,
    orders: Orders,
    known: &mut KnownModes,
) -> Result<Complex64> {
    stack.check()?;
    let polarisations = match stack.lattice {
        CellLattice::Square if !stack.is_square() => return Err(Error::Polarising),
        CellLattice::Square => 1,
        CellLattice::Staggered { .. } if stack.lattice.is_hexagonal(stack.pitch_nm) => 1,
        CellLattice::Staggered { .. } => 2,
    };
    off_cutoff(wavelength_um, |wavelength_um| {
        let problem = Problem::new(stack, &Incidence::normal(wavelength_um, side), orders)?;
        let mut along = |axis: usize| -> Result<Complex64> {
            let space = [Space::Even, Space::Odd][axis];
            let mut arriving = [Complex64::ZERO; 2];
            arriving[axis] = Complex64::ONE;
            let part = problem.part(Family::Product(space, space), &[arriving], known)?;
            response::finite(part.amplitude(&part.ends.transmitted, 0, 0, 0)[axis])
        };
        match polarisations {
            1 => along(0),
            _ => Ok(0.5 * (along(0)? + along(1)?)),
        }
    })
}

/// Solves beside a cutoff where the wavelength is at one. The field itself is finite: it is the limit of the fields at
/// neighbouring wavelengths, which are tried then.
fn off_cutoff<T>(wavelength_um: f64, mut solve: impl FnMut(f64) -> Result<T>) -> Result<T> {
    /// Relative, the closest that works. What vanishes at the cutoff goes with the root of the distance: 1e-6 of the
    /// answer for the first.
    const BESIDE: [f64; 3] = [1e-12, 1e-10, 1e-8];
    let mut at = |share: f64| solve(wavelength_um * (1.0 + share));
    let first = at(0.0);
    BESIDE.into_iter().fold(first, |found, share| match found {
        Err(Error::Cutoff) => at(share),
        found => found,
    })
}

/// A checked stack with the wave's side below, and the lengths over 1 / k0.
struct Problem {
    stack: LayerStack,
    orders: Orders,
    k: [f64; 2],
    /// Wavelength over the periods along x and y: the vectors of the orders over k0.
    steps: [f64; 2],
    k0_per_nm: f64,
}

/// The fields of one symmetry.
struct Part {
    basis: FieldBasis,
    ends: Ends,
    /// Transverse amplitudes of the incident zero order, for each column.
    incident: Vec<[Complex64; 2]>,
    /// True if x and y are exchanged.
    turned: bool,
}

impl Problem {
    fn new(stack: &LayerStack, incidence: &Incidence, orders: Orders) -> Result<Self> {
        stack.check()?;
        incidence.check()?;
        let stack = match incidence.side {
            Side::Below => stack.clone(),
            Side::Above => stack.flipped(),
        };
        incidence.check_medium(stack.below)?;
        let wavelength_nm = incidence.wavelength_um * 1e3;
        Ok(Self {
            k: incidence.sines,
            steps: stack.steps(wavelength_nm),
            k0_per_nm: TAU / wavelength_nm,
            stack,
            orders,
        })
    }

    fn part(&self, family: Family, incident: &[[Complex64; 2]], known: &mut KnownModes) -> Result<Part> {
        let basis = FieldBasis::new(self.stack.kept(self.orders), family, self.k, self.steps);
        if basis.rows.len() > MOST_UNKNOWNS {
            return Err(Error::TooLarge {
                along_axis: self.orders.along_axis(),
                unknowns: basis.rows.len(),
                most: MOST_UNKNOWNS,
            });
        }
        let layers = self.stack.layers.iter().map(|layer| {
            let section = CrossSection {
                outline: &layer.outline,
                inside: layer.inside * layer.inside,
                outside: layer.outside * layer.outside,
                pitch_nm: self.stack.pitch_nm,
                lattice: self.stack.lattice,
            };
            let place = Section {
                family,
                kept: self.stack.kept(self.orders),
                k: self.k,
                steps: self.steps,
                pitch_nm: section.pitch_nm,
                lattice: section.lattice,
                outline: layer.outline.clone(),
                inside: section.inside,
                outside: section.outside,
            };
            Ok((known.of(place, || Modes::of(&section, &basis))?, layer.height_nm))
        });
        let indices = [self.stack.below, self.stack.above];
        let ends = propagate_wave(&basis.rows, indices, layers, self.k0_per_nm, incident, |component| {
            basis.plane_wave(component, 0, 0)
        })?;
        Ok(Part {
            basis,
            ends,
            incident: incident.to_vec(),
            turned: false,
        })
    }
}

impl Part {
    /// The answer to the same wave polarised along the other axis, of a cell that is alike along both.
    fn turned(&self) -> Self {
        Self {
            basis: self.basis.clone(),
            ends: Ends {
                transmitted: self.ends.transmitted.clone(),
                reflected: self.ends.reflected.clone(),
            },
            incident: self.incident.iter().map(|&[x, y]| [y, x]).collect(),
            turned: !self.turned,
        }
    }

    /// Plane-wave amplitudes along x and y of an order of a field.
    fn amplitude(&self, field: &Mat<Complex64>, column: usize, m: i32, n: i32) -> [Complex64; 2] {
        if self.turned {
            let [x, y] = self.basis.amplitude(field, column, n, m);
            [y, x]
        } else {
            self.basis.amplitude(field, column, m, n)
        }
    }
}
