//! Transmission of a pillar by the coupled model at a wavelength between the wavelengths that have tables.
//!
//! Tables of neighbours cost minutes, and a band has dozens of wavelengths. Between two that have a table the phase of a pillar
//! runs on as k P(w), where the path P changes slowly with the wavelength, and what is left changes slowly too:
//!
//! t(l) = sum over the two tables i of L_i(l) t_i exp(2 pi i (P(w, l) / l - P_i(w) / l_i)),
//!
//! L_i the linear weights of the wavelength l between l_1 and l_2, P(w, l) the parabola through the paths P_i(w) of the
//! pillar among its typical neighbours at the three tables about l. Beyond the outermost tables paths go on straight, and
//! the power changes as that of equal neighbours does: parabolas run away there.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::{CellStack, NEIGHBOUR_DEGREE, NEIGHBOURS, NeighbourResponse, SiteResponse};
use metalith_core::{Result, lagrange_weight};

/// A wavelength that has a table, s and p as one.
#[derive(Clone, Debug)]
pub struct BandNode {
    wavelength_um: f64,
    /// Mean of s and p: the amplitude that both send into an order together. What they differ by is left out.
    response: NeighbourResponse,
    /// Optical path through a pillar by its width in whole nm (um), but for a number of turns that is common to all.
    path_um: Vec<f64>,
}

impl BandNode {
    /// Node from responses for s and p of pillars on this stack; `around` are the widths (nm) that typically stand
    /// around a pillar of a width (nm), in the order of [`NEIGHBOURS`](crate::NEIGHBOURS).
    ///
    /// # Errors
    /// If the wavelength is outside the range of a material.
    pub fn new(
        wavelength_um: f64,
        both: &[NeighbourResponse; 2],
        stack: &CellStack,
        around: impl Fn(f64) -> [f64; NEIGHBOURS.len()],
    ) -> Result<Self> {
        let mut response = both[0].clone();
        for (to, other) in response.weights.iter_mut().zip(&both[1].weights) {
            *to = 0.5 * (*to + other);
        }
        let (narrowest, widest) = response.basis.range_nm();
        // The mean permittivity tells the turns of a narrow pillar to much less than a half.
        let fill = (narrowest / stack.pitch_nm).powi(2);
        let [film, ambient] = [stack.film.index(wavelength_um)?, stack.ambient.index(wavelength_um)?];
        let mean = (film * film * fill + ambient * ambient * (1.0 - fill)).sqrt().re;
        let mut phase = TAU * mean * stack.height_nm * 1e-3 / wavelength_um;
        let path_um = (0..=widest.ceil() as usize)
            .map(|nm| {
                let width = (nm as f64).clamp(narrowest, widest);
                let found = response.among(width, &around(width)).arg();
                phase = found + TAU * ((phase - found) / TAU).round();
                phase * wavelength_um / TAU
            })
            .collect();
        Ok(Self {
            wavelength_um,
            response,
            path_um,
        })
    }
}

/// The response of a band at one wavelength.
#[derive(Clone, Debug)]
pub struct BandResponse {
    /// Parts, at least one; all have the same terms, since the tables of a cell are for the same widths.
    parts: Vec<BandPart>,
}

/// Contribution of the table of a wavelength.
#[derive(Clone, Debug)]
struct BandPart {
    response: NeighbourResponse,
    /// Weights by own width in whole nm.
    weight: Vec<Complex64>,
}

impl BandResponse {
    /// Response at a wavelength (um), from the nodes of the band in rising order; `None` if there are none. The
    /// amplitudes of tables are multiplied by `scale`.
    pub fn at(nodes: &[BandNode], wavelength_um: f64, scale: f64) -> Option<Self> {
        let after = nodes.partition_point(|n| n.wavelength_um <= wavelength_um);
        let low = after.clamp(1, nodes.len().saturating_sub(1).max(1)) - 1;
        let near = nodes.get(low..(low + 2).min(nodes.len())).filter(|n| !n.is_empty())?;
        let share = match near {
            [a, b] => (wavelength_um - a.wavelength_um) / (b.wavelength_um - a.wavelength_um),
            _ => 0.0,
        };
        let of_path = if (0.0..=1.0).contains(&share) {
            let from = low.min(nodes.len().saturating_sub(3));
            &nodes[from..(from + 3).min(nodes.len())]
        } else {
            near
        };
        let course = lagrange(of_path, wavelength_um);
        let path_um = |nm: usize| -> f64 { of_path.iter().zip(&course).map(|(n, l)| l * n.path_um[nm]).sum() };
        let inside = share.clamp(0.0, 1.0);
        let parts = near.iter().zip([1.0 - inside, inside]).filter(|(_, l)| *l > 0.0);
        let part = |(node, linear): (&BandNode, f64)| BandPart {
            response: node.response.clone(),
            weight: (0..node.path_um.len())
                .map(|nm| {
                    let turns = path_um(nm) / wavelength_um - node.path_um[nm] / node.wavelength_um;
                    Complex64::cis(TAU * turns) * (linear * scale)
                })
                .collect(),
        };
        Some(Self {
            parts: parts.map(part).collect(),
        })
    }

