//! The `searoom` program.

fn main() -> std::process::ExitCode {
    searoom::cli::run(std::env::args_os())
}
