//! The folder of a planned session: `measurement.toml` filled in, tables of the materials, and the list of widths to take.

use std::fmt::Write as _;
use std::path::Path;

use metalith_cell::Material;
use metalith_core::{AtomicFile, Result};
use metalith_design::Design;
use metalith_pillars::PillarShape;

use crate::bench_file::BenchFile;
use metalith_calibrate::MeasuredSet;
use metalith_calibrate::set_format::SPECTRUM_SIGMAS;
use metalith_sensor::{Colour, ColourFilter};

/// Step of the tables of materials (nm).
const TABLE_STEP_NM: f64 = 2.0;

/// Range by which tables reach beyond the spectra of all LEDs (nm).
const TABLE_MARGIN_NM: f64 = 15.0;

/// Write the set: its `measurement.toml`, the tables that it names, and an empty folder for frames. `layout` is the path of
/// the layout as the set names it.
///
/// # Errors
/// If a file cannot be written, or a material is not known at an LED.
pub(crate) fn write_set(
    folder: &Path,
    design: &Design,
    bench: &BenchFile,
    set: &MeasuredSet,
    layout: &str,
) -> Result<()> {
    let cell = &set.stack.cell;
    write_table(&folder.join("film_nk.csv"), &cell.film, set)?;
    let mut substrate = cell.substrate.name().to_owned();
    if Material::named(&substrate).is_err() {
        substrate = "substrate_nk.csv".into();
        write_table(&folder.join(&substrate), &cell.substrate, set)?;
    }
    let mut spacer = None;
    if let Some(layer) = cell.under.iter().find(|u| u.material != cell.film) {
        let name = layer.material.name().to_owned();
        let name = if Material::named(&name).is_ok() {
            name
        } else {
            write_table(&folder.join("spacer_nk.csv"), &layer.material, set)?;
            "spacer_nk.csv".into()
        };
        spacer = Some((name, layer.height_nm));
    }
    if !set.sem.is_empty() {
        AtomicFile::write(&folder.join("cd_sem.csv"), sem_table(set).as_bytes())?;
    }
    let text = text(design, bench, set, layout, &substrate, spacer);
    AtomicFile::write(&folder.join("measurement.toml"), text.as_bytes())
}

/// The file of a measurement, from the folder of the set.
pub(crate) fn frame_file(name: &str, bench: &BenchFile) -> String {
    format!("captures/{name}.{}", bench.ending)
}

