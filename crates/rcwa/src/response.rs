//! Results of a solution: the zeroth order as a matrix, the power of every order.

use num_complex::Complex64;

use super::{Error, Result};
use super::{Incidence, LayerStack, Orders, Part, Problem, solve};

/// Response of a stack to a plane wave.
///
/// The unit vectors: s lies in the plane of the lattice, p has its transverse part along the transverse
/// wave vector (at normal incidence from azimuth 0, p is x and s is y). Fields along p are amplitudes
/// along its unit vector, which leans in an oblique wave, not their transverse part.
#[derive(Clone, Debug)]
pub struct Response {
    /// Zero order at the far side: `transmission[out][in]`, 0 for s and 1 for p; field ratios.
    pub transmission: [[Complex64; 2]; 2],
    /// Jones matrix of the transverse fields along the axes: `jones[out][in]`, 0 for x and 1 for y; ratios of the parts
    /// of the field that lie in the plane of the lattice, whatever the angle. [`circular`](crate::circular) has it in
    /// circular polarisation.
    pub jones: [[Complex64; 2]; 2],
    /// Zero order that returns, alike. A reflected p has its transverse part where the incident has it.
    pub reflection: [[Complex64; 2]; 2],
    /// All orders that propagate on either side.
    pub orders: Vec<DiffractionOrder>,
}

/// Power of one order over the incident power, for s and p incident.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffractionOrder {
    /// Order along x and y; of staggered rows, by their rectangle of one pitch by two rows.
    pub order: [i32; 2],
    /// Power that goes on, for s and p incident.
    pub transmitted: [f64; 2],
    /// Power that returns.
    pub reflected: [f64; 2],
}

impl Response {
    /// Power of all orders on both sides over the incident, for s and p incident: 1 without loss.
    pub fn total_power(&self) -> [f64; 2] {
        [0, 1].map(|pol| self.orders.iter().map(|o| o.transmitted[pol] + o.reflected[pol]).sum())
    }

    /// Power of the transmitted zero order over the incident, for s and p incident.
    pub fn zero_order(&self) -> [f64; 2] {
        self.orders
            .iter()
            .find(|o| o.order == [0, 0])
            .map_or([0.0; 2], |o| o.transmitted)
    }

    pub(super) fn new(problem: &Problem, incidence: &Incidence, parts: Vec<Part>) -> Result<Self> {
        let kept = problem.stack.kept(problem.orders);
        let [x, y] = kept.reach().map(|order| order as i32);
        let fields = Fields::new(problem, incidence, &parts);
        let mut orders = Vec::new();
        for m in -x..=x {
            for n in (-y..=y).filter(|&n| kept.has([m, n])) {
                orders.extend(fields.order(m, n)?);
            }
        }
        let [transmission, reflection] = fields.zero_order()?;
        Ok(Self {
            transmission,
            jones: fields.jones()?,
            reflection,
            orders,
        })
    }
}

/// Plane-wave amplitudes for s and p incident.
struct Fields<'a> {
    problem: &'a Problem,
    parts: &'a [Part],
    /// Transverse unit vectors of s and p.
    polarisation: [[f64; 2]; 2],
}

impl<'a> Fields<'a> {
    fn new(problem: &'a Problem, incidence: &Incidence, parts: &'a [Part]) -> Self {
        let [x, y] = incidence.direction();
        Self {
            problem,
            parts,
            polarisation: [[-y, x], [x, y]],
        }
    }

