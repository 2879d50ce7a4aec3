//! Index types: an LED and an element cannot be taken for one another.

use metalith_attribution::index_types;
use typed_index_collections::TiVec;

pub use metalith_attribution::{MeasurementIndex, PerMeasurement};

index_types! {
    /// An LED of a set: an index into [`crate::MeasuredSet::leds`].
    LedIndex;
    /// An element of a set: an index into [`crate::MeasuredSet::elements`].
    ElementIndex;
}

/// One value for each LED.
pub type PerLed<T> = TiVec<LedIndex, T>;

/// One value for each element.
pub type PerElement<T> = TiVec<ElementIndex, T>;
