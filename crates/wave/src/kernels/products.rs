//! Sums of products, in the widest registers of the machine.

use pulp::Arch;

/// Sum of the products of `a` and `b` in double precision, in an order that does not depend on the machine.
pub fn sum_of_products<T: Copy + Into<f64>>(a: &[f32], b: &[T]) -> f64 {
    /// Sums beside one another, for registers.
    const SUMS: usize = 16;
    Arch::new().dispatch(|| {
        let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<SUMS>(), b.as_chunks::<SUMS>());
        let mut sums = [0.0f64; SUMS];
        for (a, b) in a.iter().zip(b) {
            for k in 0..SUMS {
                sums[k] += f64::from(a[k]) * b[k].into();
            }
        }
        let rest = a_rest.iter().zip(b_rest).map(|(a, b)| f64::from(*a) * (*b).into());
        sums.iter().sum::<f64>() + rest.sum::<f64>()
    })
}
