//! The expected error of the joint linear restoration of what all elements record of one part of the field.
//!
//! A lattice of pixels mistakes frequencies that differ by those of the lattice for one another. Each such group of frequencies is
//! independent of the others: x, the planes of the scene at them, has the covariance P, each lattice of each element records one
//! number g x with noise of variance one, and the error of the best linear estimate is the trace of (P^-1 + sum g^H g)^-1
//! (Kay, Statistical Signal Processing I, 1993, section 12.5). Lattices that lie at other phases on their images tell the frequencies of a
//! group apart.

use num_complex::Complex64;

use super::scene::NaturalScene;

/// Frequencies at which a camera is judged, and the groups that a lattice of pixels makes of them.
#[derive(Clone, Debug)]
pub(super) struct Groups {
    /// Step of frequency (1/um), and steps to the largest.
    pub step: f64,
    pub steps: usize,
    groups: Vec<Group>,
    /// Power of the scene at each frequency (um^2).
    power: Vec<f64>,
    /// Inverse covariance of the planes where the power is one.
    inverse: Vec<Vec<f64>>,
}

#[derive(Clone, Debug)]
struct Group {
    members: Vec<usize>,
    /// Groups that have the same error, with this one.
    count: f64,
}

/// Numbers that one lattice of one element records.
pub(super) struct Recorded<'h> {
    /// Plane of the scene that it sees.
    pub plane: usize,
    /// Transfer function of the optics and the pixel, frequency by frequency.
    pub transfer: &'h [Complex64],
    /// Signal of a scene of one, over the root of the power of the noise.
    pub gain: f64,
    /// Place of the lattice on the image of the element (um).
    pub place_um: [f64; 2],
}

impl Groups {
    /// Groups of a lattice of a pitch (um) before images of a scene whose pixel has a size there (um), with `periods` of the lattice
    /// to the window that images are confined to.
    pub(super) fn new(
        scene: &NaturalScene,
        pixel_um: f64,
        pitch_um: f64,
        periods: usize,
        inverse: Vec<Vec<f64>>,
    ) -> Self {
        let step = 1.0 / (pitch_um * periods as f64);
        let steps = (0.5 / pixel_um / step).floor() as usize;
        let side = 2 * steps + 1;
        let cycles = |k: usize| (k as f64 - steps as f64) * step * pixel_um;
        let power = (0..side * side)
            .map(|at| scene.power([cycles(at % side), cycles(at / side)], step * pixel_um / 3.0) * pixel_um.powi(2))
            .collect();
        let period = periods as i64;
        let residue = |k: usize| (k as i64 - steps as i64).rem_euclid(period);
        let mut groups = Vec::new();
        for b in 0..period {
            for a in 0..period {
                let opposite = [(period - a) % period, (period - b) % period];
                let order = (opposite[1] * period + opposite[0]).cmp(&(b * period + a));
                if order.is_lt() {
                    continue;
                }
                let members: Vec<usize> = (0..side * side)
                    .filter(|at| [residue(at % side), residue(at / side)] == [a, b])
                    .collect();
                if !members.is_empty() {
                    let count = if order.is_eq() { 1.0 } else { 2.0 };
                    groups.push(Group { members, count });
                }
            }
        }
        Self {
            step,
            steps,
            groups,
            power,
            inverse,
        }
    }

    /// Number of frequencies.
    pub(super) fn len(&self) -> usize {
        self.power.len()
    }

    /// Frequency along x and y (1/um).
    pub(super) fn frequency(&self, at: usize) -> [f64; 2] {
        let side = 2 * self.steps + 1;
        [at % side, at / side].map(|k| (k as f64 - self.steps as f64) * self.step)
    }

