//! The `fillrate` command.

fn main() -> std::process::ExitCode {
    host::share_one_heap();
    fillrate::cli::main()
}
