//! Entry point of the program.

fn main() -> std::process::ExitCode {
    glioscope::cli::main()
}
