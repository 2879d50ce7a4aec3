//! `metalith optimise`, interrupted and continued.

use std::fs;
use std::path::Path;

use metalith::cell::PublishedCell;
use metalith::layout::read_pillars;
use metalith::optimise::{Checkpoint, OptimiseTask, lens_alone};
use metalith::{Design, Fidelity, Hierarchy, PillarArray, Silent, cell_models, write_pillars};
use metalith_testing::optimised as design;

const EXCHANGE: &str = "[optimise]\ncell = \"published\"\nstep_nm = 5\nchains = 3\nhot_sweeps = 12\nseed = 4\n";

/// From the command to a phase that a design reads, on any number of threads the same, and from there to a
/// layout whose pillars keep the limit and focus as the rings promise.
#[test]
fn the_phase_of_the_command_becomes_a_layout_that_keeps_the_limit() {
    /// Single sums in another order.
    const SAME: f64 = 1e-9;
    let folder = tempfile::tempdir().unwrap();
    let path = design(folder.path(), EXCHANGE);
    let phases = ["1", "2"].map(|threads| {
        let phase = folder.path().join(format!("phase_{threads}.csv"));
        super::metalith()
            .args(["optimise", "--no-report", "--quiet", "--threads", threads])
            .arg(&path)
            .arg("--out")
            .arg(folder.path())
            .arg("--phase")
            .arg(&phase)
            .assert()
            .success();
        phase
    });
    let [one, two] = phases.each_ref().map(|p| {
        let text = fs::read_to_string(p).unwrap();
        text.lines()
            .filter(|l| !l.starts_with('#'))
            .collect::<Vec<_>>()
            .join("\n")
    });
    assert_eq!(one, two);
    assert!(!folder.path().join("checkpoint.bin").exists());

    let text = fs::read_to_string(&path).unwrap();
    let table = format!(
        "source = \"table\"\nfile = \"{}\"\ninterpolation = \"nearest\"",
        phases[0].display()
    );
    let text = text.replace("source = \"hyperbola\"\nwavelength_nm = 550", &table);
    fs::write(&path, text).unwrap();
    let design = Design::read(&path).unwrap();
    let (task, cell) = (OptimiseTask::of(&design).unwrap(), PublishedCell::new(350));
    let rings = task.judge_rings(&task.own_waves, &cell).unwrap();
    let layout = folder.path().join("lens.gds");
    let alone = lens_alone(&design, &phases[0]).unwrap();
    let array = PillarArray::build(&alone, &Silent).unwrap();
    write_pillars(&alone, &array, Hierarchy::Folded, &layout, &Silent).unwrap();
    let read = read_pillars(&alone, &layout, &Silent).unwrap();
    let found = task.judge_layout(&read.elements[0].widths, &cell).unwrap();
    // The limit of the design, and the rounding of phases to the text of their table.
    const STEP_TURNS: f64 = 0.2 + 1e-6;
    assert!(found.largest_step_waves <= STEP_TURNS, "{}", found.largest_step_waves);
    assert!((found.geometric_mean / rings.geometric_mean - 1.0).abs() < SAME);
}

/// By dissimilar neighbours, whose tables come with the program: the layout focuses as the rings promise, pillar by
/// pillar, and better than before.
#[test]
fn a_lens_is_optimised_among_unlike_neighbours() {
    /// Eight radii for all sites of a ring.
    const OF_RINGS: f64 = 1e-6;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("unlike.toml");
    let changes = [
        ("diameter_um = 1000", "diameter_um = 40"),
        ("focal_length_um = 2400", "focal_length_um = 96"),
        ("source = \"table\"", "source = \"hyperbola\"\nwavelength_nm = 550"),
        ("file = \"phases/broadband.csv\"\ninterpolation = \"nearest\"", ""),
        ("cell = \"rigorous\"", "cell = \"neighbours\""),
        ("band_nm = [400, 700]", "band_nm = [460, 650]"),
        ("step_nm = 1\n", "step_nm = 10\n"),
        ("chains = 4", "chains = 1"),
        ("hot_sweeps = 150", "hot_sweeps = 4"),
    ];
    let text = metalith_testing::changed("broadband_3x3", &changes);
    let phase = folder.path().join("phase.csv");
    let optimised = |text: &str| {
        fs::write(&path, text).unwrap();
        let mut program = super::metalith();
        program.args(["optimise", "--no-report", "--quiet"]).arg(&path);
        program.arg("--out").arg(folder.path()).arg("--phase").arg(&phase);
        program.assert()
    };
    let one = text.replacen("wavelengths_nm = [455, 530, 660]", "wavelengths_nm = [530]", 1);
    let said = optimised(&one).code(2).get_output().stderr.clone();
    let said = String::from_utf8_lossy(&said);
    assert!(said.contains(&super::refusal("optimise/too-few-wavelengths")), "{said}");
    optimised(&text).success();
    let design = Design::read(&path).unwrap();
    let alone = lens_alone(&design, &phase).unwrap();
    let cell = cell_models(&design, &[Fidelity::Neighbours]).unwrap().remove(0);
    let (task, before) = (OptimiseTask::of(&alone).unwrap(), OptimiseTask::of(&design).unwrap());
    let rings = task.judge_rings(&task.own_waves, cell.as_ref()).unwrap();
    let array = PillarArray::build(&alone, &Silent).unwrap();
    let found = task
        .judge_layout(&array.widths(array.central()), cell.as_ref())
        .unwrap();
    assert_eq!(found.fidelity, Fidelity::Neighbours);
    assert!((found.geometric_mean / rings.geometric_mean - 1.0).abs() < OF_RINGS);
    let hyperbola = before.judge_rings(&before.own_waves, cell.as_ref()).unwrap();
    assert!(
        found.geometric_mean > 1.05 * hyperbola.geometric_mean,
        "{} {}",
        found.geometric_mean,
        hyperbola.geometric_mean
    );
}

