//! White light through the elements of a layout without a design.

use rayon::prelude::*;
use serde::Serialize;

use super::polychromatic::{CameraStatement, step_nm};
use super::polychromatic_channels::{Channels, Point, WhiteChannel, per_light};
use super::single::{Lighting, OPEN, distinct, kind_of, largest_number, whole_aperture};
use metalith_core::{Progress, Result, Steps, Wedge};
use metalith_gds::extract::Extraction;
use metalith_optics::{IncoherentFields, SimulationCase};
use metalith_sensor::{Camera, Sampling, WavelengthSteps};
use metalith_wave::psf::{BandSample, IdealPsf};
use metalith_wave::{Accuracy, Pillars, Scratch};

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
    let sampling = camera.sampling(known_nm, steps(WavelengthSteps::USUAL_NM))?;
    let most_nm = step_nm(sampling.ends_nm());
    if most_nm > WavelengthSteps::USUAL_NM {
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
    let shortest_um = 1e-3 * sampling.wavelengths_nm.iter().copied().fold(f64::INFINITY, f64::min);
    let lp_mm = statement.frequencies().drawn();
    let elements = distinct(found);
    light.check_held(&elements, &[shortest_um], sampling.wavelengths_nm.len())?;
    let steps = Steps::begin(
        progress,
        "simulating polychromatic light",
        (elements.len() * sampling.wavelengths_nm.len()) as u64,
    );
    let point = || Point {
        wedge,
        sines: light.incidence_sin,
        distance_um: light.distance_um,
    };
    let optics = case.optics(kind_of(&elements), largest_number(&elements));
    let mut all = Vec::new();
    for (site, widths) in elements {
        let element = light.read(&optics, site, widths)?;
        let aperture = whole_aperture(widths);
        let fields = |nm: &f64| {
            Ok((
                nm * 1e-3,
                element.in_light(&light.illumination(nm * 1e-3).in_band(), &steps)?,
            ))
        };
        let fields = sampling.wavelengths_nm.iter().map(fields).collect::<Result<Vec<_>>>()?;
        let sample = |scratch: &mut Scratch, (um, fields): &(f64, IncoherentFields<'_>)| {
            progress.check_stopped()?;
            let landing = point().landing_um(*um)?;
            // The PSFs of a band have one step.
            let window = light.window(landing, widths, shortest_um);
            let psf = fields.psf(window, Accuracy::Fast, &lp_mm, scratch)?;
            // Sites as drawn, whatever they transmit.
            let focus = [landing[0], landing[1], light.distance_um];
            let full = case.full_transmission(*um)?;
            let matched = IdealPsf::of(&Pillars::new(&aperture, &OPEN)?, focus, *um, full);
            steps.done();
            Ok(per_light(landing, psf, matched.power_um2))
        };
        let samples = fields.par_iter().map_init(Scratch::default, sample);
        let samples: Vec<BandSample> = samples.collect::<Result<_>>()?;
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

    /// Light that a camera counts is simulated, whatever its band: of short-wave infrared, and of the visible between
    /// 390 and 720 nm.
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
        assert_eq!(error.id(), "camera/channel-without-light");
        insta::assert_snapshot!(error, @"
        channel `swir` of the camera counts no light from 310 to 760 nm
          help: use a channel or an illuminant in that range: it is the band of the design (`band_nm` of [cell], or about its wavelengths), as far as its materials are known
        ");
    }
}
