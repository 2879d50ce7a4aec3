//! The field of a round element, ring by ring.

use metalith_pillars::Lattice;
use num_complex::Complex64;

use super::aperture::sites_inside;
use super::direct_sum::kernel;
use crate::error::{Result, WaveError};

/// Rings of equal transmission about the axis, in light along the axis: the field depends on the distance
/// from the axis alone, and is a sum over rings of the azimuthal mean of the Rayleigh-Sommerfeld kernel.
///
/// The mean is a trapezoidal sum over a period, which converges faster than any power; what is omitted is only that a
/// lattice is not round: nothing on the axis, for [`Hankel::of_lattice`].
#[derive(Clone, Debug)]
pub struct Hankel {
    wavelength_um: f64,
    distance_um: f64,
    radii_um: Vec<f64>,
    areas_um2: Vec<f64>,
}

impl Hankel {
    /// Rings of these radii and areas, seen from `distance_um` behind the pillar tops.
    ///
    /// # Errors
    /// If lengths differ or a number is not positive (a radius may be zero) and finite.
    pub fn new(wavelength_um: f64, distance_um: f64, radii_um: Vec<f64>, areas_um2: Vec<f64>) -> Result<Self> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let good = radii_um.len() == areas_um2.len()
            && positive(wavelength_um)
            && positive(distance_um)
            && radii_um.iter().all(|&r| r == 0.0 || positive(r))
            && areas_um2.iter().all(|&a| positive(a));
        if !good {
            return Err(WaveError::Rings {
                radii: radii_um.len(),
                areas: areas_um2.len(),
            });
        }
        Ok(Self {
            wavelength_um,
            distance_um,
            radii_um,
            areas_um2,
        })
    }

    /// Rings of one width, the first a disc about the axis, as radial designs count them.
    ///
    /// # Errors
    /// As [`Hankel::new`].
    pub fn of_width(wavelength_um: f64, distance_um: f64, ring_um: f64, rings: usize) -> Result<Self> {
        let radii: Vec<f64> = (0..rings).map(|i| (i as f64 + 0.5) * ring_um).collect();
        let areas = radii.iter().map(|r| std::f64::consts::TAU * r * ring_um).collect();
        Self::new(wavelength_um, distance_um, radii, areas)
    }

    /// One ring for each distance from the centre that sites of a lattice have, within a circle, with the
    /// area of its sites.
    ///
    /// # Errors
    /// As [`Hankel::new`].
    pub fn of_lattice(wavelength_um: f64, distance_um: f64, lattice: &Lattice, radius_um: f64) -> Result<Self> {
        let [columns, rows] = lattice.reach();
        // One quadrant: sites at x, y >= 0, each standing for its images.
        let mut rings: Vec<(i64, f64, u32)> = Vec::new();
        for iy in lattice.sites() / 2..rows.end {
            let inside = sites_inside(lattice, radius_um, iy);
            for ix in (lattice.sites() / 2..inside.end.min(columns.end)).filter(|ix| lattice.has(*ix, iy)) {
                let images = [(0, ix), (1, iy)].map(|(axis, i)| if lattice.place_nm(axis, i) == 0.0 { 1 } else { 2 });
                let radius2_nm2 = lattice.radius2_nm2(ix, iy);
                rings.push((lattice.units2(ix, iy), radius2_nm2, images[0] * images[1]));
            }
        }
        rings.sort_by_key(|ring| ring.0);
        rings.dedup_by(|next, kept| {
            let same = next.0 == kept.0;
            kept.2 += if same { next.2 } else { 0 };
            same
        });
        let radii = rings.iter().map(|r| r.1.sqrt() * 1e-3).collect();
        let site = lattice.cell_um2();
        let areas = rings.iter().map(|r| f64::from(r.2) * site).collect();
        Self::new(wavelength_um, distance_um, radii, areas)
    }

    /// Radius of each ring (um).
    pub fn radii_um(&self) -> &[f64] {
        &self.radii_um
    }

    /// Contribution of each ring, transmitting 1, to a point `rho_um` from the axis.
    pub fn kernel(&self, rho_um: f64) -> Vec<Complex64> {
        self.radii_um
            .iter()
            .zip(&self.areas_um2)
            .map(|(&r, &area)| self.mean(r, rho_um) * area)
            .collect()
    }

    /// The field at these distances from the axis, for one transmission a ring.
    ///
    /// # Errors
    /// If there is not one transmission for each ring.
    pub fn field(&self, transmission: &[Complex64], rho_um: &[f64]) -> Result<Vec<Complex64>> {
        Self::check("transmissions", transmission.len(), self.radii_um.len())?;
        Ok(rho_um
            .iter()
            .map(|&rho| self.kernel(rho).iter().zip(transmission).map(|(k, t)| k * t).sum())
            .collect())
    }

    /// The adjoint of [`Hankel::field`]: from one value a point to one value a ring.
    ///
    /// # Errors
    /// If there is not one value for each point.
    pub fn adjoint(&self, values: &[Complex64], rho_um: &[f64]) -> Result<Vec<Complex64>> {
        Self::check("values", values.len(), rho_um.len())?;
        let mut rings = vec![Complex64::ZERO; self.radii_um.len()];
        for (value, &rho) in values.iter().zip(rho_um) {
            for (ring, k) in rings.iter_mut().zip(self.kernel(rho)) {
                *ring += k.conj() * value;
            }
        }
        Ok(rings)
    }

    /// Mean over the azimuth of the kernel from a ring of radius `r` to a point at `rho`.
    fn mean(&self, r: f64, rho: f64) -> Complex64 {
        let z = self.distance_um;
        let at = |azimuth: f64| {
            let (sin, cos) = azimuth.sin_cos();
            kernel([rho - r * cos, -r * sin, z], self.wavelength_um, 0.0)
        };
        if r == 0.0 || rho == 0.0 {
            return at(0.0);
        }
        // The kernel's harmonics end where the Bessel functions of its phase swing do.
        let swing = std::f64::consts::TAU / self.wavelength_um * r * rho / (r * r + z * z).sqrt();
        let steps = (0.5 * swing + 4.0 * swing.cbrt() + 12.0).ceil() as usize;
        let inner: Complex64 = (1..steps)
            .map(|i| at(std::f64::consts::PI * i as f64 / steps as f64))
            .sum();
        (inner + (at(0.0) + at(std::f64::consts::PI)) * 0.5) / steps as f64
    }

    fn check(what: &'static str, got: usize, need: usize) -> Result<()> {
        if got == need {
            return Ok(());
        }
        Err(WaveError::Count {
            what,
            given: got,
            needed: need,
        })
    }
}
