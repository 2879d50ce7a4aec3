//! Writes `golden/session`: a small measured set of a synthetic chip whose pillars are 8 nm too narrow and whose sensor is 5 um
//! too far, with the pillars of `designs/mini_3x3.toml` in OASIS. `cargo run --release --example shipped_set FOLDER`.

use std::path::Path;

use metalith::calibrate::{MeasuredSet, Sampling, Settings, Synthesizer};
use metalith::extract::GdsPillars;
use metalith::layout::{LayoutFormat, convert};
use metalith::{Layout, Silent};
use metalith_testing::session::{small_set, write_npy};

/// What the chip has, beside noise.
const EFFECTS: [(&str, [f64; 1]); 2] = [("cd_bias", [-8.0]), ("gap", [5.0])];

/// Seed of noise, registration, flux and black level.
const SEED: u64 = 7;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("name the folder to write into")?;
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    let description = small_set(folder);
    let [written, kept] = ["layout.gds", "layout.oas"].map(|name| folder.join(name));
    convert(&Layout::open(&written)?, LayoutFormat::of_name(&kept), &kept, &Silent)?;
    let text = std::fs::read_to_string(&description)?;
    std::fs::write(&description, text.replace("\"layout.gds\"", "\"layout.oas\""))?;
    let like = MeasuredSet::read(folder, &GdsPillars, &Silent)?;
    let settings = Settings {
        only: EFFECTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
        sampling: Sampling::default(),
        ..Settings::default()
    };
    let synthesizer = Synthesizer::new(&like, &settings)?;
    let chip = EFFECTS
        .iter()
        .map(|(name, number)| (*name, number.as_slice()))
        .collect();
    let images = synthesizer.with_effects(&[chip], &Silent)?.remove(0);
    let set = synthesizer.draw(&images, SEED);
    for capture in &set.captures.raw {
        write_npy(&folder.join(format!("{}.npy", capture.name)), &capture.dn);
    }
    std::fs::remove_file(written)?;
    Ok(())
}
