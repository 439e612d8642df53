//! Disks that are full or broken: whatever call of the system fails while a file is written, the failure is said in one
//! line, the file before is unchanged, and nothing half-written is left. And kill -9 at each of these calls.
//!
//! Calls are made to fail with `strace`, or by a limit of file sizes, which writes a part and then fails.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    time::{Duration, Instant, SystemTime},
};

use egui::Theme;
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, PaneId, Ruler, Shape},
    window::autosave::{Autosave, INTERVAL},
};
use glioscope_core::{
    files::{replace_files, temporary_folder},
    glam::DVec3,
    sample::sample_files,
};
use glioscope_tests::{Window, error_text, issue, perform, print_line, wait_for_workers, window_on};

use crate::PROGRAM;

/// Calls of the system that put files in place, and an error of each. strace counts each on its own, by thread; `?`: not
/// every processor has it.
const CALLS: [(&str, &str); 4] =
    [("write", "ENOSPC"), ("fsync", "EIO"), ("?rename", "EIO"), ("?renameat", "EIO")];
/// What removes files.
const REMOVING: [&str; 2] = ["?unlink", "?unlinkat"];

/// Whether strace may trace here. Containers can forbid it, which is reported.
fn may_trace() -> bool {
    let output = Command::new("strace")
        .args(["-f", "-qq", "--seccomp-bpf", "-e", "trace=fsync", "true"])
        .output()
        .expect("strace is installed (./x test installs it)");
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr);
        print_line(&format!(
            "SKIPPED: failing calls of the system: strace can't trace here ({})",
            why.trim()
        ));
    }
    output.status.success()
}

/// A run under strace.
struct Disturbed {
    output: Output,
    /// The calls that failed.
    failed: Vec<String>,
    killed: bool,
}

impl Disturbed {
    /// Whether the only call that failed wrote to this descriptor.
    fn hit(&self, descriptor: u32) -> bool {
        matches!(self.failed.as_slice(), [one] if one.contains(&format!("({descriptor}, ")))
    }
}

/// Runs the program while a call has `effect`: the one with number `point` of each thread.
fn disturbed(arguments: &[String], call: &str, effect: &str, point: usize) -> Disturbed {
    let log = tempfile::NamedTempFile::new().unwrap();
    let mut strace = Command::new("strace");
    if !effect.starts_with("signal") {
        // Faster, but strace 6.1 then sends no signals.
        strace.arg("--seccomp-bpf");
    }
    let output = strace
        .args(["-f", "-qq", "-o"])
        .arg(log.path())
        .args(["-e", &format!("trace={call}"), "-e", &format!("inject={call}:{effect}:when={point}")])
        .arg(PROGRAM)
        .args(arguments)
        // Its driver's own files are not the program's.
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .output()
        .unwrap();
    let log = fs::read_to_string(log.path()).unwrap();
    let failed = log.lines().filter(|line| line.ends_with("(INJECTED)")).map(str::to_owned).collect();
    // strace ends as the program does.
    let killed = std::os::unix::process::ExitStatusExt::signal(&output.status) == Some(9);
    Disturbed { output, failed, killed }
}

/// Every file below `folder` with its content; an empty folder has an entry without one.
fn content(folder: &Path) -> Files {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            let below = content(&path);
            if below.is_empty() {
                all.insert(path, None);
            } else {
                all.extend(below);
            }
        } else {
            all.insert(path.clone(), Some(fs::read(&path).unwrap()));
        }
    }
    all
}

/// A command that writes, where, and how `folder` is prepared.
struct Writer {
    arguments: Vec<String>,
    prepare: fn(&Path),
}

impl Writer {
    /// `out` is relative to a folder of the test's own.
    fn arguments(&self, folder: &Path) -> Vec<String> {
        let name = |argument: &String| argument.replace("OUT", &folder.display().to_string());
        self.arguments.iter().map(name).collect()
    }

    /// A prepared folder with the arguments for it.
    fn prepared(&self) -> (tempfile::TempDir, Vec<String>) {
        let folder = tempfile::tempdir().unwrap();
        (self.prepare)(folder.path());
        let arguments = self.arguments(folder.path());
        (folder, arguments)
    }

