//! Normal equations of the reference values.

use nalgebra::DMatrix;

use super::problem::FitProblem;
use crate::measurements::Measurements;

/// Step of derivatives, as a share of the typical size of a parameter: far above rounding, and so little that the third
/// derivative does not count.
const STEP: f64 = 1e-2;

impl<M: Measurements> FitProblem<'_, M> {
    /// The reference values as a form over shared nuisances, the parameters in `active` and the residual; the offset that
    /// all of them share is eliminated.
    pub(super) fn reference_form(&self, active: &[usize], theta: &[f64]) -> DMatrix<f64> {
        let shared = self.shared();
        let size = shared + active.len() + 1;
        let references = self.data.references();
        if references.values.is_empty() {
            return DMatrix::zeros(size, size);
        }
        let stated = self.model.reference_values(theta);
        // Declared expressions need not be linear in their parameters.
        let slots = self.model.slots();
        let steps: Vec<f64> = active.iter().map(|&s| STEP * slots[s].parameter.typical).collect();
        let moved = |s: usize, by: f64| {
            let mut theta = theta.to_vec();
            theta[s] += by;
            self.model.reference_values(&theta)
        };
        let beside = active.iter().zip(&steps);
        let beside: Vec<_> = beside.map(|(&s, h)| [moved(s, *h), moved(s, -h)]).collect();
        let mut gram = DMatrix::<f64>::zeros(active.len() + 2, active.len() + 2);
        for (place, (reference, own)) in references.values.iter().zip(&stated).enumerate() {
            let Some(own) = *own else { continue };
            let mut row = vec![1.0 / reference.sigma];
            let slopes = beside.iter().zip(&steps).map(|([ahead, behind], h)| {
                let [ahead, behind] = [ahead, behind].map(|v| v[place].unwrap_or(own));
                (ahead - behind) / (2.0 * h)
            });
            row.extend(slopes.map(|slope| slope / reference.sigma));
            row.push((reference.deviation - own) / reference.sigma);
            for (i, a) in row.iter().enumerate() {
                for (j, b) in row.iter().enumerate() {
                    gram[(i, j)] += a * b;
                }
            }
        }
        gram[(0, 0)] += references.offset_sigma.powi(-2);
        let n = active.len() + 1;
        let cross = gram.view((0, 1), (1, n)).into_owned();
        let inner = gram.view((1, 1), (n, n)) - cross.transpose() * &cross / gram[(0, 0)];
        let mut form = DMatrix::zeros(size, size);
        form.view_mut((shared, shared), (n, n)).copy_from(&inner);
        form
    }
}
