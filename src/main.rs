//! The `arborcam` program: arguments, configuration, one command run.

fn main() -> std::process::ExitCode {
    arborcam::cli::main()
}