/// Ctrl-C: the best so far is kept, exit code 3, and the same command goes on.
#[cfg(target_os = "linux")]
#[test]
fn the_program_is_interrupted_and_goes_on() {
    use std::process::{Command, Stdio};
    /// Of CPU time, a hundredth of a second each: many sweeps of the small lens.
    const WORKED_TICKS: u64 = 60;
    // Long enough to be stopped twice.
    const LONG: &str = "[optimise]\ncell = \"published\"\nstep_nm = 2\nchains = 1\nhot_sweeps = 100000\nseed = 4\n";
    let folder = tempfile::tempdir().unwrap();
    let path = design(folder.path(), LONG);
    let out = folder.path().join("out");
    let interrupt = || {
        let child = Command::new(env!("CARGO_BIN_EXE_metalith"))
            .arg("optimise")
            .arg(&path)
            .args(["--no-report", "--out"])
            .arg(&out)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Until it catches the signal, which is number 2, and has worked for a while: nothing that can be waited for.
        let proc = Path::new("/proc").join(child.id().to_string());
        let catches = || {
            let text = fs::read_to_string(proc.join("status")).unwrap();
            let mask = text.lines().find_map(|l| l.strip_prefix("SigCgt:")).unwrap();
            u64::from_str_radix(mask.trim(), 16).unwrap() & 2 != 0
        };
        let worked_ticks = || -> u64 {
            let text = fs::read_to_string(proc.join("stat")).unwrap();
            let fields = text[text.rfind(')').unwrap()..].split(' ').skip(12);
            fields.take(2).map(|ticks| ticks.parse::<u64>().unwrap()).sum()
        };
        while !catches() || worked_ticks() < WORKED_TICKS {
            std::thread::yield_now();
        }
        let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
        assert!(sent.unwrap().success());
        let ended = child.wait_with_output().unwrap();
        assert_eq!(ended.status.code(), Some(3));
        let kept = Checkpoint::load(&out.join("checkpoint.bin"), &Design::read(&path).unwrap()).unwrap();
        let rings = fs::read_to_string(out.join("phase.csv")).unwrap();
        let rows = rings
            .lines()
            .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
            .count();
        assert!(rows > 80, "{rows}");
        let said = String::from_utf8(ended.stderr).unwrap();
        (kept.chains[0].sweep, said)
    };
    let (first, said) = interrupt();
    // What was found until then is named.
    assert!(first > 0 && said.contains("phase.csv"), "{said}");
    let (second, said) = interrupt();
    assert!(
        second > first && said.contains("checkpoint.bin"),
        "{first} {second} {said}"
    );
}

