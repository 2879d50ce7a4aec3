//! How wide the pillar at each site has become.

use std::collections::BTreeMap;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Bench;
use crate::density;
use crate::departure::Geometry;
use crate::set::ElementIndex;

/// Local biases that differ by less than this share a table entry [nm]; it is 3 mrad of phase.
const BIAS_STEP_NM: f64 = 0.1;

/// Which table entry each site of an element has.
pub(super) struct Sites {
    /// Zero where light is blocked.
    pub class: Vec<u16>,
    /// Width of each class [nm], zero without pillar; that of class zero is of no use.
    pub width_nm: Vec<f64>,
    /// Sites in each class.
    pub count: Vec<u32>,
}

impl Sites {
    /// Let a share of the pillars be missing, at random places: their class has no width.
    pub fn fell(&mut self, share: f64, seed: u64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let bare = self.width_nm.len() as u16;
        self.width_nm.push(0.0);
        self.count.push(0);
        for class in self.class.iter_mut().filter(|c| **c > 0) {
            if rng.random::<f64>() < share {
                *class = bare;
            }
        }
    }
}

impl Bench<'_> {
    /// Width added to the pillar at a site by bias and density [nm].
    pub fn bias_nm(&self, element: ElementIndex, site: usize, geometry: &Geometry) -> f64 {
        let density = if geometry.cd_bias_density_nm == 0.0 {
            0.0
        } else {
            geometry.cd_bias_density_nm * f64::from(self.fill(element)[site])
        };
        geometry.cd_bias_nm + density
    }

    /// Which pillars of an element stand, and how wide.
    pub(super) fn sites(&self, element: ElementIndex, geometry: &Geometry) -> Sites {
        let measured = &self.set.elements[element];
        let lattice = measured.pillars.lattice;
        let n = lattice.sites();
        let radius = 0.5 * measured.aperture_diameter_um;
        let [ox, oy] = geometry.aperture_offset_um;
        let mut levels: BTreeMap<(u16, i32), u16> = BTreeMap::new();
        let mut out = Sites {
            class: vec![0; n * n],
            width_nm: vec![0.0],
            count: vec![0],
        };
        for (site, &w) in measured.pillars.width_nm.iter().enumerate() {
            if w == 0 {
                continue;
            }
            if ox != 0.0 || oy != 0.0 {
                let (x, y) = (
                    lattice.coordinate_um(site % n) - ox,
                    lattice.coordinate_um(site / n) - oy,
                );
                if x * x + y * y > radius * radius {
                    continue;
                }
            }
            let bias = self.bias_nm(element, site, geometry);
            let level = if geometry.cd_bias_density_nm == 0.0 {
                0
            } else {
                (bias / BIAS_STEP_NM).round() as i32
            };
            let class = *levels.entry((w, level)).or_insert_with(|| {
                let bias = if geometry.cd_bias_density_nm == 0.0 {
                    bias
                } else {
                    f64::from(level) * BIAS_STEP_NM
                };
                out.width_nm.push(f64::from(w) + bias);
                out.count.push(0);
                (out.width_nm.len() - 1) as u16
            });
            out.class[site] = class;
            out.count[usize::from(class)] += 1;
        }
        out
    }

    /// Area fraction around each site.
    fn fill(&self, element: ElementIndex) -> &[f32] {
        self.fill[element].get_or_init(|| density::fill(&self.set.elements[element].pillars))
    }
}

/// Sum of Legendre polynomials from the first on.
pub fn legendre(coefficients: &[f64], x: f64) -> f64 {
    let (mut before, mut now, mut sum) = (1.0, x, 0.0);
    for (k, c) in coefficients.iter().enumerate() {
        sum += c * now;
        let n = k as f64 + 1.0;
        (before, now) = (now, ((2.0 * n + 1.0) * x * now - n * before) / (n + 1.0));
    }
    sum
}
