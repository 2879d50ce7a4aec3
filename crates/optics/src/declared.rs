//! Terms that a person declares by an expression, where no effect of the library fits.
//!
//! | quantity | what the expression gives | its variables |
//! | --- | --- | --- |
//! | `opd_nm` | optical path added at a site (nm) | `x y r theta R X Y wavelength` |
//! | `phase_rad` | phase added at a site, the same at all colours if the expression is (rad) | the same |
//! | `amplitude` | relative change of the amplitude that a site transmits | the same |
//! | `width_nm` | added to the width of the pillar at a site (nm) | `w fill x y r theta R X Y` |
//! | `distance_um` | added to the distance of the sensor from an element (um) | `X Y` |
//! | `spectrum` | factor of the spectrum of each lamp, which keeps its power | `wavelength centre` |
//! | `kernel` | light at x, y from where it belongs, over what belongs there (1/um^2) | `x y` |
//! | `transfer` | factor of the transfer of the camera at a spatial frequency | `fx fy` |
//!
//! `x y r` from the element's centre and its aperture radius `R`, `X Y` from the centre of the chip to that of the
//! element (um); `theta` (rad) counts from +x to +y; `wavelength` and `centre` of the lamp (nm), drawn width `w` (nm),
//! area fraction `fill` around the site, spatial frequency `fx fy` on the sensor (1/um). Where an expression has no finite value it counts as zero.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::expression::{Expression, ExpressionFault, Input};
use metalith_pillars::Lattice;

/// Quantity that an expression stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeclaredQuantity {
    OpdNm,
    PhaseRad,
    Amplitude,
    WidthNm,
    DistanceUm,
    Spectrum,
    Kernel,
    Transfer,
}

/// An expression with values for its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeclaredTerm {
    /// Name of the effect that it belongs to.
    pub name: String,
    pub quantity: DeclaredQuantity,
    pub expression: String,
    /// The parameters by their names.
    pub values: BTreeMap<String, f64>,
}

/// A term ready to be evaluated.
#[derive(Clone, Debug, PartialEq)]
pub struct CompiledTerm {
    pub quantity: DeclaredQuantity,
    expression: Expression,
    /// The parameters, which stand after the variables of the quantity.
    values: Vec<f64>,
}

const PUPIL: [&str; 8] = ["x", "y", "r", "theta", "R", "X", "Y", "wavelength"];
const WIDTH: [&str; 9] = ["w", "fill", "x", "y", "r", "theta", "R", "X", "Y"];

impl DeclaredQuantity {
    /// All of them by the key that they are declared by.
    pub const ALL: [(&'static str, Self); 8] = [
        ("opd_nm", Self::OpdNm),
        ("phase_rad", Self::PhaseRad),
        ("amplitude", Self::Amplitude),
        ("width_nm", Self::WidthNm),
        ("distance_um", Self::DistanceUm),
        ("spectrum", Self::Spectrum),
        ("kernel", Self::Kernel),
        ("transfer", Self::Transfer),
    ];

    /// Names of its variables.
    pub fn variables(self) -> &'static [&'static str] {
        match self {
            Self::OpdNm | Self::PhaseRad | Self::Amplitude => &PUPIL,
            Self::WidthNm => &WIDTH,
            Self::DistanceUm => &["X", "Y"],
            Self::Spectrum => &["wavelength", "centre"],
            Self::Kernel => &["x", "y"],
            Self::Transfer => &["fx", "fy"],
        }
    }

    /// True if it acts on the light that leaves each site.
    pub fn is_pupil(self) -> bool {
        matches!(self, Self::OpdNm | Self::PhaseRad | Self::Amplitude)
    }
}

impl DeclaredTerm {
    /// Parse the expression.
    ///
    /// # Errors
    /// What is wrong with it, and where.
    pub fn compiled(&self) -> Result<CompiledTerm, ExpressionFault> {
        let parameters = self.values.keys().map(String::as_str);
        let names: Vec<&str> = self.quantity.variables().iter().copied().chain(parameters).collect();
        Ok(CompiledTerm {
            quantity: self.quantity,
            expression: Expression::parse(&self.expression, &names)?,
            values: self.values.values().copied().collect(),
        })
    }
}

/// The terms of some quantities; those that cannot be parsed have been refused where they were read.
pub(crate) fn compiled(terms: &[DeclaredTerm], of: impl Fn(DeclaredQuantity) -> bool) -> Vec<CompiledTerm> {
    let wanted = terms.iter().filter(|t| of(t.quantity));
    wanted.filter_map(|t| t.compiled().ok()).collect()
}

impl CompiledTerm {
    /// The value for these variables, in the order of [`DeclaredQuantity::variables`].
    pub fn value(&self, variables: &[f64]) -> f64 {
        let all: Vec<f64> = variables.iter().chain(&self.values).copied().collect();
        finite(self.expression.value(&all))
    }

    /// The values along a row.
    pub fn row(&self, variables: &[Input<'_>], out: &mut [f64]) {
        let parameters = self.values.iter().map(|v| Input::Scalar(*v));
        let all: Vec<Input<'_>> = variables.iter().copied().chain(parameters).collect();
        self.expression.row(&all, out);
        out.iter_mut().for_each(|v| *v = finite(*v));
    }

    /// True if it differs from one wavelength to another.
    pub fn depends_on_wavelength(&self) -> bool {
        self.uses("wavelength")
    }

    /// True if it depends on a variable.
    pub fn uses(&self, variable: &str) -> bool {
        let place = self.quantity.variables().iter().position(|v| *v == variable);
        place.is_some_and(|place| self.expression.uses(place))
    }
}

fn finite(v: f64) -> f64 {
    if v.is_finite() { v } else { 0.0 }
}

/// Places of the sites of one row of a lattice.
pub(crate) struct RowPlaces {
    x: Vec<f64>,
    y: f64,
    r: Vec<f64>,
    theta: Vec<f64>,
    /// Aperture radius, and centre of the element (um).
    radius: f64,
    centre: [f64; 2],
}

impl RowPlaces {
    pub(crate) fn new(lattice: Lattice, iy: usize, radius_um: f64, centre_um: [f64; 2]) -> Self {
        let x: Vec<f64> = (0..lattice.sites()).map(|ix| lattice.place_um(0, ix)).collect();
        let y = lattice.place_um(1, iy);
        Self {
            r: x.iter().map(|x| x.hypot(y)).collect(),
            theta: x.iter().map(|x| y.atan2(*x)).collect(),
            x,
            y,
            radius: radius_um,
            centre: centre_um,
        }
    }

    /// `x y r theta R X Y`, which pupils and widths have in common.
    pub(crate) fn inputs(&self) -> [Input<'_>; 7] {
        [
            Input::Row(&self.x),
            Input::Scalar(self.y),
            Input::Row(&self.r),
            Input::Row(&self.theta),
            Input::Scalar(self.radius),
            Input::Scalar(self.centre[0]),
            Input::Scalar(self.centre[1]),
        ]
    }
}