    /// What a run without failures leaves, by paths inside the folder.
    fn undisturbed(&self) -> Files {
        let (folder, arguments) = self.prepared();
        let output = Command::new(PROGRAM).args(&arguments).output().unwrap();
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        inside(folder.path())
    }

    /// Makes calls fail, each in a run of its own, until there are no more; returns the number of failures.
    fn fails(&self, new: &Files, (call, error): (&str, &str), points: impl Iterator<Item = usize>) -> usize {
        let mut failures = 0;
        for point in points {
            let (folder, arguments) = self.prepared();
            let before = inside(folder.path());
            let run = disturbed(&arguments, call, &format!("error={error}"), point);
            let stderr = String::from_utf8_lossy(&run.output.stderr).into_owned();
            let what = format!("{arguments:?}, {call} {point}: {:?} {stderr}", run.failed);
            let after = inside(folder.path());
            if run.failed.is_empty() {
                assert!(run.output.status.success(), "{what}");
                assert!(after == *new, "{what}");
                break;
            }
            failures += 1;
            // What was said on stdout or stderr is no file.
            if run.hit(1) || run.hit(2) {
                assert!(after == *new || after == before, "{what}");
            } else {
                assert!(after == before, "{what}: {:?}", after.keys());
            }
            if !run.hit(2) {
                assert_eq!(run.output.status.code(), Some(2), "{what}");
                let errors: Vec<&str> = stderr
                    .lines()
                    .filter(|line| !line.contains("note [") && !line.contains("warning ["))
                    .collect();
                assert_eq!(errors.len(), 1, "{what}");
                assert!(stderr.contains("No space left") || stderr.contains("Input/output"), "{what}");
            }
        }
        failures
    }

    /// Kills the program at calls, each in a run of its own, until there are no more; returns the number of kills.
    /// Temporary files may be left; the next run removes them once they are old.
    fn is_killed(&self, new: &Files, call: &str, points: impl Iterator<Item = usize>) -> usize {
        let mut kills = 0;
        for point in points {
            let (folder, arguments) = self.prepared();
            let before = inside(folder.path());
            let run = disturbed(&arguments, call, "signal=KILL", point);
            let what = format!("{arguments:?}, killed at {call} {point}");
            if !run.killed {
                assert!(run.output.status.success() && inside(folder.path()) == *new, "{what}");
                break;
            }
            kills += 1;
            let is_temporary = |part: std::path::Component<'_>| {
                part.as_os_str().to_string_lossy().starts_with(".glioscope-")
            };
            for (path, bytes) in inside(folder.path()) {
                let whole = before.get(&path) == Some(&bytes) || new.get(&path) == Some(&bytes);
                assert!(whole || path.components().any(is_temporary), "{what}: {}", path.display());
            }
            for path in before.keys().filter(|path| new.contains_key(*path)) {
                assert!(folder.path().join(path).exists(), "{what}: {} is gone", path.display());
            }
            age(folder.path());
            let again = Command::new(PROGRAM).args(&arguments).output().unwrap();
            let stderr = String::from_utf8_lossy(&again.stderr);
            // A sample that is there is not written again.
            if !again.status.success() {
                assert!(stderr.contains("found a folder with something in it"), "{what}: {stderr}");
            } else {
                assert!(inside(folder.path()) == *new, "{what}: {:?}", inside(folder.path()).keys());
            }
        }
        kills
    }
}

/// Files with their content.
type Files = BTreeMap<PathBuf, Option<Vec<u8>>>;

/// [`content`] by paths relative to `folder`.
fn inside(folder: &Path) -> Files {
    content(folder)
        .into_iter()
        .map(|(path, bytes)| (path.strip_prefix(folder).unwrap().to_owned(), bytes))
        .collect()
}

/// As if everything temporary in `folder` were of yesterday.
fn age(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            age(&path);
        }
        if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".glioscope-")) {
            let yesterday = SystemTime::now() - Duration::from_secs(86_400);
            fs::File::open(&path).unwrap().set_modified(yesterday).unwrap();
        }
    }
}

