//! A small bench session on disk: two elements, two colours, two distances.

use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_layout::write_pillars;
use ndarray::Array2;
use npyz::WriterBuilder;

/// Edge of a capture of the small set (pixels).
pub const PIXELS: usize = 48;

/// Elements of the small set, with the light that they steer to their axis.
const BEAMS: [([i64; 2], f64); 2] = [([0, 0], 0.0), ([1, 0], -15.0)];

/// Write a frame.
pub fn write_npy(path: &Path, values: &Array2<f32>) {
    let mut bytes = Vec::new();
    let shape = [values.nrows() as u64, values.ncols() as u64];
    let mut writer = npyz::WriteOptions::new()
        .default_dtype()
        .shape(&shape)
        .writer(&mut bytes)
        .begin_nd()
        .unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
    fs::write(path, bytes).unwrap();
}

/// Source, camera and two narrow LEDs of a small session, as sets and benches name them.
pub fn bench() -> String {
    format!(
        r#"[source]
kind = "collimated"
divergence_mrad = 2.35
divergence_axes = "uniform disc"

[camera]
pixel_um = 0.5
rows = {PIXELS}
cols = {PIXELS}
black_level_dn = 40.0
gain_e_per_dn = 5.0
read_noise_dn = 2.0
saturation_dn = 4095
registration_sigma_px = 0.5
flux_sigma = 0.01

[[led]]
centre_nm = 500
fwhm_nm = 6.0

[[led]]
centre_nm = 560
fwhm_nm = 6.0
"#
    )
}

/// Write a session with lenses of 60 um, its frames still dark; its `measurement.toml`.
pub fn small_set(folder: &Path) -> PathBuf {
    let root = crate::root();
    let design = Design::read(&root.join("designs/mini_3x3.toml")).unwrap();
    let array = PillarArray::build(&design, &Silent).unwrap();
    write_pillars(&design, &array, Hierarchy::Sref, &folder.join("layout.gds"), &Silent).unwrap();
    fs::copy(root.join("golden/measured/film_nk.csv"), folder.join("film_nk.csv")).unwrap();
    let bench = bench();
    let mut text = format!(
        r#"schema = 1
title = "small chip"
layout = "layout.gds"

[layout_layers]
pillars = [1, 0]
apertures = [2, 0]

[stack]
pitch_nm = 350
pillar_height_nm = 700
pillar_index = "film_nk.csv"
substrate = "fused_silica_malitson_1965"
ambient_index = 1.0
incidence = "substrate"
lens_diameter_um = 60.0
focal_length_um = 144.0

{bench}"#
    );
    for (index, _) in BEAMS {
        text.push_str(&format!(
            "\n[[element]]\nindex = [{0}, 0]\ncentre_um = [{1}.0, 0.0]\naperture_diameter_um = 60.0\n",
            index[0],
            150 * index[0]
        ));
    }
    for (index, aoi) in BEAMS {
        for led in [500, 560] {
            // Where the wedge of 550 nm sends this colour.
            let sine = 0.258_819 * f64::from(led) / 550.0 + aoi.to_radians().sin();
            let x = if index[0] == 0 {
                0.0
            } else {
                144.0 * sine / (1.0 - sine * sine).sqrt()
            };
            for (z, distance) in [139.0, 146.0].into_iter().enumerate() {
                let name = format!("e{}_{led}_z{z}", index[0]);
                write_npy(
                    &folder.join(format!("{name}.npy")),
                    &Array2::from_elem((PIXELS, PIXELS), 40.0),
                );
                text.push_str(&format!(
                    "\n[[capture]]\nfile = \"{name}.npy\"\nelement = [{}, 0]\nled_nm = {led}\naoi_deg = [{aoi:.1}, 0.0]\ndistance_um = {distance:.1}\nwindow_centre_um = [{x:.3}, 0.0]\nscale_dn = 1.0\nframes = 64\n",
                    index[0]
                ));
            }
        }
    }
    let path = folder.join("measurement.toml");
    fs::write(&path, text).unwrap();
    path
}
