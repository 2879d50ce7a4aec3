//! `[array]`: where the elements are and where each of them looks.

use serde::Serialize;

use super::LensSpec;
use super::lens::WAVELENGTH;
use metalith_core::Wedge;
use metalith_core::document::{Limits, Section};

/// A grid of elements, each the same lens with a wedge of its own.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArraySpec {
    /// Number of elements along x and y, odd, so that one is in the centre.
    pub count: (u32, u32),
    /// Distance of neighbouring elements (nm).
    pub spacing_nm: i64,
    /// Steering of an element by each step from the centre (degrees).
    pub steering_deg: f64,
    /// Wavelength lambda_w at which a wedge steers by its angle (um).
    pub wedge_wavelength_um: f64,
}

/// One element of the array.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Element {
    /// Steps from the centre element along x and y: (m, n) of the paper.
    pub index: (i32, i32),
    /// Centre on the chip (nm).
    pub centre_nm: (i64, i64),
    /// The phase that steers it.
    pub wedge: Wedge,
}

impl Element {
    /// `(m, n)`, as it is written in reports and cell names.
    pub fn label(&self) -> String {
        format!("({}, {})", self.index.0, self.index.1)
    }

    /// Centre on the chip (um).
    pub fn centre_um(&self) -> [f64; 2] {
        [self.centre_nm.0 as f64 * 1e-3, self.centre_nm.1 as f64 * 1e-3]
    }
}

impl ArraySpec {
    pub(crate) fn read(s: &Section<'_, '_>, lens: &LensSpec) -> Self {
        let count = s.array::<2>("elements", Limits::new(1.0..=99.0, "elements along x and y"));
        if count.iter().any(|c| c.fract() != 0.0 || c % 2.0 != 1.0) {
            s.fault(
                "elements",
                format!("{} by {} elements have none in the centre", count[0], count[1]),
                "use odd whole numbers",
            );
        }
        let spacing_um = s.float("spacing_um", Limits::new(1.0..=100_000.0, "um"));
        let spacing_nm = (spacing_um * 1e3).round() as i64;
        if count.iter().any(|&c| c > 1.0) && spacing_nm < i64::from(lens.diameter_nm) && s.has("spacing_um") {
            s.fault_given(
                &["lens.diameter_um", "array.elements"],
                "spacing_um",
                "neighbouring lenses overlap",
                format!(
                    "use at least the lens diameter, {} um",
                    f64::from(lens.diameter_nm) * 1e-3
                ),
            );
        }
        if (spacing_um * 1e3 - spacing_nm as f64).abs() > 1e-6 {
            s.fault(
                "spacing_um",
                format!("{spacing_um} um is not whole nanometres"),
                "round it to 0.001 um",
            );
        }
        let spec = Self {
            count: (count[0] as u32, count[1] as u32),
            spacing_nm,
            steering_deg: s
                .optional_float("steering_deg", Limits::new(0.0..=89.0, "degrees"))
                .unwrap_or(0.0),
            wedge_wavelength_um: s.optional_float("wedge_wavelength_nm", WAVELENGTH).unwrap_or(550.0) * 1e-3,
        };
        let outermost = f64::from(spec.count.0.max(spec.count.1) / 2) * spec.steering_deg;
        if outermost >= 90.0 {
            s.fault_given(
                &["array.elements"],
                "steering_deg",
                format!("the outermost element would steer by {outermost} degrees"),
                "keep it below 90",
            );
        }
        s.finish();
        spec
    }

    /// The elements, row by row from the lowest.
    pub fn elements(&self) -> Vec<Element> {
        let (mx, my) = (self.count.0 as i32 / 2, self.count.1 as i32 / 2);
        let wedge_sine = |step: i32| (f64::from(step) * self.steering_deg).to_radians().sin();
        (-my..=my)
            .flat_map(|n| (-mx..=mx).map(move |m| (m, n)))
            .map(|(m, n)| Element {
                index: (m, n),
                centre_nm: (i64::from(m) * self.spacing_nm, i64::from(n) * self.spacing_nm),
                wedge: Wedge {
                    wavelength_um: self.wedge_wavelength_um,
                    sin_x: wedge_sine(m),
                    sin_y: wedge_sine(n),
                },
            })
            .collect()
    }
}
