//! `./x` on machines that lack something: its functions are sourced into a bash whose PATH holds stand-ins.

#![cfg(target_os = "linux")]

use std::error::Error;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

type Outcome = Result<(), Box<dyn Error>>;

/// A folder of programs: real ones by their name, stand-ins by a line of shell.
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

    /// Runs `script` after sourcing `./x`, with no driver manifest in sight and no display.
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
fn a_bare_machine_that_may_not_install_is_told_the_exact_line_and_ends_with_2() -> Outcome {
    let output = Machine::bare()?.bash("main test")?;
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(output.stdout, b"", "stdout belongs to the program");
    let said = lines(&output.stderr);
    assert_eq!(
        said.last().map(String::as_str),
        Some(
            "sudo apt-get install --no-install-recommends gcc libc6-dev libvulkan1 mesa-vulkan-drivers libx11-6 \
             libx11-xcb1 libxcursor1 libxi6 libxrandr2 libxkbcommon0 libxkbcommon-x11-0 xvfb xauth python3-venv"
        )
    );
    Ok(())
}

#[test]
fn what_root_may_install_is_named_then_installed_and_looked_for_again() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("id", "echo 0")?;
    machine.stand_in("apt-get", "echo apt-get \"$@\"")?;
    let output = machine.bash("main run -- measure --sample")?;
    let said = lines(&output.stderr);
    assert_eq!(
        said,
        [
            "./x: missing system packages: gcc libc6-dev",
            "./x: installing them",
            "apt-get update -q",
            "apt-get install -y -q --no-install-recommends gcc libc6-dev",
            // The stand-in installs nothing, and that must not go unseen.
            "./x: still missing after installing: gcc libc6-dev",
        ]
    );
    assert_eq!(output.status.code(), Some(2));
    Ok(())
}

#[test]
fn nothing_is_installed_where_that_is_forbidden() -> Outcome {
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
fn numbers_need_no_graphics_and_arguments_arrive_whole() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("cc", "exit 0")?;
    let output = machine.bash("main run -- measure --mask 'A=a file.nii:1,2' --json")?;
    assert_eq!(lines(&output.stderr), [""; 0]);
    let ran = lines(&output.stdout);
    assert!(
        ran.len() == 1
            && ran[0].ends_with("--release -p glioscope -- measure --mask A=a file.nii:1,2 --json"),
        "{ran:?}"
    );
    Ok(())
}

#[test]
fn without_a_display_the_window_becomes_a_report_and_a_case_is_not_swapped_for_it() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("cc", "exit 0")?;
    machine.stand_in("ldconfig", "echo '	libvulkan.so.1 (libc6,x86-64) => /lib/libvulkan.so.1'")?;
    let with_driver = "export VK_DRIVER_FILES=\"$PATH/cargo\";";

    let report = machine.bash(&format!("{with_driver} main run"))?;
    assert!(lines(&report.stderr)[0].contains("no display"), "{report:?}");
    let ran = lines(&report.stdout);
    assert!(ran.len() == 1 && ran[0].ends_with("-- report --out out/sample-report"), "{ran:?}");

    let case = machine.bash(&format!("{with_driver} main run follow-up.toml"))?;
    assert_eq!(case.status.code(), Some(2));
    assert_eq!(lines(&case.stdout), [""; 0], "nothing ran");
    assert!(lines(&case.stderr).iter().any(|l| l.contains("follow-up.toml")), "{case:?}");
    Ok(())
}

#[test]
fn goldens_want_the_software_driver_even_beside_a_gpu() -> Outcome {
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
fn a_picture_that_no_test_names_is_dead() -> Outcome {
    let machine = Machine::bare()?;
    let repository = tempfile::tempdir()?;
    for folder in ["goldens/old", "src"] {
        std::fs::create_dir_all(repository.path().join(folder))?;
    }
    let source = br#"compare("named"); compare("in/folder"); compare("ending.png"); // unnamed, "not.this"#;
    glioscope_core::files::write_whole(&repository.path().join("src/pictures.rs"), source)?;
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
fn every_check_runs_and_the_failed_ones_are_repeated_at_the_end() -> Outcome {
    let machine = Machine::bare()?;
    machine.stand_in("cc", "exit 0")?;
    let all = "format clippy docs unused_dependencies dead_snapshots";
    let output = machine.bash(&format!(
        "for c in {all}; do eval \"check_$c() {{ echo $c spoke; }}\"; done; \
         check_clippy() {{ echo '   Compiling x'; echo a lint; return 3; }}; main check"
    ))?;
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let said = lines(&output.stdout);
    let repeated = said.iter().position(|l| l == "==== clippy: what it said ====");
    let summary = said.iter().position(|l| l == "==== check ====");
    let (Some(repeated), Some(summary)) = (repeated, summary) else { return Err(said.join("\n").into()) };
    assert_eq!(said[repeated + 1], "a lint", "cargo's progress is left out");
    let verdicts: Vec<Vec<&str>> =
        said[summary + 1..].iter().map(|l| l.split_whitespace().collect()).collect();
    assert_eq!(verdicts.len(), 5);
    for line in verdicts {
        let expected = if line[0] == "clippy" { "FAILED" } else { "ok" };
        assert!(line.contains(&expected), "{line:?}");
    }
    Ok(())
}

#[test]
fn test_results_are_added_up_and_skipped_tests_named_once() -> Outcome {
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
