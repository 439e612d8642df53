//! The study of perception without a window: a robot goes through it, its answers are analysed, files are resumed and refused, and what is
//! marked is seen in the pictures.

use std::path::{Path, PathBuf};

use egui::Key;
use glioscope::{
    study::{Page, Prepared, Settings, Study, pictures::Painter},
    words::Language,
};
use glioscope_core::study::{Design, Record, Task, records};
use glioscope_render::{LightingMode, Preset};
use glioscope_tests::{answer, refusal, run, software_gpu};
use strum::VariantArray;

use crate::PROGRAM;

const TASKS: [Task; 4] = [Task::Nearer, Task::Depth, Task::Larger, Task::Shape];

pub fn settings(out: &Path, tasks: &[Task], lights: &[LightingMode]) -> Settings {
    Settings {
        design: Design {
            seed: 4,
            participant: 2,
            tasks: tasks.to_vec(),
            lights: lights.len(),
            repeats: 1,
            practice: 1,
        },
        lights: lights.to_vec(),
        quality: Preset::Draft,
        picture_px: 256,
        language: Language::En,
        dark: false,
        out: out.to_owned(),
    }
}

fn new_study(out: &Path) -> Study {
    Study::new(settings(out, &TASKS, &[LightingMode::Traced, LightingMode::Slices])).unwrap()
}

/// Leads on to the next picture, which is then on the screen at `now_s`.
fn to_picture(study: &mut Study, now_s: f64) {
    for _ in 0..5 {
        match study.page() {
            Page::Wait { .. } => {
                let scene = study.settings().scene(study.trial().unwrap()).unwrap();
                study.prepare(Prepared { scene, pictures: Vec::new() });
                study.tick(now_s);
            }
            Page::Shown { .. } => return study.drawn(now_s),
            _ => study.press(Key::Space, false, now_s - 1.0),
        }
    }
    panic!("{:?}", study.page());
}

