//! Names that a stranger chose, in everything that leaves the program: terminal, JSON, HTML, CSV, SVG, XML, SARIF, TOML, job drafts
//! and scripts.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use metalith::drc::Deck;
use metalith_testing::lens::Chip;
use metalith_testing::{design, root};

/// Name with a formula, markup, commands of a shell and of a terminal, and a line break, after a first character.
fn hostile(first: char) -> String {
    format!("{first}1+1|x\"'>`touch forged`$(touch forged)<script>forged()</script>&\u{1b}[31m\u{202e}\nFORGED")
        .replace('/', ":")
}

/// Firsts of formulas in spreadsheets, and of options on command lines.
const FIRSTS: [char; 4] = ['=', '+', '-', '@'];

/// The part of a hostile name that a text file of ours takes: one line of printable characters.
fn one_line(name: &str) -> String {
    name.chars().filter(|&c| metalith::text::is_printable(c)).collect()
}

/// What is wrong with a text in the format of this file name's ending.
fn wrong(name: &str, text: &str) -> Option<String> {
    let ending = name.rsplit('.').next().unwrap_or_default();
    if let Some(c) = text
        .chars()
        .find(|&c| !metalith::text::is_printable(c) && !"\n\r\t".contains(c))
    {
        return Some(format!("{c:?} is left"));
    }
    if text.lines().any(|line| line.trim_start().starts_with("FORGED")) {
        return Some("a name begins a line".into());
    }
    match ending {
        "html" | "svg" | "xml" | "lyrdb" | "lyp" => markup(text)
            .err()
            .or_else(|| text.contains("<script>forged").then(|| "a name is markup".into())),
        "json" | "sarif" => serde_json::from_str::<serde_json::Value>(text)
            .err()
            .map(|e| e.to_string()),
        "csv" => formula(text),
        "jdf" | "sdf" => job(text),
        _ => None,
    }
}

/// Refuse an `&` that begins no entity, and quotes that do not end a value of an attribute.
fn markup(text: &str) -> Result<(), String> {
    for (at, _) in text.match_indices('&') {
        let rest = &text[at + 1..];
        let entity = rest.split(';').next().unwrap_or_default();
        if entity.is_empty() || entity.len() > 8 || !entity.chars().all(|c| c.is_ascii_alphanumeric() || c == '#') {
            return Err(format!(
                "a name is no text at {}",
                rest.chars().take(40).collect::<String>()
            ));
        }
    }
    Ok(())
}

/// The first field of a table that a spreadsheet would compute.
fn formula(text: &str) -> Option<String> {
    let mut field = String::new();
    let mut is_quoted = false;
    for c in text.chars().chain(['\n']) {
        match c {
            '"' => is_quoted = !is_quoted,
            ',' | '\n' if !is_quoted => {
                if field.trim_start().starts_with(FIRSTS) && field.trim().parse::<f64>().is_err() {
                    return Some(format!("a name is a formula: {field}"));
                }
                field.clear();
            }
            c => field.push(c),
        }
    }
    None
}

/// A line of a job draft in which a name is more than a comment or a word in quotes.
fn job(text: &str) -> Option<String> {
    let is_more = |line: &&str| {
        let code = line.split(';').next().unwrap_or_default();
        let outside: String = code.split('\'').step_by(2).collect();
        code.matches('\'').count() % 2 == 1 || outside.contains("forged")
    };
    text.lines().find(is_more).map(|line| format!("a name is code: {line}"))
}

/// Run the program; what is wrong with what it said.
fn said(folder: &Path, arguments: &[&str], ending: &str) -> Vec<String> {
    let run = super::metalith().args(arguments).current_dir(folder).output().unwrap();
    let mut all = Vec::new();
    for (to, bytes, ending) in [("output", run.stdout, ending), ("error", run.stderr, "txt")] {
        let text = String::from_utf8(bytes).unwrap_or_else(|e| panic!("{arguments:?}: {e}"));
        if let Some(what) = wrong(&format!("x.{ending}"), &text) {
            all.push(format!("{arguments:?}, {to}: {what}"));
        }
    }
    if !matches!(run.status.code(), Some(0 | 1 | 3)) {
        all.push(format!("{arguments:?} ended with {:?}", run.status.code()));
    }
    all
}

/// What is wrong with the files below a folder, whose names must be harmless too.
fn written(folder: &Path) -> Vec<String> {
    /// Formats of bytes, and inputs that are kept as they came.
    const BINARY: [&str; 7] = ["gds", "oas", "png", "zip", "npy", "parquet", "dxf"];
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            if name != "inputs" {
                all.extend(written(&path));
            }
            continue;
        }
        if BINARY.iter().any(|ending| name.ends_with(ending)) {
            continue;
        }
        if let Some(what) = wrong(&name, &String::from_utf8(fs::read(&path).unwrap()).unwrap()) {
            all.push(format!("{name}: {what}"));
        }
    }
    all
}

/// A chip whose cells, labels, file and folder have a hostile name, and what its rules are.
fn chip(folder: &Path, name: &str) -> [PathBuf; 2] {
    let mut chip = Chip::clean();
    chip.top = Box::leak(name.to_owned().into_boxed_str());
    chip.extra.text(1, name, 0, 0);
    // Two pillars that overlap.
    chip.at(5, 5).4 = 420;
    let own = folder.join(name);
    fs::create_dir_all(&own).unwrap();
    let path = own.join(format!("{name}.gds"));
    fs::write(&path, chip.bytes()).unwrap();
    let rules = fs::read_to_string(root().join("rules/sin_pillars.toml")).unwrap();
    let line = serde_json::to_string(&one_line(name)).unwrap();
    let deck = own.join(format!("{name}.toml"));
    fs::write(&deck, rules.replacen("name = \"", &format!("name = {line} #"), 1)).unwrap();
    [path, deck]
}

