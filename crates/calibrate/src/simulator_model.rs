//! The optical simulator as a [`ForwardModel`].

use metalith_core::{Progress, Result};

use crate::cell_error::CellError;
use crate::effects::{Stage, ValueError, separate_by};
use crate::optics::PixelGrid;
use crate::set::PerMeasurement;
use crate::simulator::Simulator;
use crate::smooth_shape::{SmoothShape, TRANSMISSION_TERMS};
use crate::statistics::{Coarser, ForwardModel, ModelError, ParameterPoint, Slot, SmoothGroups, SmoothTerm};
use metalith_optics::{Perturbation, zernike};

/// Cells are solved at multiples of this share of a typical size; the surrogate covers the difference.
const CELL_STEP: f64 = 1.0 / 16.0;

/// Relative errors of what effects change, by the stage that they act on. Sets by a program that shares nothing with
/// this one leave 3.4 % of the amplitude of a change of height, 1 % of a bias and 0.1 to 0.2 % of a defocus.
const ERROR_OF_STACK: f64 = 0.03;
const ERROR_OF_GEOMETRY: f64 = 0.01;
const ERROR_OF_LIGHT: f64 = 0.002;

impl Simulator<'_> {
    fn perturbation_at(&self, point: &ParameterPoint) -> Perturbation {
        let mut perturbation = self.perturbation(&point.theta);
        match point.smooth.and_then(|k| SmoothShape::all().nth(k)) {
            None => {}
            Some(term @ SmoothShape::Path(k)) => {
                perturbation
                    .geometry
                    .add_wavefront(zernike::FIRST + k as u32, term.step());
            }
            Some(term @ SmoothShape::Transmission(k)) => {
                perturbation.geometry.transmission = vec![0.0; TRANSMISSION_TERMS];
                perturbation.geometry.transmission[k] = term.step();
            }
            Some(term @ SmoothShape::Phase(k)) => {
                perturbation.geometry.transmission_phase_rad = vec![0.0; TRANSMISSION_TERMS];
                perturbation.geometry.transmission_phase_rad[k] = term.step();
            }
        }
        if point.smooth.is_some() {
            let (narrow, wide) = self.bench.widths_nm();
            perturbation.geometry.transmission_range_nm = [narrow, wide];
        }
        perturbation
    }
}

impl ForwardModel for Simulator<'_> {
    type Prediction = PixelGrid;

    fn effects(&self) -> usize {
        self.effects.len()
    }

    fn effect_name(&self, effect: usize) -> String {
        self.effects[effect].name()
    }

    fn slots(&self) -> &[Slot] {
        &self.slots
    }

    fn kinked(&self, effect: usize) -> bool {
        self.effects[effect].kinked()
    }

    fn dormant(&self, effect: usize) -> bool {
        self.effects[effect].dormant()
    }

    fn error_share(&self, effect: usize) -> f64 {
        match self.effects[effect].stage() {
            Stage::Stack => ERROR_OF_STACK,
            Stage::Geometry => ERROR_OF_GEOMETRY,
            Stage::Diffraction | Stage::Source | Stage::Camera => ERROR_OF_LIGHT,
        }
    }

    fn value_error(&self, effect: usize) -> ValueError {
        self.effects[effect].value_error()
    }

    fn cheap_step(&self, slot: usize) -> Option<f64> {
        let slot = &self.slots[slot];
        let is_solved = self.effects[slot.effect].stage() == Stage::Stack;
        is_solved.then_some(CELL_STEP * slot.parameter.typical)
    }

    fn is_dear_beside(&self, about: &[f64], slot: usize) -> bool {
        // A change of the pillar on top of another needs its own tables.
        let own = self.slots[slot].effect;
        let is_stack = |effect: usize| self.effects[effect].stage() == Stage::Stack;
        let others = self.slots.iter().zip(about);
        is_stack(own)
            && others
                .into_iter()
                .any(|(s, v)| *v != 0.0 && s.effect != own && is_stack(s.effect))
    }

    fn prediction_bytes(&self) -> f64 {
        self.bench.grid_bytes()
    }

    fn memory_hint(&self) -> String {
        "give smaller windows (`rows` and `cols` of [camera]) or fewer measurements, or try fewer effects (`--effects NAMES`): memory goes \
         with the area of a window on the sensor, whatever its pixels"
            .into()
    }

    fn smooth_terms(&self) -> Vec<SmoothTerm> {
        SmoothShape::all().map(SmoothShape::term).collect()
    }

    fn smooth_groups(&self) -> SmoothGroups {
        let set = self.bench.set();
        SmoothGroups {
            of: set.measurements.iter().map(|c| c.led.into()).collect(),
            count: set.leds.len(),
        }
    }

    fn model_error(&self) -> ModelError {
        CellError::MEASURED.of_model()
    }

    fn cautious_model_error(&self) -> ModelError {
        CellError::CAUTIOUS.of_model()
    }

    fn is_spent(&self) -> bool {
        self.work.is_spent()
    }

    fn coarser(&self, theta: &[f64], progress: &dyn Progress) -> Result<Option<Coarser<PerMeasurement<PixelGrid>>>> {
        let found = self.expose_coarser(&self.perturbation(theta), progress)?;
        Ok(found.map(|Coarser { fine, coarse }| Coarser {
            fine: fine.into(),
            coarse: coarse.into_iter().map(|(share, own)| (share, own.into())).collect(),
        }))
    }

    fn predictions(
        &self,
        points: &[ParameterPoint],
        progress: &dyn Progress,
    ) -> Result<Vec<PerMeasurement<PixelGrid>>> {
        let perturbations: Vec<_> = points.iter().map(|p| self.perturbation_at(p)).collect();
        let exposed = self.expose(&perturbations, progress)?;
        Ok(exposed.into_iter().map(PerMeasurement::from).collect())
    }

    fn reference_values(&self, theta: &[f64]) -> Vec<Option<f64>> {
        let geometry = self.perturbation(theta).geometry;
        let set = self.bench.set();
        set.sem
            .iter()
            .map(|site| {
                let (element, at) = set.site_of(site)?;
                Some(self.bench.bias_nm(element, at, &geometry))
            })
            .collect()
    }
}

