//! Measured sets of heights, spectra, widths and stacks of point spread functions: texts, tables, maps and declared effects.

use std::fs;
use std::path::Path;

use metalith::Silent;
use metalith::metrology::{SetKind, SpectrumSet, StackSet, calibrate};
use metalith_testing::root;

use super::{Format, Kind, copy, file};
use crate::images;

/// Samples along an edge of a map, pixels of a frame.
const SIDE: usize = 24;

/// Reads all files of a set, and effects that a file declares: an effect of a name that is not known ends the work there.
fn read(set: &Path, kind: SetKind, declared: Option<&Path>) -> metalith::Result<()> {
    let out = set.with_file_name("out");
    match calibrate(set, kind, &out, (&["none".to_owned()], declared), &Silent) {
        Err(error) if error.id() == "effects/unknown" => Ok(()),
        other => other.map(drop),
    }
}

pub(super) fn all(folder: &Path) -> Vec<Format> {
    let mut all = heights(&folder.join("heights"));
    all.extend(spectra(&folder.join("spectra")));
    all.extend(widths(&folder.join("widths")));
    all.extend(stacks(&folder.join("stacks")));
    all
}

/// Formats of files of a set, by name, path in the folder and kind; each is damaged alone, and `set` reads the set.
fn of_set(
    folder: &Path,
    set: fn(&Path) -> metalith::Result<()>,
    files: impl IntoIterator<Item = (&'static str, &'static str, Kind)>,
) -> Vec<Format> {
    let of = |(name, path, kind): (&'static str, &str, Kind)| {
        let (text, path) = (folder.join("measurement.toml"), folder.join(path));
        let corpus = vec![fs::read(&path).unwrap()];
        Format::new(name, path, kind, corpus, move |_| set(&text))
    };
    files.into_iter().map(of).collect()
}

fn heights(folder: &Path) -> Vec<Format> {
    fs::create_dir_all(folder).unwrap();
    // The same heights in each format.
    let numbers = || (0..SIDE * SIDE).map(|k| (3 * k % 4000) as f32);
    let shape = format!("({SIDE}, {SIDE})");
    let map = metalith_testing::npy("<f4", &shape, numbers().flat_map(f32::to_le_bytes));
    let numbers: Vec<String> = numbers().map(|v| format!("{v}.25")).collect();
    let csv: String = numbers.chunks(SIDE).map(|row| row.join(",") + "\n").collect();
    for (ending, measured) in [
        ("npy", map.clone()),
        ("tif", images::tiff(SIDE, 1)),
        ("csv", csv.into_bytes()),
    ] {
        fs::write(folder.join(format!("measured1.{ending}")), measured).unwrap();
    }
    fs::write(folder.join("drawn1.npy"), &map).unwrap();
    let declared = folder.join("effects.toml");
    let effect = "[[effect]]\nname = \"swell\"\nunit = \"nm\"\nstage = \"measured\"\nheight_nm = \"a * (x^2 - min(y, 3)^2) + b * \
                  zernike(4, x, y)\"\nby = \"group\"\n[[effect.parameter]]\nname = \"a\"\nrange = [-100, 100]\nprior = 10\n\
                  [[effect.parameter]]\nname = \"b\"\nrange = [-1, 1]\nprior = 0.1\n";
    let text = |ending: &str| {
        let set = folder.join(format!("{ending}.toml"));
        let text = format!(
            "schema = 1\nkind = \"heights\"\ntitle = \"relief\"\n[grid]\nsample_um = 0.1\nrim = 2\n[drawn]\nfiles = \
             \"drawn{{plate}}.npy\"\nnm_per_level = 1.0\n[measured]\nfiles = \"measured{{plate}}.{ending}\"\nnm_per_level = 1.0\n\
             [groups]\nby = \"plate\"\n"
        );
        fs::write(&set, &text).unwrap();
        (set, text)
    };
    let mut all = Vec::new();
    for (name, ending, kind) in [
        ("heights_npy", "npy", Kind::Bytes),
        ("heights_tiff", "tif", Kind::Bytes),
        ("heights_csv", "csv", Kind::Text),
    ] {
        let (set, _) = text(ending);
        let path = folder.join(format!("measured1.{ending}"));
        let corpus = vec![fs::read(&path).unwrap()];
        all.push(Format::new(name, path, kind, corpus, move |_| {
            read(&set, SetKind::Heights, None)
        }));
    }
    let (set, words) = text("npy");
    let own = folder.join("mutant.toml");
    all.push(Format::new("heights", own, Kind::Text, vec![words.into()], |path| {
        read(path, SetKind::Heights, None)
    }));
    all.push(Format::new(
        "effects of heights",
        declared,
        Kind::Text,
        vec![effect.into()],
        move |path| read(&set, SetKind::Heights, Some(path)),
    ));
    all
}