/// Rotated rectangles: the phase gains on what it began from, and the layout that is read back has the Strehl ratio that `verify` says.
#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn a_lens_of_rotated_rectangles_is_optimised() {
    /// By the sum over rings, and by folded transforms; the light that is not converted adds 1e-5 at the focus.
    const AS_VERIFIED: f64 = 2e-3;
    /// Of nine orders a wavelength of a band, beside a single wavelength with as many as it needs.
    const OF_A_BAND: f64 = 0.02;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rotated.toml");
    let changes = [
        ("diameter_um = 80", "diameter_um = 30"),
        ("focal_length_um = 80", "focal_length_um = 60"),
        ("wavelength_nm = 532\n\n[array]", "wavelength_nm = 580\n\n[array]"),
        (
            "[verify]",
            "[optimise]\nband_nm = [525, 530]\nstep_nm = 1\nchains = 2\nhot_sweeps = 10\nblocks = 5\n\n[verify]",
        ),
        ("wavelengths_nm = [532]", "wavelengths_nm = [527.25]"),
    ];
    let text = metalith_testing::changed("geometric_phase_532", &changes);
    fs::write(&path, &text).unwrap();
    let run = |args: &[&str]| {
        let out = super::metalith().args(args).arg("--quiet").output().unwrap();
        assert!(out.status.code() < Some(2), "{}", String::from_utf8_lossy(&out.stderr));
    };
    let number = |file: &Path, at: &[&str]| -> f64 {
        let report: serde_json::Value = serde_json::from_slice(&fs::read(file).unwrap()).unwrap();
        report
            .pointer(&format!("/{}", at.join("/")))
            .and_then(|v| v.as_f64())
            .unwrap()
    };
    let out = folder.path().join("out");
    run(&["optimise", path.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let report = out.join("report.json");
    let mean = |of: &str, at: &str| number(&report, &[of, at, "geometric_mean"]);
    assert!(mean("after", "1") > mean("before", "0"));
    let table = format!(
        "source = \"table\"\nfile = \"{}\"\ninterpolation = \"nearest\"",
        out.join("phase.csv").display()
    );
    fs::write(
        &path,
        text.replacen("source = \"hyperbola\"\nwavelength_nm = 580", &table, 1),
    )
    .unwrap();
    let verified = folder.path().join("verified");
    let layout = out.join("lens.gds");
    run(&[
        "verify",
        path.to_str().unwrap(),
        layout.to_str().unwrap(),
        "--out",
        verified.to_str().unwrap(),
    ]);
    let own = number(&report, &["at_single_wavelengths", "0", "1"]);
    let judged = number(
        &verified.join("report.json"),
        &["distinct", "0", "spots", "0", "extracted", "0", "1", "strehl"],
    );
    assert!((own / judged - 1.0).abs() < AS_VERIFIED, "{own} {judged}");
    assert!((mean("after", "1") / own - 1.0).abs() < OF_A_BAND, "{own}");
}

/// A search of one small camera writes its design, which the program reads, beside front and page.
#[test]
fn a_camera_is_searched_and_its_design_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let design = fs::read_to_string("designs/imaging_3x3.toml").unwrap();
    let table = Path::new("designs/phases/imaging.csv").canonicalize().unwrap();
    let phase = format!("\"{}\"", table.display());
    let (head, _) = design.split_once("\n[optimise]").unwrap();
    let section = "\n[optimise]\ncell = \"published\"\n\n[optimise.camera]\nfield_deg = 80\nmost_track_um = 2400\ncolumns = [2]\n\
                   rows = [1]\ndiameters_um = [60]\nstarts = 1\nsteps = 1\nfinal_steps = 1\n";
    let path = folder.path().join("small.toml");
    fs::write(
        &path,
        format!("{}{section}", head.replace("\"phases/imaging.csv\"", &phase)),
    )
    .unwrap();
    let out = folder.path().join("out");
    let search = |design: &Path| {
        let mut command = super::metalith();
        command.arg("optimise").arg(design).arg("--out").arg(&out);
        command.arg("--camera").arg("cameras/gt1930.toml");
        command
    };
    search(&path).assert().success();
    let front = fs::read_to_string(out.join("front.csv")).unwrap();
    assert_eq!(front.lines().count(), 2);
    assert!(out.join("report.html").is_file() && out.join("report.json").is_file());
    let found = Design::read(&out.join("camera_500.toml")).unwrap();
    assert_eq!(found.array.elements().len(), 2);
    assert_eq!(found.lens.diameter_nm, 60_000);
    // Diameters that fit no arrangement are refused before the search, each by its line, and the largest possible one is said.
    let large = fs::read_to_string(&path).unwrap();
    fs::write(
        &path,
        large.replace("diameters_um = [60]", "diameters_um = [60, 5000, 4990]\ntime_ms = 10"),
    )
    .unwrap();
    let ids = |text: &str| {
        let known = [
            "optimise.camera.diameters_um.1/inconsistent",
            "optimise.camera.diameters_um.2/inconsistent",
        ];
        known.iter().filter(|id| text.contains(*id)).count()
    };
    let said = || String::from_utf8(search(&path).output().unwrap().stderr).unwrap();
    let renamed = said();
    assert!(renamed.contains("optimise.camera.time_ms/renamed"), "{renamed}");
    let text = fs::read_to_string(&path).unwrap().replace("time_ms", "longest_ms");
    fs::write(&path, text.replace("columns = [2]", "columns = [3]")).unwrap();
    let refused = said();
    assert_eq!(ids(&refused), 2, "{refused}");
    // A third of 1936 pixels of 5.86 um: whole lattices of 11.72 um and a third of one.
    assert!(refused.contains("3777 um"), "{refused}");
    // A design without the section sets no task.
    let text = String::from_utf8(search(Path::new("designs/imaging_3x3.toml")).output().unwrap().stderr).unwrap();
    assert!(text.contains(&crate::refusal("optimise/no-camera-section")), "{text}");
}
