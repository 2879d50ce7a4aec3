//! Every format of an input file but layouts: good files, and the reader that a user reaches them by.

use std::fs;
use std::path::{Path, PathBuf};

use metalith::bench_plan::BenchFile;
use metalith::calibrate::{DeclaredEffect, MeasuredSet};
use metalith::cell::{MappingTable, Material, PillarLibrary, UnitCellTable};
use metalith::drc::{Deck, Waivers};
use metalith::gds::extract::PillarsAt;
use metalith::handoff::{Manifest, ManifestEntry, Process, verify_handoff};
use metalith::imaging::scene::{SceneFile, read_depth, read_picture, read_scene};
use metalith::optics::Perturbation;
use metalith::optimise::Checkpoint;
use metalith::phase::{Interpolation, RadialPhase};
use metalith::prior::NetworkDenoiser;
use metalith::sensor::{Camera, Spectrum};
use metalith::study::{Slurm, Tolerance};
use metalith::{CalibratedModel, Design, Layout, Silent};
use metalith_testing::session::{PIXELS, small_set};
use metalith_testing::{design, root};

use super::images;

/// Part of a file that may be damaged.
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    Bytes,
    /// Lines and values too.
    Text,
    /// Ends with the SHA-256 of what comes before.
    Sealed,
}

/// One format.
pub(crate) struct Format {
    pub name: &'static str,
    /// Path at which a file of it is read.
    pub file: PathBuf,
    pub kind: Kind,
    /// Files that are read.
    pub corpus: Vec<Vec<u8>>,
    /// Reads the file; why it was refused.
    pub read: Box<dyn Fn() -> Result<(), String>>,
}

impl Format {
    fn new<T, E: std::fmt::Display>(
        name: &'static str,
        file: PathBuf,
        kind: Kind,
        corpus: Vec<Vec<u8>>,
        read: impl Fn(&Path) -> Result<T, E> + 'static,
    ) -> Self {
        let path = file.clone();
        Self {
            name,
            file,
            kind,
            corpus,
            read: Box::new(move || read(&path).map(drop).map_err(|e| e.to_string())),
        }
    }
}

/// All formats; their files are put below `folder`.
pub(crate) fn all(folder: &Path) -> Vec<Format> {
    let own = |name: &str| {
        let own = folder.join(name);
        fs::create_dir_all(&own).unwrap();
        own
    };
    let mut all = designs(&own("designs"));
    all.extend(settings(&own("settings")));
    all.extend(pictures(&own("pictures")));
    all.extend(measured(&own("measured")));
    all.extend(kept(&own("kept")));
    all
}

fn file(name: &str) -> Vec<u8> {
    fs::read(root().join(name)).unwrap()
}

/// The files of a folder of the project that end so.
fn files(folder: &str, ending: &str) -> Vec<Vec<u8>> {
    let mut paths: Vec<_> = fs::read_dir(root().join(folder))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == ending))
        .collect();
    paths.sort();
    paths.iter().map(|p| fs::read(p).unwrap()).collect()
}

fn copy(from: &str, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(root().join(from)).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
        }
    }
}

/// The example of a document that holds these words.
fn example(document: &str, words: &str) -> Vec<u8> {
    let text = fs::read_to_string(root().join(document)).unwrap();
    let blocks = text.split("```toml\n").skip(1).map(|b| b.split("```").next().unwrap());
    let found = blocks.into_iter().find(|b| b.contains(words));
    found
        .unwrap_or_else(|| panic!("{document} has no example with {words}"))
        .into()
}