fn text(
    design: &Design,
    bench: &BenchFile,
    set: &MeasuredSet,
    layout: &str,
    substrate: &str,
    spacer: Option<(String, f64)>,
) -> String {
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let (cell, camera, layers) = (&set.stack.cell, &set.camera, &design.layout.layers);
    let mut out = String::new();
    let mut line = |key: &str, value: String| {
        let _ = if key.starts_with('[') {
            writeln!(out, "\n{key}")
        } else {
            writeln!(out, "{key} = {value}")
        };
    };
    let none = String::new;
    line("schema", "1".into());
    line("title", quoted(&set.title));
    line("layout", quoted(layout));
    line("[layout_layers]", none());
    for (key, layer) in [("pillars", &layers.pillars), ("apertures", &layers.apertures)] {
        line(key, format!("[{}, {}]", layer.layer, layer.datatype));
    }
    line("[stack]", none());
    line("pitch_nm", format!("{}", cell.pitch_nm));
    line("pillar_height_nm", format!("{}", cell.height_nm));
    if let Some(shape) = word(&PillarShape::CHOICES, Some(cell.shape)) {
        line("shape", quoted(shape));
    }
    let lattice = cell.lattice.kind();
    if !lattice.is_square() {
        line("lattice", quoted(&lattice.to_string()));
    }
    line("pillar_index", quoted("film_nk.csv"));
    line("substrate", quoted(substrate));
    if let Some((name, height_nm)) = spacer {
        line("spacer_material", quoted(&name));
        line("spacer_nm", format!("{height_nm}"));
    }
    if let Some(residual) = cell.under.iter().find(|u| u.material == cell.film) {
        line("residual_nm", format!("{}", residual.height_nm));
    }
    let middle_um = set.leds.iter().map(|l| l.centre_nm * 1e-3).next().unwrap_or(1.0);
    let ambient = cell.ambient.index(middle_um).map_or(1.0, |n| n.re);
    line("ambient_index", format!("{ambient:?}"));
    line("incidence", quoted("substrate"));
    line("lens_diameter_um", format!("{}", set.stack.lens_diameter_um));
    line("focal_length_um", format!("{}", set.stack.focal_length_um));
    line("[source]", none());
    line("kind", quoted("collimated"));
    line("divergence_mrad", format!("{}", rounded(set.divergence_rad * 1e3)));
    line("divergence_axes", quoted("uniform disc"));
    line("[camera]", none());
    line("pixel_um", format!("{}", camera.pixel_um));
    line("rows", format!("{}", camera.rows));
    line("cols", format!("{}", camera.cols));
    for (key, value) in [
        ("black_level_dn", camera.black_level_dn),
        ("gain_e_per_dn", camera.gain_e_per_dn),
        ("read_noise_dn", camera.read_noise_dn),
        ("saturation_dn", camera.saturation_dn),
        ("registration_sigma_px", camera.registration_sigma_px),
        ("flux_sigma", camera.flux_sigma),
    ] {
        line(key, format!("{value}"));
    }
    if camera.relay_blur_um > 0.0 {
        line("relay_blur_um", format!("{}", camera.relay_blur_um));
    }
    if let Some(bayer) = word(&ColourFilter::BAYER, Some(camera.filter)) {
        line("bayer", quoted(bayer));
    }
    for led in &set.leds {
        line("[[led]]", none());
        line("centre_nm", format!("{}", led.centre_nm));
        line("fwhm_nm", format!("{}", led.fwhm_nm));
        if let Some(channel) = word(&Colour::CHOICES, led.channel) {
            line("channel", quoted(channel));
        }
    }
    for e in &set.elements {
        line("[[element]]", none());
        line("index", format!("{:?}", e.index));
        line("centre_um", format!("{:?}", e.centre_um));
        line("aperture_diameter_um", format!("{}", rounded(e.aperture_diameter_um)));
    }
    for c in &set.measurements {
        line("[[capture]]", none());
        line("file", quoted(&frame_file(&c.name, bench)));
        line("element", format!("{:?}", set.elements[c.element].index));
        line("led_nm", format!("{}", set.leds[c.led].centre_nm));
        line("aoi_deg", format!("{:?}", c.aoi_rad.map(|a| rounded(a.to_degrees()))));
        line("distance_um", format!("{}", c.distance_um));
        line("window_centre_um", format!("{:?}", c.window_centre_um));
        line("scale_dn", format!("{}", c.scale_dn));
        line("frames", format!("{}", c.frames));
    }
    if let Some(place) = set.field_boundary_um {
        line("[writer]", none());
        line("field_boundary_um", format!("{place:?}"));
    }
    if !set.sem.is_empty() {
        line("[cd_sem]", none());
        line("file", quoted("cd_sem.csv"));
        line("edge_offset_nm", format!("{}", set.sem_offset_sigma_nm));
    }
    out
}

/// The word that a choice is written by.
fn word<T: PartialEq>(choices: &[(&'static str, T)], chosen: Option<T>) -> Option<&'static str> {
    let chosen = chosen?;
    choices.iter().find(|c| c.1 == chosen).map(|c| c.0)
}

/// Number without what the conversion to other units and back has added.
fn rounded(v: f64) -> f64 {
    (v * 1e6).round() / 1e6
}

/// The index of a material over the spectra of all LEDs.
fn write_table(path: &Path, material: &Material, set: &MeasuredSet) -> Result<()> {
    let (known_low, known_high) = material.range_um();
    let reach = |l: &metalith_calibrate::BenchLed| SPECTRUM_SIGMAS * l.sigma_nm() * 1.2 + TABLE_MARGIN_NM;
    let ends = set.leds.iter().fold((f64::MAX, 0.0f64), |(low, high), l| {
        (low.min(l.centre_nm - reach(l)), high.max(l.centre_nm + reach(l)))
    });
    let (low, high) = (ends.0.max(known_low * 1e3).ceil(), ends.1.min(known_high * 1e3).floor());
    let mut text = format!("# {}, from the design\nwavelength_nm,n,k\n", material.name());
    let mut nm = low;
    while nm <= high {
        let index = material.index(nm * 1e-3)?;
        let _ = writeln!(text, "{nm},{:.6},{:.6}", index.re, index.im);
        nm += TABLE_STEP_NM;
    }
    AtomicFile::write(path, text.as_bytes())
}

/// The sites that a SEM is to measure, `measured_nm` left empty.
fn sem_table(set: &MeasuredSet) -> String {
    let mut text = String::from("# Fill in measured_nm; lines without it count as not measured.\n");
    text.push_str(metalith_calibrate::SEM_COLUMNS);
    text.push('\n');
    for s in &set.sem {
        let [m, n] = s.element;
        let _ = writeln!(
            text,
            "{m},{n},{:.3},{:.3},{},,{}",
            s.at_um[0], s.at_um[1], s.designed_nm, s.sigma_nm
        );
    }
    text
}
