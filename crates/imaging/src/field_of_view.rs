//! Field of view of a camera, an array and its kernels, checked before and after work is spent on it.

use metalith_core::{Error, Result};
use metalith_design::Design;
use metalith_sensor::{Camera, ChannelSampling};

use crate::acceptance::Acceptance;
use crate::chip::element_views;
use crate::geometry::{ElementView, SceneView};
use crate::kernel_plan::WIDEST_FIELD_DEG;
use crate::kernels::BankSpec;
use crate::scene::SceneImage;
use crate::stray_light::{LightShares, StrayLight};

/// Least share of the light that travels to the sensor in the windows of the kernels: with less there is no image.
/// `prototype_3x3` has 40 %.
const LEAST_IN_WINDOWS: f64 = 0.02;
/// Least share of the light of each channel that must lie among the wavelengths of a spectral cube. Beyond them its spectra are
/// taken to be level; of 5 % of the light that may be wrong by a fifth, which is 1 % of a signal, what the operator of a
/// restoration errs by.
const LEAST_COVERED: f64 = 0.95;

/// Kernels must hold a part of the light that can be called an image.
pub(crate) fn check_windows(
    stray_light: &StrayLight,
    bases: usize,
    channels: &[ChannelSampling],
    spec: &BankSpec,
) -> Result<()> {
    for (channel, shares) in channels.iter().zip(stray_light.budget.chunks(bases)) {
        let all = LightShares::sum(shares);
        let travelling = all.in_kernels + all.stray_light + all.beyond;
        if all.in_kernels < LEAST_IN_WINDOWS * travelling {
            return Err(Error::refused(
                "camera/window-too-small",
                format!(
                    "windows of {} pixels of {} um are too small for the images of a point: they hold {:.2} % of the light of channel `{}` that travels to the sensor",
                    spec.window,
                    spec.pixel_um,
                    100.0 * all.in_kernels / travelling.max(f64::MIN_POSITIVE),
                    channel.name
                ),
                "give a sensor with larger pixels, or a layout that images at the distance of the sensor",
            ));
        }
    }
    Ok(())
}

/// A camera must see the chip, and the array the scene.
pub(crate) fn check_view(elements: &[ElementView], spec: &BankSpec, camera: &Camera, view: &SceneView) -> Result<()> {
    if !(view.field_deg > 0.0 && view.field_deg < 175.0 && view.distance_um > 0.0) {
        return Err(Error::refused(
            "scene/field-out-of-range",
            format!(
                "a field of {} degrees at a distance of {} um",
                view.field_deg, view.distance_um
            ),
            "give a field from 1 to 174 degrees and a positive distance",
        ));
    }
    let seen = |row: f64, column: f64| {
        let tangents = view.tangents(row, column);
        (0..elements.len())
            .any(|k| off_axis_um(elements, k, camera, view, tangents).is_some_and(|um| um <= spec.reach_um))
    };
    // Places of the scene along its border and its middle.
    let (last_row, last_column) = (view.rows as f64 - 1.0, view.columns as f64 - 1.0);
    if !seen(0.5 * last_row, 0.5 * last_column) {
        return Err(Error::refused(
            "camera/sensor-misplaced",
            "the middle of the scene is imaged outside of the sensor",
            "check `offset_um`, `columns` and `rows` of the sensor",
        ));
    }
    // Corners and the middles of the edges: sines grow less than tangents, so that either may be the farther off.
    let (middle_row, middle_column) = (0.5 * last_row, 0.5 * last_column);
    let border = [0.0, middle_row, last_row]
        .into_iter()
        .flat_map(|row| [0.0, middle_column, last_column].map(|column| (row, column)));
    if let Some((row, column)) = border.into_iter().find(|(r, c)| !seen(*r, *c)) {
        let [tx, ty] = view.tangents(row, column);
        return Err(Error::refused(
            "scene/field-too-wide",
            format!(
                "the scene is wider than the field of view of the array: no element images its border at ({:.1}, {:.1}) degrees onto the sensor by light that leaves within {WIDEST_FIELD_DEG} degrees of its axis",
                tx.atan().to_degrees(),
                ty.atan().to_degrees()
            ),
            "give a smaller field of the scene, or a larger sensor",
        ));
    }
    Ok(())
}