/// Design files and what they name.
fn designs(folder: &Path) -> Vec<Format> {
    for part in ["", "/phases", "/mappings"] {
        copy(&format!("designs{part}"), &folder.join(format!(".{part}")));
    }
    let lens = folder.join("lens_of_a_file.toml");
    let mini = fs::read_to_string(design("mini_3x3")).unwrap();
    let term = "\n[[phase.term]]\nsource = \"optic_studio\"\nfile = \"lens.zmx\"\nsurface = 1\n";
    fs::write(&lens, mini + term).unwrap();
    let zmx = "VERS 190513\nUNIT MM X W X CM MR CPMM\nSURF 0\n  TYPE STANDARD\nSURF 1\n  TYPE BINARY_2\n  PARM 0 1\n  PARM 1 0\n  \
               XDAT 1 2.0 0 0 1.0 0.0 0 \"\"\n  XDAT 2 0.5 0 0 1.0 0.0 0 \"\"\n  XDAT 3 -600.0 0 0\n  XDAT 4 25.0 0 0\n";
    let map_design = folder.join("hologram.toml");
    let tio2 = Design::read(&design("tio2_532")).unwrap();
    let allowed: Vec<u16> = tio2.cell.widths_nm().collect();
    let upright = Design::read(&design("birefringent_532"))
        .unwrap()
        .cell
        .shape
        .upright()
        .unwrap();
    vec![
        Format::new(
            "design",
            folder.join("mutant.toml"),
            Kind::Text,
            files("designs", "toml"),
            Design::read,
        ),
        Format::new(
            "zmx",
            folder.join("lens.zmx"),
            Kind::Text,
            vec![zmx.into()],
            move |_| Design::read(&lens),
        ),
        Format::new(
            "phase_map",
            folder.join("phases/four_spots.npy"),
            Kind::Bytes,
            vec![file("designs/phases/four_spots.npy")],
            move |_| Design::read(&map_design),
        ),
        Format::new(
            "phase_table",
            folder.join("mutant.csv"),
            Kind::Text,
            ["broadband", "imaging", "neighbours", "robust"]
                .map(|name| file(&format!("designs/phases/{name}.csv")))
                .into(),
            |path| RadialPhase::read_table(path, Interpolation::Nearest, 1.0),
        ),
        Format::new(
            "library",
            folder.join("library.csv"),
            Kind::Text,
            vec![file("designs/phases/birefringent_532.csv")],
            move |path| PillarLibrary::read_csv(path, upright),
        ),
        Format::new(
            "mapping",
            folder.join("mapping.csv"),
            Kind::Text,
            files("designs/mappings", "csv"),
            move |path| MappingTable::read_csv(path, &allowed),
        ),
        Format::new(
            "unit cells",
            folder.join("cells.h5"),
            Kind::Bytes,
            ["tidy3d.hdf5", "latest.hdf5", "chunks.h5", "parts.nc"]
                .map(|name| file(&format!("golden/unit_cells/{name}")))
                .to_vec(),
            unit_cells,
        ),
        Format::new(
            "unit cells as text",
            folder.join("cells.txt"),
            Kind::Text,
            cells_as_text(),
            unit_cells,
        ),
        Format::new(
            "material",
            folder.join("material.csv"),
            Kind::Text,
            vec![file("golden/measured/film_nk.csv")],
            Material::read_csv,
        ),
    ]
}

/// Unit cells of pillars from 100 to 160 nm whose phase rises by half a wave, in the columns of two programs.
fn cells_as_text() -> Vec<Vec<u8>> {
    let mut texts = ["radius (m), abs(S21), angle(S21)\n", "width,f,t\n"].map(str::to_owned);
    for k in 0..=15 {
        let (nm, phase_rad) = (100.0 + 4.0 * f64::from(k), 0.2 * f64::from(k));
        let [re, im] = [0.9 * phase_rad.cos(), 0.9 * phase_rad.sin()];
        texts[0].push_str(&format!("{:e},0.9,{phase_rad}\n", 0.5e-9 * nm));
        texts[1].push_str(&format!("{},{:e},({re}{im:+}j)\n", 1e-3 * nm, 299_792_458.0 / 0.62e-6));
    }
    texts.map(String::into_bytes).into()
}

/// Reads unit cells as a design does.
fn unit_cells(path: &Path) -> metalith::Result<()> {
    match UnitCellTable::read(path)? {
        Some(table) => table.curve(600.0, 0.62, &[101, 121, 159], None).map(|_| ()),
        None => Ok(()),
    }
}

