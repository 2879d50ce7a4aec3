//! White light through the elements of a layout without a design.

use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use super::case::TransmissionTables;
use super::single::{Lighting, distinct, kind_of, largest_number};
use super::white::{CameraStatement, STEP_NM, step_nm};
use super::white_channels::{Channels, Point, WhiteChannel, per_light};
use metalith_core::{Error, Progress, Result, Wedge};
use metalith_gds::extract::Extraction;
use metalith_optics::SimulationCase;
use metalith_sensor::{Camera, Sampling, WavelengthSteps};
use metalith_wave::psf::{BandSample, IdealPsf};
use metalith_wave::{Accuracy, FoldedPropagator, Pillars, Scratch, Window};

/// One distinct element of a layout in white light.
#[derive(Clone, Debug, Serialize)]
pub struct SingleWhite {
    /// Name of the element: of several with the same pillars, the first.
    pub element: String,
    pub channels: Vec<WhiteChannel>,
}

/// The wavelengths that white light for a camera is simulated at, without a design: all that it counts light of, as far as cells
/// are known, from the first to the last of `known_nm`, behind lenses of these radii and focal lengths (um).
///
/// # Errors
/// As [`Camera::sampling`].
pub fn white_sampling(camera: &Camera, known_nm: [f64; 2], lenses_um: &[[f64; 2]]) -> Result<Sampling> {
    let steps = |most_nm: f64| WavelengthSteps::from(most_nm).behind(lenses_um.iter().copied(), camera.sensor.pixel_um);
    let sampling = camera.sampling(known_nm, steps(STEP_NM))?;
    let most_nm = step_nm(sampling.ends_nm());
    if most_nm > STEP_NM {
        return camera.sampling(known_nm, steps(most_nm));
    }
    Ok(sampling)
}