/// Distance along either axis from the axis of one of the elements to its image of a place of a scene (um); `None` if that is not on
/// the sensor, or behind a wall.
pub(crate) fn off_axis_um(
    elements: &[ElementView],
    k: usize,
    camera: &Camera,
    view: &SceneView,
    tangents: [f64; 2],
) -> Option<f64> {
    let (element, sensor) = (&elements[k], &camera.sensor);
    let half = [sensor.columns, sensor.rows].map(|n| 0.5 * f64::from(n) * sensor.pixel_um);
    let sines = element.sines(tangents, view.distance_um);
    let place = element.landing_um(sines, element.wedge.wavelength_um)?;
    let on = |a: usize| (place[a] + element.centre_um[a] - sensor.offset_um[a]).abs() <= half[a];
    let on_chip = [0, 1].map(|a| place[a] + element.centre_um[a]);
    (on(0) && on(1) && Acceptance::new(elements, sensor).is_open(k, on_chip))
        .then(|| place[0].abs().max(place[1].abs()))
}

/// Distance from the axes of elements (um) within which each place of a scene has an image that is on the sensor, if it has one
/// at any distance.
pub(crate) fn needed_reach_um(elements: &[ElementView], camera: &Camera, view: &SceneView) -> f64 {
    /// Steps between places along each axis of the scene.
    const STEPS: usize = 8;
    let at = |k: usize, n: usize| k as f64 / STEPS as f64 * (n as f64 - 1.0);
    let nearest = |row: f64, column: f64| {
        let all =
            (0..elements.len()).filter_map(|k| off_axis_um(elements, k, camera, view, view.tangents(row, column)));
        all.reduce(f64::min)
    };
    let places = (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |k| (at(i, view.rows), at(k, view.columns))));
    places
        .filter_map(|(row, column)| nearest(row, column))
        .fold(0.0, f64::max)
}

/// The widest field, in whole degrees up to `most_deg`, of a square scene of so many pixels an axis that is far away and that the
/// array sees by light that leaves within the least field of the kernels.
///
/// # Errors
/// If it sees not even one degree.
pub(crate) fn widest_field_deg(design: &Design, camera: &Camera, pixels: usize, most_deg: u32) -> Result<f64> {
    let (elements, spec) = (element_views(design, camera), BankSpec::standard(design, camera));
    let sees = |field_deg: f64| {
        let view = SceneView {
            rows: pixels,
            columns: pixels,
            field_deg,
            distance_um: f64::INFINITY,
        };
        check_view(&elements, &spec, camera, &view)
    };
    let fields = (2..=most_deg).rev().map(f64::from);
    match fields.into_iter().find(|field_deg| sees(*field_deg).is_ok()) {
        Some(field_deg) => Ok(field_deg),
        None => sees(1.0).map(|()| 1.0),
    }
}

/// A cube must know the light that the channels count.
pub(crate) fn check_coverage(scene: &SceneImage, channels: &[ChannelSampling]) -> Result<()> {
    // Where all of its spectra are known.
    let ends = scene.basis.iter().filter_map(|b| Some((*b.nm.first()?, *b.nm.last()?)));
    let (low, high) = ends.fold((0.0, f64::INFINITY), |(a, b), (low, high)| {
        (f64::max(a, low), f64::min(b, high))
    });
    for channel in channels {
        let (mut inside, mut all) = (0.0, 0.0);
        for part in &channel.parts {
            all += part.weight;
            if (low..=high).contains(&(0.5 * (part.nm[0] + part.nm[1]))) {
                inside += part.weight;
            }
        }
        if inside < LEAST_COVERED * all {
            return Err(Error::refused(
                "scene/spectra-too-narrow",
                format!(
                    "the spectra of `{}` are known from {low} to {high} nm, where channel `{}` of the camera counts {:.1} % of its light",
                    scene.name,
                    channel.name,
                    100.0 * inside / all
                ),
                format!(
                    "give a cube whose wavelengths hold {:.0} % of the light of each channel, or a camera or an illuminant for those of this one",
                    100.0 * LEAST_COVERED
                ),
            ));
        }
    }
    Ok(())
}

