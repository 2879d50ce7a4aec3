//! Tests of inputs and outputs: inputs as they were read, manifests that say one thing, films that agree.

use std::fs;
use std::path::Path;

use metalith_core::{Error, FaultKind, Silent};
use metalith_handoff::{HandoffOptions, handoff, verify_handoff};

use crate::{DESIGN, PROCESS, copy_of_shared, options, source};

/// The design with words replaced, in a folder.
fn altered(folder: &Path, changes: &[(&str, &str)]) -> HandoffOptions {
    let mut text = fs::read_to_string(DESIGN).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let path = folder.join("design.toml");
    fs::write(&path, text).unwrap();
    HandoffOptions {
        source: source(&path),
        ..options(&folder.join("out"))
    }
}

#[test]
fn a_file_that_is_not_read_is_not_copied() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("secret"), "a key").unwrap();
    let options = altered(folder.path(), &[("\"sin_luke_2015\"", "\"secret\"")]);
    let error = handoff(&options, &Silent).unwrap_err();
    assert!(
        error.has_fault(FaultKind::Inconsistent, "cell.pillar_material"),
        "{error}"
    );
    assert!(!options.out.exists());
    // Nor is one that is read and found to be no table.
    fs::write(folder.path().join("secret.csv"), "a key").unwrap();
    let options = altered(folder.path(), &[("\"sin_luke_2015\"", "\"secret.csv\"")]);
    assert!(handoff(&options, &Silent).is_err());
    assert!(!options.out.exists());
}

#[test]
fn inputs_of_one_name_are_both_kept() {
    let folder = tempfile::tempdir().unwrap();
    let phase = "r_um,phase_rad\n0,0\n10,-3\n20,-11\n30.5,-25\n";
    let widths = "turns,width_nm\n0.125,102\n0.375,160\n0.625,210\n0.875,288\n";
    for (name, text) in [("a", phase), ("b", widths)] {
        fs::create_dir(folder.path().join(name)).unwrap();
        fs::write(folder.path().join(name).join("t.csv"), text).unwrap();
    }
    let design = fs::read_to_string(DESIGN).unwrap();
    let section = |name: &str| {
        let begin = design.find(&format!("[{name}]")).unwrap();
        let end = design[begin + 1..].find("\n[").unwrap() + begin + 1;
        &design[begin..end]
    };
    let options = altered(
        folder.path(),
        &[
            (section("phase"), "[phase]\nsource = \"table\"\nfile = \"a/t.csv\"\n"),
            (
                section("mapping"),
                "[mapping]\nwavelength_nm = 550\ntable = \"b/t.csv\"\n",
            ),
        ],
    );
    let made = handoff(&options, &Silent).unwrap();
    let kept = |name: &str| fs::read_to_string(made.folder.join("inputs").join(name)).unwrap();
    assert_eq!((kept("t.csv"), kept("t_2.csv")), (widths.to_owned(), phase.to_owned()));
    assert!(verify_handoff(&made.folder, &Silent).unwrap().holds());
}

#[test]
fn film_and_process_must_agree() {
    let folder = tempfile::tempdir().unwrap();
    let options = altered(
        folder.path(),
        &[
            ("\"sin_luke_2015\"", "\"alumina_malitson_dodge_1972\""),
            ("[mapping]", "[mapping]\naccept = \"a test of another film\""),
        ],
    );
    let error = handoff(&options, &Silent).unwrap_err();
    assert_eq!(error.id(), "handoff/film-material-differs");
    insta::assert_snapshot!(error, @r#"
    the film of the design is "alumina_malitson_dodge_1972"; `films` in [transfer] of process jbx6300_zep520a in jbx6300_zep520a.toml has sin_luke_2015, sin_philipp_1973 (reactive ion etch of silicon nitride, stopped on fused silica), and no shipped process has it
      help: copy processes/jbx6300_zep520a.toml within its folder, set `films = ["alumina_malitson_dodge_1972"]` and `etch` in [transfer] to what the lab does, and give the copy to --process: its limits count as assumed until the lab confirms them
    "#);
    assert!(!options.out.exists());
}

#[test]
fn a_text_that_would_be_two_lines_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let process = folder.path().join("process.toml");
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../rules");
    let text = fs::read_to_string(PROCESS).unwrap().replace("../rules", root);
    let path = text.lines().find(|l| l.starts_with("path = ")).unwrap().to_owned();
    fs::write(&process, text.replace(&path, "path = \"A\\nEND\"")).unwrap();
    let options = HandoffOptions {
        process: Some(process),
        ..options(&folder.path().join("out"))
    };
    let error = handoff(&options, &Silent).unwrap_err();
    assert_eq!(error.ids(), ["job.path/unprintable"]);
}

/// Changes of a received folder that leave every listed file and the seal as they were.
#[test]
fn what_is_added_to_a_manifest_or_a_folder_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let received = copy_of_shared(folder.path());
    assert!(verify_handoff(&received, &Silent).unwrap().holds());
    fs::create_dir_all(received.join("more/and more")).unwrap();
    let found = verify_handoff(&received, &Silent).unwrap();
    assert_eq!(
        (found.holds(), found.unknown),
        (false, vec!["more/and more/".to_owned()])
    );
    fs::remove_dir_all(received.join("more")).unwrap();

    let manifest = received.join("manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let entry = {
        let begin = text.find("\"index.html\"").unwrap();
        let end = text[begin..].find('}').unwrap() + begin + 1;
        text[begin..end].to_owned()
    };
    for (what, altered) in [
        ("added", text.replacen('{', "{\"remark\": \"fine\",", 1)),
        ("doubled", text.replacen('{', "{\"seal\": \"0\",", 1)),
        ("twice", text.replacen(&entry, &format!("{entry}, {entry}"), 1)),
        ("added", text.replacen("\"bytes\"", "\"remark\": 1, \"bytes\"", 1)),
    ] {
        fs::write(&manifest, altered).unwrap();
        let error = verify_handoff(&received, &Silent).unwrap_err();
        assert!(
            matches!(&error, Error::Table { path, .. } if *path == manifest),
            "{what}: {error:?}"
        );
    }
    fs::write(&manifest, &text).unwrap();
    assert!(verify_handoff(&received, &Silent).unwrap().holds());
}

/// A manifest that has no end, and one that is too long, are not read.
#[cfg(unix)]
#[test]
fn a_manifest_is_an_ordinary_file_of_bounded_length() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = folder.path().join("manifest.json");
    std::os::unix::fs::symlink("/dev/zero", &manifest).unwrap();
    let refused = || verify_handoff(folder.path(), &Silent).unwrap_err().id();
    assert_eq!(refused(), "file/not-regular");
    fs::remove_file(&manifest).unwrap();
    let long = fs::File::create(&manifest).unwrap();
    long.set_len(1 << 40).unwrap();
    assert_eq!(refused(), "file/too-large");
}
