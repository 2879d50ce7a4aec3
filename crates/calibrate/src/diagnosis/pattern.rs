//! A quantity that was fitted free for each element, colour, distance or angle, and what its values follow.

use metalith_report::sig;
use serde::Serialize;

use crate::grouping::{Grouping, linear_trend};
use crate::set::{MeasuredSet, MeasurementIndex};
use crate::simulator::Simulator;
use crate::statistics::{LinearTrend, Pattern};

/// A quantity that was fitted free for each element, colour, distance or angle, where this removes most of the residual.
#[derive(Clone, Debug, Serialize)]
pub struct FreePattern {
    /// The effect whose parameter it is, with the number of the parameter if it has several.
    pub quantity: String,
    /// Unit of the parameter.
    pub unit: String,
    /// `element`, `colour`, `distance` or `angle`.
    pub by: String,
    pub values: Vec<GroupValue>,
    /// Reduced chi-square per pixel without and with it.
    pub before: f64,
    pub after: f64,
    /// Trend of the values over the place of the element, the wavelength, the distance or the angle.
    pub linear_trend: Option<PatternTrend>,
}

/// The value of a quantity in one group of measurements.
#[derive(Clone, Debug, Serialize)]
pub struct GroupValue {
    pub group: String,
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}

/// Values put as linear in what the groups differ in.
#[derive(Clone, Debug, Serialize)]
pub struct PatternTrend {
    /// Coordinate in words: the place of the element, the wavelength, the distance, the angle of incidence.
    pub of: String,
    /// True if they are linear in it, to what they are known to.
    pub is_linear: bool,
    /// Middle of what the groups span: um on the chip, nm, um, or degrees.
    pub middle: [f64; 2],
    /// Value there, with its standard deviation.
    pub at_middle: [f64; 2],
    pub slopes: Vec<Slope>,
    /// Distance of the farthest value from that.
    pub off: f64,
    /// Values beyond as many as determine the trend: with none, any values are linear.
    pub degrees_of_freedom: usize,
    /// Cause if they are linear.
    pub means: Option<String>,
    /// Effects that these groups cannot distinguish.
    pub remark: Option<String>,
}

/// Slope of the values along one direction.
#[derive(Clone, Debug, Serialize)]
pub struct Slope {
    /// Unit vector.
    pub along: [f64; 2],
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
    pub unit: String,
}

/// Difference of the groups: in words, the unit that slopes are given per, and how many of the unit of the coordinates that is.
fn trend_of(by: Grouping) -> (&'static str, &'static str, f64) {
    match by {
        Grouping::Element => ("place of the element", "mm", 1e3),
        Grouping::Colour => ("wavelength", "100 nm", 100.0),
        Grouping::Distance => ("distance", "um", 1.0),
        Grouping::Angle => ("angle of incidence", "degree", 1.0),
    }
}

impl FreePattern {
    /// Pattern in the form of the report.
    pub fn new(simulator: &Simulator<'_>, pattern: &Pattern) -> Self {
        let (set, by) = (simulator.bench.set(), Grouping::of(pattern));
        let slot = simulator.slots[pattern.slot];
        let effect = &simulator.effects[slot.effect];
        // Some effects report another number than the one that is fitted.
        let unit = if effect.value(1.0, set) == 1.0 {
            effect.unit()
        } else {
            "of its parameter"
        };
        let values = pattern.groups.iter().zip(&pattern.values);
        let mut out = Self {
            quantity: match effect.parameters().len() {
                1 => effect.name(),
                _ => format!("{}[{}]", effect.name(), slot.index),
            },
            unit: unit.into(),
            by: by.word().into(),
            values: values
                .map(|(&c, &(value, sigma))| GroupValue {
                    group: label(set, by, c),
                    value,
                    sigma,
                })
                .collect(),
            before: pattern.chi2.1,
            after: pattern.chi2.0,
            linear_trend: None,
        };
        let gradient = effect.as_gradient().filter(|_| by == Grouping::Element);
        out.linear_trend = linear_trend(pattern, set).map(|c| out.trend_from(&c, by, gradient));
        out
    }

