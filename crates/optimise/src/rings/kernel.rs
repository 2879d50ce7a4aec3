//! The field that one ring of unit transmission makes on the axis, or near it.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::rings::sites::Rings;
use metalith_wave::kernels::Bessel;

/// Field of the rings of one lens in air, at one wavelength and distance, for a unit wave along the axis.
///
/// Rayleigh-Sommerfeld, point samples of weight pitch^2:
/// U(P) = sum over sites of p^2 (z / (2 pi R^2)) (1/R - i k) exp(i k R), exp(-i w t), with the phase
/// k z common to all left out.
#[derive(Clone, Copy, Debug)]
pub struct RingField<'r> {
    rings: &'r Rings,
    wavenumber: f64,
    distance_um: f64,
}

impl<'r> RingField<'r> {
    /// The field at a distance `distance_um` behind the lens.
    pub fn new(rings: &'r Rings, wavelength_um: f64, distance_um: f64) -> Self {
        Self {
            rings,
            wavenumber: TAU / wavelength_um,
            distance_um,
        }
    }

    /// Field on the axis of one ring of unit transmission.
    pub fn on_axis(&self, ring: usize) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for node in self.rings.nodes(ring) {
            sum += node.weight * self.point(node.radius_um * node.radius_um);
        }
        sum
    }

    /// Field on the axis of a ring for what each neighbour of its sites adds to their transmission, of one of each link of the
    /// ring ([`crate::Links::of_ring`]).
    pub fn on_axis_by_link(&self, ring: usize) -> impl Iterator<Item = Complex64> {
        let nodes = self.rings.nodes(ring).iter();
        let points: Vec<_> = nodes.map(|node| self.point(node.radius_um * node.radius_um)).collect();
        let links = self.rings.links();
        links.all()[links.of_ring(ring)].iter().map(move |link| {
            let each = points.iter().zip(link.weights);
            each.map(|(point, weight)| point * weight).sum()
        })
    }

    /// Largest field on the axis: every site in phase.
    pub fn matched(&self) -> f64 {
        (0..self.rings.len())
            .flat_map(|ring| self.rings.nodes(ring))
            .map(|node| node.weight * self.point(node.radius_um * node.radius_um).norm())
            .sum()
    }

    /// Field of one ring at a distance `rho_um` from the axis, averaged around it.
    ///
    /// With Q^2 = r^2 + rho^2 + z^2 the path to a site is Q - (r rho / Q) cos a - (r rho)^2 / (4 Q^3) (1 + cos 2a)
    /// but for (r rho)^3 / (2 Q^5) and less; the average over the angle a is a series of Bessel functions
    /// (Jacobi, Anger), of which two terms are kept; 1 / R^2 changes by 2 r rho cos a / Q^2. What is left out is below 0.01 rad for rho < 40 um at
    /// NA 0.2, and below 0.1 rad for rho < 80 um.
    pub fn at_radius(&self, ring: usize, rho_um: f64, bessel: &Bessel) -> Complex64 {
        let (rho2, distance2) = (rho_um * rho_um, self.distance_um * self.distance_um);
        let mut sum = Complex64::ZERO;
        for node in self.rings.nodes(ring) {
            let r2 = node.radius_um * node.radius_um;
            let q = (r2 + rho2 + distance2).sqrt();
            let linear = self.wavenumber * node.radius_um * rho_um / q;
            let quadratic = self.wavenumber * r2 * rho2 / (4.0 * q * q * q);
            let (j0, j1) = bessel.j0_j1(linear);
            let j2 = if linear < 1e-3 {
                linear * linear / 8.0
            } else {
                2.0 * j1 / linear - j0
            };
            let (b0, b1) = bessel.j0_j1(quadratic);
            let nearer = 2.0 * node.radius_um * rho_um / (q * q);
            let around = Complex64::new(b0 * j0, 2.0 * b1 * j2 - nearer * j1) * Complex64::cis(-quadratic);
            sum += node.weight * self.point(r2 + rho2) * around;
        }
        sum
    }

    /// Bessel functions for [`RingField::at_radius`], of all rings out to `farthest_um` from the axis.
    pub fn bessel(&self, farthest_um: f64) -> Bessel {
        Bessel::up_to(self.largest_argument(farthest_um))
    }

    /// k r rho / Q of [`RingField::at_radius`], which grows with both radii, at the end of the outermost ring: its nodes reach
    /// beyond the edge of the lens. The argument of the other term is at most an eighth of it.
    fn largest_argument(&self, farthest_um: f64) -> f64 {
        let edge_um = self.rings.len() as f64 * self.rings.lattice().pitch_um();
        let q = (edge_um * edge_um + farthest_um * farthest_um + self.distance_um * self.distance_um).sqrt();
        self.wavenumber * edge_um * farthest_um / q
    }

    /// Field of a single site at a squared lateral distance (um^2).
    pub fn point(&self, lateral2_um2: f64) -> Complex64 {
        let r2 = lateral2_um2 + self.distance_um * self.distance_um;
        let r = r2.sqrt();
        let path = lateral2_um2 / (r + self.distance_um);
        let area = self.rings.lattice().cell_um2();
        area * self.distance_um / (TAU * r2)
            * Complex64::new(1.0 / r, -self.wavenumber)
            * Complex64::cis(self.wavenumber * path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::{Lattice, LatticeKind};

    const KINDS: [LatticeKind; 2] = [LatticeKind::Square, LatticeKind::Hexagonal];

    fn rings(kind: LatticeKind, diameter_nm: u32) -> Rings {
        let lattice = Lattice::of_kind_covering(kind, diameter_nm, 350).unwrap();
        Rings::new(lattice, diameter_nm).unwrap()
    }

    /// Rayleigh-Sommerfeld over all sites of the real lattice, on the axis and off it.
    fn brute_force(rings: &Rings, phase: impl Fn(usize) -> f64, wavelength: f64, z: f64, at: (f64, f64)) -> Complex64 {
        let (lattice, k) = (rings.lattice(), TAU / wavelength);
        let mut sum = Complex64::ZERO;
        for ix in 0..lattice.sites() {
            for iy in 0..lattice.sites() {
                let Some(ring) = rings.ring_at(ix, iy) else { continue };
                let (x, y) = (lattice.place_um(0, ix) - at.0, lattice.place_um(1, iy) - at.1);
                let lateral2 = x * x + y * y;
                let r = (lateral2 + z * z).sqrt();
                let path = k * (lateral2 / (r + z)) + phase(ring);
                sum += z / (TAU * r * r) * Complex64::new(1.0 / r, -k) * Complex64::cis(path);
            }
        }
        sum * lattice.cell_um2()
    }

    #[test]
    fn on_the_axis_it_is_the_sum_over_all_sites() {
        /// The nodes err by 1e-9 of a ring; more would be a fault.
        const TOLERANCE: f64 = 1e-8;
        let cases = KINDS.map(|kind| [(kind, 0.4, 480.0), (kind, 0.7, 300.0)]);
        for (kind, wavelength, z) in cases.into_iter().flatten() {
            let rings = rings(kind, 200_000);
            let field = RingField::new(&rings, wavelength, z);
            let phase = |ring: usize| (ring * ring) as f64 * 0.37;
            let quick = (0..rings.len())
                .map(|k| field.on_axis(k) * Complex64::cis(phase(k)))
                .sum::<Complex64>();
            let exact = brute_force(&rings, phase, wavelength, z, (0.0, 0.0));
            let error = (quick - exact).norm() / field.matched();
            assert!(error < TOLERANCE, "{wavelength}: {error:e}");
        }
    }

    #[test]
    fn near_the_axis_it_is_the_average_around_it() {
        /// Tolerance as a share of the matched peak: where the series for the path ends.
        const TOLERANCE: f64 = 2e-5;
        /// Angles within a half turn that the brute force is averaged over, which leaves either lattice alike.
        const ANGLES: u32 = 24;
        let (wavelength, z) = (0.5, 240.0);
        let rings = KINDS.map(|kind| rings(kind, 100_000));
        for (rings, rho) in rings.iter().flat_map(|rings| [0.0, 1.3, 7.0].map(|rho| (rings, rho))) {
            let field = RingField::new(rings, wavelength, z);
            let bessel = field.bessel(rho);
            let phase = |ring: usize| -TAU / 0.55 * (rings.middle_um(ring).hypot(z) - z);
            let quick = (0..rings.len())
                .map(|k| field.at_radius(k, rho, &bessel) * Complex64::cis(phase(k)))
                .sum::<Complex64>();
            let exact = (0..ANGLES)
                .map(|i| std::f64::consts::PI * (f64::from(i) + 0.3) / f64::from(ANGLES))
                .map(|a| brute_force(rings, phase, wavelength, z, (rho * a.cos(), rho * a.sin())))
                .sum::<Complex64>()
                / f64::from(ANGLES);
            let error = (quick - exact).norm() / field.matched();
            assert!(error < TOLERANCE, "{rho} um: {error:e}");
        }
    }

    #[test]
    fn the_table_ends_where_the_outermost_ring_needs_it() {
        /// Far beyond all that is asked for here.
        const AMPLE: f64 = 2000.0;
        let ample = Bessel::up_to(AMPLE);
        for (diameter_nm, wavelength, z, rho) in [(100_000, 0.5, 240.0, 7.0), (100_000, 0.5, 5.0, 60.0)] {
            let rings = rings(LatticeKind::Square, diameter_nm);
            let field = RingField::new(&rings, wavelength, z);
            let bessel = field.bessel(rho);
            for ring in 0..rings.len() {
                assert_eq!(field.at_radius(ring, rho, &bessel), field.at_radius(ring, rho, &ample));
            }
            // However near the lens is: sines end at one.
            assert!(field.largest_argument(rho) < TAU / wavelength * rho);
        }
    }
}
