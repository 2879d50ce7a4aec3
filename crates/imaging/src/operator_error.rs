//! Error of the operator of a restoration against the simulation, pixel by pixel.

use ndarray::Array2;

use metalith_wave::kernels::box_sums;

/// Errors of an operator as shares of the light, root mean square.
#[derive(Clone, Debug, Default)]
pub struct OperatorError {
    /// Error of each channel's frame.
    pub overall: Vec<f64>,
    /// About each pixel, by channel; none where it is the same everywhere.
    local: Vec<Array2<f32>>,
}

/// Share of the light above which the error of an operator is stated beside a picture. The arrays that it is made for have 1 %, which is
/// the shot noise of ten thousand electrons. Three times that is ten times the variance: it hides more than the noise of a
/// pixel that is well exposed, and a restoration is no longer limited by its frame.
const TOLD: f64 = 0.03;

/// Pixels on both sides over which an error is taken about a pixel: the scene that it is found with is random, and fewer
/// would show how it happened to be.
const ABOUT: usize = 24;

impl OperatorError {
    /// Error of an operator that has none.
    pub fn none(channels: usize) -> Self {
        Self::uniform(vec![0.0; channels])
    }

    /// Error that is the same share everywhere in a channel.
    pub fn uniform(overall: Vec<f64>) -> Self {
        let local = Vec::new();
        Self { overall, local }
    }

    /// Error between frames and reference frames, by channel, in the pixels that count one.
    pub fn between(
        light: &[Array2<f32>],
        known: &[Array2<f32>],
        counts: impl Fn(usize, (usize, usize)) -> bool,
    ) -> Self {
        let mut error = Self::default();
        for (channel, (light, known)) in light.iter().zip(known).enumerate() {
            let of_counted = |value: &dyn Fn((usize, usize)) -> f64| {
                Array2::from_shape_fn(light.dim(), |at| if counts(channel, at) { value(at) } else { 0.0 })
            };
            let number = of_counted(&|_| 1.0);
            let squares = of_counted(&|at| f64::from(light[at] - known[at]).powi(2));
            let mean = of_counted(&|at| f64::from(light[at]));
            let all: f64 = of_counted(&|at| f64::from(light[at]).powi(2)).sum();
            error.overall.push((squares.sum() / all.max(f64::MIN_POSITIVE)).sqrt());
            // Against the same light as that which it is a share of when it is used.
            let least = mean.sum() / number.sum().max(1.0);
            let [squares, mean, number] = [squares, mean, number].map(|p| box_sums(&p, ABOUT));
            error.local.push(Array2::from_shape_fn(light.dim(), |at| {
                let number = number[at].max(1.0);
                let light = (mean[at] / number).max(least).max(f64::MIN_POSITIVE);
                ((squares[at].max(0.0) / number).sqrt() / light) as f32
            }));
        }
        error
    }

    /// These errors, so many times as large.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        Self {
            overall: self.overall.iter().map(|e| e * factor).collect(),
            local: self.local.iter().map(|p| p * factor as f32).collect(),
        }
    }

    /// Note on a restoration that this error limits, with the worst of its channels of these names; `None` where it
    /// does not.
    pub fn note(&self, channels: &[String]) -> Option<String> {
        let worst = self.overall.iter().zip(channels).max_by(|a, b| a.0.total_cmp(b.0));
        let (error, channel) = worst.filter(|(error, _)| **error > TOLD)?;
        Some(format!(
            "the restoration is limited by its operator, which errs by {:.1} % of the light of a pixel in channel `{channel}`: the picture says less than the chip could give. With more pixels behind each element, or a larger --field-deg, it errs by less",
            100.0 * error
        ))
    }

    /// About a pixel of a channel, as a share of the light there and of no less than the mean light of the frame.
    pub fn about(&self, channel: usize, at: (usize, usize)) -> f64 {
        let local = self.local.get(channel).map(|p| f64::from(p[at]));
        local.unwrap_or(self.overall[channel])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_that_limits_a_picture_is_told() {
        let names = ["red".to_owned(), "green".to_owned()];
        assert_eq!(OperatorError::uniform(vec![0.01, 0.012]).note(&names), None);
        let note = OperatorError::uniform(vec![0.01, 0.095]).note(&names).unwrap();
        assert!(note.contains("errs by 9.5 %") && note.contains("`green`"), "{note}");
    }

    #[test]
    fn an_error_is_stated_where_it_is() {
        const SHARE: f32 = 0.1;
        // Farther than what is taken together, the light is known on the left and errs on the right.
        let light = vec![Array2::from_elem((40, 200), 2.0f32)];
        let known = vec![Array2::from_shape_fn((40, 200), |(_, x)| {
            if x < 100 { 2.0 } else { 2.0 * (1.0 + SHARE) }
        })];
        // Every other pixel counts.
        let error = OperatorError::between(&light, &known, |_, (y, x)| (y + x) % 2 == 0);
        assert_eq!(error.about(0, (20, 40)), 0.0);
        // Values of single precision.
        assert!((error.about(0, (20, 160)) - f64::from(SHARE)).abs() < 1e-6);
        assert!((error.overall[0] - f64::from(SHARE) / 2f64.sqrt()).abs() < 1e-6);
        assert_eq!(OperatorError::uniform(vec![0.3]).about(0, (7, 7)), 0.3);
        let twice = error.times(2.0);
        assert_eq!(twice.about(0, (20, 160)), 2.0 * error.about(0, (20, 160)));
        assert_eq!(twice.overall[0], 2.0 * error.overall[0]);
    }
}