/// The commands whose every call fits into a test of some seconds.
fn writers() -> [Writer; 3] {
    let writer = |arguments: &str, prepare| Writer {
        arguments: arguments.split(' ').map(str::to_owned).collect(),
        prepare,
    };
    [
        writer("sample --out OUT/sample", |folder| fs::create_dir(folder.join("sample")).unwrap()),
        writer("change --sample --force --csv OUT/a.csv", |folder| {
            fs::write(folder.join("a.csv"), "before").unwrap();
        }),
        writer("render --sample --view sagittal --size 64x64 --software --out OUT/a.png", |folder| {
            fs::write(folder.join("a.png"), "before").unwrap();
        }),
    ]
}

#[test]
fn commands_say_every_failure_and_leave_the_old_file() {
    if !may_trace() {
        return;
    }
    let mut failures = BTreeMap::new();
    for writer in writers() {
        let new = writer.undisturbed();
        for kind in CALLS {
            *failures.entry(kind.0).or_insert(0) += writer.fails(&new, kind, 1..);
        }
    }
    println!("failures: {failures:?}");
    for (call, least) in [("write", 17), ("fsync", 16), ("?renameat", 16)] {
        assert!(failures[call] >= least, "{failures:?}");
    }
}

#[test]
fn commands_killed_at_any_call_leave_the_old_or_the_new_file() {
    if !may_trace() {
        return;
    }
    let mut kills = 0;
    for writer in writers() {
        let new = writer.undisturbed();
        let calls = CALLS.iter().map(|(call, _)| *call).chain(REMOVING);
        kills += calls.map(|call| writer.is_killed(&new, call, 1..)).sum::<usize>();
    }
    println!("{kills} kills");
    assert!(kills >= 50, "{kills}");
}

