//! `[array]`: where the elements are and where each of them looks.

use serde::Serialize;

use super::footprint::{Footprint, um};
use super::lens::WAVELENGTH;
use super::{CellSpec, LensSpec, phase_term};
use metalith_core::Wedge;
use metalith_core::document::{Limits, Section};

/// Wavelength at which the wedges of the paper steer by their angles (nm).
const PAPER_WEDGE_NM: f64 = 550.0;

/// Elements of one lens, each with its own wedge: on a grid, or wherever each is said to be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArraySpec {
    /// Number of elements of the grid along x and y.
    pub count: (u32, u32),
    /// Distance of neighbouring elements of the grid along x (nm).
    pub spacing_nm: i64,
    /// Spacing along y, where it is another.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spacing_y_nm: Option<i64>,
    /// Steering of an element by each step from the middle (degrees).
    pub steering_deg: f64,
    /// Wavelength lambda_w at which a wedge steers by its angle (um).
    pub wedge_wavelength_um: f64,
    /// Elements that are placed one by one, in place of the grid.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub placed: Vec<PlacedSpec>,
}

/// An element that is placed individually.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlacedSpec {
    /// Centre on the chip (nm).
    pub centre_nm: (i64, i64),
    /// Steering along x and y (degrees).
    pub steering_deg: (f64, f64),
    /// Rotation of the phase of its lens about its middle, from x towards y (degrees); the steering is not rotated.
    #[serde(skip_serializing_if = "is_zero")]
    pub rotation_deg: f64,
    /// Own lens, in place of that all share.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens: Option<LensSpec>,
}

/// Test by which serde leaves the key out where nothing is rotated.
#[allow(clippy::trivially_copy_pass_by_ref)]
fn is_zero(deg: &f64) -> bool {
    *deg == 0.0
}

/// One element of the array.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Element {
    /// Steps from the middle of the grid along x and y: (m, n) of the paper. Of an even number the two beside the middle are
    /// -1 and 1. Elements that are placed one by one are counted from (1, 0) on.
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

    /// Square of the distance from the middle of the chip (nm²), to tell the nearest element and the furthest.
    pub fn distance_nm2(&self) -> i64 {
        let (x, y) = self.centre_nm;
        x * x + y * y
    }
}

impl ArraySpec {
    /// The array; `phase` is the section of the phase that all elements share, `mapping_um` the wavelength of the mapping.
    pub(crate) fn read(
        s: &Section<'_, '_>,
        lens: &LensSpec,
        phase: &Section<'_, '_>,
        cell: &CellSpec,
        mapping_um: f64,
        placed: &[Section<'_, '_>],
    ) -> Self {
        let default_um = if cell.is_of_the_paper() {
            PAPER_WEDGE_NM * 1e-3
        } else {
            lens.focused_um().unwrap_or(mapping_um)
        };
        let wedge_wavelength_um = s
            .optional_float("wedge_wavelength_nm", WAVELENGTH)
            .map_or(default_um, |nm| nm * 1e-3);
        let spec = if placed.is_empty() {
            Self::read_grid(s, lens, cell, wedge_wavelength_um)
        } else {
            Self {
                wedge_wavelength_um,
                ..Self::read_placed(s, lens, phase, cell, placed)
            }
        };
        s.finish();
        phase_term::check_elements(&spec, lens, phase, placed);
        spec
    }

    fn read_grid(s: &Section<'_, '_>, lens: &LensSpec, cell: &CellSpec, wedge_wavelength_um: f64) -> Self {
        let count = s.array::<2>("elements", Limits::new(1.0..=99.0, "elements along x and y"));
        if count.iter().any(|c| c.fract() != 0.0) {
            s.fault(
                "elements",
                format!("{} by {} elements", count[0], count[1]),
                "use whole numbers",
            );
        }
        let range = Limits::new(1.0..=1_000_000.0, "um");
        let spacing_um = if s.is_list("spacing_um") {
            s.array::<2>("spacing_um", range)
        } else {
            [s.float("spacing_um", range); 2]
        };
        let spacing_nm = spacing_um.map(|um| whole_nm(s, "spacing_um", um));
        let spec = Self {
            count: (count[0] as u32, count[1] as u32),
            spacing_nm: spacing_nm[0],
            spacing_y_nm: (spacing_nm[1] != spacing_nm[0]).then_some(spacing_nm[1]),
            steering_deg: s.float_or("steering_deg", Limits::new(0.0..=89.0, "degrees"), 0.0),
            wedge_wavelength_um,
            placed: Vec::new(),
        };
        let sides_nm = Footprint::of(lens, 0.0, cell).map(|footprint| footprint.sides_nm());
        if let Some([x, y]) = sides_nm.filter(|sides_nm| !spec.has_room_for(*sides_nm))
            && s.has("spacing_um")
        {
            s.fault_given(
                &["lens.diameter_um", "cell.pitch_nm", "array.elements"],
                "spacing_um",
                "neighbouring lenses overlap, or the boxes about their pillars do",
                if x == y {
                    format!("use at least {} um: the lens with its lattice", um(x))
                } else {
                    format!("use at least [{}, {}] um: the lens with its lattice", um(x), um(y))
                },
            );
        }
        let outermost = steps_from_middle(spec.count.0.max(spec.count.1))
            .next_back()
            .unwrap_or(0.0)
            * spec.steering_deg;
        if outermost >= 90.0 {
            s.fault_given(
                &["array.elements"],
                "steering_deg",
                format!("the outermost element would steer by {outermost} degrees"),
                "keep it below 90",
            );
        }
        spec
    }

