//! Bench sessions on disk: small lenses, two or three of them in two colours at two distances, and full-size ones.

use std::fs;
use std::path::{Path, PathBuf};

use metalith_core::Silent;
use metalith_design::{Design, Hierarchy, PillarArray};
use metalith_layout::write_pillars;
use ndarray::Array2;
use npyz::WriterBuilder;

/// Edge of a capture of the small set (pixels).
pub const PIXELS: usize = 48;

/// Elements of the small sets, with the light that they steer to their axis (degrees along x and y).
const BEAMS: [([i64; 2], [f64; 2]); 3] = [([0, 0], [0.0; 2]), ([1, 0], [-15.0, 0.0]), ([0, 1], [0.0, -15.0])];

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

/// The lenses of a design, and how they are looked at.
struct Lenses {
    design: &'static str,
    /// Lines of the design that are others.
    changes: &'static [(&'static str, &'static str)],
    diameter_um: f64,
    focal_um: f64,
    spacing_um: i64,
    distances_um: [f64; 2],
    scale_dn: f64,
    leds: &'static [i32],
}

const SMALL: Lenses = Lenses {
    design: "designs/mini_3x3.toml",
    changes: &[],
    diameter_um: 60.0,
    focal_um: 144.0,
    spacing_um: 150,
    distances_um: [139.0, 146.0],
    scale_dn: 1.0,
    leds: &[500, 560],
};

/// Lenses as large as on the chips that twins of a bench have measured.
const MIDDLE: Lenses = Lenses {
    changes: &[
        ("\ndiameter_um = 60\n", "\ndiameter_um = 140\n"),
        ("\nfocal_length_um = 144\n", "\nfocal_length_um = 336\n"),
        ("\nspacing_um = 150\n", "\nspacing_um = 400\n"),
        ("\nsize_um = [800, 800]\n", "\nsize_um = [1400, 1400]\n"),
        ("\nchord_error_nm = 5\n", "\nchord_error_nm = 20\n"),
    ],
    diameter_um: 140.0,
    focal_um: 336.0,
    spacing_um: 400,
    distances_um: [324.0, 348.0],
    ..SMALL
};

/// One colour: the transforms of a lens of 1 mm take 0.1 CPU s at each of its 21 wavelengths.
const FULL_SIZE: Lenses = Lenses {
    design: "designs/prototype_3x3.toml",
    changes: &[],
    diameter_um: 1000.0,
    focal_um: 2400.0,
    spacing_um: 2420,
    distances_um: [2360.0, 2430.0],
    scale_dn: 0.2,
    leds: &[560],
};

impl Lenses {
    fn design(&self) -> Design {
        let path = crate::root().join(self.design);
        let text = fs::read_to_string(&path).unwrap();
        Design::parse(&path, &crate::replaced(&text, self.changes)).unwrap()
    }
}

/// Write a session with two lenses of 60 um, its frames still dark; its `measurement.toml`.
pub fn small_set(folder: &Path) -> PathBuf {
    set_of(folder, &SMALL, &BEAMS[..2])
}

/// The design of its lenses.
pub fn small_design() -> Design {
    SMALL.design()
}

/// Set with two lenses of 140 um; their design.
pub fn middle_set(folder: &Path) -> Design {
    set_of(folder, &MIDDLE, &BEAMS[..2]);
    MIDDLE.design()
}

/// Set with three lenses that are not in one line.
pub fn set_of_three(folder: &Path) -> PathBuf {
    set_of(folder, &SMALL, &BEAMS)
}

/// Set with one to three lenses of 1 mm in one colour.
pub fn full_size_set(folder: &Path, elements: usize) -> PathBuf {
    set_of(folder, &FULL_SIZE, &BEAMS[..elements.clamp(1, BEAMS.len())])
}

fn set_of(folder: &Path, lenses: &Lenses, beams: &[([i64; 2], [f64; 2])]) -> PathBuf {
    let Lenses {
        diameter_um,
        focal_um,
        spacing_um,
        scale_dn,
        ..
    } = lenses;
    let (root, design) = (crate::root(), lenses.design());
    let array = PillarArray::build(&design, &Silent).unwrap();
    write_pillars(&design, &array, Hierarchy::Folded, &folder.join("layout.gds"), &Silent).unwrap();
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
lens_diameter_um = {diameter_um:?}
focal_length_um = {focal_um:?}

{bench}"#
    );
    for ([m, n], _) in beams {
        text.push_str(&format!(
            "\n[[element]]\nindex = [{m}, {n}]\ncentre_um = [{}.0, {}.0]\naperture_diameter_um = {diameter_um:?}\n",
            spacing_um * m,
            spacing_um * n
        ));
    }
    for (index, aoi) in beams {
        for led in lenses.leds {
            // Where the wedge of 550 nm sends this colour.
            let [x, y] = [0, 1].map(|axis| {
                if index[axis] == 0 {
                    return 0.0;
                }
                let sine = 0.258_819 * f64::from(*led) / 550.0 + aoi[axis].to_radians().sin();
                focal_um * sine / (1.0 - sine * sine).sqrt()
            });
            let element = match index {
                [m, 0] => format!("e{m}"),
                [m, n] => format!("e{m}{n}"),
            };
            for (z, distance) in lenses.distances_um.into_iter().enumerate() {
                let name = format!("{element}_{led}_z{z}");
                write_npy(
                    &folder.join(format!("{name}.npy")),
                    &Array2::from_elem((PIXELS, PIXELS), 40.0),
                );
                text.push_str(&format!(
                    "\n[[capture]]\nfile = \"{name}.npy\"\nelement = [{}, {}]\nled_nm = {led}\naoi_deg = [{:.1}, {:.1}]\ndistance_um = {distance:.1}\nwindow_centre_um = [{x:.3}, {y:?}]\nscale_dn = {scale_dn:?}\nframes = 64\n",
                    index[0], index[1], aoi[0], aoi[1]
                ));
            }
        }
    }
    let path = folder.join("measurement.toml");
    fs::write(&path, text).unwrap();
    path
}
