//! The `fillrate` command.

fn main() -> std::process::ExitCode {
    host::share_one_heap();
    host::survive_full_files();
    fillrate::cli::main()
}
