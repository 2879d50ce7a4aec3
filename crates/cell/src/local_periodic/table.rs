//! Table of a cell in the local periodic approximation: complex transmission by width and wavelength, made once and cached.

use std::path::{Path, PathBuf};

use num_complex::Complex64;
use serde::Serialize;

use super::column::{Between, Column, columns};
use super::table_file;
use super::width_spectrum::lagrange;
use crate::CellStack;
use crate::cache_file;
use metalith_core::{Error, Progress, Result};
use metalith_rcwa::Orders;

/// Everything that decides a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TableSpec {
    /// The cell.
    pub stack: CellStack,
    /// Shortest and longest wavelength (um).
    pub band_um: (f64, f64),
    /// Narrowest and widest pillar tabulated at every nanometre; other widths up to the pitch stand at
    /// every five.
    pub widths_nm: (u16, u16),
    /// Largest error of t in the middle of an interval of wavelengths, before that middle is added; rational functions are nearer.
    pub tolerance: f64,
    /// Diffraction orders along an axis.
    pub orders: usize,
}

/// Distance of widths outside of [`TableSpec::widths_nm`] (nm).
const COARSE_STEP_NM: usize = 5;

/// Widest band that a table may span (um), and largest pitch (nm): as far as the wavelengths and pitches of design files reach,
/// to the thermal infrared.
const WIDEST_BAND_UM: f64 = 20.0;
const LARGEST_PITCH_NM: f64 = 20_000.0;

impl TableSpec {
    /// Orders, tolerance and margins in width that suit the shipped designs: 13 orders, 0.01, 20 nm.
    pub fn new(stack: CellStack, band_um: (f64, f64), widths_nm: (u16, u16)) -> Self {
        let margin = 20;
        let pitch = stack.pitch_nm.clamp(1.0, f64::from(u16::MAX)) as u16;
        Self {
            stack,
            band_um,
            widths_nm: (
                widths_nm.0.saturating_sub(margin).max(1),
                widths_nm.1.saturating_add(margin).min(pitch),
            ),
            tolerance: 0.01,
            orders: 13,
        }
    }

    /// Widths that are tabulated (nm), rising; the first is 0, the bare substrate.
    fn columns_nm(&self) -> Vec<u16> {
        let (low, high) = self.widths_nm;
        let pitch = self.stack.pitch_nm as u16;
        let coarse = (0..=pitch).step_by(COARSE_STEP_NM);
        let mut widths: Vec<u16> = coarse.chain(low..=high).chain([pitch]).collect();
        widths.sort_unstable();
        widths.dedup();
        widths
    }

    fn check(&self) -> Result<()> {
        let (short, long) = self.band_um;
        if !(short > 0.0 && long > short && long - short <= WIDEST_BAND_UM) {
            return Err(Error::refused(
                "cell/band-out-of-range",
                format!("the band is from {short} to {long} um"),
                format!("give two rising, positive wavelengths at most {WIDEST_BAND_UM} um apart"),
            ));
        }
        let (low, high) = self.widths_nm;
        let pitch = self.stack.pitch_nm;
        if !(1.0..=LARGEST_PITCH_NM).contains(&pitch) {
            return Err(Error::refused(
                "cell/pitch-out-of-range",
                format!("the cell has a pitch of {pitch} nm"),
                format!("use a pitch from 1 to {LARGEST_PITCH_NM} nm"),
            ));
        }
        if low == 0 || low > high || f64::from(high) > pitch {
            return Err(Error::refused(
                "cell/width-range-invalid",
                format!("pillars from {low} to {high} nm wide on a pitch of {pitch} nm"),
                "give a range of widths above zero that fits into the pitch",
            ));
        }
        if !(self.tolerance > 0.0 && self.tolerance.is_finite()) {
            return Err(Error::refused(
                "cell/tolerance-out-of-range",
                format!("the tolerance of the transmission is {}", self.tolerance),
                "give a positive number, such as 0.01",
            ));
        }
        Ok(())
    }
}

/// Complex transmission of the zero order along the normal, substrate to air, of every width over a band.
#[derive(Clone, Debug, PartialEq)]
pub struct CellTable {
    spec: TableSpec,
    /// Tabulated widths (nm), rising from 0.
    widths_nm: Vec<f64>,
    columns: Vec<Column>,
}

/// Transmission of a table between the wavelengths that were solved for it, and its error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TableInterpolation {
    /// Widths that have a rational function of wavelength.
    pub rational: usize,
    /// Widths that have cubics, because a rational function did not converge.
    pub cubic: usize,
    /// Wavelengths, one for each width, that were solved to compare with what was found without them.
    pub held_out: usize,
    /// Error of t there: root of the mean square, and largest.
    pub rms: f64,
    pub largest: f64,
}

