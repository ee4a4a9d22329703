//! The `fillrate` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    host::share_one_heap();
    host::survive_full_files();
    host::with_program_stack(fillrate::cli::main).unwrap_or_else(|error| {
        eprintln!("error: {error}");
        ExitCode::from(2)
    })
}
