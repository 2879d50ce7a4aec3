//! Inputs of a check.

use metalith_design::Design;
use metalith_design::array::PillarArray;
use metalith_gds::Layout;

use super::waiver::{Date, Waivers};

/// Inputs of a check besides the layout itself.
#[derive(Default)]
pub struct CheckInput<'a> {
    /// Further layouts on the same substrate, such as the apertures.
    pub with: Vec<&'a Layout>,
    /// The design that the layout should hold.
    pub design: Option<&'a Design>,
    /// The pillars of that design, where the caller has computed them; else they are computed if a rule needs them.
    pub array: Option<&'a PillarArray>,
    pub waivers: Option<&'a Waivers>,
    /// Today, for the expiry of waivers.
    pub today: Date,
    /// Most markers that are kept for each rule; all violations are counted.
    pub markers: usize,
}
