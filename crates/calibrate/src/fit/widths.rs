//! Normal equations of the widths by SEM.

use nalgebra::DMatrix;

use super::problem::FitProblem;

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
        // Widths are linear in the parameters that change them: one unit more of each.
        let ahead: Vec<_> = active
            .iter()
            .map(|&s| {
                let mut more = theta.to_vec();
                more[s] += 1.0;
                self.model.width_biases_nm(&more)
            })
            .collect();
        let mut gram = DMatrix::<f64>::zeros(active.len() + 2, active.len() + 2);
        for (place, (width, bias)) in self.data.widths.iter().zip(&biases).enumerate() {
            let Some(bias) = *bias else { continue };
            let mut row = vec![1.0 / width.sigma_nm];
            let slopes = ahead.iter().map(|more| more[place].unwrap_or(bias) - bias);
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
