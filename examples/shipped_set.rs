//! Writes `golden/session`: a small measured set of a synthetic chip whose pillars are 8 nm too narrow and whose sensor is 5 um
//! too far, with the pillars of `designs/mini_3x3.toml` in OASIS. `cargo run --release --example shipped_set FOLDER`. With `EFFECTS.toml
//! NAME VALUE...` the chip has an effect of that file too. With `--full-size` first it is a set of two lenses of
//! `designs/prototype_3x3.toml` in one colour, and the sensor is 8 um too far.

use std::path::Path;

use metalith::calibrate::{DeclaredEffect, MeasuredSet, Sampling, Settings, Synthesizer};
use metalith::extract::GdsPillars;
use metalith::layout::{LayoutFormat, convert};
use metalith::{Layout, Silent};
use metalith_testing::session::{full_size_set, small_set, write_npy};

/// What the chip has, beside noise.
const EFFECTS: [(&str, [f64; 1]); 2] = [("cd_bias", [-8.0]), ("gap", [5.0])];

/// And a chip with lenses of 1 mm.
const FULL_SIZE_EFFECTS: [(&str, [f64; 1]); 1] = [("gap", [8.0])];

/// Elements of that set.
const FULL_SIZE_ELEMENTS: usize = 2;

/// Seed of noise, registration, flux and black level.
const SEED: u64 = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1).peekable();
    let full_size = args.next_if(|a| a == "--full-size").is_some();
    let folder = args.next().ok_or("name the folder to write into")?;
    let folder = Path::new(&folder);
    let made: &[(&str, [f64; 1])] = if full_size { &FULL_SIZE_EFFECTS } else { &EFFECTS };
    let mut effects: Vec<(String, Vec<f64>)> = made.iter().map(|(name, v)| ((*name).into(), v.to_vec())).collect();
    let declared = match args.next() {
        Some(file) => DeclaredEffect::read(Path::new(&file))?,
        None => Vec::new(),
    };
    if let Some(name) = args.next() {
        effects.push((name, args.map(|value| value.parse()).collect::<Result<_, _>>()?));
    }
    std::fs::create_dir_all(folder)?;
    let description = match full_size {
        true => full_size_set(folder, FULL_SIZE_ELEMENTS),
        false => small_set(folder),
    };
    let [written, kept] = ["layout.gds", "layout.oas"].map(|name| folder.join(name));
    convert(&Layout::open(&written)?, LayoutFormat::of_name(&kept), &kept, &Silent)?;
    let text = std::fs::read_to_string(&description)?;
    std::fs::write(&description, text.replace("\"layout.gds\"", "\"layout.oas\""))?;
    let like = MeasuredSet::read(folder, &GdsPillars, &Silent)?;
    let settings = Settings {
        only: effects.iter().map(|(name, _)| name.clone()).collect(),
        declared,
        sampling: Sampling::default(),
        ..Settings::default()
    };
    let synthesizer = Synthesizer::new(&like, &settings)?;
    let chip = effects
        .iter()
        .map(|(name, values)| (name.as_str(), values.as_slice()))
        .collect();
    let images = synthesizer.with_effects(&[chip], &Silent)?.remove(0);
    let set = synthesizer.draw(&images, SEED);
    for capture in &set.captures.raw {
        write_npy(&folder.join(format!("{}.npy", capture.name)), &capture.dn);
    }
    std::fs::remove_file(written)?;
    Ok(())
}
