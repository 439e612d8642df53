//! `./x` on machines without certain packages: its functions are sourced into a bash whose PATH contains stand-ins.

#![cfg(target_os = "linux")]

use std::error::Error;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

type Outcome = Result<(), Box<dyn Error>>;

/// A folder of programs, the only one on PATH: links to real ones, and stand-ins that are one line of shell.
struct Machine {
    folder: tempfile::TempDir,
}

impl Machine {
    /// A machine with ordinary tools and cargo; no compiler, no Vulkan, no X, and an empty linker cache.
    fn bare() -> Result<Self, Box<dyn Error>> {
        let machine = Self { folder: tempfile::tempdir()? };
        let tools = "awk basename bash cat dirname env find git grep mktemp rm sed sort tee tr uname";
        for tool in tools.split(' ') {
            let path = Command::new("bash").args(["-c", &format!("type -P {tool}")]).output()?;
            let target = String::from_utf8(path.stdout)?;
            std::os::unix::fs::symlink(target.trim(), machine.folder.path().join(tool))?;
        }
        for (name, line) in [("cargo", "echo cargo \"$@\""), ("ldconfig", ":"), ("id", "echo 1000")] {
            machine.stand_in(name, line)?;
        }
        Ok(machine)
    }

    fn stand_in(&self, name: &str, line: &str) -> Outcome {
        let path = self.folder.path().join(name);
        glioscope_core::files::write_whole(&path, format!("#!/bin/sh\n{line}\n").as_bytes())?;
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755))?;
        Ok(())
    }

    /// Runs `script` after sourcing `./x`, without a driver manifest and without a display.
    fn bash(&self, script: &str) -> Result<Output, Box<dyn Error>> {
        let x = Path::new(env!("CARGO_MANIFEST_DIR")).join("../x");
        Ok(Command::new(self.folder.path().join("bash"))
            .args(["-c", &format!("source '{}'; {script}", x.display())])
            .env_clear()
            .env("PATH", self.folder.path())
            .env("HOME", self.folder.path())
            .env("VK_DRIVER_FILES", self.folder.path().join("no-driver.json"))
            .output()?)
    }
}

fn lines(bytes: &[u8]) -> Vec<String> {
    String::from_utf8_lossy(bytes).lines().map(str::to_owned).collect()
}

#[test]
fn without_install_rights_the_install_command_is_printed_and_the_exit_code_is_2() -> Outcome {
    let output = Machine::bare()?.bash("main test")?;
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(output.stdout, b"", "stdout is reserved for the program");
    let stderr = lines(&output.stderr);
    assert_eq!(
        stderr.last().map(String::as_str),
        Some(
            "sudo apt-get install --no-install-recommends gcc libc6-dev libvulkan1 mesa-vulkan-drivers libx11-6 \
             libx11-xcb1 libxcursor1 libxi6 libxrandr2 libxkbcommon0 libxkbcommon-x11-0 xvfb xauth python3-venv strace"
        )
    );
    Ok(())
}

#[test]
fn root_lists_installs_and_rechecks_missing_packages() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("id", "echo 0")?;
    machine.stand_in("apt-get", "echo apt-get \"$@\"")?;
    let output = machine.bash("main run -- measure --sample")?;
    let stderr = lines(&output.stderr);
    assert_eq!(
        stderr,
        [
            "./x: missing system packages: gcc libc6-dev",
            "./x: installing them",
            "apt-get update -q",
            "apt-get install -y -q --no-install-recommends gcc libc6-dev",
            // The stand-in installs nothing, which must be detected.
            "./x: still missing after installing: gcc libc6-dev",
        ]
    );
    assert_eq!(output.status.code(), Some(2));
    Ok(())
}

#[test]
fn nothing_is_installed_with_glioscope_no_install() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("id", "echo 0")?;
    machine.stand_in("apt-get", "echo apt-get \"$@\"")?;
    let output = machine.bash("GLIOSCOPE_NO_INSTALL=1 main run -- measure --sample")?;
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(
        lines(&output.stderr).last().map(String::as_str),
        Some("sudo apt-get install --no-install-recommends gcc libc6-dev")
    );
    Ok(())
}

#[test]
fn measure_requires_no_graphics_and_arguments_are_passed_on_unchanged() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("cc", "exit 0")?;
    let output = machine.bash("main run -- measure --mask 'A=a file.nii:1,2' --json")?;
    assert_eq!(lines(&output.stderr), [""; 0]);
    let commands = lines(&output.stdout);
    assert!(
        commands.len() == 1
            && commands[0].ends_with("--release -p glioscope -- measure --mask A=a file.nii:1,2 --json"),
        "{commands:?}"
    );
    Ok(())
}