/// Words for light that the channels of a camera count and the band of a design does not hold, which is not simulated; `None` where
/// it is little.
pub(crate) fn light_left_out(channels: &[ChannelSampling], design: &Design) -> Option<String> {
    let (low, high) = design.band_um().ok()?;
    let least = channels.iter().map(|channel| channel.counted).fold(1.0, f64::min);
    (least < LEAST_COVERED).then(|| {
        let each = channels.iter().map(|c| format!("{:.0} % of `{}`", 100.0 * c.counted, c.name));
        let [low, high] = [low, high].map(|um| (um * 1e3).round());
        format!(
            "only light from {low} to {high} nm is simulated, the band of the design: {} of what the channels count; colours, \
             exposure and scores are those of a picture in this band. Widen `band_nm` of [cell] for all of the light",
            each.collect::<Vec<_>>().join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectra::SceneSpectrum;
    use ndarray::Array3;

    #[test]
    fn windows_without_an_image_are_refused() {
        let camera = Camera::three_bands(5.86);
        let channels = camera.sampling([400.0, 700.0], 12.5).unwrap().channels;
        let spec = BankSpec {
            pixel_um: 5.86,
            window: 64,
            nodes: 3,
            reach_um: 10.0,
            accurate: false,
        };
        let with = |in_kernels: f64| {
            let mut stray_light = StrayLight::none(&camera.sensor, channels.len(), 2);
            for shares in &mut stray_light.budget {
                *shares = LightShares {
                    arrives: 1.0,
                    in_kernels,
                    stray_light: 0.5,
                    ..LightShares::default()
                };
            }
            check_windows(&stray_light, 2, &channels, &spec)
        };
        assert!(with(0.3).is_ok());
        assert_eq!(with(0.005).unwrap_err().id(), "camera/window-too-small");
    }

    #[test]
    fn cubes_that_do_not_cover_a_channel_are_refused() {
        let camera = Camera::three_bands(5.86);
        let channels = camera.sampling([400.0, 700.0], 12.5).unwrap().channels;
        let cube = |low: f64, high: f64| {
            let mut scene = SceneImage::of_rgb("cube", &Array3::zeros((16, 16, 3)), 60.0, f64::INFINITY);
            let spectrum = |last: f64| SceneSpectrum {
                nm: vec![low, 550.0, last],
                values: vec![0.2, 0.5, 0.3],
            };
            // One spectrum that is known farther does not make up for the others.
            scene.basis = vec![spectrum(high), spectrum(high + 100.0)];
            check_coverage(&scene, &channels)
        };
        assert!(cube(400.0, 700.0).is_ok() && cube(300.0, 900.0).is_ok());
        // Of 100 parts of a band of equal energy, photons: 4 and 6 of the shortest.
        assert!(cube(404.0, 700.0).is_ok());
        let error = cube(406.0, 700.0).unwrap_err().to_string();
        assert!(error.contains("`blue`") && error.contains("94."), "{error}");
        let error = cube(400.0, 650.0).unwrap_err().to_string();
        assert!(error.contains("`red`") && error.contains("650 nm"), "{error}");
    }

    #[test]
    fn the_widest_field_is_one_that_is_seen() {
        let design = Design::read("../../designs/mini_3x3.toml".as_ref()).unwrap();
        let mut camera = Camera::three_bands(2.0);
        let mut with_pixels = |pixels: u32| {
            (camera.sensor.columns, camera.sensor.rows) = (pixels, pixels);
            widest_field_deg(&design, &camera, 512, 80)
        };
        // All elements, and the middle one alone: 144 um above a sensor of 80 um.
        assert_eq!(with_pixels(240).unwrap(), 80.0);
        let alone = with_pixels(40).unwrap();
        let edge = 2.0 * (40.0f64 / 144.0).atan().to_degrees();
        assert!((edge - 2.0..=edge + 1.0).contains(&alone), "{alone} {edge}");
        camera.sensor.offset_um = [9000.0, 0.0];
        let error = widest_field_deg(&design, &camera, 512, 80).unwrap_err();
        assert_eq!(error.id(), "camera/sensor-misplaced");
    }
}
