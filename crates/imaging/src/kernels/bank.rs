//! The kernels of all elements over their fields.

use std::borrow::Cow;

use metalith_core::{Error, Result};
use metalith_design::array::Symmetry;
use serde::{Deserialize, Serialize};

/// Most bytes that the numbers of a bank or of its stray light may have: both are held in memory, and refused before they are
/// made if they would be more.
pub(crate) const MOST_BYTES: u64 = 4 << 30;
/// Radius of lenses whose fast fields err by more than accurate ones, which cost as much there: what is seen of them is mostly the
/// window of a kernel (um).
pub(crate) const SMALL_UM: f64 = 150.0;

/// Specification of the sampling of a bank.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BankSpec {
    /// Edge of a sensor pixel (um).
    pub pixel_um: f64,
    /// Pixels an axis of a kernel, even. What lands outside is the stray light's.
    pub window: usize,
    /// Places an axis of the field of each element, odd, at which kernels are formed.
    pub nodes: usize,
    /// Distance from the element's axis to the last of these places (um): light whose chief ray lands farther off is
    /// the stray light's.
    pub reach_um: f64,
    /// Fields of all elements to 1e-5 of the matched peak, those of small lenses always, instead of to 1e-3; see [`metalith_wave::Accuracy`].
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub accurate: bool,
}

impl BankSpec {
    /// Place of node `i` of an axis, from the element's axis (um).
    pub fn node_um(&self, i: usize) -> f64 {
        match self.nodes {
            1 => 0.0,
            n => self.reach_um * (2.0 * i as f64 / (n as f64 - 1.0) - 1.0),
        }
    }

    /// Place among the nodes of a place on the sensor from the element's axis (um).
    pub fn place(&self, um: f64) -> f64 {
        match self.nodes {
            1 => 0.0,
            n => 0.5 * (um / self.reach_um + 1.0) * (n as f64 - 1.0),
        }
    }

    /// Values an axis of a kernel.
    pub fn side(&self) -> usize {
        2 * self.window
    }

    /// Checks that the kernels of so many different places of elements can be held and stored, in so many channels and
    /// spectra, made of so many wavelengths.
    ///
    /// # Errors
    /// If they are too many.
    pub fn check_size(&self, places: usize, channels: usize, bases: usize, wavelengths: usize) -> Result<()> {
        let kernels = channels as u64 * bases as u64 * (self.side() as u64).pow(2);
        let values = (places as u64).saturating_mul(kernels + wavelengths as u64);
        let bytes = values.saturating_mul(size_of::<f32>() as u64);
        if bytes <= MOST_BYTES {
            return Ok(());
        }
        Err(Error::refused(
            "camera/too-much-memory",
            format!(
                "images of points at {places} places of elements, in {channels} channels and {bases} spectra of {} x {} pixels, would take {} MB",
                self.window,
                self.window,
                bytes >> 20
            ),
            "give a camera with fewer channels, a scene with fewer spectra (a picture in colour has three), or an array whose elements are alike",
        ))
    }
}

/// Kernels of every element, channel and spectrum of the scene, on a grid over the field of the element.
///
/// The place of a node is where light of the wedge's wavelength lands; the middle of a kernel is where light of the
/// channel's own wavelength lands from there. A kernel holds the energy in a pixel, as a share of the light of its
/// channel that arrives at the element, with pixels at every half of one.
#[derive(Clone, Debug)]
pub struct KernelBank {
    pub spec: BankSpec,
    /// Wavelength about whose chief ray the kernels of each channel are (um).
    pub channel_um: Vec<f64>,
    /// Spectra of the scene.
    pub bases: usize,
    /// Elements that are copies of one another share kernels: index into `distinct`, and what turns that one into this.
    pub elements: Vec<(usize, Symmetry)>,
    pub distinct: Vec<DistinctKernels>,
}

/// The kernels of one distinct element.
#[derive(Clone, Debug)]
pub struct DistinctKernels {
    /// Kernels of each node, row by row, and the symmetry that turns them into the kernels of the node.
    pub nodes: Vec<(usize, Symmetry)>,
    /// Unique node, channel, spectrum, then rows of `side` values.
    pub values: Vec<f32>,
    /// Share of the light of each wavelength that lands in the window of its own chief ray: unique node, wavelength.
    pub in_window: Vec<f32>,
}

/// A kernel where it is, and how it is turned.
#[derive(Clone, Copy)]
pub struct TurnedKernel<'a> {
    values: &'a [f32],
    side: usize,
    /// Turns an offset in this kernel back to one in the kept values.
    back: Symmetry,
}

