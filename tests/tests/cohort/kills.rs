//! Runs that are killed at any moment leave whole cases alone, and the next run ends as an undisturbed one.

#![cfg(unix)]

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    process::{Command, Stdio},
    time::Duration,
};

use glioscope_core::optics::random::Random;
use serde_json::Value;

use crate::{PROGRAM, glioscope_cohort, made::cohort, tree};

/// Fixes when runs are killed.
const SEED: u64 = 19;
const CASES: usize = 12;
const OPTIONS: [&str; 5] = ["participant", "--n-procs", "2", "--compute", "metrics,lesions,change"];

/// How many runs are killed.
fn rounds() -> u64 {
    std::env::var("GLIOSCOPE_TEST_ROUNDS").ok().and_then(|text| text.parse().ok()).unwrap_or(8)
}

/// Cases in the results, each checked to be whole: its files are those of its status, with their sizes.
fn whole_cases(out: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(out.join("cases")) else { return 0 };
    let mut count = 0;
    for entry in entries {
        let folder = entry.unwrap().path();
        let status: Value =
            serde_json::from_slice(&std::fs::read(folder.join("status.json")).unwrap()).unwrap();
        let files: BTreeMap<String, u64> = tree(&folder)
            .into_iter()
            .map(|(path, bytes)| {
                (path.strip_prefix(&folder).unwrap().display().to_string(), bytes.len() as u64)
            })
            .filter(|(name, _)| name != "status.json" && name != "log.txt")
            .collect();
        let stated: BTreeMap<String, u64> = status["results"]
            .as_array()
            .unwrap()
            .iter()
            .map(|file| (file["path"].as_str().unwrap().to_owned(), file["bytes"].as_u64().unwrap()))
            .collect();
        assert_eq!(files, stated, "{}", folder.display());
        assert_eq!(status["state"], "done", "{}", folder.display());
        count += 1;
    }
    count
}

/// What runs left that were killed while they made it.
fn parts(out: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(out.join(".parts")).into_iter().flatten();
    entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// Processes of the program that work on `out`.
#[cfg(target_os = "linux")]
fn processes_on(out: &Path) -> usize {
    let mark = format!("GLIOSCOPE_TEST_RUN={}", out.display());
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let environments = processes.filter_map(|entry| std::fs::read(entry.path().join("environ")).ok());
    environments.filter(|bytes| bytes.split(|b| *b == 0).any(|word| word == mark.as_bytes())).count()
}

fn tables(input: &Path, out: &Path) -> BTreeMap<String, Vec<u8>> {
    let (code, _, stderr) = glioscope_cohort(input, out, &["group", "--reference", "ref"]);
    assert_eq!(code, 0, "{stderr}");
    let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
    tree(&out.join("tables")).into_iter().map(|(path, bytes)| (name(&path), bytes)).collect()
}

#[test]
fn killed_runs_leave_whole_cases_and_the_table_is_that_of_an_undisturbed_run() {
    let (folder, input) = cohort(CASES);
    let (undisturbed, killed) = (folder.path().join("undisturbed"), folder.path().join("killed"));
    let started = std::time::Instant::now();
    let (code, _, stderr) = glioscope_cohort(&input, &undisturbed, &OPTIONS);
    assert_eq!(code, 0, "{stderr}");
    let took = started.elapsed().as_secs_f64();
    let mut random = Random::new(SEED, 0);
    let (mut most, mut interrupted) = (0, 0);
    for round in 0..rounds() {
        // Each may get through at most a part, so that there is always something to be killed in.
        let delay = Duration::from_secs_f64(random.unit() * took / rounds() as f64 * 1.5);
        let left = parts(&killed);
        let mut child = Command::new(PROGRAM)
            .args(["cohort", input.to_str().unwrap(), killed.to_str().unwrap()])
            .args(OPTIONS)
            .env("GLIOSCOPE_TEST_RUN", &killed)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(delay);
        let signal = ["-KILL", "-INT", "-TERM"][(random.unit() * 3.0) as usize];
        let running = child.try_wait().unwrap().is_none();
        Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
        let status = child.wait().unwrap();
        interrupted += usize::from(running && !status.success());
        #[cfg(target_os = "linux")]
        {
            // The processes of cases end with it.
            let asked = std::time::Instant::now();
            while processes_on(&killed) > 0 {
                assert!(asked.elapsed() < Duration::from_secs(10), "round {round}: processes are left");
                std::thread::sleep(Duration::from_millis(10));
            }
        }
        if signal != "-KILL" {
            // Cases that it came to are cleaned up; what a killed run left of others stays.
            let new: BTreeSet<String> = parts(&killed).difference(&left).cloned().collect();
            assert!(new.is_empty(), "round {round}: {signal} left {new:?}");
        }
        let whole = whole_cases(&killed);
        assert!(whole >= most, "round {round}: {most} cases were whole, now {whole}");
        most = whole;
    }
    assert!(interrupted > 1, "{interrupted} of {} runs were interrupted", rounds());
    let (code, _, stderr) = glioscope_cohort(&input, &killed, &OPTIONS);
    assert_eq!(code, 0, "{stderr}");
    assert_eq!(whole_cases(&killed), CASES);
    assert!(parts(&killed).is_empty());
    assert!(tables(&input, &undisturbed) == tables(&input, &killed));
}
