//! Axes: from values to places in a drawing, and ticks at numbers that people like.

use super::figure::text_width;
use super::number::{fixed, power_of_ten, sig};

/// Quantity, unit and scale along one side of a chart.
#[derive(Clone, Debug)]
pub struct Axis {
    name: String,
    unit: String,
    logarithmic: bool,
    range: Option<(f64, f64)>,
}

impl Axis {
    /// An axis of equal steps. The unit may be empty.
    pub fn linear(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            logarithmic: false,
            range: None,
        }
    }

    /// A logarithmic axis; values that are not positive are not drawn.
    pub fn log(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            logarithmic: true,
            ..Self::linear(name, unit)
        }
    }

    /// Show this range; without it, the axis covers its data.
    #[must_use]
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// The axis over its data, laid along a drawing from `start` to `end`. `widen` to the next ticks.
    pub(super) fn fit(&self, data: impl IntoIterator<Item = f64>, start: f64, end: f64, widen: bool) -> Fitted {
        let usable = |x: &f64| x.is_finite() && (!self.logarithmic || *x > 0.0);
        let (mut low, mut high) = data
            .into_iter()
            .filter(usable)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        if let Some((a, b)) = self.range.filter(|(a, b)| usable(a) && usable(b)) {
            (low, high) = (a.min(b), a.max(b));
        }
        if low > high {
            (low, high) = if self.logarithmic { (0.1, 1.0) } else { (0.0, 1.0) };
        }
        if low == high {
            let room = if low == 0.0 { 1.0 } else { low.abs() * 0.1 };
            (low, high) = if self.logarithmic {
                (low / 2.0, high * 2.0)
            } else {
                (low - room, high + room)
            };
        }
        if self.logarithmic {
            // Twelve decades are as many as a reader can distinguish.
            low = low.max(high * 1e-12);
        }
        let mut fitted = Fitted {
            axis: self.clone(),
            low,
            high,
            start,
            end,
        };
        if widen && self.range.is_none() {
            fitted.widen();
        }
        fitted
    }
}

/// An axis laid along a drawing.
pub(super) struct Fitted {
    axis: Axis,
    pub low: f64,
    pub high: f64,
    start: f64,
    end: f64,
}

/// Ticks with their labels, what to write beside the axis, and small ticks without labels.
pub(super) struct Ticks {
    pub labelled: Vec<(f64, String)>,
    pub small: Vec<f64>,
    pub title: String,
}

impl Fitted {
    /// Place of a value; none for one that a logarithmic axis does not have.
    pub(crate) fn place(&self, x: f64) -> Option<f64> {
        let share = if self.axis.logarithmic {
            if x <= 0.0 {
                return None;
            }
            (x / self.low).ln() / (self.high / self.low).ln()
        } else {
            (x - self.low) / (self.high - self.low)
        };
        // Far outside is as good as anywhere outside, and drawings do not like huge numbers.
        share
            .is_finite()
            .then(|| self.start + (self.end - self.start) * share.clamp(-4.0, 5.0))
    }

    /// Position of a value; values that are not positive are at the low end of a logarithmic axis.
    pub(crate) fn place_or_end(&self, x: f64) -> Option<f64> {
        self.place(x).or_else(|| x.is_finite().then_some(self.start))
    }

    fn step(&self) -> f64 {
        let wanted = ((self.end - self.start).abs() / 52.0).clamp(2.0, 8.0);
        let raw = (self.high - self.low) / wanted;
        let decade = 10f64.powf(raw.log10().floor());
        [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|m| m * decade)
            .find(|&step| step >= raw * 0.999)
            .unwrap_or(10.0 * decade)
    }

    fn widen(&mut self) {
        if self.axis.logarithmic {
            if self.high / self.low > 3.0 {
                self.low = 10f64.powf((self.low.log10() + 1e-9).floor());
                self.high = 10f64.powf((self.high.log10() - 1e-9).ceil());
            }
        } else {
            let step = self.step();
            self.low = (self.low / step + 1e-9).floor() * step;
            self.high = (self.high / step - 1e-9).ceil() * step;
        }
    }

    pub(crate) fn ticks(&self) -> Ticks {
        if self.axis.logarithmic && self.high / self.low > 8.0 {
            self.decades()
        } else {
            self.steps()
        }
    }

    /// Width of the label of the last tick, if it is at the end of the axis.
    pub(super) fn last_label_width(&self) -> f64 {
        let ticks = self.ticks();
        let last = ticks.labelled.last();
        let at_end = last.filter(|(value, _)| self.place(*value).is_some_and(|p| (p - self.end).abs() < 1.0));
        at_end.map_or(0.0, |(_, label)| text_width(label))
    }

