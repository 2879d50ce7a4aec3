//! Index types: a capture, an LED and an element cannot be taken for one another.

use typed_index_collections::TiVec;

/// Declare index types over `usize`.
macro_rules! index_types {
    ($($(#[$doc:meta])* $name:ident;)*) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(usize);

        impl From<usize> for $name {
            fn from(index: usize) -> Self {
                Self(index)
            }
        }

        impl From<$name> for usize {
            fn from(index: $name) -> Self {
                index.0
            }
        }
    )*};
}

index_types! {
    /// A capture of a set: an index into [`crate::MeasuredSet::captures`].
    CaptureIndex;
    /// An LED of a set: an index into [`crate::MeasuredSet::leds`].
    LedIndex;
    /// An element of a set: an index into [`crate::MeasuredSet::elements`].
    ElementIndex;
}

/// One value for each capture.
pub type PerCapture<T> = TiVec<CaptureIndex, T>;

/// One value for each LED.
pub type PerLed<T> = TiVec<LedIndex, T>;

/// One value for each element.
pub type PerElement<T> = TiVec<ElementIndex, T>;