fn written(path: &Path) -> Vec<Record> {
    records(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn robot(folder: &Path, participant: u32) -> PathBuf {
    let out = folder.join(format!("{participant}.csv"));
    let number = participant.to_string();
    let arguments = ["study", "--robot", "9", "--participant", &number, "--out", out.to_str().unwrap()];
    let done = run(
        PROGRAM,
        &[&arguments[..], &["--repeats", "2", "--practice", "1", "--lights", "traced,slices,cones"]].concat(),
    );
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    out
}

#[test]
fn a_robot_goes_through_the_whole_study_and_is_analysed() {
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = (1..=4).map(|participant| robot(folder.path(), participant)).collect();
    let rows = written(&files[0]);
    // Four tasks of 3 lights twice and one for practice, and 6 pairs and one for practice.
    assert_eq!(rows.len(), 4 * 7 + 7);
    assert!(rows.iter().all(|row| row.time_s > 0.5 && row.time_s < 8.0));
    let again = tempfile::tempdir().unwrap();
    assert_eq!(
        std::fs::read(robot(again.path(), 1)).unwrap(),
        std::fs::read(&files[0]).unwrap(),
        "the same bytes"
    );
    let names: Vec<&str> = files.iter().map(|path| path.to_str().unwrap()).collect();
    let (report, _) = answer(PROGRAM, &[&["study", "analyse", "--json"], &names[..]].concat());
    assert_eq!(report["participants"], serde_json::json!([1, 2, 3, 4]));
    assert_eq!(report["lights"], serde_json::json!(["traced", "slices", "cones"]));
    assert_eq!(report["tasks"].as_array().unwrap().len(), 5);
    // Means counted here.
    let all: Vec<Record> = files.iter().flat_map(|path| written(path)).collect();
    let times: Vec<f64> = all
        .iter()
        .filter(|row| row.task == Task::Depth && !row.practice && row.light == "slices")
        .map(|row| row.time_s)
        .collect();
    assert_eq!(times.len(), 8);
    let mean = times.iter().sum::<f64>() / 8.0;
    let found = report["tasks"][1]["measures"][1]["lights"][1]["mean"].as_f64().unwrap();
    assert!((found - mean).abs() < 1e-9, "{found} {mean}");
    let text = run(PROGRAM, &[&["study", "analyse"], &names[..]].concat());
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    for part in
        ["4 participants, 3 lights (traced, slices, cones)", "F(2, 6) = ", "(Bonferroni)", "preferred"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let twice = refusal(PROGRAM, &["study", "analyse", names[0], names[0]]);
    assert!(twice.contains("answered by participant 1 a second time"), "{twice}");
}

#[test]
fn a_study_resumes_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("answers.csv");
    let mut study = new_study(&out);
    let all = study.trials().to_vec();
    assert_eq!(written(&out), [], "a file from the start");
    for n in 0..2 {
        to_picture(&mut study, 10.0 * f64::from(n));
        study.press(Key::ArrowLeft, false, 10.0 * f64::from(n) + 1.5);
    }
    to_picture(&mut study, 30.0);
    study.press(Key::Escape, false, 31.0);
    assert_eq!(study.page(), &Page::Left);
    assert_eq!(written(&out).len(), 2, "what has no answer isn't kept");
    let mut study = new_study(&out);
    assert_eq!((study.resumed(), study.trial()), (2, Some(&all[2])));
    for n in 2..all.len() {
        to_picture(&mut study, 10.0 * n as f64);
        let keys = match study.trial().unwrap().task {
            Task::Depth => [Key::Num4, Key::Enter],
            _ => [Key::ArrowLeft; 2],
        };
        keys.iter().for_each(|key| study.press(*key, false, 10.0 * n as f64 + 2.25));
    }
    // Of practice the last page is what was right.
    assert_eq!(study.page(), &Page::Done);
    let rows = written(&out);
    let identity = |row: &Record| (row.task, row.trial, row.practice, row.scene);
    let planned: Vec<_> = all.iter().map(|t| (t.task, t.number, t.practice, t.scene)).collect();
    assert_eq!(rows.iter().map(identity).collect::<Vec<_>>(), planned);
    assert_eq!((rows[0].time_s, rows[5].time_s), (1.5, 2.25), "from the picture to the key");
    assert_eq!(new_study(&out).page(), &Page::Done);
}

#[test]
fn only_the_participants_own_answers_are_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("answers.csv");
    let mut study = new_study(&out);
    to_picture(&mut study, 0.0);
    study.press(Key::ArrowRight, false, 1.0);
    let before = std::fs::read(&out).unwrap();
    let refused = |change: &dyn Fn(&mut Settings)| {
        let mut other = settings(&out, &TASKS, &[LightingMode::Traced, LightingMode::Slices]);
        change(&mut other);
        Study::new(other).err().unwrap().to_string()
    };
    let line = refused(&|other| other.design.participant = 3);
    assert!(line.contains("trial 1 of nearer by participant 2 with seed 4"), "{line}");
    refused(&|other| other.design.seed = 5);
    refused(&|other| other.lights.reverse());
    refused(&|other| other.design.tasks.reverse());
    let data = folder.path().join("data.csv");
    std::fs::write(&data, "name,volume\nDoe,1\n").unwrap();
    let line = refused(&|other| other.out.clone_from(&data));
    assert!(line.contains("another first line"), "{line}");
    assert_eq!(std::fs::read_to_string(&data).unwrap(), "name,volume\nDoe,1\n");
    assert_eq!(std::fs::read(&out).unwrap(), before);
    for (arguments, expected) in [
        (&["study", "--participant", "1"][..], "no --out FILE"),
        (&["study", "--out", "x.csv"], "no --participant N"),
        (&["study", "--participant", "1", "--out", "x.nii"], "another ending"),
        (&["study", "--participant", "1", "--out", "x.csv", "--lights", "cones"], "two lights or more"),
        (&["study", "--participant", "1", "--out", "x.csv", "--lights", "cones,cones"], "each light once"),
        (&["study", "--participant", "1", "--out", "x.csv", "--lights", "lamp"], "--lights: found \"lamp\""),
        (&["study", "analyse", "/no/such.csv"], "/no/such.csv"),
    ] {
        let line = refusal(PROGRAM, arguments);
        assert!(line.contains(expected), "{line}");
    }
}

#[test]
fn an_answer_that_cant_be_written_is_kept_and_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("answers.csv");
    let mut study = new_study(&out);
    to_picture(&mut study, 0.0);
    let good = std::fs::read(&out).unwrap();
    std::fs::write(&out, "someone else's").unwrap();
    study.press(Key::ArrowRight, false, 1.0);
    assert!(matches!(study.page(), Page::Failed(_)), "{:?}", study.page());
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "someone else's", "left alone");
    std::fs::write(&out, &good).unwrap();
    study.press(Key::Space, false, 60.0);
    assert!(matches!(study.page(), Page::Feedback { .. }), "{:?}", study.page());
    assert_eq!(written(&out).len(), 1);
    assert_eq!(written(&out)[0].time_s, 1.0, "the time is that of the key");
}

