//! The program, built beside its whole-program tests so that cargo tells them where it is.

fn main() -> std::process::ExitCode {
    glioscope::cli::main()
}
