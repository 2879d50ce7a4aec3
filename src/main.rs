//! The `metalith` program. See `metalith --help`.

mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