#[test]
fn every_subcommand_has_its_requirements() -> Outcome {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../app/src/cli/arguments.rs");
    let source = std::fs::read_to_string(source)?;
    let (_, tasks) = source.split_once("pub enum Task {").ok_or("no Task")?;
    let (tasks, _) = tasks.split_once("\n}").ok_or("no end of Task")?;
    let is_variant = |line: &&str| {
        line.strip_prefix("    ").is_some_and(|line| line.starts_with(|c: char| c.is_ascii_uppercase()))
    };
    let kebab = |variant: &str| {
        let name = variant.trim().split(['(', ' ', ',']).next().unwrap_or_default();
        let parts = name.chars().enumerate().map(|(n, c)| match c.is_ascii_uppercase() {
            true if n > 0 => format!("-{}", c.to_ascii_lowercase()),
            _ => c.to_ascii_lowercase().to_string(),
        });
        parts.collect::<String>()
    };
    let words: Vec<String> = tasks.lines().filter(is_variant).map(kebab).collect();
    assert!(words.len() > 15 && words.contains(&"self-check".to_owned()), "{words:?}");
    let script = format!("for w in {}; do echo $w $(kind_of_run $w case); done", words.join(" "));
    let output = Machine::bare()?.bash(&script)?;
    let windows: Vec<String> =
        lines(&output.stdout).into_iter().filter(|line| line.ends_with(" window")).collect();
    assert_eq!(windows, ["open window", "study window"]);
    Ok(())
}

#[test]
fn without_a_display_the_sample_report_is_written_unless_a_case_is_given() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("cc", "exit 0")?;
    machine.stand_in("ldconfig", "echo '	libvulkan.so.1 (libc6,x86-64) => /lib/libvulkan.so.1'")?;
    let with_driver = "export VK_DRIVER_FILES=\"$PATH/cargo\";";

    let report = machine.bash(&format!("{with_driver} main run"))?;
    assert!(lines(&report.stderr)[0].contains("no display"), "{report:?}");
    let commands = lines(&report.stdout);
    assert!(
        commands.len() == 1 && commands[0].ends_with("-- report --out out/sample-report"),
        "{commands:?}"
    );

    let case = machine.bash(&format!("{with_driver} main run follow-up.toml"))?;
    assert_eq!(case.status.code(), Some(2));
    assert_eq!(lines(&case.stdout), [""; 0], "nothing ran");
    assert!(lines(&case.stderr).iter().any(|l| l.contains("follow-up.toml")), "{case:?}");
    Ok(())
}

#[test]
fn mutants_says_how_to_install_what_it_needs() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("cc", "exit 0")?;
    machine.stand_in("ldconfig", "echo '	libvulkan.so.1 (libc6,x86-64) => /lib/libvulkan.so.1'")?;
    machine.stand_in("lvp_icd.x86_64.json", "")?;
    let with_driver = "export VK_DRIVER_FILES=\"$PATH/lvp_icd.x86_64.json\";";
    machine.stand_in("cargo", "echo cargo \"$@\"; test \"$2\" != --version")?;
    let output = machine.bash(&format!("{with_driver} main mutants"))?;
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let stderr = lines(&output.stderr);
    assert_eq!(stderr, ["./x: cargo-mutants is not installed; run: cargo install cargo-mutants --locked"]);
    machine.stand_in("cargo", "echo cargo \"$@\"")?;
    let all = machine.bash(&format!("{with_driver} main mutants --shard 0/10"))?;
    let command = lines(&all.stdout).join("");
    assert!(command.contains("--file core/src/grid.rs") && command.ends_with("--shard 0/10"), "{command}");
    let one = machine.bash(&format!("{with_driver} main mutants -f core/src/mask.rs"))?;
    assert!(!lines(&one.stdout).join("").contains("grid.rs"), "{one:?}");
    Ok(())
}

#[test]
fn tests_require_the_software_driver_even_with_a_gpu_driver() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("ldconfig", "echo '	libvulkan.so.1 (libc6,x86-64) => /lib/libvulkan.so.1'")?;
    machine.stand_in("nvidia_icd.json", "")?;
    machine.stand_in("lvp_icd.x86_64.json", "")?;
    let missing = |drivers: &str, need: &str| -> Result<Vec<String>, Box<dyn Error>> {
        Ok(lines(
            &machine.bash(&format!("export VK_DRIVER_FILES={drivers}; missing_packages {need}"))?.stdout,
        ))
    };
    assert_eq!(missing("$PATH/nvidia_icd.json", "vulkan")?, [""; 0]);
    assert_eq!(missing("$PATH/nvidia_icd.json", "software")?, ["mesa-vulkan-drivers"]);
    assert_eq!(missing("$PATH/nvidia_icd.json:$PATH/lvp_icd.x86_64.json", "software")?, [""; 0]);
    assert_eq!(missing("$PATH/absent.json", "vulkan")?, ["mesa-vulkan-drivers"]);
    Ok(())
}