/// Files that say how something is done.
fn settings(folder: &Path) -> Vec<Format> {
    copy("cameras", folder);
    // A process names rules, a tolerance a design.
    copy("rules", &folder.join("rules"));
    fs::copy(design("mini_3x3"), folder.join("DESIGN")).unwrap();
    let toml = |name: &str| folder.join(name);
    let processes = folder.join("processes");
    fs::create_dir_all(&processes).unwrap();
    let model = toml("model.toml");
    let mut perturbation = Perturbation::default();
    perturbation.geometry.cd_bias_nm = -9.75;
    CalibratedModel::new("chip".into(), "explained by cd_bias".into(), perturbation)
        .write(&model)
        .unwrap();
    let model_text = fs::read(&model).unwrap();
    vec![
        Format::new(
            "camera",
            toml("camera.toml"),
            Kind::Text,
            files("cameras", "toml"),
            Camera::read,
        ),
        Format::new(
            "spectrum",
            toml("spectrum.csv"),
            Kind::Text,
            files("cameras", "csv"),
            |path| Spectrum::read_csv(path, 1.0),
        ),
        Format::new(
            "rules",
            toml("rules.toml"),
            Kind::Text,
            files("rules", "toml"),
            Deck::read,
        ),
        Format::new(
            "waivers",
            toml("waivers.toml"),
            Kind::Text,
            vec![b"[[waiver]]\nrule = \"pillar.width.min\"\nhash = \"f2a1c3d400112233\"\nreason = \"test pad\"\nauthor = \"N. N.\"\nexpires = \"2027-01-31\"\n".to_vec()],
            Waivers::read,
        ),
        Format::new(
            "process",
            processes.join("process.toml"),
            Kind::Text,
            files("processes", "toml"),
            Process::read,
        ),
        Format::new(
            "tolerance",
            toml("tolerance.toml"),
            Kind::Text,
            vec![file("scripts/study/tolerance.toml")],
            Tolerance::read,
        ),
        Format::new(
            "slurm",
            toml("slurm.toml"),
            Kind::Text,
            vec![example("docs/guide/study.md", "max_array_size")],
            Slurm::read,
        ),
        Format::new(
            "bench",
            toml("bench.toml"),
            Kind::Text,
            vec![example("docs/guide/plan.md", "divergence_mrad")],
            BenchFile::read,
        ),
        Format::new(
            "effects",
            toml("effects.toml"),
            Kind::Text,
            ["bow", "ghost"]
                .map(|name| example("docs/guide/calibrate.md", &format!("name = \"{name}\"")))
                .into(),
            DeclaredEffect::read,
        ),
        Format::new("model", model, Kind::Text, vec![model_text], |path| {
            CalibratedModel::read(path)
        }),
    ]
}

/// Scenes and how far they are.
fn pictures(folder: &Path) -> Vec<Format> {
    let cube = images::npy(&[16, 20, 4], images::FLOAT);
    vec![
        Format::new(
            "picture",
            folder.join("scene"),
            Kind::Bytes,
            vec![
                images::png(24, 16, png::ColorType::Rgb, png::BitDepth::Eight),
                images::png(24, 16, png::ColorType::Rgb, png::BitDepth::Sixteen),
                images::png(24, 16, png::ColorType::Grayscale, png::BitDepth::Eight),
                file("tests/mutants/small.jpg"),
                images::coloured_png(),
                images::tiff(20, 1),
                images::exr(),
                images::npy(&[16, 20, 3], images::FLOAT),
                images::npy(&[16, 20], images::FLOAT),
            ],
            read_picture,
        ),
        Format::new(
            "drawing",
            folder.join("drawing.dxf"),
            Kind::Text,
            vec![images::DRAWING.into()],
            Layout::open,
        ),
        Format::new("cube", folder.join("cube.npy"), Kind::Bytes, vec![cube], |path| {
            read_scene(&SceneFile {
                path: path.to_owned(),
                wavelengths_nm: Some(vec![450.0, 500.0, 550.0, 600.0]),
                field_deg: 30.0,
                distance_um: 1e6,
            })
        }),
        Format::new(
            "depth",
            folder.join("depth"),
            Kind::Bytes,
            vec![
                images::png(24, 16, png::ColorType::Grayscale, png::BitDepth::Sixteen),
                images::npy(&[16, 20], images::WORD),
            ],
            read_depth,
        ),
    ]
}