/// Simulate every distinct element of a layout in the light of a point of the scene, for a camera at the wavelengths of its
/// [`white_sampling`]. The direction is that of the [`Lighting`]; `wedge` is that of the elements, which a layout does not tell:
/// it decides where each wavelength lands.
///
/// # Errors
/// If a cell has no answer at a wavelength of the camera, a wavelength does not reach the sensor, or the user stopped it.
pub fn single_white(
    found: &Extraction,
    case: SimulationCase<'_>,
    light: &Lighting,
    (camera, sampling): (&Camera, &Sampling),
    wedge: Wedge,
    progress: &dyn Progress,
) -> Result<(CameraStatement, Vec<SingleWhite>)> {
    let statement = CameraStatement::of(camera, sampling);
    let lp_mm = statement.frequencies().drawn();
    let elements = distinct(found);
    let widest = largest_number(&elements);
    progress.begin(
        "simulating white light",
        (elements.len() * sampling.wavelengths_nm.len()) as u64,
    );
    let point = || Point {
        wedge,
        sines: light.incidence_sin,
        distance_um: light.distance_um,
    };
    let tables = sampling.wavelengths_nm.iter().map(|nm| match case {
        SimulationCase::Made(_) => Ok(None),
        SimulationCase::Cell(cell) => {
            let (lattice, um) = (kind_of(&elements), nm * 1e-3);
            let mut tables = TransmissionTables::in_band(cell, lattice, um, widest, light.polarised)?;
            tables.add_neighbours_in_band(cell, um, &|um| point().wave(um), progress)?;
            if light.cells_as_lit {
                tables.add_directions(cell, &[point().wave(um)], widest, progress)?;
            }
            Ok(Some(tables))
        }
    });
    let tables = tables.collect::<Result<Vec<_>>>()?;
    let mut all = Vec::new();
    for (site, widths) in elements {
        let made = match case {
            SimulationCase::Cell(_) => None,
            SimulationCase::Made(chip) => {
                let radius = light.aperture_radius_um.unwrap_or_else(|| widths.circle_um());
                let drawn = chip
                    .drawn(widths, radius)
                    .placed(site.centre_nm.map(|c| c as f64 * 1e-3));
                Some((chip, chip.element(&drawn)?))
            }
        };
        let views = sampling.wavelengths_nm.iter().map(|nm| match &made {
            Some((chip, element)) => {
                let wave = point().wave(nm * 1e-3);
                chip.view_in_band(element, &wave, light.cells_as_lit, progress)
                    .map(Some)
            }
            None => Ok(None),
        });
        let views = views.collect::<Result<Vec<_>>>()?;
        let sample = |scratch: &mut Scratch, (nm, tables, view): (&f64, &Option<TransmissionTables>, _)| {
            if progress.stopped() {
                return Err(Error::Interrupted);
            }
            let (point, um) = (point(), nm * 1e-3);
            let (wave, landing) = (point.wave(um), point.landing_um(um)?);
            let pitch = widths.lattice.pitch_um();
            let window = Window::about(landing, pitch, light.samples, light.distance_um);
            let psf = match (view, tables) {
                (Some(view), _) => metalith_optics::AsBuiltOptics::psf(view, window, Accuracy::Fast, &lp_mm, scratch)?,
                (None, Some(tables)) => {
                    let fold = FoldedPropagator::plan(widths.lattice, widths.circle_um(), um, window, Accuracy::Fast)?;
                    tables.psf(widths, &wave, &wave, &fold, &lp_mm, scratch)?
                }
                (None, None) => unreachable!("a case is a cell or a made chip"),
            };
            // Sites as drawn, whatever they transmit.
            let ones = vec![Complex64::ONE; usize::from(widest) + 1];
            let focus = [landing[0], landing[1], light.distance_um];
            let full = case.full_transmission(um)?;
            let matched = IdealPsf::of(&Pillars::new(widths, &ones)?, focus, um, full);
            progress.advance(1);
            Ok(per_light(landing, psf, matched.power_um2))
        };
        let tasks: Vec<_> = sampling.wavelengths_nm.iter().zip(&tables).zip(&views).collect();
        let samples: Vec<BandSample> = tasks
            .into_par_iter()
            .map_init(Scratch::default, |scratch, ((nm, tables), view)| {
                sample(scratch, (nm, tables, view.as_ref()))
            })
            .collect::<Result<_>>()?;
        let shown = Channels {
            point: point(),
            samples: &samples,
            lp_mm: &lp_mm,
            pixel_um: camera.sensor.pixel_um,
        };
        all.push(SingleWhite {
            element: site.name.clone(),
            channels: sampling
                .channels
                .iter()
                .map(|c| shown.channel(c))
                .collect::<Result<_>>()?,
        });
    }
    Ok((statement, all))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a camera counts is simulated, whatever its band: of short-wave infrared, and of the visible between 390 and 720 nm.
    #[test]
    fn a_camera_is_sampled_over_its_own_light() {
        let sampled = |name: &str, known_nm: [f64; 2]| {
            let file = metalith_testing::root().join(format!("cameras/{name}.toml"));
            let sampling = white_sampling(&Camera::read(&file).unwrap(), known_nm, &[]);
            sampling.map(|s| (s.wavelengths_nm[0], *s.wavelengths_nm.last().unwrap()))
        };
        let (first, last) = sampled("swir", [413.3, 2066.0]).unwrap();
        assert!(
            first > 1500.0 && first < 1540.0 && last > 1560.0 && last < 1600.0,
            "{first} {last}"
        );
        let (first, last) = sampled("gt1930", [310.0, 5504.0]).unwrap();
        assert!(
            first > 390.0 && first < 405.0 && last > 690.0 && last < 720.0,
            "{first} {last}"
        );
        // As far as cells are known.
        const PART_NM: f64 = 1.0;
        assert!((sampled("gt1930", [450.0, 5504.0]).unwrap().0 - 450.0).abs() <= PART_NM);
        let error = sampled("swir", [310.0, 760.0]).unwrap_err();
        assert_eq!(error.id(), "camera/no-light");
        insta::assert_snapshot!(error, @"
        channel `swir` of the camera counts no light from 310 to 760 nm
          help: use a channel or an illuminant in that range: it is the band of the design (`band_nm` of [cell], or about its wavelengths), as far as its materials are known
        ");
    }
}