    fn trend_from(&self, trend: &LinearTrend, by: Grouping, gradient: Option<&str>) -> PatternTrend {
        let (of, per, factor) = trend_of(by);
        let slopes = trend.extent.directions.iter().zip(&trend.slopes);
        let slopes = slopes.map(|(along, (value, sigma))| Slope {
            along: *along,
            value: factor * value,
            sigma: factor * sigma,
            unit: format!("{} per {per}", self.unit),
        });
        PatternTrend {
            of: of.into(),
            is_linear: trend.is_linear,
            middle: trend.extent.middle,
            at_middle: [trend.at_middle.0, trend.at_middle.1],
            slopes: slopes.collect(),
            off: trend.off,
            degrees_of_freedom: trend.degrees_of_freedom,
            means: gradient.filter(|_| trend.is_linear).map(str::to_owned),
            remark: (trend.degrees_of_freedom == 0).then(|| {
                if by == Grouping::Element && self.quantity == "defocus" {
                    untold_tilt(self.values.len())
                } else {
                    untold(self.values.len(), &self.by, "a slope", "its own value")
                }
            }),
        }
    }

    /// One line for a person.
    pub fn sentence(&self) -> String {
        let one = |v: &GroupValue| format!("{}: {} +- {}", v.group, sig(v.value, 3), sig(v.sigma, 1));
        let values: Vec<String> = self.values.iter().map(one).collect();
        let trend = self
            .linear_trend
            .as_ref()
            .map_or_else(String::new, |c| c.sentence(&self.unit));
        format!(
            "`{}` by {} ({}): reduced chi-square {} to {}.{trend}",
            self.quantity,
            self.by,
            values.join(", "),
            sig(self.before, 3),
            sig(self.after, 3)
        )
    }
}

impl PatternTrend {
    fn sentence(&self, unit: &str) -> String {
        let slope = |s: &Slope| {
            let along = match s.along {
                _ if self.of != "place of the element" && self.slopes.len() == 1 => String::new(),
                [1.0, 0.0] => " along x".into(),
                [0.0, 1.0] => " along y".into(),
                [x, y] => format!(" along ({}, {})", sig(x, 3), sig(y, 3)),
            };
            format!("{} +- {} {}{along}", sig(s.value, 3), sig(s.sigma, 1), s.unit)
        };
        let slopes: Vec<String> = self.slopes.iter().map(slope).collect();
        let [middle, sigma] = self.at_middle;
        let mut text = if self.is_linear {
            format!(
                " It is linear in the {}: {}, {} +- {} {unit} in the middle.",
                self.of,
                slopes.join(" and "),
                sig(middle, 3),
                sig(sigma, 1)
            )
        } else {
            format!(
                " It is not linear in the {}: the farthest value is {} {unit} off.",
                self.of,
                sig(self.off, 3)
            )
        };
        if let Some(means) = &self.means {
            text.push_str(&format!(" That is {means}."));
        }
        if let Some(remark) = &self.remark {
            text.push_str(&format!(" {remark}"));
        }
        text
    }
}

/// What values cannot distinguish of which there are as many as numbers: `count` of them, one for each element, colour, distance
/// or angle.
fn untold(count: usize, by: &str, slope: &str, own: &str) -> String {
    match count {
        1 => format!(
            "Of one {by}, {slope} and {own} cannot be distinguished; measurements of another {by} would distinguish them."
        ),
        2 => format!(
            "Of two, {slope} and {own} for each {by} cannot be distinguished: two values are always on a line; measurements of a third {by} would tell."
        ),
        _ => format!(
            "Of three that are not in line, {slope} with another value in the middle and {own} for each {by} cannot be distinguished: three values are always on a plane; measurements of a fourth {by} would tell."
        ),
    }
}

/// Statement that so many elements do not distinguish a tilt of the sensor from individual distances.
pub(super) fn untold_tilt(elements: usize) -> String {
    untold(elements, "element", "a tilt of the sensor", "its own distance")
}

/// Statement that one colour does not distinguish effects that differ by colour alone.
pub(super) fn untold_colours() -> String {
    let widths = untold(1, "colour", "an index or a height of the film", "a bias of widths");
    widths + " So it is with the centre of a lamp and a defocus."
}

fn label(set: &MeasuredSet, by: Grouping, c: MeasurementIndex) -> String {
    let measurement = &set.measurements[c];
    match by {
        Grouping::Element => format!("{:?}", set.elements[measurement.element].index),
        Grouping::Colour => format!("{} nm", set.leds[measurement.led].name()),
        Grouping::Distance => format!("{} um", measurement.distance_um),
        Grouping::Angle => format!("{:.1?} deg", measurement.aoi_rad.map(f64::to_degrees)),
    }
}
