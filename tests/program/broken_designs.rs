//! Designs with mistakes: each is refused with exit code 2 and the message beside it in `golden/broken`.

use std::fs;

use metalith_testing::{golden, root};

#[test]
fn golden_messages_of_broken_designs() {
    let mut tried = 0;
    let mut entries = fs::read_dir(root().join("tests/broken"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect::<Vec<_>>();
    entries.sort();
    for path in entries
        .into_iter()
        .filter(|p| p.extension().is_some_and(|e| e == "toml"))
    {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let folder = tempfile::tempdir().unwrap();
        let output = super::metalith()
            .env("NO_COLOR", "1")
            .args(["layout", &format!("tests/broken/{name}.toml"), "--out"])
            .arg(folder.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{name}");
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            0,
            "{name} left files behind"
        );
        golden(&format!("broken/{name}.txt"), &output.stderr);
        tried += 1;
    }
    assert!(tried >= 9, "only {tried} broken designs were found");
}
