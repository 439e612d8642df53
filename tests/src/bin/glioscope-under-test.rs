//! The program, built with its whole-program tests so that cargo gives them its path (`CARGO_BIN_EXE_…`).

fn main() -> std::process::ExitCode {
    glioscope::cli::main()
}