    fn decades(&self) -> Ticks {
        let first = (self.low.log10() - 1e-9).ceil() as i32;
        let last = (self.high.log10() + 1e-9).floor() as i32;
        let wanted = ((self.end - self.start).abs() / 45.0).clamp(2.0, 8.0) as i32;
        let every = ((last - first) / wanted + 1).max(1);
        let plain = first >= -3 && last <= 4;
        let labelled = (first..=last)
            .filter(|e| (e - first) % every == 0)
            .map(|e| {
                let label = if plain {
                    fixed(10f64.powi(e), (-e).max(0) as usize)
                } else {
                    power_of_ten(e)
                };
                (10f64.powi(e), label)
            })
            .collect();
        let small = if every == 1 {
            (first - 1..=last)
                .flat_map(|e| (2..10).map(move |m| f64::from(m) * 10f64.powi(e)))
                .filter(|x| (self.low..=self.high).contains(x))
                .collect()
        } else {
            Vec::new()
        };
        Ticks {
            labelled,
            small,
            title: self.title(0),
        }
    }

    fn steps(&self) -> Ticks {
        let step = self.step();
        let largest = self.low.abs().max(self.high.abs());
        // A common power of ten moves to the title, so that labels stay short.
        let scale = if (1e-3..1e5).contains(&largest) {
            0
        } else {
            (largest.log10() / 3.0).floor() as i32 * 3
        };
        let unit = 10f64.powi(scale);
        let decimals = (-(step / unit * 1.0001).log10().floor()).max(0.0) as usize;
        let first = (self.low / step - 1e-9).ceil() as i64;
        let last = (self.high / step + 1e-9).floor() as i64;
        let labelled = (first..=last.min(first + 100))
            .map(|i| {
                let x = i as f64 * step;
                (x, fixed(x / unit, decimals))
            })
            .collect();
        Ticks {
            labelled,
            small: Vec::new(),
            title: self.title(scale),
        }
    }

    /// Distance from the left edge of a drawing at which a chart with this axis may begin, so that labels and title
    /// next to it do not touch.
    pub(crate) fn left(&self) -> f64 {
        /// Enough for five digits.
        const USUAL: f64 = 66.0;
        /// Width of the title, and of the ticks between labels and chart.
        const BESIDE: f64 = 30.0;
        let widths = self.ticks().labelled.into_iter().map(|(_, label)| text_width(&label));
        widths.fold(USUAL, |left, width| left.max(width + BESIDE))
    }

    fn title(&self, scale: i32) -> String {
        let mut unit = self.axis.unit.clone();
        if scale != 0 {
            unit = format!("{} {unit}", power_of_ten(scale)).trim_end().to_owned();
        }
        if unit.is_empty() {
            self.axis.name.clone()
        } else if self.axis.name.is_empty() {
            format!("[{unit}]")
        } else {
            format!("{} [{unit}]", self.axis.name)
        }
    }

    /// Description of the axis as text.
    pub(crate) fn words(&self) -> String {
        format!("{} from {} to {}", self.title(0), sig(self.low, 3), sig(self.high, 3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, data: [f64; 2]) -> (Vec<String>, String) {
        let ticks = axis.fit(data, 0.0, 400.0, true).ticks();
        (ticks.labelled.into_iter().map(|t| t.1).collect(), ticks.title)
    }

    #[test]
    fn ticks_are_round_and_cover_the_data() {
        let (text, title) = labels(&Axis::linear("width", "nm"), [102.3, 288.7]);
        assert_eq!(text, ["100", "150", "200", "250", "300"]);
        assert_eq!(title, "width [nm]");
        let (text, title) = labels(&Axis::linear("pillars", ""), [0.0, 6_411_448.0]);
        assert_eq!(text, ["0", "1", "2", "3", "4", "5", "6", "7"]);
        assert_eq!(title, "pillars [10⁶]");
        let (text, _) = labels(&Axis::log("|E|²", ""), [3e-5, 0.4]);
        assert_eq!(text, ["10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "10⁰"]);
    }

    #[test]
    fn data_that_are_no_use_still_give_an_axis() {
        for data in [[f64::NAN, f64::NAN], [0.0, 0.0], [-1.0, -1.0], [f64::INFINITY, 2.0]] {
            for axis in [Axis::linear("x", ""), Axis::log("x", "")] {
                let fitted = axis.fit(data, 0.0, 400.0, true);
                assert!(
                    fitted.low < fitted.high && !fitted.ticks().labelled.is_empty(),
                    "{data:?} {axis:?}"
                );
            }
        }
    }
}