#[test]
fn keys_choose_confirm_and_pause() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("answers.csv");
    let mut study =
        Study::new(settings(&out, &[Task::Depth], &[LightingMode::Traced, LightingMode::Slices])).unwrap();
    to_picture(&mut study, 0.0);
    let percent = |study: &Study| match study.page() {
        Page::Shown { percent, .. } => *percent,
        other => panic!("{other:?}"),
    };
    study.press(Key::Enter, false, 1.0);
    assert_eq!(percent(&study), None, "nothing is chosen yet");
    for (key, expected) in [
        (Key::ArrowRight, 51),
        (Key::ArrowUp, 61),
        (Key::ArrowDown, 51),
        (Key::Num0, 0),
        (Key::ArrowLeft, 0),
        (Key::Num9, 90),
        (Key::ArrowUp, 100),
        (Key::ArrowUp, 100),
    ] {
        study.press(key, true, 1.0);
        assert_eq!(percent(&study), Some(expected), "{key:?}");
    }
    study.press(Key::Enter, true, 1.0);
    assert_eq!(percent(&study), Some(100), "a held key confirms nothing");
    study.press(Key::Enter, false, 2.0);
    assert_eq!(written(&out)[0].answer.text(), "100");
    // Space while a picture is shown pauses after it; no time is lost, as the picture stays.
    to_picture(&mut study, 10.0);
    study.press(Key::Space, false, 11.0);
    assert!(study.pauses() && percent(&study).is_none());
    study.press(Key::Num3, false, 12.0);
    study.press(Key::Enter, false, 13.0);
    assert_eq!((study.page(), written(&out)[1].time_s), (&Page::Paused, 3.0));
    study.press(Key::ArrowLeft, false, 14.0);
    assert_eq!(study.page(), &Page::Paused, "other keys do nothing");
}

#[test]
fn a_key_held_over_from_the_picture_before_is_no_answer() {
    let folder = tempfile::tempdir().unwrap();
    let mut study = new_study(&folder.path().join("answers.csv"));
    to_picture(&mut study, 0.0);
    study.press(Key::ArrowLeft, true, 0.1);
    assert!(matches!(study.page(), Page::Shown { .. }));
    // Nor one before the picture is on the screen.
    let mut study = new_study(&folder.path().join("others.csv"));
    study.press(Key::Space, false, 0.0);
    study.press(Key::Space, false, 0.0);
    study.prepare(Prepared {
        scene: study.settings().scene(study.trial().unwrap()).unwrap(),
        pictures: Vec::new(),
    });
    assert_eq!(study.tick(0.1), Some(0.5), "the cross is shown for 0.6 s");
    study.press(Key::ArrowLeft, false, 0.2);
    assert!(matches!(study.page(), Page::Wait { .. }));
    study.tick(0.7);
    study.press(Key::ArrowLeft, false, 0.8);
    assert_eq!(study.page(), &Page::Shown { since_s: None, percent: None });
}

/// The pick of each mark's pixel lies on the marked point, within a voxel and the pixel: what is marked is what is seen, in every light.
#[test]
fn marked_points_are_seen_in_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let gpu = software_gpu();
    let lights = LightingMode::VARIANTS;
    let settings = settings(&folder.path().join("answers.csv"), &TASKS, lights);
    let mut painter = Painter::new(&gpu, &settings).unwrap();
    let (mut seen, mut worst) = (0, 0.0_f64);
    for trial in settings.design.trials() {
        let (scene, regions) = painter.scene(&trial).unwrap();
        let picture = painter.picture(&regions, lights[trial.light]).unwrap();
        let frame = painter.renderer().frame().unwrap();
        let side = f64::from(settings.picture_px);
        for mark in &scene.marks {
            let pixel = (mark.at * side).as_uvec2();
            let pick = frame.pick(&gpu, pixel.x, pixel.y).unwrap().unwrap();
            let off = pick.world_mm.distance(mark.world_mm);
            worst = worst.max(off);
            seen += 1;
            let expected = match (trial.task, scene.marks.len() > 1 && mark.at == scene.marks[1].at) {
                (Task::Larger, is_right) => 2 << u32::from(is_right),
                _ => 1,
            };
            assert_eq!(pick.bits, expected, "{trial:?}");
            assert!(off < 1.0, "{trial:?}: {off} mm");
        }
        // Something of the picture is lit, and something is the ground.
        let ground = picture.pixels[0];
        let solid = picture.pixels.iter().filter(|pixel| **pixel != ground).count() as f64
            / picture.pixels.len() as f64;
        assert!((0.4..0.95).contains(&solid), "{trial:?}: {solid}");
    }
    glioscope_tests::print_line(&format!("{seen} marks, at most {worst:.2} mm off"));
    // Two marks of two tasks, one of two others, for each light and for practice.
    assert_eq!(seen, 6 * (lights.len() + 1));
}
