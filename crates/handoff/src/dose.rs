//! Doses, shot steps and the time a job takes.

use serde::Serialize;

use super::process::{Process, Writer};
use metalith_core::{Error, Result};

/// The beam at one current: how far apart its shots may be, and how fast they come.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Beam {
    pub current_na: f64,
    /// Distance of neighbouring shots (nm).
    pub shot_step_nm: f64,
    /// Shot rate that gives the dose at this step (MHz).
    pub clock_mhz: f64,
}

impl Beam {
    /// The finest step at which the writer's clock can follow: with I the current (pA), f the clock (MHz)
    /// and s the step (nm), dose (uC/cm2) = 100 I / (f s^2).
    ///
    /// # Errors
    /// If no step up to a pillar's size is coarse enough.
    pub fn choose(writer: &Writer, current_na: f64, dose_uc_cm2: f64) -> Result<Self> {
        let clock = |step: f64| 100.0 * current_na * 1e3 / (dose_uc_cm2 * step * step);
        // Steps are one grid unit or an even number of them.
        let steps = std::iter::once(1.0).chain((1..=COARSEST / 2).map(|k| f64::from(2 * k)));
        steps
            .map(|units| units * writer.grid_nm)
            .find(|&step| clock(step) <= writer.clock_max_mhz)
            .map(|shot_step_nm| Self {
                current_na,
                shot_step_nm,
                clock_mhz: clock(shot_step_nm),
            })
            .ok_or_else(|| {
                Error::refused(
                    "handoff/beam-current-too-high",
                    format!(
                        "{current_na} nA is too much for a dose of {dose_uc_cm2} uC/cm2 at {} MHz",
                        writer.clock_max_mhz
                    ),
                    "lower `currents_na` or raise the dose in the process file",
                )
            })
    }

    /// A width rounded to the shot grid (nm).
    pub fn snapped_nm(&self, width_nm: f64) -> f64 {
        (width_nm / self.shot_step_nm).round() * self.shot_step_nm
    }
}

/// Most grid units of a step.
const COARSEST: u32 = 200;

/// Exposed area and shapes, counted in a layout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Exposure {
    pub area_um2: f64,
    pub shapes: u64,
    pub fields: u64,
}

/// Exposure time and its contributions (s).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WriteTime {
    pub beam: Beam,
    pub beam_s: f64,
    pub shapes_s: f64,
    pub fields_s: f64,
    pub job_s: f64,
}

/// Formula of the time of a job, for the page.
pub(super) const FORMULA: &str =
    "time = dose x area / current  +  shapes x overhead a shape  +  fields x overhead a field  +  overhead of the job";
/// Formulas of step and clock from the dose, for the page.
pub(super) const DOSE_FORMULA: &str = "dose [uC/cm2] = current [pA] x 100 / (clock [MHz] x step^2 [nm2])";

impl WriteTime {
    /// The time to expose this at a current and the dose of the process.
    ///
    /// # Errors
    /// As [`Beam::choose`].
    pub fn of(process: &Process, exposure: &Exposure, current_na: f64) -> Result<Self> {
        let dose = process.resist.dose_uc_cm2;
        let writer = &process.writer;
        let charge_uc = dose * exposure.area_um2 * 1e-8;
        Ok(Self {
            beam: Beam::choose(writer, current_na, dose)?,
            beam_s: charge_uc / (current_na * 1e-3),
            shapes_s: exposure.shapes as f64 * writer.shape_overhead_us * 1e-6,
            fields_s: exposure.fields as f64 * writer.field_overhead_s,
            job_s: writer.job_overhead_s,
        })
    }

    /// All of it (s).
    pub fn total_s(&self) -> f64 {
        self.beam_s + self.shapes_s + self.fields_s + self.job_s
    }
}

/// A time in hours, minutes or seconds.
pub(super) fn duration(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    match minutes {
        0 => format!("{seconds:.0} s"),
        1..60 => format!("{minutes} min"),
        _ => format!("{} h {:02} min", minutes / 60, minutes % 60),
    }
}

/// One dose of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DoseRow {
    /// Number of the dose, which is the datatype in the dose matrix: 1 to 9.
    pub number: usize,
    pub factor: f64,
    pub dose_uc_cm2: f64,
    /// Change from the base dose as a job asks for it (%).
    pub modulation_percent: f64,
}

/// The doses of the matrix, in the order of the process file.
pub(crate) fn doses(process: &Process) -> Vec<DoseRow> {
    let factors = process.dose_matrix.factors.iter().enumerate();
    factors
        .map(|(i, &factor)| DoseRow {
            number: i + 1,
            factor,
            dose_uc_cm2: factor * process.resist.dose_uc_cm2,
            modulation_percent: ((factor - 1.0) * 1e4).round() / 100.0,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative rounding of a few operations in double precision.
    const ROUNDING: f64 = 1e-12;

    fn process() -> Process {
        Process::standard()
    }

    /// The known steps of this writer at 280 uC/cm2 and 50 MHz.
    #[test]
    fn steps_follow_from_dose_current_and_clock() {
        for (current_na, step_nm) in [(8.0, 8.0), (2.0, 4.0), (0.5, 2.0)] {
            let beam = Beam::choose(&process().writer, current_na, 280.0).unwrap();
            assert_eq!(beam.shot_step_nm, step_nm);
            // Charge of one shot over its own area, from first principles: C/nm2 to uC/cm2 is 1e20.
            let charge = current_na * 1e-9 / (beam.clock_mhz * 1e6);
            assert!((charge / (step_nm * step_nm) * 1e20 - 280.0).abs() < 280.0 * ROUNDING);
        }
        assert!(Beam::choose(&process().writer, 1e6, 280.0).is_err());
    }

    #[test]
    fn a_square_millimetre_takes_the_time_of_its_charge() {
        let exposure = Exposure {
            area_um2: 1e6,
            shapes: 2_000_000,
            fields: 9,
        };
        let time = WriteTime::of(&process(), &exposure, 2.0).unwrap();
        // 280 uC/cm2 on 0.01 cm2 are 2.8 uC: 1400 s at 2 nA.
        assert!((time.beam_s - 1400.0).abs() < 1400.0 * ROUNDING);
        assert!((time.total_s() - (1400.0 + 1.0 + 3.6 + 2700.0)).abs() < time.total_s() * ROUNDING);
        assert_eq!(duration(time.total_s()), "1 h 08 min");
        assert_eq!(duration(12.0), "12 s");
    }
}
