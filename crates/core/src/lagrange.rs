//! Lagrange's interpolation.

/// The weight of the value at `own` in the polynomial through the values there and at the `others`, at `x`.
#[inline]
pub fn lagrange_weight(x: f64, own: f64, others: impl IntoIterator<Item = f64>) -> f64 {
    others.into_iter().map(|other| (x - other) / (own - other)).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_polynomial_through_three_places_is_a_parabola() {
        const ROUNDING: f64 = 1e-14;
        let places = [-1.0, 0.5, 2.0];
        let parabola = |x: f64| 3.0 * x * x - x + 0.25;
        let at = |x: f64| -> f64 {
            let others = |i: usize| places.into_iter().enumerate().filter(move |(j, _)| *j != i);
            let each = places.into_iter().enumerate();
            each.map(|(i, own)| parabola(own) * lagrange_weight(x, own, others(i).map(|(_, p)| p)))
                .sum()
        };
        for x in [-1.0, 0.0, 1.3] {
            assert!((at(x) - parabola(x)).abs() < ROUNDING);
        }
    }
}