#[test]
fn no_name_of_a_layout_is_anything_but_text() {
    let folder = tempfile::tempdir().unwrap();
    let mut found = Vec::new();
    for first in ['=', '-'] {
        let [layout, deck] = chip(folder.path(), &hostile(first));
        let [layout, deck] = [&layout, &deck].map(|path| path.to_str().unwrap());
        let out = folder.path().join(format!("out_{}", u32::from(first)));
        fs::create_dir_all(&out).unwrap();
        let file = |name: &str| out.join(name).to_str().unwrap().to_owned();
        let check = ["check", layout, "--rules", deck];
        let [lyrdb, junit, sarif, page, set] = ["a.lyrdb", "a.xml", "a.sarif", "a.html", "a.toml"].map(file);
        let with = |more: &[&'static str]| [&check[..], more].concat();
        found.extend(said(folder.path(), &with(&["--json"]), "json"));
        let files = ["--lyrdb", &lyrdb, "--junit", &junit, "--sarif", &sarif];
        found.extend(said(folder.path(), &[&check[..], &files].concat(), "txt"));
        found.extend(said(folder.path(), &["info", layout], "txt"));
        found.extend(said(folder.path(), &["info", layout, "--json"], "json"));
        found.extend(said(folder.path(), &["diff", layout, layout, "--report", &page], "txt"));
        found.extend(said(folder.path(), &["diff", layout, layout, "--json"], "json"));
        found.extend(said(folder.path(), &["check", layout, "--new-rules", &set], "txt"));
        found.extend(written(&out));
        found.extend(Deck::read(Path::new(&set)).err().map(|e| e.to_string()));
    }
    assert!(!folder.path().join("forged").exists());
    assert!(found.is_empty(), "{found:#?}");
}

/// A process file whose texts are hostile, beside the rules that it names.
fn process(folder: &Path, name: &str) -> PathBuf {
    let text = fs::read_to_string(root().join("processes/jbx6300_zep520a.toml")).unwrap();
    let rules = root().join("rules").display().to_string();
    let line = serde_json::to_string(&one_line(name)).unwrap();
    let text = text.replace("../rules", &rules);
    let texts = text.lines().map(|of_file| match of_file.split_once(" = ") {
        Some((key @ ("title" | "developer" | "source"), _)) => format!("{key} = {line}"),
        _ => of_file.to_owned(),
    });
    let path = folder.join(format!("{name}.toml"));
    fs::write(&path, texts.collect::<Vec<_>>().join("\n")).unwrap();
    path
}

#[test]
fn no_name_in_a_hand_off_is_anything_but_text() {
    let folder = tempfile::tempdir().unwrap();
    let mut found = Vec::new();
    let name = hostile('=');
    let [layout, _] = chip(folder.path(), &name);
    let process = process(folder.path(), &name);
    let title = serde_json::to_string(&one_line(&name)).unwrap();
    let text = fs::read_to_string(design("mini_3x3")).unwrap();
    let own = folder.path().join(format!("{name}_design.toml"));
    fs::write(&own, text.replacen("title = \"", &format!("title = {title} #"), 1)).unwrap();
    let [layout, process, own] = [&layout, &process, &own].map(|path| path.to_str().unwrap());
    for (k, source) in [layout, own].into_iter().enumerate() {
        let out = folder.path().join(format!("{k}{name}"));
        let to = out.to_str().unwrap();
        let mut arguments = vec!["handoff", source, "--process", process, "--out", to];
        if source == own {
            arguments.extend(["--fast", "--fidelity", "published"]);
        }
        found.extend(said(folder.path(), &arguments, "txt"));
        found.extend(written(&out));
        found.extend(said(folder.path(), &["handoff", "--verify", to], "txt"));
    }
    assert!(!folder.path().join("forged").exists());
    assert!(found.is_empty(), "{found:#?}");
}

/// Scripts of jobs read each name as one word, which the program gets back.
#[test]
fn no_name_in_a_job_script_is_shell() {
    for first in FIRSTS {
        let folder = tempfile::tempdir().unwrap();
        let name = hostile(first);
        let own = folder.path().join(&name);
        fs::create_dir_all(&own).unwrap();
        let text = fs::read_to_string(root().join("scripts/study/tolerance.toml")).unwrap();
        let [tolerance, slurm, study] = ["tolerance.toml", "slurm.toml", "study"].map(|file| own.join(file));
        fs::write(&tolerance, text.replace("DESIGN", design("mini_3x3").to_str().unwrap())).unwrap();
        fs::write(&slurm, "program = \"printf '<%s>'\"\n").unwrap();
        let mut submit = super::metalith();
        submit
            .args(["study", "submit", "--slurm"])
            .arg(&slurm)
            .arg(&study)
            .arg("--plan")
            .arg(&tolerance);
        submit
            .args(["--draws-per-shard", "2", "--dry-run", "--merge"])
            .assert()
            .code(0);
        let scripts = fs::read_dir(study.join("slurm"))
            .unwrap()
            .map(|entry| entry.unwrap().path());
        let mut run = 0;
        for script in scripts.filter(|path| path.extension().is_some_and(|e| e == "sh")) {
            let done = Command::new("bash")
                .arg(&script)
                .env("SLURM_ARRAY_TASK_ID", "0")
                .current_dir(folder.path())
                .output();
            let said = String::from_utf8(done.unwrap().stdout).unwrap();
            assert!(said.contains(&format!("<{}>", study.display())), "{said}");
            run += 1;
        }
        assert_eq!(run, 3);
        assert!(!folder.path().join("forged").exists());
    }
}
