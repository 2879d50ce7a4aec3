//! `metalith calibrate`: what is refused before anything is read.

#[test]
fn sets_whose_answers_would_be_in_one_folder_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let refused = |arguments: &[&str], id: &str| {
        let mut command = super::metalith();
        let told = command.arg("calibrate").args(arguments).assert().code(2);
        told.stderr(predicates::str::contains(super::refusal(id)));
    };
    for set in ["monday/lens", "tuesday/lens", "tuesday/other"] {
        std::fs::create_dir_all(folder.path().join(set)).unwrap();
    }
    let [monday, tuesday, other] = ["monday/lens", "tuesday/lens", "tuesday/other"].map(path);
    refused(
        &[&monday, &tuesday, "--out", &path("out")],
        "calibrate/same-output-folder",
    );
    refused(&["--validate", &monday, &other], "calibrate/several-sets-to-validate");
}
