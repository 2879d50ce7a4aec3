//! Expected value of a pixel, where its own value is too uncertain to say how uncertain it is.

use ndarray::Array2;

/// Electrons that a value rests on, those of the read noise among them, from which on it says its own variance: to 5 %. Fewer would make
/// pixels that came out too dark count for more than those that came out too bright: 0.3 % of the light at this number, a
/// quarter at five electrons.
const ENOUGH: f32 = 400.0;

/// Pixels on each side, at most, that stand in for one.
const MOST_REACH: usize = 3;

/// Values, those that rest on few electrons replaced by the mean of their neighbours, of as many as are needed. A pixel is no part of its
/// own mean, or its noise would decide its weight. `electrons` is what each value rests on, zero for one that tells
/// nothing.
pub fn expected(values: &Array2<f32>, electrons: &Array2<f32>) -> Array2<f32> {
    let (rows, cols) = values.dim();
    let mut out = values.clone();
    for ((y, x), to) in out.indexed_iter_mut().filter(|(at, _)| electrons[*at] < ENOUGH) {
        for reach in 1..=MOST_REACH {
            let (mut sum, mut count, mut told) = (0.0, 0.0, 0.0);
            for ny in y.saturating_sub(reach)..(y + reach + 1).min(rows) {
                for nx in x.saturating_sub(reach)..(x + reach + 1).min(cols) {
                    if (ny, nx) != (y, x) && electrons[(ny, nx)] > 0.0 {
                        sum += values[(ny, nx)];
                        count += 1.0;
                        told += electrons[(ny, nx)];
                    }
                }
            }
            if count > 0.0 {
                *to = sum / count;
            }
            if told >= ENOUGH {
                break;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Poisson};

    use super::*;

    #[test]
    fn values_of_many_electrons_stay_and_others_are_those_of_their_neighbours() {
        let values = ndarray::arr2(&[[1.0, 2.0, 3.0], [4.0, 50.0, 6.0], [7.0, 8.0, 900.0]]);
        let mut electrons = Array2::from_elem((3, 3), ENOUGH);
        electrons[(1, 1)] = 1.0;
        // Tells nothing, and nobody anything.
        electrons[(2, 2)] = 0.0;
        let found = expected(&values, &electrons);
        assert_eq!(found[(1, 1)], (1.0 + 2.0 + 3.0 + 4.0 + 6.0 + 7.0 + 8.0) / 7.0);
        assert_eq!(found[(0, 0)], 1.0);
    }

    /// The weighted mean of even light of five electrons a pixel is five electrons, and its scatter is what is said.
    #[test]
    fn few_electrons_are_not_made_fewer_by_their_weights() {
        /// Four deviations of a mean over so many pixels, and what neighbours err by.
        const TOLERANCE: f64 = 0.02;
        let (light, read_noise_e) = (5.0, 1.0);
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let poisson = Poisson::new(light).unwrap();
        let values = Array2::from_shape_simple_fn((300, 300), || poisson.sample(&mut random) as f32);
        let told = |v: f32| v + read_noise_e * read_noise_e;
        let mean = |of: &Array2<f32>| {
            let each = values.iter().zip(of);
            let (sum, all) = each.fold((0.0, 0.0), |(sum, all), (v, of)| {
                let weight = 1.0 / f64::from(told(*of));
                (sum + weight * f64::from(*v), all + weight)
            });
            sum / all
        };
        let found = expected(&values, &values.mapv(told));
        assert!((mean(&found) / light - 1.0).abs() < TOLERANCE, "{}", mean(&found));
        // By their own values it is not.
        assert!(mean(&values) < (1.0 - 5.0 * TOLERANCE) * light, "{}", mean(&values));
    }
}