impl TableInterpolation {
    /// One line of what is interpolated and how well.
    pub fn words(&self) -> String {
        let cubic = match self.cubic {
            0 => String::new(),
            cubic => format!(", cubics at {cubic}"),
        };
        format!(
            "rational functions at {} widths{cubic}; error of t {:.1e} rms, {:.1e} at most, at {} wavelengths that were held out",
            self.rational, self.rms, self.largest, self.held_out
        )
    }
}

/// Origin of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Read from this file, whose inputs are the same and whose checksum holds.
    Kept(PathBuf),
    /// Computed now, and kept in this file if it could be written.
    Computed(Option<PathBuf>),
}

impl CellTable {
    /// Compute a table, one width a thread; the same on any number of threads.
    ///
    /// # Errors
    /// If the inputs are not physical or out of a material's range, or the user interrupts.
    pub fn compute(spec: &TableSpec, progress: &dyn Progress) -> Result<Self> {
        spec.check()?;
        let orders = Orders::new(spec.orders)?;
        for wavelength_um in [spec.band_um.0, spec.band_um.1] {
            spec.stack.layers(f64::from(spec.widths_nm.1), wavelength_um)?;
        }
        let widths = spec.columns_nm();
        progress.begin("cell library", widths.len() as u64);
        let solve = |column: usize, wavelength_um| {
            progress.check_stopped()?;
            spec.stack
                .transmission(spec.reachable(widths[column]), wavelength_um, orders)
        };
        let widths_nm: Vec<f64> = widths.iter().map(|w| spec.reachable(*w)).collect();
        let pitch_nm = spec.stack.pitch_nm;
        let done = || progress.advance(1);
        let columns = columns(&widths_nm, pitch_nm, spec.band_um, spec.tolerance, &solve, &done)?;
        Ok(Self::assemble(spec, &widths, columns))
    }

    fn assemble(spec: &TableSpec, widths: &[u16], columns: Vec<Column>) -> Self {
        Self {
            spec: spec.clone(),
            widths_nm: widths.iter().map(|&w| f64::from(w)).collect(),
            columns,
        }
    }

    /// The table of a spec: from `folder` if it is kept there, whole and for the very same inputs; else
    /// computed and kept there. A file that cannot be written or trusted costs time, not truth.
    ///
    /// # Errors
    /// As [`CellTable::compute`].
    pub fn obtain(spec: &TableSpec, folder: Option<&Path>, progress: &dyn Progress) -> Result<(Self, Origin)> {
        spec.check()?;
        let inputs = inputs(spec);
        let widths = spec.columns_nm();
        let file = folder.map(|folder| folder.join(table_file::file_name(&inputs)));
        if let Some(file) = &file {
            match table_file::read(file, &inputs, &widths) {
                Ok(Some(columns)) => return Ok((Self::assemble(spec, &widths, columns), Origin::Kept(file.clone()))),
                Ok(None) => {}
                Err(why) => progress.warn(&format!("{} is not used: {why}", file.display())),
            }
        }
        let table = Self::compute(spec, progress)?;
        let kept = file.filter(|file| match table_file::write(file, &inputs, &widths, &table.columns) {
            Ok(()) => true,
            Err(error) => {
                progress.warn(&format!("the cell library is not kept: {error}"));
                false
            }
        });
        Ok((table, Origin::Computed(kept)))
    }

    /// Specification that it was made for.
    pub fn spec(&self) -> &TableSpec {
        &self.spec
    }

    /// Number of cells solved for it.
    pub fn points(&self) -> usize {
        self.columns.iter().map(|c| c.solved as usize).sum()
    }

    /// Transmission between the wavelengths that were solved, and its error.
    pub fn interpolation(&self) -> TableInterpolation {
        let is_rational = |c: &&Column| matches!(c.between, Between::Rational(_));
        let rational = self.columns.iter().filter(is_rational).count();
        let squares: f64 = self.columns.iter().map(|c| c.held_out.powi(2)).sum();
        TableInterpolation {
            rational,
            cubic: self.columns.len() - rational,
            held_out: self.columns.len(),
            rms: (squares / self.columns.len() as f64).sqrt(),
            largest: self.columns.iter().map(|c| c.held_out).fold(0.0, f64::max),
        }
    }

