//! The rigorous cell of rectangular pillars of one size, by their rotation.

pub(crate) mod jones;
mod samples;
mod series;

use std::sync::Arc;

use num_complex::Complex64;
use serde::Serialize;

use metalith_core::{Memo, Progress, Result, Silent};
use metalith_pillars::RotatedRectangles;
use metalith_rcwa::Orders;

pub use self::jones::{Handedness, OBLIQUE_RECTANGLES, RotatedRectangle, oblique_refused};
pub use self::samples::RotationSamples;

use self::series::{Channels, Series, every};
use super::{
    CellModel, CellResponse, CellStack, CircularTables, Fidelity, Illumination, JonesTables, PolarisedTables, Spectral,
};

/// Intervals of an eighth of a turn whose ends are solved.
const INTERVALS: usize = 6;

/// Number of intervals where numbers of orders are compared: what more orders change is small, and varies slowly with
/// rotation.
const COMPARED_INTERVALS: usize = 2;

/// Numbers of diffraction orders an axis that a cell is solved with.
#[derive(Clone, Copy, Debug)]
struct OrderChoice {
    /// Number for most cells.
    usual: usize,
    /// Number that shows whether more are needed.
    fewer: usize,
    /// Distance in the complex transmission between these two, at most, where the usual ones will do.
    close: f64,
    /// Otherwise.
    more: usize,
}

/// Choice for all cells. Of fifteen sizes of rectangles of three materials (`examples/shapes.rs`, docs/method/cells.md)
/// ten are close: their 25 orders are within 0.0018 of 41. Of the others, with thin sides or of a high index, 25 orders
/// are off by up to 0.008, and 41 are within 0.0023 of 57.
const CHOICE: OrderChoice = OrderChoice {
    usual: 25,
    fewer: 17,
    close: 0.005,
    more: 41,
};

/// Orders for one of many wavelengths of a band.
const BAND_ORDERS: usize = 9;

/// Number of diffraction orders that a cell was solved with, and the change by the last of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Truncation {
    /// Orders an axis.
    pub orders: usize,
    /// Fewer, that these were compared with.
    pub fewer: usize,
    /// Largest distance in the complex transmission between the two, over rotations.
    pub apart: f64,
}

/// A cell at a wavelength.
#[derive(Clone, Debug, PartialEq)]
struct Solved {
    series: Series,
    /// Series that more orders add to it, where they are needed.
    finer: Option<Series>,
    /// Truncation; not known for a wavelength of a band.
    truncation: Option<Truncation>,
}

/// Response of rectangular pillars to circularly polarised light, in an infinite lattice of equally rotated pillars. By
/// its number a pillar is rotated as it is drawn, with its corners on the grid; that these also shear it a little is
/// left out.
///
/// A pillar that is rotated by an angle converts light to the other circular polarisation with twice that angle as phase, more
/// or less: the lattice does not turn with it. What the lattice adds repeats every quarter turn, and is solved at a few
/// rotations and carried to all others by its Fourier series.
#[derive(Debug)]
pub struct RotatedCell {
    stack: CellStack,
    pillars: RotatedRectangles,
    arriving: Handedness,
    /// Solutions by wavelength, and whether it is one of a band.
    solved: Memo<(u64, bool), Arc<Solved>>,
}

impl RotatedCell {
    /// The cell of these pillars in light of this handedness.
    pub fn new(stack: CellStack, pillars: RotatedRectangles, arriving: Handedness) -> Self {
        Self {
            stack,
            pillars,
            arriving,
            solved: Memo::default(),
        }
    }

    /// The pillars.
    pub fn pillars(&self) -> RotatedRectangles {
        self.pillars
    }

    /// The handedness of the light.
    pub fn arriving(&self) -> Handedness {
        self.arriving
    }

    /// The cell at a single wavelength (um).
    ///
    /// # Errors
    /// As [`CellStack::jones`].
    pub fn at(&self, wavelength_um: f64) -> Result<RotationResponse> {
        self.at_with(wavelength_um, &Silent)
    }

