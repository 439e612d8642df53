//! Runs with a shell script in place of the program.

use std::{
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
};

use glioscope_core::{Progress, files::write_whole};

use crate::{CaseStatus, CohortError, Options, Outcome, Place, Resources, State, Step, find, run};

/// Answers as `measure`, needs 32 MB for the case `large`, crashes for `crash` and waits for `slow`.
const PROGRAM: &str = r#"#!/bin/sh
case "$2" in
    */large) x=$(head -c 32000000 /dev/zero | tr '\0' x); sleep 0.3 ;;
    */crash) kill -SEGV $$ ;;
    */slow) sleep 60 ;;
    */images) echo '{"time_points": [{"time": "a", "masks": []}]}'; exit ;;
esac
echo '{"time_points": [{"time": "a"}]}'
"#;

struct Made(tempfile::TempDir);

impl Made {
    fn new(cases: &[&str]) -> Self {
        let made = Self(tempfile::tempdir().unwrap());
        for case in cases {
            std::fs::create_dir_all(made.at("in").join(case)).unwrap();
        }
        write_whole(&made.at("program"), PROGRAM.as_bytes()).unwrap();
        std::fs::set_permissions(made.at("program"), std::fs::Permissions::from_mode(0o755)).unwrap();
        made
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(
        &self,
        processes: usize,
        memory_mb: Option<u64>,
        progress: &Progress,
    ) -> Result<Vec<Outcome>, CohortError> {
        let resources = Resources {
            program: self.at("program"),
            version: "1".into(),
            processes,
            threads: 1,
            memory_mb,
            work: None,
        };
        let (input, no_session) =
            (self.at("in"), |_: &Path| -> Result<Vec<PathBuf>, CohortError> { Ok(Vec::new()) });
        let place = Place::open(&self.at("out"), &input)?;
        let cases = find(&input, &[], true)?;
        let options = Options { compute: vec![Step::Measure, Step::Change], ..Options::default() };
        let summary = run((&cases, &input), &place, &options, &resources, &no_session, (progress, &|_| {}))?;
        Ok(summary.cases.into_iter().map(|(_, outcome)| outcome).collect())
    }

    fn status(&self, case: &str) -> CaseStatus {
        CaseStatus::read(&self.at("out").join("cases").join(case)).unwrap()
    }
}

#[test]
fn a_case_that_needs_more_than_its_share_is_computed_again_with_all_memory() {
    let made = Made::new(&["a", "large", "z"]);
    // A share of 15 MB.
    assert_eq!(
        made.run(20, Some(300), &Progress::new()).unwrap(),
        [Outcome::Done, Outcome::Done, Outcome::Done]
    );
    assert!(made.status("large").steps[0].peak_mb.unwrap() > 15.0);
    let small = Made::new(&["large", "z"]);
    let outcomes = small.run(1, Some(15), &Progress::new()).unwrap();
    assert!(matches!(&outcomes[0], Outcome::Failed(why) if why.contains("more than 15 MB")), "{outcomes:?}");
    assert_eq!(outcomes[1], Outcome::Done);
}

#[test]
fn a_crash_is_one_cases_failure_and_one_date_has_no_change() {
    let made = Made::new(&["a", "crash", "z"]);
    let outcomes = made.run(2, None, &Progress::new()).unwrap();
    assert!(matches!(&outcomes[1], Outcome::Failed(why) if why.contains("signal: 11")), "{outcomes:?}");
    assert_eq!((made.status("crash").state, made.status("a").state), (State::Failed, State::Done));
    assert_eq!(made.status("a").steps[1].state, State::NotApplicable);
    assert_eq!(made.run(2, None, &Progress::new()).unwrap()[0], Outcome::Skipped);
}

#[test]
fn a_case_without_masks_fails_and_results_are_described_as_derived() {
    let made = Made::new(&["a", "images"]);
    let outcomes = made.run(1, None, &Progress::new()).unwrap();
    assert_eq!(outcomes[0], Outcome::Done);
    assert!(matches!(&outcomes[1], Outcome::Failed(why) if why.contains("found no mask")), "{outcomes:?}");
    let log = std::fs::read_to_string(made.at("out/cases/images/log.txt")).unwrap();
    assert!(log.contains("found no mask"), "{log}");
    let path = made.at("out/dataset_description.json");
    let described: serde_json::Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    assert_eq!(described["DatasetType"], "derivative");
    assert_eq!(described["GeneratedBy"][0]["Name"], "Glioscope");
    // One that is there is another's.
    write_whole(&path, b"{}").unwrap();
    made.run(1, None, &Progress::new()).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"{}");
}

#[test]
fn a_cancelled_run_leaves_whole_cases_alone() {
    let made = Made::new(&["a", "slow"]);
    let progress = Progress::new();
    let cancel = progress.clone();
    let finished = made.at("out/cases/a/status.json");
    std::thread::spawn(move || {
        while !finished.exists() {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        cancel.cancel();
    });
    assert!(matches!(made.run(1, None, &progress), Err(CohortError::Cancelled(_))));
    assert!(made.at("out/cases/a/status.json").exists() && !made.at("out/cases/slow").exists());
    assert!(std::fs::read_dir(made.at("out/.parts")).unwrap().next().is_none());
}
