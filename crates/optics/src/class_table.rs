//! Transmission of the sites of an element in one light, equal sites by one number.

use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use metalith_wave::Aperture;

/// Transmission of the sites of each class at one wavelength and polarisation.
#[derive(Clone, Debug)]
pub struct ClassTable {
    /// Field ratio, foot to top of the pillars; zero for class zero. Of pillars that differ over the lens, in its middle.
    pub t: Vec<Complex32>,
    /// Logarithm of the ratio of the transmission at the rim of the lens to that in its middle; empty where they are alike.
    pub(super) to_rim: Vec<Complex32>,
    /// |t|^2 summed over sites of what missing pillars scatter, each on its own.
    pub scattered: f64,
    /// Class of each site, row by row, where it is not that of its width.
    sites: Option<Arc<[u16]>>,
}

/// Steps of the real and of the imaginary part from the least to the largest where each site has its own number: what
/// rounding scatters is 5e-5 of the largest |t|^2.
const STEPS: u16 = 127;

impl ClassTable {
    /// Table of classes of widths.
    pub(super) fn of_widths(t: Vec<Complex32>, scattered: f64) -> Self {
        Self {
            t,
            to_rim: Vec::new(),
            scattered,
            sites: None,
        }
    }

    /// Table of an element whose sites transmit as an aperture says, each individually, rounded to 127 steps of its
    /// real and imaginary part. Sites that pass nothing pass nothing after it.
    pub fn of_sites(aperture: &dyn Aperture) -> Self {
        let n = aperture.lattice().sites();
        let row = |iy: usize| {
            let mut row = vec![Complex32::ZERO; n];
            aperture.fill_row(iy, &mut row);
            row
        };
        let rows: Vec<Vec<Complex32>> = (0..n).into_par_iter().map(row).collect();
        let largest = |row: &Vec<Complex32>| row.iter().fold(0.0f32, |m, t| m.max(t.re.abs()).max(t.im.abs()));
        let most = rows.iter().map(largest).fold(0.0, f32::max);
        let step = 2.0 * most / f32::from(STEPS);
        let one_over = if step > 0.0 { 1.0 / step } else { 0.0 };
        let code = |t: &Complex32| {
            if *t == Complex32::ZERO {
                return 0;
            }
            let [re, im] = [t.re, t.im].map(|v| ((v + most) * one_over).round() as u16);
            1 + re * (STEPS + 1) + im
        };
        let codes: Vec<u16> = rows.iter().flatten().map(code).collect();
        let value = |v: u16| f32::from(v) * step - most;
        let all = (0..=STEPS).flat_map(|re| (0..=STEPS).map(move |im| Complex32::new(value(re), value(im))));
        Self {
            sites: Some(codes.into()),
            ..Self::of_widths(std::iter::once(Complex32::ZERO).chain(all).collect(), 0.0)
        }
    }

    /// Class of each site, of an element that has these by width.
    pub fn classes<'a>(&'a self, by_width: &'a [u16]) -> &'a [u16] {
        self.sites.as_deref().unwrap_or(by_width)
    }

    /// Sum of the transmissions of all sites of an element that has these classes by width.
    pub fn sum(&self, by_width: &[u16]) -> Complex64 {
        let mut counts = vec![0u32; self.t.len()];
        for class in self.classes(by_width) {
            counts[usize::from(*class)] += 1;
        }
        let each = counts.iter().zip(&self.t);
        each.map(|(n, t)| Complex64::new(f64::from(t.re), f64::from(t.im)) * f64::from(*n))
            .sum()
    }

    /// Power that all these sites pass together, in the middle of the lens: |t|^2 summed over them.
    pub fn power(&self, by_width: &[u16]) -> f64 {
        let each = self.classes(by_width).iter();
        each.map(|class| f64::from(self.t[usize::from(*class)].norm_sqr()))
            .sum()
    }

    /// Table between some of the same classes, by weights whose sum is one, each turned to the phase of the first.
    pub(super) fn between(parts: &[(f64, &Self)]) -> Self {
        let mut all = Self {
            t: vec![Complex32::ZERO; parts[0].1.t.len()],
            to_rim: vec![Complex32::ZERO; parts[0].1.to_rim.len()],
            scattered: 0.0,
            sites: parts[0].1.sites.clone(),
        };
        for (weight, part) in parts {
            let overlap: Complex32 = part
                .t
                .iter()
                .zip(&parts[0].1.t)
                .map(|(t, first)| t.conj() * first)
                .sum();
            let turn = Complex32::from_polar(*weight as f32, overlap.arg());
            all.t.iter_mut().zip(&part.t).for_each(|(sum, t)| *sum += turn * t);
            let rims = all.to_rim.iter_mut().zip(&part.to_rim);
            rims.for_each(|(sum, rim)| *sum += rim * *weight as f32);
            all.scattered += weight * part.scattered;
        }
        all
    }

    /// These sites with all light multiplied by this.
    #[must_use]
    pub fn scaled(mut self, by: f32) -> Self {
        self.t.iter_mut().for_each(|t| *t *= by);
        self.scattered *= f64::from(by * by);
        self
    }

    /// Say what the same sites transmit at the rim of the lens; between it and the middle, the logarithm of the
    /// transmission goes with the square of the radius.
    pub fn set_rim(&mut self, rim: &Self) {
        let ratio = |(middle, rim): (&Complex32, &Complex32)| {
            let ratio = rim / middle;
            // Sites that are dark stay so.
            if ratio.is_finite() && ratio != Complex32::ZERO {
                ratio.ln()
            } else {
                Complex32::ZERO
            }
        };
        self.to_rim = self.t.iter().zip(&rim.t).map(ratio).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::Lattice;

    struct Sites(Lattice);

    impl Aperture for Sites {
        fn lattice(&self) -> Lattice {
            self.0
        }

        fn radius_um(&self) -> f64 {
            1.0
        }

        fn fill_row(&self, iy: usize, row: &mut [Complex32]) {
            for (ix, t) in row.iter_mut().enumerate() {
                let turn = (ix * 7 + iy * 3) as f32;
                *t = Complex32::from_polar(if ix == 3 { 0.0 } else { 0.3 + 0.02 * iy as f32 }, turn);
            }
        }
    }

    #[test]
    fn sites_come_back_but_for_the_steps() {
        let sites = Sites(Lattice::new(350, 20).unwrap());
        let table = ClassTable::of_sites(&sites);
        let classes = table.classes(&[]).to_vec();
        let mut row = vec![Complex32::ZERO; 20];
        let (mut sum, mut most) = (Complex64::ZERO, 0.0f32);
        for iy in 0..20 {
            sites.fill_row(iy, &mut row);
            for (t, class) in row.iter().zip(&classes[iy * 20..]) {
                let back = table.t[usize::from(*class)];
                most = most.max((back - t).norm());
                sum += Complex64::new(f64::from(back.re), f64::from(back.im));
                assert_eq!(*t == Complex32::ZERO, back == Complex32::ZERO);
            }
        }
        // Half a step along both axes; the largest part is below 0.68.
        assert!(most <= 0.68 * 2.0 / 127.0 * 0.5 * 1.42, "{most}");
        // Sums of four hundred numbers of single precision.
        assert!((table.sum(&[]) - sum).norm() < 1e-6);
    }
}