    /// [`RotatedCell::at`] with progress of the rotations that are solved.
    ///
    /// # Errors
    /// As [`RotatedCell::at`]; also if the user stopped it.
    pub fn at_with(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<RotationResponse> {
        Ok(self.response_of(self.solved(wavelength_um, false, progress)?))
    }

    fn response_of(&self, solved: Arc<Solved>) -> RotationResponse {
        RotationResponse {
            solved,
            pillars: self.pillars,
            arriving: self.arriving,
        }
    }

    fn solved(&self, wavelength_um: f64, of_band: bool, progress: &dyn Progress) -> Result<Arc<Solved>> {
        self.solved.get_or_make((wavelength_um.to_bits(), of_band), || {
            Ok(Arc::new(if of_band {
                self.solve_in_band(wavelength_um, progress)?
            } else {
                self.solve(wavelength_um, CHOICE, progress)?
            }))
        })
    }

    fn solve_in_band(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<Solved> {
        Ok(Solved {
            series: Series::of(&self.samples(INTERVALS, wavelength_um, BAND_ORDERS, progress)?),
            finer: None,
            truncation: None,
        })
    }

    /// Solves with as many orders as this cell needs.
    fn solve(&self, wavelength_um: f64, choice: OrderChoice, progress: &dyn Progress) -> Result<Solved> {
        Solved::converged(choice, |intervals, orders| {
            self.samples(intervals, wavelength_um, orders, progress)
        })
    }

    /// Over a quarter turn.
    fn samples(
        &self,
        intervals: usize,
        wavelength_um: f64,
        orders: usize,
        progress: &dyn Progress,
    ) -> Result<Vec<Channels>> {
        let (orders, edges) = (Orders::new(orders)?, [self.pillars.width_nm, self.pillars.length_nm]);
        let edges = edges.map(f64::from);
        RotationSamples::over(
            intervals,
            &self.stack,
            edges,
            wavelength_um,
            orders,
            self.arriving,
            progress,
        )
        .map(RotationSamples::channels)
    }

    /// Table of converted (0) or unconverted (1) light.
    fn table(&self, solved: &Solved, most: u16, hand: Hand, channel: usize) -> Vec<Complex64> {
        let of = |number: u16| {
            let rotation = self.pillars.drawn_rotation(number);
            // A mirror turns the pillar back and one handedness into the other.
            let seen = match hand {
                Hand::Focused => rotation,
                Hand::Other => -rotation,
            };
            solved.at(seen, self.arriving)[channel]
        };
        std::iter::once(Complex64::ZERO).chain((1..=most).map(of)).collect()
    }

    fn both_hands(
        &self,
        wavelength_um: f64,
        of_band: bool,
        most: u16,
        progress: &dyn Progress,
    ) -> Result<PolarisedTables> {
        let solved = self.solved(wavelength_um, of_band, progress)?;
        let of = |channel: usize| [Hand::Focused, Hand::Other].map(|hand| self.table(&solved, most, hand, channel));
        Ok(PolarisedTables::Hands(CircularTables {
            focused: self.arriving,
            converted: of(0),
            unconverted: of(1),
            rotation: Some(self.response_of(solved)),
        }))
    }
}

/// Response of a cell of rotated rectangles at one wavelength, at any rotation.
#[derive(Clone, Debug, PartialEq)]
pub struct RotationResponse {
    solved: Arc<Solved>,
    pillars: RotatedRectangles,
    arriving: Handedness,
}

impl RotationResponse {
    /// The pillars.
    pub fn pillars(&self) -> RotatedRectangles {
        self.pillars
    }

    /// The handedness of the light.
    pub fn arriving(&self) -> Handedness {
        self.arriving
    }

    /// Converted and unconverted light of a pillar of any rotation (rad), as ratios of fields.
    pub fn at(&self, rotation: f64) -> [Complex64; 2] {
        self.solved.at(rotation, self.arriving)
    }

    /// Number of orders that it takes, and how sure they are; `None` for one of many wavelengths of a band.
    pub fn truncation(&self) -> Option<Truncation> {
        self.solved.truncation
    }
}

/// Hand of the light that arrives.
#[derive(Clone, Copy)]
enum Hand {
    Focused,
    Other,
}

impl Solved {
    /// Solution with as many orders as are needed, from what `samples` has over a quarter turn of so many intervals
    /// with so many orders.
    fn converged(choice: OrderChoice, samples: impl Fn(usize, usize) -> Result<Vec<Channels>>) -> Result<Self> {
        let own = samples(INTERVALS, choice.usual)?;
        let compared = |orders: usize| -> Result<(Vec<Channels>, f64)> {
            let other = samples(COMPARED_INTERVALS, orders)?;
            let pairs = other.iter().zip(every(COMPARED_INTERVALS, &own));
            let changes: Vec<Channels> = pairs.map(|(a, b)| [a[0] - b[0], a[1] - b[1]]).collect();
            let apart = changes.iter().flatten().map(|d| d.norm()).fold(0.0, f64::max);
            Ok((changes, apart))
        };
        let series = Series::of(&own);
        let (_, apart) = compared(choice.fewer)?;
        if apart <= choice.close {
            return Ok(Solved {
                series,
                finer: None,
                truncation: Some(Truncation {
                    orders: choice.usual,
                    fewer: choice.fewer,
                    apart,
                }),
            });
        }
        let (changes, apart) = compared(choice.more)?;
        Ok(Solved {
            series,
            finer: Some(Series::of(&changes)),
            truncation: Some(Truncation {
                orders: choice.more,
                fewer: choice.usual,
                apart,
            }),
        })
    }

    /// Converted light less its geometric phase, and unconverted light, at a rotation (rad).
    fn channels(&self, rotation: f64) -> Channels {
        let mut sum = self.series.at(rotation);
        if let Some(finer) = &self.finer {
            let more = finer.at(rotation);
            sum = [sum[0] + more[0], sum[1] + more[1]];
        }
        sum
    }

    /// Converted and unconverted light at a rotation (rad).
    fn at(&self, rotation: f64, arriving: Handedness) -> Channels {
        let sum = self.channels(rotation);
        let geometric = Complex64::cis(arriving.geometric_phase(rotation));
        [sum[0] * geometric, sum[1]]
    }
}

impl CellModel for RotatedCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, light: &Illumination<'_>, last: u16, progress: &dyn Progress) -> Result<CellResponse> {
        if light.cell_sines() != [0.0; 2] {
            return Err(oblique_refused());
        }
        let in_band = light.spectral == Spectral::InBand;
        // Of a band whoever asks says how far it is.
        let progress = if in_band { &Silent } else { progress };
        let tables = self.both_hands(light.wavelength_um, in_band, last, progress)?;
        Ok(CellResponse::Jones(JonesTables::Polarised(tables)))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.stack.full_transmission(wavelength_um)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_1_SQRT_2;

    use super::super::{Polarisation, PolarisedLight, RotatedRectangle};
    use super::jones::tests::{PILLARS, titania};
    use super::*;
    use metalith_rcwa::circular;

    /// Between the solved rotations, of |t| near 1.1: what the series leaves out; ten times more with five rotations.
    const BETWEEN: f64 = 5e-4;

    /// Share that three rotations may leave of a change by more orders: a fifth from 9 to 13 orders, where it is 0.037, and a tenth of
    /// 0.0035 from 25 to 41 of 120 x 260 nm of silicon at 940 nm.
    const OF_A_CHANGE: f64 = 0.25;

    /// Distance of both channels, at rotations between those that are solved and at mirrored ones, from the solver itself with so
    /// many orders.
    fn from_the_solver(cell: &RotatedCell, solved: &Solved, orders: usize) -> f64 {
        let (from, to) = match cell.arriving {
            Handedness::Left => (0, 1),
            Handedness::Right => (1, 0),
        };
        let each = [7.0_f64, 31.0, 70.0, 124.0].map(|degrees| {
            let number = PILLARS.number(degrees.to_radians());
            let pillar = RotatedRectangle {
                width_nm: 100.0,
                length_nm: 250.0,
                rotation: PILLARS.drawn_rotation(number),
            };
            let orders = Orders::new(orders).unwrap();
            let exact = circular(titania().jones(&pillar, 0.532, [0.0; 2], orders).unwrap());
            let [converted, unconverted] = solved.at(pillar.rotation, cell.arriving);
            (converted - exact[to][from])
                .norm()
                .max((unconverted - exact[from][from]).norm())
        });
        each.into_iter().fold(0.0, f64::max)
    }

    fn in_band(cell: &RotatedCell, most: u16) -> CircularTables {
        match cell.both_hands(0.532, true, most, &Silent).unwrap() {
            PolarisedTables::Hands(hands) => hands,
            PolarisedTables::Axes(_) => unreachable!("rotated pillars have tables of hands"),
        }
    }

    #[test]
    fn the_series_meets_the_solver_between_its_samples() {
        for arriving in [Handedness::Left, Handedness::Right] {
            let cell = RotatedCell::new(titania(), PILLARS, arriving);
            let off = from_the_solver(&cell, &cell.solved(0.532, true, &Silent).unwrap(), BAND_ORDERS);
            assert!(off < BETWEEN, "{arriving:?}: {off}");
        }
    }

    #[test]
    fn tables_have_the_series_at_drawn_rotations() {
        let cell = RotatedCell::new(titania(), PILLARS, Handedness::Left);
        let solved = cell.solved(0.532, true, &Silent).unwrap();
        let light = Illumination::normal(0.532).in_band();
        let converted = cell
            .response(&light, 180, &Silent)
            .and_then(CellResponse::focused)
            .unwrap();
        let hands = in_band(&cell, 180);
        for number in [1, 37, 180] {
            let at = solved.at(PILLARS.drawn_rotation(number), Handedness::Left);
            let k = usize::from(number);
            assert_eq!([converted[k], hands.unconverted[0][k]], at);
            assert_eq!(hands.converted[0][k], converted[k]);
        }
    }

    /// Linear and unpolarised light, which both hands make up, against the Jones matrices of the solver along x and y; so are the
    /// amplitudes of both hands and the phases between them.
    #[test]
    fn both_hands_are_those_of_the_solver() {
        let orders = Orders::new(BAND_ORDERS).unwrap();
        let right = [Complex64::ONE, Complex64::new(0.0, -1.0)].map(|c| c * FRAC_1_SQRT_2);
        for focused in [Handedness::Left, Handedness::Right] {
            let cell = RotatedCell::new(titania(), PILLARS, focused);
            let hands = in_band(&cell, PILLARS.steps);
            for (number, deg) in [(8, 0.0_f64), (31, 90.0), (70, 20.0), (124, -55.0)] {
                let pillar = RotatedRectangle {
                    width_nm: 100.0,
                    length_nm: 250.0,
                    rotation: PILLARS.drawn_rotation(number),
                };
                let jones = titania().jones(&pillar, 0.532, [0.0; 2], orders).unwrap();
                let (sin, cos) = deg.to_radians().sin_cos();
                let leaves = [0, 1].map(|out| jones[out][0] * cos + jones[out][1] * sin);
                let in_right = right[0].conj() * leaves[0] + right[1].conj() * leaves[1];
                let in_left = right[0] * leaves[0] + right[1] * leaves[1];
                let wanted = match focused {
                    Handedness::Left => [in_right, in_left],
                    Handedness::Right => [in_left, in_right],
                };
                let light = PolarisedLight {
                    arriving: Some(Polarisation::Linear(deg)),
                    analyser: None,
                };
                let passed = PolarisedTables::Hands(hands.clone()).passed(light);
                assert_eq!(passed.len(), 2);
                for (found, wanted) in passed.iter().zip(wanted) {
                    let off = (found.table[usize::from(number)] - wanted).norm();
                    assert!(off < BETWEEN, "{focused}, {number}, {deg}: {off}");
                }
            }
        }
    }

    /// Where fewer orders are not close, the answer is that of more, at all rotations, and says how far the usual ones were off.
    #[test]
    fn a_cell_takes_the_orders_that_it_needs() {
        let cell = RotatedCell::new(titania(), PILLARS, Handedness::Left);
        let choice = |close: f64| OrderChoice {
            usual: 9,
            fewer: 7,
            close,
            more: 13,
        };
        let few = cell.solve(0.532, choice(1.0), &Silent).unwrap();
        assert!(from_the_solver(&cell, &few, 9) < BETWEEN);
        let many = cell.solve(0.532, choice(0.001), &Silent).unwrap();
        let off = from_the_solver(&cell, &many, 13);
        let [few, many] = [few, many].map(|s| s.truncation.unwrap());
        assert_eq!([few.orders, few.fewer, many.orders, many.fewer], [9, 7, 13, 9]);
        assert!(
            few.apart > 0.001 && off < OF_A_CHANGE * many.apart,
            "{few:?} {many:?} {off}"
        );
    }
}
