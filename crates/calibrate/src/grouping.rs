//! Ways of giving a quantity a value for each group of measurements: by element, colour, distance or angle.

use metalith_attribution::{LinearTrend, Pattern};

use crate::set::{MeasuredSet, MeasurementIndex};

/// Quantity that measurements of one group share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Grouping {
    Element,
    Colour,
    Distance,
    Angle,
}

impl Grouping {
    /// All of them, in the order of the groupings of [`Data`](crate::data::Data).
    pub(crate) const ALL: [Self; 4] = [Self::Element, Self::Colour, Self::Distance, Self::Angle];

    /// The grouping of a pattern.
    pub(crate) fn of(pattern: &Pattern) -> Self {
        Self::ALL[pattern.by]
    }

    /// Name of the quantity.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Element => "element",
            Self::Colour => "colour",
            Self::Distance => "distance",
            Self::Angle => "angle",
        }
    }

    /// Value that measurements of one group share: the place of the element (um), the centre of the LED (nm), the distance (um),
    /// or the angle of incidence (degrees).
    pub(crate) fn coordinates(self, set: &MeasuredSet, measurement: MeasurementIndex) -> [f64; 2] {
        let own = &set.measurements[measurement];
        match self {
            Self::Element => set.elements[own.element].centre_um,
            Self::Colour => [set.leds[own.led].centre_nm, 0.0],
            Self::Distance => [own.distance_um, 0.0],
            Self::Angle => own.aoi_rad.map(f64::to_degrees),
        }
    }
}

/// Trend of the values of a pattern over the coordinate of its groups; none if it has a single value.
pub(crate) fn linear_trend(pattern: &Pattern, set: &MeasuredSet) -> Option<LinearTrend> {
    let by = Grouping::of(pattern);
    let at: Vec<[f64; 2]> = pattern.groups.iter().map(|&c| by.coordinates(set, c)).collect();
    LinearTrend::new(&at, &pattern.values)
}
