//! Writes a measured set of a synthetic chip: `cargo run --release --example shipped_set [--full-size ELEMENTS] [--seed SEED]
//! [--boundary X,Y] FOLDER [EFFECTS.toml] [NAME=VALUE,VALUE...]...`. Without options it is `golden/session`: pillars of `designs/mini_3x3.toml` in OASIS, 8 nm
//! too narrow, and the sensor 5 um too far. Effects that are named stand in place of these two; those of a file may be named as well.
//! `--full-size` is a set of one to three lenses of `designs/prototype_3x3.toml` in one colour, its cells solved with more orders than
//! those of a fit. With `--boundary` write fields meet there in every lens (um from its middle), which the set does not say.

use std::path::Path;

use metalith::calibrate::{BenchSampling, DeclaredEffect, MeasuredSet, Settings, Synthesizer};
use metalith::extract::PillarsAt;
use metalith::layout::{LayoutFormat, convert};
use metalith::{Layout, Silent};
use metalith_testing::session::{full_size_set, small_set, write_npy};

/// What the chip has, beside noise, where nothing is named.
const EFFECTS: [&str; 2] = ["cd_bias=-8", "defocus=5"];

/// Seed of noise, registration, flux and black level.
const SEED: u64 = 7;

/// Orders of the cells of full-size lenses: fewer than a fit has err by more than noise there, 0.1 um in the defocus of two lenses.
const FULL_SIZE_ORDERS: usize = 15;

/// An effect and its numbers, as `NAME=VALUE,VALUE`.
fn effect(text: &str) -> Result<(String, Vec<f64>), Box<dyn std::error::Error>> {
    let (name, values) = text.split_once('=').ok_or("an effect is NAME=VALUE,VALUE")?;
    Ok((name.into(), numbers(values)?))
}

fn numbers(text: &str) -> Result<Vec<f64>, std::num::ParseFloatError> {
    text.split(',').map(str::parse).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1).peekable();
    let mut option = |name: &str| args.next_if(|a| a == name).and_then(|_| args.next());
    let elements: Option<usize> = option("--full-size").map(|n| n.parse()).transpose()?;
    let seed = option("--seed").map_or(Ok(SEED), |n| n.parse())?;
    let boundary = option("--boundary").map(|text| numbers(&text)).transpose()?;
    let folder = args.next().ok_or("name the folder to write into")?;
    let folder = Path::new(&folder);
    let declared = match args.next_if(|a| a.ends_with(".toml")) {
        Some(file) => DeclaredEffect::read(Path::new(&file))?,
        None => Vec::new(),
    };
    let mut effects = args.map(|a| effect(&a)).collect::<Result<Vec<_>, _>>()?;
    if effects.is_empty() {
        effects = EFFECTS.into_iter().map(effect).collect::<Result<_, _>>()?;
    }
    std::fs::create_dir_all(folder)?;
    let description = match elements {
        Some(elements) => full_size_set(folder, elements),
        None => small_set(folder),
    };
    let [written, kept] = ["layout.gds", "layout.oas"].map(|name| folder.join(name));
    convert(&Layout::open(&written)?, LayoutFormat::of_name(&kept), &kept, &Silent)?;
    let text = std::fs::read_to_string(&description)?;
    std::fs::write(&description, text.replace("\"layout.gds\"", "\"layout.oas\""))?;
    let mut like = MeasuredSet::read(folder, &PillarsAt::STATED, &Silent)?;
    if let Some(place) = boundary {
        like.field_boundary_um = Some(place.try_into().map_err(|_| "a boundary is X,Y")?);
    }
    let settings = Settings {
        only: effects.iter().map(|(name, _)| name.clone()).collect(),
        declared,
        sampling: BenchSampling::default(),
        ..Settings::default()
    };
    let synthesizer = match elements {
        Some(_) => Synthesizer::with_orders(&like, &settings, FULL_SIZE_ORDERS)?,
        None => Synthesizer::new(&like, &settings)?,
    };
    let chip = effects
        .iter()
        .map(|(name, values)| (name.as_str(), values.as_slice()))
        .collect();
    let images = synthesizer.with_effects(&[chip], &Silent)?.remove(0);
    let set = synthesizer.draw(&images, seed);
    for measurement in &set.measurements.raw {
        write_npy(&folder.join(format!("{}.npy", measurement.name)), &measurement.dn);
    }
    std::fs::remove_file(written)?;
    Ok(())
}
