//! `metalith study`: shards by processes, and what is said of them.

use std::path::Path;

use assert_cmd::Command;

use super::refusal;

fn metalith(arguments: &[&str]) -> Command {
    let mut command = super::metalith();
    command.args(arguments);
    command
}

/// The tolerance of `.ci/run`, for a single small lens.
fn tolerance(folder: &Path) {
    let design = std::fs::read_to_string("designs/mini_3x3.toml").unwrap();
    let design = design
        .replace("diameter_um = 60", "diameter_um = 20")
        .replace("elements = [3, 3]", "elements = [1, 1]")
        .replace("wavelengths_nm = [455, 530, 660]", "wavelengths_nm = [530]");
    std::fs::write(folder.join("design.toml"), design).unwrap();
    let text = std::fs::read_to_string("scripts/study/tolerance.toml").unwrap();
    std::fs::write(folder.join("tolerance.toml"), text.replace("DESIGN", "design.toml")).unwrap();
}

/// A process that makes a shard for another one ends when that one does, and leaves the shard to the next.
fn ends_with_its_parent(study: &str) {
    let mut child = std::process::Command::new(super::metalith().get_program())
        .args(["study", "run", study, "--shard", "0", "--with-parent", "--threads", "1"])
        .stdin(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdin.take());
    assert_eq!(child.wait().unwrap().code(), Some(130));
}

/// A second submission leaves out what is queued, whatever the queue says otherwise; names of folders are no shell.
#[cfg(unix)]
#[test]
fn a_second_submission_leaves_out_what_is_queued() {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    tolerance(folder.path());
    let at = |name: &str| folder.path().join(name);
    let text = |name: &str| fs::read_to_string(at(name)).unwrap_or_default();
    let program = |name: &str, line: &str| {
        fs::write(at(name), format!("#!/bin/sh\ncd \"$(dirname \"$0\")\"\n{line}\n")).unwrap();
        fs::set_permissions(at(name), fs::Permissions::from_mode(0o755)).unwrap();
    };
    program("sbatch", "echo \"$@\" >>said; grep -c -- --parsable said");
    fs::write(at("slurm.toml"), "max_array_size = 2\nthrottle = 1\n").unwrap();
    let study = at("it's\na study; touch forged");
    let submit = |more: &[&str]| {
        let path = format!("{}:/usr/bin:/bin", folder.path().display());
        let mut command = metalith(&["study", "submit", "--slurm"]);
        command
            .arg(at("slurm.toml"))
            .arg(&study)
            .arg("--plan")
            .arg(at("tolerance.toml"));
        command.args(["--draws-per-shard", "2"]).args(more).env("PATH", path);
        let done = command.assert().code(0).get_output().clone();
        [done.stdout, done.stderr].map(|said| String::from_utf8(said).unwrap())
    };
    assert_eq!(
        submit(&["--merge"])[0],
        "plan: job 1\n2 shards: job 2\n1 shards: job 3\nmerge: job 4\n"
    );
    let said = text("said");
    let asked: Vec<&str> = said.matches("--dependency=afterok:").collect();
    assert_eq!(asked.len(), 3);
    assert!(said.contains("afterok:1 ") && said.contains("afterok:2:3 "), "{said}");
    // Without squeue the record counts.
    let [answer, notes] = submit(&[]);
    assert_eq!(answer, "");
    assert!(notes.contains("3 missing shards were submitted as job "), "{notes}");
    // One task of the first array is queued, and the plan.
    let name = |job: usize| {
        let record = fs::read_to_string(study.join("slurm/submitted.jsonl")).unwrap();
        let line: serde_json::Value = serde_json::from_str(record.lines().nth(job - 1).unwrap()).unwrap();
        line["name"].as_str().unwrap().to_owned()
    };
    let queue = format!("{} 1 N/A\n{} 2 1\nother 9 0\n", name(1), name(2));
    fs::write(at("queue"), queue).unwrap();
    program("squeue", "cat queue");
    let list = study.join(format!("slurm/{}.txt", name(2)));
    assert_eq!(fs::read_to_string(&list).unwrap(), "0\n1\n");
    let [answer, notes] = submit(&["--throttle", "7"]);
    assert_eq!(answer, "2 shards: job 5\n");
    assert!(notes.contains("1 missing shards are queued already"), "{notes}");
    assert_eq!(fs::read_to_string(&list).unwrap(), "0\n1\n", "the queued task reads it");
    let script = fs::read_to_string(study.join(format!("slurm/{}.sh", name(5)))).unwrap();
    assert!(script.contains("#SBATCH --array=0-1%7\n"), "{script}");
    // The script is started by bash as it is: the name of the folder is one word of the command.
    fs::write(at("slurm.toml"), "program = \"printf '<%s>'\"\n").unwrap();
    let [lines, _] = submit(&["--dry-run", "--preamble", "set -f", "--merge"]);
    assert!(lines.contains("plan=$(") || lines.starts_with("array_0=$("), "{lines}");
    let latest = fs::read_dir(study.join("slurm")).unwrap().map(|e| e.unwrap().path());
    let scripts = latest.filter(|p| p.extension().is_some_and(|e| e == "sh"));
    for script in scripts {
        let mut bash = std::process::Command::new("bash");
        bash.arg(&script)
            .env("SLURM_ARRAY_TASK_ID", "0")
            .env("PATH", "/usr/bin:/bin");
        let said = bash.current_dir(folder.path()).output().unwrap().stdout;
        let said = String::from_utf8(said).unwrap();
        assert!(
            said.is_empty() || said.contains(&format!("<{}>", study.display())),
            "{said}"
        );
    }
    assert!(!at("forged").exists());
}

