//! The zones and bands of frequency that power is counted in.

use crate::score::Zone;

/// Zones of which the field is made.
pub(super) const ZONES: [Zone; 3] = [Zone::Centre, Zone::Edge, Zone::Corner];

/// Upper ends of bands of frequency (cycles a pixel): half of the power of a restoration is lost somewhere between the fifth and
/// the tenth, by the place in the field. The last one holds all that is finer.
pub(super) const BANDS: [f64; 14] = [
    0.008, 0.016, 0.03, 0.045, 0.06, 0.08, 0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.4, 1.0,
];

/// Powers of a plane by band.
pub(crate) type Bands = [f64; BANDS.len()];