/// A report takes seconds: few points, or all where `GLIOSCOPE_TEST_ROUNDS` says that there is time.
#[test]
fn a_report_that_fails_or_is_killed_leaves_the_old_one() {
    if !may_trace() {
        return;
    }
    let report = Writer {
        arguments: "report --mask A=OUT/case/mask.nii.gz --software --force --out OUT/report"
            .split(' ')
            .map(str::to_owned)
            .collect(),
        prepare: |folder| {
            let mask = sample_files().find(|(name, _)| *name == "t1-mask-2024-01-15.nii.gz").unwrap().1;
            ["case", "report"].iter().for_each(|name| fs::create_dir(folder.join(name)).unwrap());
            fs::write(folder.join("case/mask.nii.gz"), mask).unwrap();
            fs::write(folder.join("report/measure.json"), r#"{"case": "command line"}"#).unwrap();
            for name in ["window.png", "axial.png", "change.png"] {
                fs::write(folder.join("report").join(name), "a picture of the old report").unwrap();
            }
        },
    };
    let all = rounds() >= 100;
    let points = |few: &[usize]| if all { (1..100).collect() } else { few.to_vec() };
    let new = report.undisturbed();
    assert!(!new.contains_key(Path::new("report/change.png")), "one date");
    let few: [&[usize]; 4] = [&[4], &[3], &[1, 6], &[]];
    let failures =
        CALLS.iter().zip(few).map(|(kind, few)| report.fails(&new, *kind, points(few).into_iter()));
    let failures: Vec<usize> = failures.collect();
    let kills = report.is_killed(&new, "?rename", points(&[5]).into_iter());
    let kills = kills + report.is_killed(&new, "?unlink", points(&[1]).into_iter());
    println!("failures: {failures:?}, {kills} kills");
    assert!(
        failures[0] > 0 && failures[1] > 0 && failures[2] + failures[3] > 0 && kills > 0,
        "{failures:?} {kills}"
    );
}

/// Rounds of deeds: `GLIOSCOPE_TEST_ROUNDS`, for a longer search.
fn rounds() -> usize {
    std::env::var("GLIOSCOPE_TEST_ROUNDS").ok().and_then(|text| text.parse().ok()).unwrap_or(18)
}

/// Names the folder of [`deeds_to_be_disturbed`].
const FOLDER: &str = "GLIOSCOPE_TEST_DEEDS";
/// `limit`: it limits the size of files itself.
const MODE: &str = "GLIOSCOPE_TEST_DEEDS_MODE";

/// What the window writes. Each returns the error that was said.
struct Deeds {
    window: Window,
    autosave: Autosave,
    now: Instant,
    /// Report files, to be put in place.
    folder: PathBuf,
}

const NAMES: [&str; 7] = ["session", "autosave", "numbers", "table", "lines", "picture", "report"];

impl Deeds {
    fn new(folder: &Path) -> Self {
        let mut window = window_on(CaseRef::Sample, [700.0, 500.0], Theme::Light);
        perform(&mut window, EditCommand::MaximizePane(PaneId::Overlap));
        let state = folder.join("state");
        Self {
            window,
            autosave: Autosave::in_folder(&state).unwrap(),
            now: Instant::now(),
            folder: folder.to_owned(),
        }
    }

    fn file(&self, deed: &str) -> PathBuf {
        self.folder.join(match deed {
            "session" => "a.glioscope.json",
            "autosave" => "state/unsaved-0.glioscope.json",
            "numbers" => "numbers.json",
            "table" => "numbers.csv",
            "lines" => "lines.csv",
            "picture" => "picture.png",
            _ => "report/window.png",
        })
    }

    /// Work that was not there before.
    fn work_on(&mut self, round: usize) {
        let ruler = Ruler {
            name: format!("Line {round}"),
            from_mm: DVec3::ZERO,
            to_mm: DVec3::new(3.0, round as f64, 0.0),
            shape: Shape::Line,
            view: PaneId::Axial,
            time: 0,
        };
        perform(&mut self.window, EditCommand::AddRuler(Box::new(ruler)));
        perform(&mut self.window, EditCommand::ToggleRegion(1 + round as u32 % 7));
    }

    fn perform(&mut self, deed: &str) -> String {
        let file = self.file(deed);
        self.window.state_mut().work.error = None;
        match deed {
            "session" => issue(&mut self.window, AppCommand::SaveSessionTo(file)),
            "numbers" | "table" => issue(&mut self.window, AppCommand::ExportMeasurementsTo(file)),
            "lines" => issue(&mut self.window, AppCommand::ExportRulersTo(file)),
            "picture" => {
                issue(&mut self.window, AppCommand::ScreenshotTo(Some(PaneId::Overlap), file));
                self.window.run_steps(3);
            }
            "autosave" => {
                let work = &self.window.state().work;
                assert!(work.has_unsaved_work());
                self.autosave.keep(work, self.now);
                self.now += INTERVAL;
                let waits = self.autosave.keep(work, self.now);
                // Said once.
                let failure = self.autosave.take_failure().map(|failure| failure.to_string());
                return if waits.is_none() { String::new() } else { failure.unwrap_or("as before".into()) };
            }
            _ => {
                let folder = self.folder.join("report");
                let new = temporary_folder(&folder).unwrap();
                let names = ["measure.json", "window.png", "axial.png"].map(str::to_owned);
                for name in &names {
                    fs::write(new.path().join(name), format!("{name} at {:?}", self.now)).unwrap();
                }
                self.now += INTERVAL;
                let done = replace_files(&new, &folder, &names, &["old.png".to_owned()]);
                return done.err().map(|error| error.to_string()).unwrap_or_default();
            }
        }
        wait_for_workers(&mut self.window);
        error_text(&self.window)
    }
}

/// Sets the limit of the sizes of files that this process writes.
fn limit_files(bytes: Option<usize>) {
    let limit = bytes.map_or("unlimited".to_owned(), |bytes| bytes.to_string());
    let arguments = ["--pid", &std::process::id().to_string(), &format!("--fsize={limit}:unlimited")];
    assert!(Command::new("prlimit").args(arguments).status().unwrap().success());
}

/// Child process of [`the_window_says_every_failure_and_leaves_the_old_file`].
#[test]
#[ignore = "a child process of another test"]
fn deeds_to_be_disturbed() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else { return };
    let limits = std::env::var(MODE).is_ok_and(|mode| mode == "limit");
    let mut deeds = Deeds::new(&folder);
    let mut sizes: BTreeMap<&str, usize> = BTreeMap::new();
    let mut failures: BTreeMap<&str, usize> = BTreeMap::new();
    deeds.work_on(0);
    if limits {
        for deed in NAMES {
            assert_eq!(deeds.perform(deed), "", "{deed}");
            sizes.insert(deed, fs::metadata(deeds.file(deed)).unwrap().len() as usize);
            deeds.work_on(0);
        }
    } else {
        for deed in NAMES {
            fs::write(deeds.file(deed), format!("an old {deed}")).unwrap();
        }
        fs::write(folder.join("report/old.png"), "an old picture").unwrap();
    }
    for round in 1..=rounds() {
        for deed in NAMES {
            if limits && deed == "report" {
                // Renaming needs no space.
                continue;
            }
            deeds.work_on(round);
            let before = content(&folder);
            if limits {
                limit_files(Some(sizes[deed] * (round - 1) / rounds()));
            }
            let said = deeds.perform(deed);
            if limits {
                limit_files(None);
            }
            let mut after = content(&folder);
            let what = format!("{deed} in round {round}: {said}");
            if said.is_empty() {
                let name = deeds.file(deed);
                let written = after[&name].clone().unwrap();
                assert!(before.get(&name) != Some(&Some(written.clone())), "{what}");
                // A session's ellipsoids are beside it.
                after.retain(|path, _| before.contains_key(path));
                assert!(before.keys().all(|path| after.contains_key(path) || deed == "report"), "{what}");
            } else {
                *failures.entry(deed).or_default() += 1;
                assert!(after == before, "{what}: {:?}", after.keys());
                assert!(said == "as before" || said.contains("writing failed"), "{what}");
                assert_eq!(said.lines().count(), 1, "{what}");
            }
        }
    }
    println!("FAILED {}", serde_json::to_string(&failures).unwrap());
}