    /// Mean square error of a plane. `slopes`: of each recorded number, to which the slope by its transfer function times `scale` is
    /// added: the error changes by the real part of the sum of conj(slope) times the change.
    pub(super) fn error(
        &self,
        recorded: &[Recorded<'_>],
        scale: f64,
        mut slopes: Option<&mut [Vec<Complex64>]>,
    ) -> f64 {
        let planes = self.inverse.len();
        let mut sum = 0.0;
        for group in &self.groups {
            let k = group.members.len();
            let n = k * planes;
            let mut matrix = vec![Complex64::ZERO; n * n];
            for (i, &at) in group.members.iter().enumerate() {
                for (a, line) in self.inverse.iter().enumerate() {
                    for (b, v) in line.iter().enumerate() {
                        matrix[(a * k + i) * n + b * k + i] += v / self.power[at];
                    }
                }
            }
            let rows: Vec<Vec<Complex64>> = recorded.iter().map(|r| self.row(group, r)).collect();
            for (g, r) in rows.iter().zip(recorded) {
                for i in 0..k {
                    for j in 0..k {
                        matrix[(r.plane * k + i) * n + r.plane * k + j] += g[i].conj() * g[j];
                    }
                }
            }
            let inverse = hermitian_inverse(&mut matrix, n);
            let weight = group.count * self.step.powi(2) / planes as f64;
            sum += weight * (0..n).map(|i| inverse[i * n + i].re).sum::<f64>();
            let Some(slopes) = &mut slopes else { continue };
            let blocks: Vec<Vec<Complex64>> = (0..planes).map(|c| squared_block(&inverse, n, c * k, k)).collect();
            for ((g, r), slope) in rows.iter().zip(recorded).zip(slopes.iter_mut()) {
                let block = &blocks[r.plane];
                for (i, &at) in group.members.iter().enumerate() {
                    let v: Complex64 = (0..k).map(|j| block[i * k + j] * g[j].conj()).sum();
                    let by_row = -2.0 * scale * weight * v.conj();
                    // g = gain * phase * transfer.
                    slope[at] += by_row * (r.gain * self.phase(at, r.place_um)).conj();
                }
            }
        }
        sum
    }

    fn phase(&self, at: usize, place_um: [f64; 2]) -> Complex64 {
        let u = self.frequency(at);
        Complex64::cis(std::f64::consts::TAU * (u[0] * place_um[0] + u[1] * place_um[1]))
    }

    fn row(&self, group: &Group, recorded: &Recorded<'_>) -> Vec<Complex64> {
        let members = group.members.iter();
        members
            .map(|&at| recorded.transfer[at] * recorded.gain * self.phase(at, recorded.place_um))
            .collect()
    }
}

/// Block of the square of a Hermitian matrix.
fn squared_block(matrix: &[Complex64], n: usize, from: usize, k: usize) -> Vec<Complex64> {
    let mut block = vec![Complex64::ZERO; k * k];
    for i in 0..k {
        for j in 0..k {
            let (a, b) = (&matrix[(from + i) * n..][..n], &matrix[(from + j) * n..][..n]);
            block[i * k + j] = a.iter().zip(b).map(|(a, b)| a * b.conj()).sum();
        }
    }
    block
}

/// Inverse of a positive definite Hermitian matrix, by Cholesky's factors.
fn hermitian_inverse(a: &mut [Complex64], n: usize) -> Vec<Complex64> {
    for j in 0..n {
        for k in 0..j {
            let factor = a[j * n + k].conj();
            for i in j..n {
                let v = a[i * n + k] * factor;
                a[i * n + j] -= v;
            }
        }
        let root = a[j * n + j].re.max(f64::MIN_POSITIVE).sqrt();
        for i in j..n {
            a[i * n + j] /= root;
        }
    }
    // The inverse of the lower factor, column by column.
    let mut lower = vec![Complex64::ZERO; n * n];
    for j in 0..n {
        lower[j * n + j] = Complex64::from(1.0 / a[j * n + j].re);
        for i in j + 1..n {
            let sum: Complex64 = (j..i).map(|k| a[i * n + k] * lower[k * n + j]).sum();
            lower[i * n + j] = -sum / a[i * n + i].re;
        }
    }
    let mut inverse = vec![Complex64::ZERO; n * n];
    for i in 0..n {
        for j in 0..=i {
            let v: Complex64 = (i..n).map(|k| lower[k * n + i].conj() * lower[k * n + j]).sum();
            inverse[i * n + j] = v;
            inverse[j * n + i] = v.conj();
        }
    }
    inverse
}
