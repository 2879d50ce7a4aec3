//! The `metalith` program. See `metalith --help`.

#[allow(dead_code, unreachable_code, unused_variables)] // until the first command is in its list
mod cli;

fn main() -> std::process::ExitCode {
    cli::run()
}