/// Runs [`deeds_to_be_disturbed`] and returns how often each failed.
fn failures_of_the_window(mut command: Command, mode: &str) -> BTreeMap<String, usize> {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("report")).unwrap();
    command.arg(std::env::current_exe().unwrap());
    let output = command
        .args(["--exact", "faults::deeds_to_be_disturbed", "--ignored", "--nocapture", "--test-threads=1"])
        .env(FOLDER, folder.path())
        .env(MODE, mode)
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .output()
        .unwrap();
    let stdout = String::from_utf8_lossy(&output.stdout);
    let found = stdout.lines().find_map(|line| line.split("FAILED {").nth(1));
    let found =
        found.unwrap_or_else(|| panic!("{mode}: {stdout}{}", String::from_utf8_lossy(&output.stderr)));
    print_line(&format!("{mode}: {{{found}"));
    serde_json::from_str(&format!("{{{found}")).unwrap()
}

#[test]
fn the_window_says_every_failure_and_leaves_the_old_file() {
    let mut limited = Command::new("sh");
    // Ignored, the signal leaves an error of the call.
    limited.args(["-c", "trap '' XFSZ; exec \"$0\" \"$@\""]);
    let failed = failures_of_the_window(limited, "limit");
    assert!(NAMES[..6].iter().all(|deed| failed[*deed] == rounds()), "{failed:?}");
    assert!(failed.values().sum::<usize>() >= 100, "{failed:?}");
    if !may_trace() {
        return;
    }
    let (syncs, renames) = ("fsync", "?rename,?renameat,?renameat2");
    let strace = |calls: &str, when: &str| {
        let mut strace = Command::new("strace");
        strace.args(["-f", "-qq", "--seccomp-bpf", "-o", "/dev/null", "-e", &format!("trace={calls}")]);
        strace.args(["-e", &format!("inject={calls}:error=EIO:when={when}")]);
        strace
    };
    for (mode, calls) in [("sync", syncs), ("rename", renames)] {
        let failed = failures_of_the_window(strace(calls, "1+"), mode);
        // Files of a report are synced when they are written, which here they aren't.
        let deeds = if mode == "sync" { &NAMES[..6] } else { &NAMES[..] };
        assert!(deeds.iter().all(|deed| failed[*deed] == rounds()), "{mode}: {failed:?}");
        assert!(failed.values().sum::<usize>() >= 100, "{failed:?}");
    }
    // Every third call of a thread: what failed before works again.
    let failed = failures_of_the_window(strace(renames, "2+3"), "some renames");
    for deed in ["session", "autosave", "picture"] {
        assert!((1..rounds()).contains(failed.get(deed).unwrap_or(&0)), "{failed:?}");
    }
}
