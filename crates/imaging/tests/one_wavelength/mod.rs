//! A camera that counts the light of one nanometre.

use metalith_sensor::{Camera, Channel, Illuminant, Response, Sensor};

/// Camera with a small sensor of pixels of 1.5 um, for light from this wavelength (nm) to one nanometre more.
pub(crate) fn camera(nm: f64) -> Camera {
    let plain = Camera::three_bands(1.5);
    Camera {
        sensor: Sensor {
            columns: 64,
            rows: 64,
            ..plain.sensor
        },
        channels: vec![Channel {
            name: "band".into(),
            response: Response::Band {
                band_nm: [nm, nm + 1.0],
                efficiency: 1.0,
            },
        }],
        illuminant: Illuminant::EqualEnergy,
        ..plain
    }
}
