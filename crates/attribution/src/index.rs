//! Index types: a measurement cannot be taken for anything else that is counted.

use typed_index_collections::TiVec;

/// Declare index types over `usize`.
#[macro_export]
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
    /// The number of a measurement among all of a set.
    MeasurementIndex;
}

/// One value for each measurement.
pub type PerMeasurement<T> = TiVec<MeasurementIndex, T>;
