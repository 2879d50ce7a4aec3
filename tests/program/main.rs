//! The program as a person or a build server calls it.

mod broken_designs;
mod calibrate;
mod cells;
mod check;
mod compare;
mod cut_pictures;
mod dataset;
mod files;
mod handoff;
mod hexagonal;
mod made;
mod new;
mod oasis;
mod optimise;
mod picture;
mod plan;
mod polarisation;
mod predict;
mod run;
mod schema;
mod sinks;
mod strangers;
mod study;
mod train;

/// The program, in the folder of the project.
fn metalith() -> assert_cmd::Command {
    assert_cmd::Command::cargo_bin("metalith").unwrap()
}

/// Text that the program prints before the words of a refusal with this identity.
fn refusal(id: &str) -> String {
    format!("error[{id}]: ")
}