#[test]
fn goldens_that_no_test_names_are_reported() -> Outcome {
    let machine = Machine::bare()?;
    let repository = tempfile::tempdir()?;
    for folder in ["goldens/old", "src"] {
        std::fs::create_dir_all(repository.path().join(folder))?;
    }
    let source = br#"compare("named"); compare("in/folder"); compare("ending.png"); // unnamed, "not.this"#;
    glioscope_core::files::write_whole(&repository.path().join("src/goldens.rs"), source)?;
    for stem in ["goldens/named", "goldens/folder", "goldens/old/ending", "goldens/old/unnamed", "not"] {
        glioscope_core::files::write_whole(&repository.path().join(format!("{stem}.png")), b"")?;
    }
    let at = repository.path().display();
    let output = machine.bash(&format!(
        "cd '{at}'; git init -q; git add .; check_dead_snapshots || echo found; \
         git rm -qf goldens/old/unnamed.png; check_dead_snapshots && echo none"
    ))?;
    assert_eq!(
        lines(&output.stdout),
        ["goldens/old/unnamed.png: no test names \"unnamed\"", "found", "none"],
        "{output:?}"
    );
    Ok(())
}

#[test]
fn every_check_runs_and_output_of_failed_ones_is_repeated_at_the_end() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("cc", "exit 0")?;
    let all = "format clippy docs dead_snapshots";
    let output = machine.bash(&format!(
        "for c in {all}; do eval \"check_$c() {{ echo output of $c; }}\"; done; \
         check_clippy() {{ echo '   Compiling x'; echo a lint; return 3; }}; main check"
    ))?;
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let stdout = lines(&output.stdout);
    let repeated = stdout.iter().position(|l| l == "==== clippy: output ====");
    let summary = stdout.iter().position(|l| l == "==== check ====");
    let (Some(repeated), Some(summary)) = (repeated, summary) else { return Err(stdout.join("\n").into()) };
    assert_eq!(stdout[repeated + 1], "a lint", "cargo's progress lines are omitted");
    let verdicts: Vec<Vec<&str>> =
        stdout[summary + 1..].iter().map(|l| l.split_whitespace().collect()).collect();
    assert_eq!(verdicts.len(), 4);
    for line in verdicts {
        let expected = if line[0] == "clippy" { "FAILED" } else { "ok" };
        assert!(line.contains(&expected), "{line:?}");
    }
    Ok(())
}

#[test]
fn what_failed_is_said_last() -> Outcome {
    let machine = Machine::bare()?;
    let log = machine.folder.path().join("log");
    let text = "test a::good ... ok\ntest a::bad ... FAILED\n\nsuccesses:\n\n---- a::good stdout ----\nfine\n\n\
                failures:\n\n---- a::bad stdout ----\nthread 'a::bad' panicked at a.rs:1:1:\nfound 3, expected 4\n\n\
                failures:\n    a::bad\n\n\
                test result: FAILED. 1 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out\n";
    glioscope_core::files::write_whole(&log, text.as_bytes())?;
    let output = machine.bash(&format!("summarise_tests '{}'", log.display()))?;
    let said = lines(&output.stdout);
    let last = [
        "1 passed, 1 failed",
        "",
        "FAILED: a::bad",
        "thread 'a::bad' panicked at a.rs:1:1:",
        "found 3, expected 4",
    ];
    assert_eq!(said[said.len() - last.len()..], last);
    Ok(())
}

#[test]
fn test_counts_are_summed_and_each_skip_is_listed_once() -> Outcome {
    let machine = Machine::bare()?;
    let log = machine.folder.path().join("log");
    let text = "SKIPPED: no real data\ntest result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out\n\
                SKIPPED: no real data\ntest result: FAILED. 4 passed; 2 failed; 0 ignored; 0 measured; 0 filtered out\n";
    glioscope_core::files::write_whole(&log, text.as_bytes())?;
    let output = machine.bash(&format!("summarise_tests '{}'", log.display()))?;
    assert_eq!(
        lines(&output.stdout),
        ["  SKIPPED: no real data", "", "2 test programs, 1 tests ignored", "7 passed, 2 failed"]
    );
    Ok(())
}
