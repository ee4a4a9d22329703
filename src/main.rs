//! The `fillrate` command.

fn main() -> std::process::ExitCode {
    fillrate::cli::main()
}
