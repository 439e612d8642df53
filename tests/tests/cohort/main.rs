//! `glioscope cohort` as a process: a made cohort of boxes with known volumes and overlaps, computed, killed, computed again, and its
//! tables; and in the window.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_methods,
    reason = "in a test a failed unwrap is a failed test"
)]

mod forms;
mod kills;
mod made;
mod synthetic;
mod tables;
mod window;

use std::path::Path;

use glioscope_tests::run;
use made::{cohort, results, tree};
use serde_json::Value;

/// The program, built for tests.
const PROGRAM: &str = env!("CARGO_BIN_EXE_glioscope-under-test");

/// Runs `glioscope cohort IN OUT …` and returns its exit code, stdout and stderr.
fn glioscope_cohort(input: &Path, out: &Path, arguments: &[&str]) -> (i32, String, String) {
    let (input, out) = (input.to_str().unwrap(), out.to_str().unwrap());
    let output = run(PROGRAM, &[&["cohort", input, out], arguments].concat());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

fn status(out: &Path, case: &str) -> Value {
    let path = out.join("cases").join(case).join("status.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_case_has_what_the_command_line_answers_and_is_computed_once() {
    let (folder, input) = cohort(4);
    let out = folder.path().join("out");
    let before = tree(&input);
    let arguments = ["participant", "--n-procs", "2", "--compute", "metrics,lesions,change"];
    let (code, stdout, stderr) = glioscope_cohort(&input, &out, &arguments);
    assert_eq!((code, stdout.as_str()), (0, "4 computed, 0 were there, 0 failed\n"), "{stderr}");
    assert!(stderr.contains("[4/4]") && stderr.contains("s left"), "{stderr}");
    for (file, subcommand) in [
        ("measure.json", ["measure", "--metrics"].as_slice()),
        ("lesions-1.json", &["lesions"]),
        ("change-1.json", &["change"]),
    ] {
        let case = input.join("case-002");
        let answer = run(PROGRAM, &[subcommand, &[case.to_str().unwrap(), "--json"]].concat());
        assert_eq!(std::fs::read(out.join("cases/case-002").join(file)).unwrap(), answer.stdout, "{file}");
    }
    let first = results(&out);
    let (code, stdout, _) = glioscope_cohort(&input, &out, &arguments);
    assert_eq!((code, stdout.as_str()), (0, "0 computed, 4 were there, 0 failed\n"));
    assert_eq!(results(&out), first);
    // Other options, and another input: computed again, this case alone.
    let (_, stdout, _) = glioscope_cohort(
        &input,
        &out,
        &["participant", "--participant-label", "case-001", "--compute", "lesions"],
    );
    assert_eq!(stdout, "1 computed, 0 were there, 0 failed\n");
    assert_eq!(status(&out, "case-001")["options"]["compute"], serde_json::json!(["measure", "lesions"]));
    assert_eq!(tree(&input), before, "the input was written");
    made::case(&input.join("case-003"), 9);
    let (_, stdout, _) = glioscope_cohort(&input, &out, &arguments);
    assert_eq!(stdout, "2 computed, 2 were there, 0 failed\n");
    // A result that lost its end is made again.
    std::fs::write(out.join("cases/case-002/measure.json"), b"{").unwrap();
    let (_, stdout, _) = glioscope_cohort(&input, &out, &arguments);
    assert_eq!(stdout, "1 computed, 3 were there, 0 failed\n");
    assert!(std::fs::read_dir(out.join(".parts")).unwrap().next().is_none());
}

#[test]
fn a_case_that_fails_says_so_and_the_others_go_on() {
    let (folder, input) = cohort(3);
    let (out, work) = (folder.path().join("out"), folder.path().join("work"));
    std::fs::write(input.join("case-001/a-2024-01-01.nii"), b"no image").unwrap();
    let arguments = ["participant", "-w", work.to_str().unwrap(), "--n-procs", "1"];
    let (code, _, stderr) = glioscope_cohort(&input, &out, &arguments);
    assert_eq!(code, 1, "{stderr}");
    let last = stderr.lines().last().unwrap();
    assert!(last.contains("1 of 3 cases failed (case-001)") && last.contains("log.txt"), "{last}");
    let failed = status(&out, "case-001");
    assert_eq!((&failed["state"], &failed["steps"][0]["exit_code"]), (&"failed".into(), &2.into()));
    assert!(failed["steps"][0]["error"].as_str().unwrap().contains("a-2024-01-01.nii"));
    assert!(!out.join("cases/case-001/measure.json").exists());
    assert_eq!(status(&out, "case-002")["state"], "done");
    assert!(std::fs::read_dir(&work).unwrap().next().is_none(), "the work folder isn't empty");
    let (code, _, stderr) = glioscope_cohort(&input, &out, &["group"]);
    assert!(code == 0 && stderr.contains("1 a step that failed"), "{stderr}");
    let failures = tables::read(&out, "failures");
    assert_eq!((failures.len(), failures[0]["case"].as_str()), (1, "case-001"));
    // Mended, it is computed, and it alone.
    made::case(&input.join("case-001"), 1);
    let (code, stdout, _) = glioscope_cohort(&input, &out, &arguments);
    assert_eq!((code, stdout.as_str()), (0, "1 computed, 2 were there, 0 failed\n"));
}

#[test]
fn names_of_patients_are_in_no_result() {
    let Some(input) = glioscope_tests::real_data("dicom-folders") else { return };
    let case = run(PROGRAM, &["measure", input.join("two-patients").to_str().unwrap()]);
    assert!(String::from_utf8_lossy(&case.stderr).contains("Doe"), "the case names nobody");
    let folder = tempfile::tempdir().unwrap();
    let (code, stdout, stderr) = glioscope_cohort(&input, folder.path(), &["participant"]);
    assert!(
        code == 1
            && stderr.contains("two-patients: failed: measure")
            && stderr.contains("2 patients, expected"),
        "{stderr}"
    );
    assert_eq!(glioscope_cohort(&input, folder.path(), &["group"]).0, 0);
    let said = [stdout.into_bytes(), stderr.into_bytes()];
    for bytes in tree(folder.path()).into_values().chain(said) {
        assert!(!bytes.windows(3).any(|part| part == b"Doe"), "{}", String::from_utf8_lossy(&bytes));
    }
}

#[test]
fn two_runs_at_once_share_the_cases() {
    let (folder, input) = cohort(6);
    let out = folder.path().join("out");
    let computed = |text: &str| -> usize { text.split_whitespace().next().unwrap().parse().unwrap() };
    let run = || glioscope_cohort(&input, &out, &["participant", "--n-procs", "1"]);
    let both = std::thread::scope(|scope| {
        let other = scope.spawn(run);
        [run(), other.join().unwrap()]
    });
    assert!(both.iter().all(|(code, ..)| *code == 0), "{both:?}");
    assert_eq!(both.iter().map(|(_, stdout, _)| computed(stdout)).sum::<usize>(), 6, "{both:?}");
}

#[test]
fn wrong_arguments_are_one_line() {
    let (folder, input) = cohort(1);
    let out = folder.path().join("out");
    for (arguments, expected) in [
        (["participant", "--participant-label", "x"].as_slice(), "--participant-label: found \"x\""),
        (&["participant", "--compute", "x"], "--compute: found \"x\", expected measure, metrics"),
        (&["participant", "--compute", "response"], "response without criteria"),
        (&["group"], "no results of any case"),
        (
            &["group", "--reference", "ref", "--rank-by", "lesions_ignored"],
            "--rank-by: found \"lesions_ignored\"",
        ),
    ] {
        let (code, stdout, stderr) = glioscope_cohort(&input, &out, arguments);
        assert!(code == 2 && stdout.is_empty(), "{arguments:?}: {code}: {stdout}");
        assert!(stderr.contains(expected) && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
    }
    let (code, _, stderr) = glioscope_cohort(&input, &input.join("out"), &["participant"]);
    assert!(code == 2 && stderr.contains("a folder among the cases"), "{stderr}");
    let (_, stdout, _) = glioscope_cohort(&input, &out, &["participant", "--list"]);
    assert_eq!(stdout, "case-000\n");
    // As the paper of BIDS-Apps writes it.
    let (_, stdout, _) =
        glioscope_cohort(&input, &out, &["participant", "--participant_label", "case-000", "--list"]);
    assert_eq!(stdout, "case-000\n");
}