    /// Transmission of a pillar of any width up to the pitch (nm) at a wavelength of the band (um); a
    /// width of zero is the bare substrate.
    ///
    /// # Errors
    /// If width or wavelength are outside the table.
    pub fn transmission(&self, width_nm: f64, wavelength_um: f64) -> Result<Complex64> {
        self.check_wavelength(wavelength_um)?;
        let pitch = self.spec.stack.pitch_nm;
        if !(0.0..=pitch).contains(&width_nm) {
            return Err(Error::refused(
                "cell/width-out-of-range",
                format!("a pillar {width_nm} nm wide on a pitch of {pitch} nm"),
                "give a width from zero to the pitch",
            ));
        }
        Ok(lagrange(
            &self.widths_nm,
            |i| self.columns[i].at(wavelength_um),
            width_nm,
        ))
    }

    /// Transmission of every whole width from 0 to `max_width_nm` at a wavelength of the band (um); the
    /// first is the bare substrate.
    ///
    /// # Errors
    /// As [`CellTable::transmission`].
    pub fn transmissions(&self, wavelength_um: f64, max_width_nm: u16) -> Result<Vec<Complex64>> {
        self.check_wavelength(wavelength_um)?;
        let last = usize::from(max_width_nm);
        let pitch = self.spec.stack.pitch_nm;
        if f64::from(max_width_nm) > pitch {
            return Err(Error::refused(
                "cell/width-out-of-range",
                format!("a pillar {max_width_nm} nm wide on a pitch of {pitch} nm"),
                "the layout has pillars that the cell cannot hold: correct it or the design's pitch",
            ));
        }
        let tabulated: Vec<_> = self.columns.iter().map(|c| c.at(wavelength_um)).collect();
        let mut at = 0;
        Ok((0..=last)
            .map(|width| {
                while at + 1 < self.widths_nm.len() && self.widths_nm[at] < width as f64 {
                    at += 1;
                }
                if self.widths_nm[at] == width as f64 {
                    tabulated[at]
                } else {
                    lagrange(&self.widths_nm, |i| tabulated[i], width as f64)
                }
            })
            .collect())
    }

    fn check_wavelength(&self, wavelength_um: f64) -> Result<()> {
        let (short, long) = self.spec.band_um;
        // Whole nanometres in um do not meet the ends of the band to the last bit.
        let slack = 1e-9;
        if wavelength_um >= short - slack && wavelength_um <= long + slack {
            return Ok(());
        }
        Err(Error::refused(
            "cell/wavelength-out-of-band",
            format!("the cell library spans {short} to {long} um, not {wavelength_um} um"),
            "make the library for a wider band",
        ))
    }
}

impl TableSpec {
    /// A leaning wall may be too wide at its foot before its top fills the pitch, and staggered rows may be nearer than that:
    /// such widths, which no layout has, count as the widest that fits.
    fn reachable(&self, width_nm: u16) -> f64 {
        let lean = 2.0 * self.stack.taper.max(0.0).tan() * self.stack.height_nm;
        let nearest = self.stack.lattice.nearest_nm(self.stack.pitch_nm);
        f64::from(width_nm).min(nearest - lean).max(0.0)
    }
}

/// Raised whenever wavelengths of tables are chosen otherwise, or what is between them is: 2 has rational functions, 1 had cubics.
const SAMPLING: u32 = 2;

/// The inputs as text: equal if and only if the table is the same.
fn inputs(spec: &TableSpec) -> Vec<u8> {
    #[derive(Serialize)]
    struct Inputs<'a> {
        solver: u32,
        sampling: u32,
        spec: &'a TableSpec,
    }
    let inputs = Inputs {
        solver: cache_file::solver_of(spec.stack.shape),
        sampling: SAMPLING,
        spec,
    };
    serde_json::to_vec(&inputs).expect("plain data serialises")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(pitch_nm: f64, band_um: (f64, f64)) -> TableSpec {
        let stack = CellStack::paper(pitch_nm, 8000.0).unwrap();
        TableSpec::new(stack, band_um, (1000, 4000))
    }

    /// A design for the thermal infrared has a table; what is beyond all designs says which number it is.
    #[test]
    fn tables_reach_as_far_as_designs() {
        assert!(spec(6000.0, (8.0, 13.0)).check().is_ok());
        let wide = spec(6000.0, (0.2, 20.3)).check().unwrap_err();
        assert_eq!(wide.id(), "cell/band-out-of-range");
        insta::assert_snapshot!(wide, @"
            the band is from 0.2 to 20.3 um
              help: give two rising, positive wavelengths at most 20 um apart
            ");
        let large = spec(20_002.0, (8.0, 13.0)).check().unwrap_err();
        assert_eq!(large.id(), "cell/pitch-out-of-range");
        insta::assert_snapshot!(large, @"
            the cell has a pitch of 20002 nm
              help: use a pitch from 1 to 20000 nm
            ");
    }
}
