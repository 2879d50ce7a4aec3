//! The `metalith` program. See `metalith --help`.

fn main() -> std::process::ExitCode {
    std::process::ExitCode::from(metalith::cli::run_with(std::env::args_os()))
}
