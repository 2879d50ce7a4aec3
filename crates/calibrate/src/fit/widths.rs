//! Normal equations of the widths by SEM.

use nalgebra::DMatrix;

use super::problem::FitProblem;

/// Step of derivatives, as a share of the typical size of a parameter: far above rounding, and so little that the third
/// derivative does not count.
const STEP: f64 = 1e-2;

impl FitProblem<'_> {
    /// The widths as a form over shared nuisances, the parameters in `active` and the residual; the offset that
    /// all widths share is eliminated.
    pub(super) fn width_form(&self, active: &[usize], theta: &[f64]) -> DMatrix<f64> {
        let shared = self.shared();
        let size = shared + active.len() + 1;
        if self.data.widths.is_empty() {
            return DMatrix::zeros(size, size);
        }
        let biases = self.model.width_biases_nm(theta);
        // Declared expressions need not be linear in their parameters.
        let slots = self.model.slots();
        let steps: Vec<f64> = active.iter().map(|&s| STEP * slots[s].parameter.typical).collect();
        let moved = |s: usize, by: f64| {
            let mut theta = theta.to_vec();
            theta[s] += by;
            self.model.width_biases_nm(&theta)
        };
        let beside = active.iter().zip(&steps);
        let beside: Vec<_> = beside.map(|(&s, h)| [moved(s, *h), moved(s, -h)]).collect();
        let mut gram = DMatrix::<f64>::zeros(active.len() + 2, active.len() + 2);
        for (place, (width, bias)) in self.data.widths.iter().zip(&biases).enumerate() {
            let Some(bias) = *bias else { continue };
            let mut row = vec![1.0 / width.sigma_nm];
            let slopes = beside.iter().zip(&steps).map(|([ahead, behind], h)| {
                let [ahead, behind] = [ahead, behind].map(|b| b[place].unwrap_or(bias));
                (ahead - behind) / (2.0 * h)
            });
            row.extend(slopes.map(|slope| slope / width.sigma_nm));
            row.push((width.deviation_nm - bias) / width.sigma_nm);
            for (i, a) in row.iter().enumerate() {
                for (j, b) in row.iter().enumerate() {
                    gram[(i, j)] += a * b;
                }
            }
        }
        gram[(0, 0)] += self.data.width_offset_sigma_nm.powi(-2);
        let n = active.len() + 1;
        let cross = gram.view((0, 1), (1, n)).into_owned();
        let inner = gram.view((1, 1), (n, n)) - cross.transpose() * &cross / gram[(0, 0)];
        let mut form = DMatrix::zeros(size, size);
        form.view_mut((shared, shared), (n, n)).copy_from(&inner);
        form
    }
}