#[test]
#[ignore = "second tier: CPU time, in scripts/slow_tests.sh"]
fn shards_by_processes_are_those_of_one_process() {
    let folder = tempfile::tempdir().unwrap();
    tolerance(folder.path());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, by_two, alone) = (path("tolerance.toml"), path("by_two"), path("alone"));
    metalith(&["study", "plan", &file, "--out", &by_two, "--draws-per-shard", "2"])
        .assert()
        .code(0);
    metalith(&["study", "plan", &file, "--out", &alone]).assert().code(0);
    metalith(&["study", "merge", &by_two])
        .assert()
        .code(2)
        .stderr(predicates::str::contains(format!(
            "{}6 of 6 ",
            refusal("study/draws-missing")
        )));
    ends_with_its_parent(&by_two);
    // Two runs at once share the shards.
    let other = std::thread::spawn({
        let by_two = by_two.clone();
        move || metalith(&["study", "run", &by_two, "--missing"]).assert().code(0)
    });
    metalith(&["study", "run", &by_two, "--missing", "--jobs", "2"])
        .assert()
        .code(0);
    other.join().unwrap();
    let shard = format!("{by_two}/shards/000000.jsonl");
    metalith(&["study", "merge", &by_two, "--out", &shard])
        .assert()
        .code(2)
        .stderr(predicates::str::contains(refusal("option/same-file")));
    metalith(&["study", "run", &by_two, "--shard", "1"]).assert().code(0);
    metalith(&["study", "run", &by_two, "--shard", "3"])
        .assert()
        .code(2)
        .stderr(predicates::str::contains(refusal("study/unknown-shard")));
    metalith(&["study", "run", &alone, "--missing", "--threads", "1"])
        .assert()
        .code(0);
    let said = metalith(&["study", "status", &by_two, "--json"])
        .output()
        .unwrap()
        .stdout;
    let said: serde_json::Value = serde_json::from_slice(&said).unwrap();
    assert_eq!(
        (said["finished"].as_u64(), said["missing"].as_array().unwrap().len()),
        (Some(3), 0)
    );
    let draws = |study: &str| {
        let out = path(&format!(
            "{}.jsonl",
            Path::new(study).file_name().unwrap().to_str().unwrap()
        ));
        metalith(&["study", "merge", study, "--out", &out, "--psfs", "0"])
            .assert()
            .code(0);
        std::fs::read_to_string(out).unwrap()
    };
    assert_eq!(draws(&by_two), draws(&alone));
    let slurm = path("slurm.toml");
    std::fs::write(&slurm, "max_array_size = 2\n").unwrap();
    metalith(&["study", "submit", &by_two, "--slurm", &slurm, "--dry-run"])
        .assert()
        .code(0)
        .stdout(predicates::str::contains("nothing is missing"));
}