fn spectra(folder: &Path) -> Vec<Format> {
    let example = fs::read_to_string(root().join("examples/measured/pads.toml")).unwrap();
    copy("examples/measured/pads", folder);
    copy("examples/measured/pads/captures", &folder.join("captures"));
    fs::write(
        folder.join("measurement.toml"),
        example.replace("folder = \"pads\"\n", ""),
    )
    .unwrap();
    // Models of pads take seconds.
    of_set(
        folder,
        |set| SpectrumSet::read(set).map(drop),
        [
            ("spectra", "measurement.toml", Kind::Text),
            ("spectra_capture", "captures/120_0.csv", Kind::Text),
            ("spectra_reference", "reference_mirror.csv", Kind::Text),
        ],
    )
}

fn widths(folder: &Path) -> Vec<Format> {
    copy("examples/measured/widths", folder);
    let example = String::from_utf8(file("examples/measured/widths.toml")).unwrap();
    fs::write(
        folder.join("measurement.toml"),
        example.replace("folder = \"widths\"\n", ""),
    )
    .unwrap();
    of_set(
        folder,
        |set| read(set, SetKind::Widths, None),
        [
            ("widths", "measurement.toml", Kind::Text),
            ("widths_table", "widths.csv", Kind::Text),
            ("widths_regions", "regions.csv", Kind::Text),
        ],
    )
}

fn stacks(folder: &Path) -> Vec<Format> {
    fs::create_dir_all(folder).unwrap();
    let text = "schema = 1\nkind = \"psf_stack\"\ntitle = \"masks\"\n[source]\nwavelength_nm = 633.0\n[aperture]\ndiameter_um = \
                500.0\n[lens]\nfocal_length_mm = 10.0\n[sensor]\ndistance_mm = 10.0\npixel_um = 4.0\nfiles = \
                \"stack_{object}.npy\"\n[planes]\nstart_um = -300.0\nstep_um = 100.0\nnot_fitted = [2]\n[[object]]\nname = \
                \"open\"\nkind = \"none\"\n[[object]]\nname = \"mask\"\nkind = \"phase\"\nfile = \"mask.npy\"\nsample_um = 20.0\n";
    for name in ["stack_open.npy", "stack_mask.npy"] {
        fs::write(folder.join(name), images::npy(&[5, SIDE, SIDE], images::FLOAT)).unwrap();
    }
    fs::write(folder.join("mask.npy"), images::npy(&[SIDE, SIDE], images::FLOAT)).unwrap();
    fs::write(folder.join("measurement.toml"), text).unwrap();
    of_set(
        folder,
        |set| StackSet::read(set).map(drop),
        [
            ("stacks", "measurement.toml", Kind::Text),
            ("stack_frames", "stack_mask.npy", Kind::Bytes),
            ("stack_mask", "mask.npy", Kind::Bytes),
        ],
    )
    .into_iter()
    .chain(masks(folder, text))
    .collect()
}

/// A mask in each of the other formats.
fn masks(folder: &Path, text: &str) -> Vec<Format> {
    let rows: Vec<String> = (0..SIDE * SIDE).map(|k| format!("{}.5", k % 97)).collect();
    let csv: String = rows.chunks(SIDE).map(|row| row.join(",") + "\n").collect();
    let side = SIDE as u32;
    let files = [
        ("stack_mask_png", "mask.png", Kind::Png, {
            images::png(side, side, png::ColorType::Grayscale, png::BitDepth::Sixteen)
        }),
        ("stack_mask_tiff", "mask.tif", Kind::Bytes, images::tiff(SIDE, 1)),
        ("stack_mask_fits", "mask.fits", Kind::Bytes, images::fits(SIDE)),
        ("stack_mask_csv", "mask.csv", Kind::Text, csv.into_bytes()),
    ];
    let of = |(name, file, kind, bytes): (&'static str, &str, Kind, Vec<u8>)| {
        let (path, set) = (folder.join(file), folder.join(format!("with_{file}.toml")));
        fs::write(&set, text.replace("mask.npy\"\nsample", &format!("{file}\"\nsample"))).unwrap();
        Format::new(name, path, kind, vec![bytes], move |_| StackSet::read(&set).map(drop))
    };
    files.into_iter().map(of).collect()
}
