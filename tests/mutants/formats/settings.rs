//! Files that say how something is done.

use std::fs;
use std::path::Path;

use metalith::CalibratedModel;
use metalith::bench_plan::{BenchFile, check_not_begun};
use metalith::calibrate::DeclaredEffect;
use metalith::design::CellFile;
use metalith::drc::{Deck, Waivers};
use metalith::handoff::Process;
use metalith::optics::Perturbation;
use metalith::sensor::{Camera, Spectrum};
use metalith::study::{Slurm, Tolerance};
use metalith::text::hex;
use metalith_testing::design;
use sha2::{Digest, Sha256};

use super::{Format, Kind, copy, example, file, files};

/// Files that say how something is done.
pub(super) fn all(folder: &Path) -> Vec<Format> {
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
    let lit = toml("lit.toml");
    let camera = fs::read_to_string(folder.join("gt1930.toml")).unwrap();
    let light = "source = \"file\"\nfile = \"light.csv\" #";
    fs::write(&lit, camera.replacen("source = \"d65\"", light, 1)).unwrap();
    let session = toml("session");
    fs::create_dir_all(&session).unwrap();
    let filled_in = "title = \"session\"\n";
    fs::write(session.join("measurement.toml"), filled_in).unwrap();
    let digest = hex(&Sha256::digest(filled_in));
    let plan = serde_json::json!({ "written": { "measurement.toml": digest }, "effects": [], "captures": 3 });
    vec![
        Format::new(
            "illuminant",
            toml("light.csv"),
            Kind::Text,
            files("cameras", "csv"),
            move |_| Camera::read(&lit),
        ),
        Format::new(
            "cell",
            toml("cell.toml"),
            Kind::Text,
            files("designs", "toml"),
            CellFile::read,
        ),
        Format::new(
            "plan of a session",
            session.join("plan.json"),
            Kind::Json,
            vec![plan.to_string().into_bytes()],
            move |_| check_not_begun(&session),
        ),
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