    /// `[[element]]`: each individually.
    fn read_placed(
        s: &Section<'_, '_>,
        lens: &LensSpec,
        phase: &Section<'_, '_>,
        cell: &CellSpec,
        sections: &[Section<'_, '_>],
    ) -> Self {
        for key in ["elements", "spacing_um", "steering_deg"] {
            s.refuse(
                key,
                "a grid beside elements that are placed one by one",
                format!("leave `{key}` out, or the sections `[[element]]`"),
            );
        }
        let angle = Limits::new(-89.0..=89.0, "degrees");
        let placed: Vec<_> = sections
            .iter()
            .zip(1..)
            .map(|(s, k)| {
                let place = Limits::new(-150_000.0..=150_000.0, "um");
                let [x, y] = ["x_um", "y_um"].map(|key| whole_nm(s, key, s.float(key, place.clone())));
                let [steer_x, steer_y] =
                    ["steering_x_deg", "steering_y_deg"].map(|key| s.float_or(key, angle.clone(), 0.0));
                let spec = PlacedSpec {
                    centre_nm: (x, y),
                    steering_deg: (steer_x, steer_y),
                    rotation_deg: s.float_or("rotation_deg", Limits::new(-360.0..=360.0, "degrees"), 0.0),
                    lens: LensSpec::read_own(s, lens, phase, (k, 0), cell),
                };
                s.finish();
                spec
            })
            .collect();
        let spec = Self {
            count: (0, 0),
            spacing_nm: 0,
            spacing_y_nm: None,
            steering_deg: 0.0,
            wedge_wavelength_um: 0.0,
            placed,
        };
        spec.apart(lens, cell, sections);
        spec
    }

    /// The lens of the element of an index: its own, or that all share.
    pub fn lens_of<'a>(&'a self, shared: &'a LensSpec, index: (i32, i32)) -> &'a LensSpec {
        self.placed(index).and_then(|p| p.lens.as_ref()).unwrap_or(shared)
    }

    /// Specification of an element that was placed individually.
    pub fn placed(&self, index: (i32, i32)) -> Option<&PlacedSpec> {
        self.placed.get(usize::try_from(index.0).ok()?.checked_sub(1)?)
    }

    /// Rotation of the lens of an element (degrees).
    pub fn rotation_deg(&self, index: (i32, i32)) -> f64 {
        self.placed(index).map_or(0.0, |p| p.rotation_deg)
    }

    /// True if lenses that need so much along x and along y (nm) have room next to one another, as far as a grid shows.
    pub(crate) fn has_room_for(&self, sides_nm: [i64; 2]) -> bool {
        let counts = [self.count.0, self.count.1];
        let spacings_nm = [self.spacing_nm, self.spacing_y_nm.unwrap_or(self.spacing_nm)];
        self.placed.is_empty() && (0..2).all(|axis| counts[axis] == 1 || spacings_nm[axis] >= sides_nm[axis])
    }

    /// True if an element has an individual lens, or one that is rotated.
    pub fn has_own_lenses(&self) -> bool {
        self.placed.iter().any(|p| p.lens.is_some() || p.rotation_deg != 0.0)
    }

    /// The lenses of all elements; where all share one, that.
    pub fn lenses<'a>(&'a self, shared: &'a LensSpec) -> impl Iterator<Item = &'a LensSpec> {
        let own = self.placed.iter().map(move |p| p.lens.as_ref().unwrap_or(shared));
        own.chain(self.placed.is_empty().then_some(shared))
    }

