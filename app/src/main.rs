//! The program.

fn main() -> std::process::ExitCode {
    glioscope::cli::main()
}
