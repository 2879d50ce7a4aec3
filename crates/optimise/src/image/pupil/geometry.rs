//! Geometry of the light of each site: where it comes from and goes to.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;

use crate::PixelWindow;
use crate::merit::focus::Lens;

/// Geometry of light: where it comes from and goes to.
pub(super) struct Geometry<'l> {
    lens: &'l Lens,
    wavelength_um: f64,
    sine: f64,
    /// Place where the chief ray lands, and its distance.
    landing_um: f64,
    distance_um: f64,
    side_um: f64,
    offset_um: f64,
    pub(super) scale: f64,
}

/// One site above the x axis, and with it its mirror image below.
pub(super) struct SitePair {
    pub ring: u32,
    /// Direction in cells.
    pub q: (f64, f64),
    pub value: Complex64,
}

impl<'l> Geometry<'l> {
    pub(super) fn new(lens: &'l Lens, wavelength_um: f64, angle_rad: f64, window: PixelWindow, offset_um: f64) -> Self {
        let cell_um2 = lens.rings.lattice().cell_um2();
        Self {
            lens,
            wavelength_um,
            sine: angle_rad.sin(),
            landing_um: lens.distance_um * angle_rad.tan(),
            distance_um: lens.distance_um / angle_rad.cos(),
            side_um: window.side_um(),
            offset_um,
            // Root of the area of a sample over that of the lens; the number of samples comes later.
            scale: window.side_um() / (lens.rings.sites() as f64 * cell_um2).sqrt(),
        }
    }

    /// Least and greatest direction along x, and greatest along y, in cells.
    pub(super) fn extent(&self) -> (f64, f64, f64) {
        let radius = 0.5e-3 * f64::from(self.lens.rings.diameter_nm());
        let mut extent = (f64::MAX, f64::MIN, 0.0f64);
        for i in 0..=180 {
            let (sin, cos) = (PI * f64::from(i) / 180.0).sin_cos();
            let q = self.site(radius * cos, radius * sin, 0, false).q;
            extent = (extent.0.min(q.0), extent.1.max(q.0), extent.2.max(q.1.abs()));
        }
        extent
    }

    fn site(&self, x: f64, y: f64, ring: u32, with_value: bool) -> SitePair {
        let (z, x0) = (self.lens.distance_um, self.landing_um);
        let dx = x0 - x;
        let r2 = dx * dx + y * y + z * z;
        let r = r2.sqrt();
        let q_x = (dx / r - self.sine) / self.wavelength_um;
        // The field is even in y: of a site and its mirror image, one stands for both.
        let q = (q_x * self.side_um, y / r / self.wavelength_um * self.side_um);
        if !with_value {
            return SitePair {
                ring,
                q,
                value: Complex64::ZERO,
            };
        }
        // R - R0 without cancellation, and the incident wave.
        let path = (x * x - 2.0 * x * x0 + y * y) / (r + self.distance_um) + x * self.sine;
        let waves = path / self.wavelength_um + q_x * self.offset_um;
        let k = TAU / self.wavelength_um;
        let area = self.lens.rings.lattice().cell_um2();
        let amplitude = self.scale * area * z / (TAU * r2);
        let value = amplitude * Complex64::new(1.0 / r, -k) * Complex64::cis(TAU * (waves - waves.round()));
        SitePair { ring, q, value }
    }

    pub(super) fn for_each(&self, with_value: bool, mut visit: impl FnMut(&SitePair)) {
        let lattice = self.lens.rings.lattice();
        let half = lattice.sites() / 2;
        for iy in half..lattice.sites() {
            let y = lattice.place_um(1, iy);
            for ix in 0..lattice.sites() {
                if let Some(ring) = self.lens.rings.ring_at(ix, iy) {
                    let mut site = self.site(lattice.place_um(0, ix), y, ring as u32, with_value);
                    if y == 0.0 {
                        // On the axis of the mirror, where a site is its own image.
                        site.value *= 0.5;
                    }
                    visit(&site);
                }
            }
        }
    }
}
