//! The forward model of a set, with access to the field between the pillars and the pixels.

use super::light::light;
use super::{Bench, FocusSeries};
use crate::set::MeasurementIndex;
use metalith_core::Result;
use metalith_optics::{ArrivingLight, AsBuiltElement, DrawnElement, IncoherentFields, Perturbation, SolvedWidths};

impl Bench<'_> {
    /// The element of a measurement with a perturbation applied.
    ///
    /// # Errors
    /// As [`AsBuiltElement::new`].
    pub fn element_of(&self, measurement: MeasurementIndex, perturbation: &Perturbation) -> Result<AsBuiltElement> {
        let drawn: &DrawnElement<'_> = &self.drawn[self.set.measurements[measurement].element];
        AsBuiltElement::new(drawn, &perturbation.geometry)
    }

    /// Element under the light of the measurement, at one wavelength (um). `solved`: transmission of its widths.
    pub fn view<'a>(
        &self,
        measurement: MeasurementIndex,
        element: &'a AsBuiltElement,
        perturbation: &Perturbation,
        wavelength_um: f64,
        solved: &SolvedWidths,
    ) -> IncoherentFields<'a> {
        let light = self.direction_of(measurement, perturbation, wavelength_um);
        IncoherentFields::as_built(element, light, perturbation, solved)
    }

    /// The incident wave at the element of a measurement, at one wavelength (um).
    pub fn direction_of(
        &self,
        measurement: MeasurementIndex,
        perturbation: &Perturbation,
        wavelength_um: f64,
    ) -> ArrivingLight {
        light(self.group_of(measurement), &perturbation.path, wavelength_um)
    }

    fn group_of(&self, measurement: MeasurementIndex) -> &FocusSeries {
        let group = self.groups.iter().find(|g| g.measurements.contains(&measurement));
        group.expect("every measurement is in a group")
    }
}

#[cfg(test)]
mod tests {
    use super::super::BenchSampling;
    use super::*;
    use crate::cells::CellSource;
    use crate::effects;
    use crate::set::MeasuredSet;
    use crate::simulator::Simulator;
    use metalith_cell::{CellModel, PublishedCell};
    use metalith_core::Silent;
    use metalith_gds::extract::PillarsAt;
    use metalith_wave::{Accuracy, Scratch, Window};
    use num_complex::Complex64;

    /// Share of the peak by which pixels may differ: the error of the propagator for many distances (see its own
    /// test), and the faded border of its window.
    const OF_THE_PEAK: f64 = 2e-3;

    /// Effects that the published cell cannot show, since it has no layer stack.
    const OF_THE_STACK: [&str; 6] = [
        "film_height",
        "rim_height",
        "film_index",
        "sidewall_taper",
        "corner_rounding",
        "residual_mask",
    ];

    #[test]
    fn measurements_show_what_the_made_chip_makes_of_every_effect() {
        let folder = tempfile::tempdir().unwrap();
        metalith_testing::session::small_set(folder.path());
        let mut set = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
        // One wavelength and a point source: only chip, path and camera remain.
        set.leds.iter_mut().for_each(|led| led.fwhm_nm = 1e-6);
        set.divergence_rad = 0.0;
        set.field_boundary_um = Some([5.0, -4.0]);
        let sampling = BenchSampling {
            spectrum: 3.0,
            ..BenchSampling::default()
        };
        let mut bench = Bench::new(&set, sampling);
        bench.follows = false;
        let published = || PublishedCell::new(set.stack.cell.pitch_nm as u32);
        let simulator = Simulator::new(bench, CellSource::Model(Box::new(published())), effects::all(&set));
        let pixel = set.camera.pixel_um;
        for effect in &simulator.effects {
            // A shifted line has none of the one wavelength that is simulated.
            if OF_THE_STACK.contains(&effect.name().as_str()) || effect.name().starts_with("led_centre") {
                continue;
            }
            let typical: Vec<f64> = effect.parameters().iter().map(|p| p.typical).collect();
            let mut perturbation = Perturbation::default();
            effect.apply(&typical, &mut perturbation);
            let grids = simulator
                .expose(std::slice::from_ref(&perturbation), &Silent)
                .unwrap()
                .remove(0);
            for (c, grid) in grids
                .iter()
                .enumerate()
                .step_by(3)
                .map(|(c, grid)| (MeasurementIndex::from(c), grid))
            {
                let measurement = &set.measurements[c];
                let um = set.leds[measurement.led].centre_nm * 1e-3;
                let element = simulator.bench.element_of(c, &perturbation).unwrap();
                let table = published().transmissions(um, 400).unwrap();
                let solved = SolvedWidths {
                    unseen: vec![Complex64::ONE],
                    share: 1.0,
                    pillars: vec![element.widths_nm().iter().map(|w| between(&table, *w)).collect()],
                    bare: vec![Complex64::ONE],
                    rim: None,
                };
                let window = Window {
                    centre_um: measurement.window_centre_um,
                    step_um: 0.25,
                    samples: 160,
                    distance_um: measurement.distance_um,
                };
                let view = simulator.bench.view(c, &element, &perturbation, um, &solved);
                let mut view = view;
                // Stray light is a share of the light in the camera's window: computed from the pixels below.
                let stray = std::mem::take(&mut view.camera.stray_light);
                let psf = view
                    .psf(window, Accuracy::Accurate, &[], &mut Scratch::default())
                    .unwrap();
                let mut want = psf
                    .on_pixels(measurement.window_centre_um, pixel, set.camera.rows)
                    .unwrap()
                    .mapv(|energy| energy / (pixel * pixel));
                let mean = want.mean().unwrap();
                want.mapv_inplace(|v| metalith_optics::veiled(v, mean, stray));
                let peak = want.iter().copied().fold(0.0, f64::max);
                let got = grid.pixels([0.0; 2]);
                assert!(got.iter().all(|v| v.is_finite()), "{}", effect.name());
                let worst = got.iter().zip(&want).map(|(a, b)| (f64::from(*a) - b).abs());
                let worst = worst.fold(0.0, f64::max) / peak;
                println!("{}, {}: {worst:.1e}", effect.name(), measurement.name);
                assert!(worst < OF_THE_PEAK, "{}, {}: {worst}", effect.name(), measurement.name);
            }
        }
    }

    /// The transmission at any width, interpolated in a table of whole nanometres as the tables of this crate are.
    fn between(table: &[Complex64], width_nm: f64) -> Complex64 {
        let i = width_nm.floor();
        let weights = metalith_optics::lagrange(width_nm - i);
        let at = i as usize;
        table[at - 1..at + 3].iter().zip(weights).map(|(t, w)| t * w).sum()
    }
}