    /// Transmission of the zero order along x and y.
    fn jones(&self) -> Result<[[Complex64; 2]; 2]> {
        let mut jones = [[Complex64::ZERO; 2]; 2];
        for (input, unit) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
            let [transmitted, _] = self.amplitudes(unit, 0, 0);
            for output in [0, 1] {
                jones[output][input] = finite(transmitted[output])?;
            }
        }
        Ok(jones)
    }

    /// Transverse amplitudes [transmitted, reflected] of an order, for this transverse field that arrives.
    fn amplitudes(&self, wanted: [f64; 2], m: i32, n: i32) -> [[Complex64; 2]; 2] {
        let mut sum = [[Complex64::ZERO; 2]; 2];
        for part in self.parts {
            for (column, incident) in part.incident.iter().enumerate() {
                let weight = incident[0] * wanted[0] + incident[1] * wanted[1];
                for (total, field) in sum.iter_mut().zip([&part.ends.transmitted, &part.ends.reflected]) {
                    let amplitude = part.amplitude(field, column, m, n);
                    total[0] += weight * amplitude[0];
                    total[1] += weight * amplitude[1];
                }
            }
        }
        sum
    }

    fn wave_vector(&self, m: i32, n: i32) -> [f64; 2] {
        let Problem { k, steps, .. } = self.problem;
        [k[0] + f64::from(m) * steps[0], k[1] + f64::from(n) * steps[1]]
    }

    fn order(&self, m: i32, n: i32) -> Result<Option<DiffractionOrder>> {
        let k = self.wave_vector(m, n);
        let square = k[0] * k[0] + k[1] * k[1];
        let media = [self.problem.stack.above, self.problem.stack.below];
        if media
            .iter()
            .all(|index| (index * index).re <= square && (m, n) != (0, 0))
        {
            return Ok(None);
        }
        let mut power = [[0.0; 2]; 2];
        let below = self.problem.stack.below;
        for polarisation in [0, 1] {
            let incident = flux(
                below,
                self.problem.k,
                self.polarisation[polarisation].map(Complex64::from),
            );
            let both = self.amplitudes(self.polarisation[polarisation], m, n);
            for side in [0, 1] {
                power[side][polarisation] = finite(Complex64::from(flux(media[side], k, both[side]) / incident))?.re;
            }
        }
        Ok(Some(DiffractionOrder {
            order: [m, n],
            transmitted: power[0],
            reflected: power[1],
        }))
    }

    /// Transmission and reflection of the zero order in s and p.
    fn zero_order(&self) -> Result<[[[Complex64; 2]; 2]; 2]> {
        let k = self.problem.k;
        let square = k[0] * k[0] + k[1] * k[1];
        let cosine = |index: Complex64| (1.0 - square / (index * index)).sqrt();
        let arriving = cosine(self.problem.stack.below);
        let mut result = [[[Complex64::ZERO; 2]; 2]; 2];
        for (side, index) in [self.problem.stack.above, self.problem.stack.below]
            .into_iter()
            .enumerate()
        {
            let leaving = cosine(index);
            for input in [0, 1] {
                let field = self.amplitudes(self.polarisation[input], 0, 0)[side];
                for output in [0, 1] {
                    let unit = self.polarisation[output];
                    let mut ratio = field[0] * unit[0] + field[1] * unit[1];
                    if input == 1 {
                        ratio *= arriving;
                    }
                    if output == 1 {
                        ratio /= leaving;
                    }
                    result[side][output][input] = finite(ratio)?;
                }
            }
        }
        Ok(result)
    }
}

/// Power flux along z of a plane wave with transverse amplitude `e` and wave vector `k` over k0.
pub(super) fn flux(index: Complex64, k: [f64; 2], e: [Complex64; 2]) -> f64 {
    let permittivity = index * index;
    if permittivity.im == 0.0 && permittivity.re <= k[0] * k[0] + k[1] * k[1] {
        return 0.0;
    }
    let gamma = (permittivity - k[0] * k[0] - k[1] * k[1]).sqrt();
    if gamma.norm() < 1e-9 {
        return 0.0;
    }
    let g = [
        (e[0] * (permittivity - k[1] * k[1]) + e[1] * (k[0] * k[1])) / gamma,
        (e[0] * (k[0] * k[1]) + e[1] * (permittivity - k[0] * k[0])) / gamma,
    ];
    (e[0] * g[0].conj() + e[1] * g[1].conj()).re
}

/// No number leaves the solver that is not one.
pub(super) fn finite(value: Complex64) -> Result<Complex64> {
    if value.re.is_finite() && value.im.is_finite() {
        Ok(value)
    } else {
        Err(Error::Cutoff)
    }
}

/// Outcome of [`converge`].
#[derive(Clone, Debug)]
pub struct Convergence {
    /// The answer with the most orders.
    pub response: Response,
    /// Orders along an axis it was made with.
    pub orders: Orders,
    /// Largest change of an entry of the transmission in the last step.
    pub change: f64,
    /// True if the change was within the tolerance.
    pub converged: bool,
}

/// Doubles the highest order until the zero-order transmission changes by no more than `tolerance`,
/// or `most` orders are reached.
///
/// # Errors
/// As [`solve`].
pub fn converge(stack: &LayerStack, incidence: &Incidence, tolerance: f64, most: Orders) -> Result<Convergence> {
    let mut highest = 3;
    let mut last: Option<Response> = None;
    loop {
        let orders = Orders::new((2 * highest + 1).min(most.along_axis()))?;
        let response = solve(stack, incidence, orders)?;
        let change = last.map_or(f64::INFINITY, |last| {
            let pairs = response
                .transmission
                .iter()
                .flatten()
                .zip(last.transmission.iter().flatten());
            pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
        });
        let converged = change <= tolerance;
        if converged || orders >= most {
            return Ok(Convergence {
                response,
                orders,
                change,
                converged,
            });
        }
        last = Some(response);
        highest *= 2;
    }
}