impl TurnedKernel<'_> {
    /// Values, row by row, as it is turned.
    pub fn turned(&self) -> Cow<'_, [f32]> {
        if self.back == Symmetry::IDENTITY {
            return Cow::Borrowed(self.values);
        }
        let last = self.side as i64 - 1;
        let kept = |x: i64, y: i64| {
            let (x, y) = self.back.point(2 * x - last, 2 * y - last);
            (y + last) / 2 * self.side as i64 + (x + last) / 2
        };
        // Along a row kept values are equally far apart.
        let step = kept(1, 0) - kept(0, 0);
        let mut turned = Vec::with_capacity(self.values.len());
        for y in 0..self.side {
            let first = kept(0, y as i64) as usize;
            let row = self.side;
            match step {
                1 => turned.extend_from_slice(&self.values[first..first + row]),
                -1 => turned.extend(self.values[first + 1 - row..=first].iter().rev()),
                down if down > 0 => turned.extend(self.values[first..].iter().step_by(row).take(row)),
                _ => turned.extend(self.values[..=first].iter().rev().step_by(row).take(row)),
            }
        }
        turned.into()
    }

    /// Energy in all pixels of the window.
    pub fn energy(&self) -> f64 {
        // Pixels stand at every half of one along both axes: each place counts four times.
        self.values.iter().map(|v| f64::from(*v)).sum::<f64>() / 4.0
    }
}

impl KernelBank {
    /// Index of the unique node of an element at one of its nodes, and what turns that into this.
    fn unique(&self, element: usize, row: usize, column: usize) -> (usize, usize, Symmetry) {
        let (base, turn) = self.elements[element];
        let (row, column) = self.turned_node(turn.inverse(), row, column);
        let (unique, own) = self.distinct[base].nodes[row * self.spec.nodes + column];
        (base, unique, turn.after(own))
    }

    fn turned_node(&self, turn: Symmetry, row: usize, column: usize) -> (usize, usize) {
        let last = self.spec.nodes as i64 - 1;
        let (x, y) = turn.point(2 * column as i64 - last, 2 * row as i64 - last);
        (((y + last) / 2) as usize, ((x + last) / 2) as usize)
    }

    /// The kernel of a node.
    pub fn kernel(&self, element: usize, node: [usize; 2], channel: usize, basis: usize) -> TurnedKernel<'_> {
        let (base, unique, turn) = self.unique(element, node[0], node[1]);
        let side = self.spec.side();
        let at = ((unique * self.channel_um.len() + channel) * self.bases + basis) * side * side;
        TurnedKernel {
            values: &self.distinct[base].values[at..at + side * side],
            side,
            back: turn.inverse(),
        }
    }

    /// Share of the light of a wavelength (by its index) that lands in its window, at any place of the field of an
    /// element: between nodes as kernels are.
    pub fn in_window(&self, element: usize, place: [f64; 2], wavelength: usize, wavelengths: usize) -> f64 {
        self.blend(place, |row, column| {
            let (base, unique, _) = self.unique(element, row, column);
            f64::from(self.distinct[base].in_window[unique * wavelengths + wavelength])
        })
    }

    /// Energy of the kernel in force at a place among the nodes (row, column).
    pub fn energy(&self, element: usize, place: [f64; 2], channel: usize, basis: usize) -> f64 {
        self.blend(place, |row, column| {
            self.kernel(element, [row, column], channel, basis).energy()
        })
    }

    fn blend(&self, place: [f64; 2], value: impl Fn(usize, usize) -> f64) -> f64 {
        let last = (self.spec.nodes - 1) as f64;
        let at = place.map(|p| p.clamp(0.0, last));
        let low = at.map(|p| (p as usize).min(self.spec.nodes.saturating_sub(2)));
        let share = [at[0] - low[0] as f64, at[1] - low[1] as f64];
        let mut sum = 0.0;
        for (k, weight) in [(0, 1.0 - share[0]), (1, share[0])] {
            for (l, other) in [(0, 1.0 - share[1]), (1, share[1])] {
                if weight * other > 0.0 {
                    sum += weight * other * value(low[0] + k, low[1] + l);
                }
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bank_that_cannot_be_held_is_refused() {
        let spec = BankSpec {
            pixel_um: 5.86,
            window: 64,
            nodes: 17,
            reach_um: 1386.0,
            accurate: false,
        };
        // `wide_5x5` in three colours: 558 MB. Without any symmetry the 25 elements still fit, in nine spectra not.
        let every = 25 * spec.nodes.pow(2);
        assert!(spec.check_size(every, 3, 3, 25).is_ok());
        let error = spec.check_size(every, 3, 9, 25).unwrap_err().to_string();
        assert!(error.contains("7225 places") && error.contains("MB"), "{error}");
        assert!(spec.check_size(usize::MAX, 16, 9, 100).is_err());
    }
}
