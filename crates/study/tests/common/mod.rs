//! Helpers that tests of studies and of other work share.

use std::fs;
use std::path::{Path, PathBuf};

/// A design that is solved in some seconds: one small lens, one wavelength and white light.
pub(crate) fn tolerance(folder: &Path, draws: u64) -> PathBuf {
    let design = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../designs/mini_3x3.toml")).unwrap();
    let small = [
        ("diameter_um = 60", "diameter_um = 20"),
        ("focal_length_um = 144", "focal_length_um = 48"),
        ("elements = [3, 3]", "elements = [1, 1]"),
        ("wavelengths_nm = [455, 530, 660]", "wavelengths_nm = [660]"),
        ("field_x_deg = [0, 15]", "field_x_deg = [0]"),
        ("field_y_deg = [0, 0]", "field_y_deg = [0]"),
        ("window_samples = 128", "window_samples = 32"),
        ("width_step_nm = 2 ", "width_step_nm = 10 "),
        ("[mapping]", "[mapping]\naccept = \"heights of a grid\""),
    ];
    let design = small.iter().fold(design, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    fs::write(folder.join("design.toml"), design).unwrap();
    let text = format!(
        r#"
schema = 1
design = "design.toml"
draws = {draws}
[[vary]]
effect = "cd_bias"
distribution = "normal"
sd = 3.0
[[vary]]
effect = "defocus"
distribution = "uniform"
low = -4.0
high = 4.0
[[limit]]
figure = "strehl_660nm_0deg"
at_least = 0.01
"#
    );
    let path = folder.join("tolerance.toml");
    fs::write(&path, text).unwrap();
    path
}

/// A camera for one lens of 20 um: small pixels, one channel.
pub(crate) const SMALL_CAMERA: &str = r#"
schema = 1
name = "small"
[sensor]
pixel_um = 1.0
columns = 96
rows = 96
filter = "none"
offset_um = [0, 0]
tilt_deg = [0, 0]
bits = 12
noise_photon = 4e-5
noise_read = 1e-5
[[channel]]
name = "mono"
band_nm = [600, 680]
efficiency = 0.6
[exposure]
time_ms = "auto"
white = 0.9
[illuminant]
source = "equal_energy"
"#;