    fn sum(&self, own_nm: f64, of: impl Fn(&NeighbourResponse) -> Complex64) -> Complex64 {
        let weighed = |part: &BandPart| {
            let last = part.weight.len() - 1;
            part.weight[(own_nm.round() as usize).min(last)] * of(&part.response)
        };
        self.parts.iter().map(weighed).sum()
    }
}

/// Weights of the values at these wavelengths in the polynomial through them.
fn lagrange(nodes: &[BandNode], wavelength_um: f64) -> Vec<f64> {
    let of = |i: usize| {
        let others = nodes.iter().enumerate().filter(|(j, _)| *j != i);
        let others = others.map(|(_, other)| other.wavelength_um);
        lagrange_weight(wavelength_um, nodes[i].wavelength_um, others)
    };
    (0..nodes.len()).map(of).collect()
}

impl SiteResponse for BandResponse {
    fn own(&self, width_nm: f64) -> Complex64 {
        self.sum(width_nm, |r| r.own(width_nm))
    }

    fn pair(&self, number: usize, own_nm: f64, neighbour_nm: f64) -> Complex64 {
        self.sum(own_nm, |r| r.pair(number, own_nm, neighbour_nm))
    }

    fn pair_factors(&self, number: usize, own_nm: f64) -> [Complex64; NEIGHBOUR_DEGREE] {
        std::array::from_fn(|b| self.sum(own_nm, |r| r.pair_factors(number, own_nm)[b]))
    }

    fn neighbour_factors(&self, neighbour_nm: f64) -> [f64; NEIGHBOUR_DEGREE] {
        self.parts[0].response.neighbour_factors(neighbour_nm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NEIGHBOUR_TERMS, NeighbourBasis};

    /// Double precision, and a polynomial of degree 12 for a phase that it follows nearly.
    const CLOSE: f64 = 1e-3;

    /// Pillars of a path that is linear in width and wavelength, neighbours without effect.
    fn node(wavelength_um: f64) -> BandNode {
        let basis = NeighbourBasis::new((100..=290).map(f64::from));
        let wanted = |w: f64| Complex64::cis(TAU * path_um(w, wavelength_um) / wavelength_um);
        // The weights of Chebyshev's polynomials by their orthogonality at the zeros of a high one.
        let count = 200;
        let weight = |k: usize| -> Complex64 {
            let sum: Complex64 = (0..count)
                .map(|j| {
                    let angle = std::f64::consts::PI * (f64::from(j) + 0.5) / f64::from(count);
                    let w = 195.0 + 95.0 * angle.cos();
                    wanted(w) * (k as f64 * angle).cos()
                })
                .sum();
            sum * (if k == 0 { 1.0 } else { 2.0 } / f64::from(count))
        };
        let mut weights = vec![Complex64::ZERO; NEIGHBOUR_TERMS];
        weights[..13].iter_mut().enumerate().for_each(|(k, w)| *w = weight(k));
        let both = [0, 1].map(|_| NeighbourResponse {
            basis,
            weights: weights.clone(),
        });
        BandNode::new(wavelength_um, &both, &CellStack::paper(350.0, 700.0).unwrap(), |w| {
            [w; 12]
        })
        .unwrap()
    }

    fn path_um(width_nm: f64, wavelength_um: f64) -> f64 {
        0.75 + 0.0025 * (width_nm - 100.0) * (1.3 - wavelength_um / 2.0)
    }

    #[test]
    fn paths_that_are_straight_come_back_between_and_beyond_the_tables() {
        let nodes = [0.455, 0.53, 0.66].map(node);
        for um in [0.41, 0.455, 0.49, 0.53, 0.6, 0.66, 0.69] {
            let found = BandResponse::at(&nodes, um, 0.5).unwrap();
            for width in [100.0, 151.0, 220.0, 290.0] {
                let wanted = 0.5 * Complex64::cis(TAU * path_um(width, um) / um);
                let own = found.own(width);
                assert!((own - wanted).norm() < CLOSE, "{um} {width}: {own} {wanted}");
                assert_eq!(found.pair(3, width, 140.0), Complex64::ZERO);
            }
        }
    }

    #[test]
    fn one_table_serves_its_surroundings_and_none_nothing() {
        assert!(BandResponse::at(&[], 0.5, 1.0).is_none());
        let nodes = [node(0.53)];
        let [at, beside] = [0.53, 0.54].map(|um| BandResponse::at(&nodes, um, 1.0).unwrap().own(200.0));
        assert!((at - nodes[0].response.own(200.0)).norm() < CLOSE);
        assert!((at.norm() - beside.norm()).abs() < CLOSE && (at - beside).norm() > CLOSE);
    }
}