    /// Diameter of the largest lens (nm).
    pub fn largest_nm(&self, shared: &LensSpec) -> u32 {
        let each = self.lenses(shared).map(|lens| lens.diameter_nm);
        each.max().expect("the shared one at least")
    }

    /// The elements: of a grid row by row from the lowest, else as they are listed.
    pub fn elements(&self) -> Vec<Element> {
        let element = |index, centre_nm, (x_deg, y_deg): (f64, f64)| Element {
            index,
            centre_nm,
            wedge: Wedge {
                wavelength_um: self.wedge_wavelength_um,
                sin_x: x_deg.to_radians().sin(),
                sin_y: y_deg.to_radians().sin(),
            },
        };
        if !self.placed.is_empty() {
            let each = self.placed.iter().zip(1..);
            return each
                .map(|(p, k)| element((k, 0), p.centre_nm, p.steering_deg))
                .collect();
        }
        let spacing_y_nm = self.spacing_y_nm.unwrap_or(self.spacing_nm);
        let place = |half_steps: i64, spacing_nm: i64| half_steps * spacing_nm / 2;
        let mut elements = Vec::new();
        for (n, y) in indices(self.count.1) {
            for (m, x) in indices(self.count.0) {
                let steering = |half_steps: i64| 0.5 * half_steps as f64 * self.steering_deg;
                let centre = (place(x, self.spacing_nm), place(y, spacing_y_nm));
                elements.push(element((m, n), centre, (steering(x), steering(y))));
            }
        }
        elements
    }

    /// One element in the middle of the chip, not steered.
    #[must_use]
    pub fn alone(&self) -> Self {
        Self {
            count: (1, 1),
            steering_deg: 0.0,
            placed: Vec::new(),
            ..self.clone()
        }
    }

    /// Distance of neighbouring elements along x and y in words; nothing where they are placed one by one.
    pub fn spacing_words(&self) -> Option<String> {
        self.placed.is_empty().then(|| match self.spacing_y_nm {
            None => format!("{} um", um(self.spacing_nm)),
            Some(y) => format!("{} by {} um", um(self.spacing_nm), um(y)),
        })
    }
}

/// Index of each of so many elements of an axis, and its place in half steps from the middle.
fn indices(count: u32) -> impl Iterator<Item = (i32, i64)> {
    (0..i64::from(count)).map(move |k| {
        let half_steps = 2 * k - (i64::from(count) - 1);
        let index = if half_steps % 2 == 0 {
            half_steps / 2
        } else {
            (half_steps + half_steps.signum()) / 2
        };
        (index as i32, half_steps)
    })
}

/// Distances of elements from the middle of an axis of so many (steps), rising.
fn steps_from_middle(count: u32) -> impl DoubleEndedIterator<Item = f64> {
    let distances: Vec<f64> = indices(count).map(|(_, half)| 0.5 * half.max(0) as f64).collect();
    distances.into_iter()
}

/// A length of a text (um) as whole nanometres; anything between two of them is a fault.
pub(super) fn whole_nm(s: &Section<'_, '_>, key: &str, um: f64) -> i64 {
    let nm = (um * 1e3).round() as i64;
    if (um * 1e3 - nm as f64).abs() > 1e-6 {
        s.fault(key, format!("{um} um is not whole nanometres"), "round it to 0.001 um");
    }
    nm
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(count: (u32, u32)) -> ArraySpec {
        ArraySpec {
            count,
            spacing_nm: 1000,
            spacing_y_nm: Some(3000),
            steering_deg: 10.0,
            wedge_wavelength_um: 0.55,
            placed: Vec::new(),
        }
    }

    #[test]
    fn grids_of_any_number_are_about_the_middle() {
        let columns: Vec<_> = grid((4, 1))
            .elements()
            .iter()
            .map(|e| (e.index.0, e.centre_nm.0))
            .collect();
        assert_eq!(columns, [(-2, -1500), (-1, -500), (1, 500), (2, 1500)]);
        let rows: Vec<_> = grid((1, 3))
            .elements()
            .iter()
            .map(|e| (e.index.1, e.centre_nm.1))
            .collect();
        assert_eq!(rows, [(-1, -3000), (0, 0), (1, 3000)]);
        let last = grid((2, 3)).elements()[5];
        assert_eq!((last.index, last.centre_nm), ((1, 1), (500, 3000)));
        assert_eq!(last.wedge.sin_x, 5f64.to_radians().sin());
        assert_eq!(last.wedge.sin_y, 10f64.to_radians().sin());
    }
}