/// A measured set: its text and its captures.
fn measured(folder: &Path) -> Vec<Format> {
    let set = small_set(folder);
    let text = fs::read_to_string(&set).unwrap();
    // One capture in each of the formats that frames come in; the rest of the set stays as it is.
    let first = text
        .split("file = \"")
        .nth(1)
        .and_then(|t| t.split('"').next())
        .unwrap()
        .to_owned();
    let with = |ending: &str| {
        let own = folder.join(format!("with_{ending}.toml"));
        fs::write(&own, text.replacen(&first, &format!("frame.{ending}"), 1)).unwrap();
        own
    };
    let reads = |set: PathBuf| move |_: &Path| MeasuredSet::read(&set, &PillarsAt::STATED, &Silent);
    let size = PIXELS as u32;
    vec![
        Format::new(
            "measured_set",
            folder.join("mutant.toml"),
            Kind::Text,
            vec![text.clone().into()],
            |path| MeasuredSet::read(path, &PillarsAt::STATED, &Silent),
        ),
        Format::new(
            "capture_npy",
            folder.join("frame.npy"),
            Kind::Bytes,
            vec![
                images::npy(&[PIXELS, PIXELS], images::FLOAT),
                images::npy(&[3, PIXELS, PIXELS], images::WORD),
            ],
            reads(with("npy")),
        ),
        Format::new(
            "capture_png",
            folder.join("frame.png"),
            Kind::Bytes,
            [png::BitDepth::Eight, png::BitDepth::Sixteen]
                .map(|depth| images::png(size, size, png::ColorType::Grayscale, depth))
                .into(),
            reads(with("png")),
        ),
        Format::new(
            "capture_tiff",
            folder.join("frame.tiff"),
            Kind::Bytes,
            vec![images::tiff(PIXELS, 1), images::tiff(PIXELS, 3)],
            reads(with("tiff")),
        ),
        Format::new(
            "capture_fits",
            folder.join("frame.fits"),
            Kind::Bytes,
            vec![images::fits(PIXELS)],
            reads(with("fits")),
        ),
    ]
}

/// Files that the program itself wrote: manifests, checkpoints, weights.
fn kept(folder: &Path) -> Vec<Format> {
    let handed = folder.join("handoff");
    fs::create_dir_all(&handed).unwrap();
    fs::write(handed.join("README.txt"), "a chip\n").unwrap();
    let digest = "0".repeat(64);
    let entry = ManifestEntry {
        bytes: 7,
        sha256: digest.clone(),
    };
    let manifest = Manifest {
        metalith: "0.1.0".into(),
        command: "metalith handoff".into(),
        design: "chip".into(),
        design_digest: digest.clone(),
        process: "writer".into(),
        files: [("README.txt".to_owned(), entry)].into(),
        seal: digest,
    };
    let mini = Design::read(&design("mini_3x3")).unwrap();
    let checkpoint = folder.join("checkpoint.bin");
    Checkpoint::begin(&mini).save(&checkpoint).unwrap();
    let saved = fs::read(&checkpoint).unwrap();
    vec![
        Format::new(
            "manifest",
            handed.join("manifest.json"),
            Kind::Text,
            vec![serde_json::to_vec_pretty(&manifest).unwrap()],
            move |_| verify_handoff(&handed, &Silent),
        ),
        Format::new("checkpoint", checkpoint, Kind::Sealed, vec![saved], move |path| {
            Checkpoint::load(path, &mini)
        }),
        Format::new(
            "weights",
            folder.join("denoiser.safetensors"),
            Kind::Bytes,
            vec![file("crates/prior/weights/denoiser.safetensors")],
            NetworkDenoiser::read,
        ),
    ]
}