/// The measurement that would distinguish an effect from others, as far as it is known.
pub fn separating_measurement(simulator: &Simulator<'_>, effect: usize, others: &[usize]) -> Option<String> {
    let own = &simulator.effects[effect];
    others
        .iter()
        .find_map(|&o| {
            let other = &simulator.effects[o];
            separate_by(own.as_ref(), &other.name()).or_else(|| separate_by(other.as_ref(), &own.name()))
        })
        .map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{Bench, BenchSampling};
    use crate::cells::CellSource;
    use crate::effects;
    use crate::set::MeasuredSet;
    use crate::statistics::check_calibration_fits;
    use metalith_cell::PublishedCell;
    use metalith_core::Silent;
    use metalith_gds::extract::PillarsAt;

    fn small_set() -> MeasuredSet {
        let folder = tempfile::tempdir().unwrap();
        metalith_testing::session::small_set(folder.path());
        let mut set = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
        // One wavelength.
        set.leds.iter_mut().for_each(|led| led.fwhm_nm = 1e-6);
        set
    }

    fn simulator(set: &MeasuredSet) -> Simulator<'_> {
        let sampling = BenchSampling {
            spectrum: 3.0,
            ..BenchSampling::default()
        };
        let cells = CellSource::Model(Box::new(PublishedCell::new(set.stack.cell.pitch_nm as u32)));
        Simulator::new(Bench::new(set, sampling), cells, effects::all(set))
    }

    #[test]
    fn memory_is_about_what_is_said_beforehand() {
        /// In one wavelength what is faded out reaches all bins: 1.6 is found, and 1.04 to 1.3 in spectra of 20 nm.
        const OFF: f64 = 1.8;
        let mut set = small_set();
        for (pixels, pixel_um) in [(48, 0.5), (16, 5.86)] {
            (set.camera.rows, set.camera.cols, set.camera.pixel_um) = (pixels, pixels, pixel_um);
            let simulator = simulator(&set);
            let grids = simulator.expose(&[Perturbation::default()], &Silent).unwrap().remove(0);
            let held: usize = grids.iter().map(PixelGrid::bytes).sum();
            let ratio = held as f64 / simulator.prediction_bytes();
            assert!((1.0 / OFF..OFF).contains(&ratio), "{pixels} x {pixel_um} um: {ratio}");
        }
    }

    #[test]
    fn measurements_that_would_not_fit_into_memory_are_refused_with_what_to_do() {
        let mut set = small_set();
        assert!(check_calibration_fits(&simulator(&set)).is_ok());
        (set.camera.rows, set.camera.cols, set.camera.pixel_um) = (512, 512, 5.86);
        let error = check_calibration_fits(&simulator(&set)).unwrap_err();
        assert_eq!(error.id(), "calibrate/too-much-memory");
    }
}
