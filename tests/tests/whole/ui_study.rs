//! The study's window: some trials by keys, as a participant goes through them.

use std::{path::Path, time::Duration};

use egui::{Key, Theme};
use egui_kittest::{Harness, HarnessBuilder, kittest::Queryable};
use glioscope::{
    study::{Page, Study},
    window::study::StudyApp,
    words::Language,
};
use glioscope_core::study::{Answer, Score, Task, Truth, records};
use glioscope_render::{Gpu, LightingMode};
use glioscope_tests::{count_color, software_setup};
use strum::VariantArray;

use crate::study::settings;

/// How long a picture is looked at at least.
const LOOKED: Duration = Duration::from_millis(50);

type StudyWindow = Harness<'static, StudyApp>;

fn window(
    out: &Path,
    tasks: &[Task],
    size: [f32; 2],
    (language, dark): (Language, bool),
    px: u32,
) -> StudyWindow {
    let mut settings = settings(out, tasks, &[LightingMode::Slices, LightingMode::Traced]);
    (settings.language, settings.dark, settings.picture_px) = (language, dark, px);
    let study = Study::new(settings).unwrap();
    HarnessBuilder::default()
        .with_size(size)
        .with_theme(if dark { Theme::Dark } else { Theme::Light })
        .with_max_steps(60)
        .wgpu_setup(software_setup())
        .build_eframe(move |cc| {
            let state = cc.wgpu_render_state.as_ref().unwrap();
            let gpu = Gpu::from_parts(state.adapter.clone(), state.device.clone(), state.queue.clone());
            StudyApp::new(study, &gpu, &cc.egui_ctx)
        })
}

fn press(window: &mut StudyWindow, key: Key) {
    window.key_press(key);
    window.run_steps(2);
}

/// Goes on until a picture is on the screen.
fn to_picture(window: &mut StudyWindow) {
    for _ in 0..15_000 {
        match window.state().study.page() {
            Page::Shown { since_s: Some(_), .. } => {
                // A participant looks at it.
                std::thread::sleep(LOOKED);
                return;
            }
            Page::Shown { .. } | Page::Wait { .. } => {
                std::thread::sleep(Duration::from_millis(20));
                window.run_steps(1);
            }
            _ => press(window, Key::Space),
        }
    }
    panic!("{:?}", window.state().study.page());
}

/// Saves a picture of the window where GLIOSCOPE_TEST_PICTURES says so.
fn keep(window: &mut StudyWindow, name: &str) -> image::RgbaImage {
    let picture = window.render().unwrap();
    if let Some(folder) = std::env::var_os("GLIOSCOPE_TEST_PICTURES") {
        std::fs::create_dir_all(&folder).unwrap();
        picture.save(Path::new(&folder).join(format!("study-{name}.png"))).unwrap();
    }
    picture
}

#[test]
fn trials_are_answered_by_keys_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("answers.csv");
    let tasks = [Task::Nearer, Task::Depth];
    let mut window = window(&out, &tasks, [1280.0, 800.0], (Language::En, false), 256);
    window.run_steps(2);
    window.get_by_label("A study of seeing");
    press(&mut window, Key::Space);
    window.get_by_label("Which point is nearer?");
    window.get_by_label("First come pictures for practice: 1. They don't count.");
    to_picture(&mut window);
    window.get_by_label("Picture of the study. Which point is nearer?");
    window.get_by_label("Practice 1 of 1");
    let picture = keep(&mut window, "test-nearer");
    assert!(count_color(&picture, [255; 3], 2) > 100, "white circles");
    let truth = window.state().study.prepared().unwrap().scene.truth;
    let Truth::Is(right) = truth else { panic!("{truth:?}") };
    press(&mut window, if right == Answer::Left { Key::ArrowLeft } else { Key::ArrowRight });
    window.get_by_label("Right.");
    press(&mut window, Key::Space);
    window.get_by_label("Practice is over.");
    for number in 1..=2 {
        to_picture(&mut window);
        window.get_by_label(&format!("Picture {number} of 2"));
        press(&mut window, if right == Answer::Left { Key::Num1 } else { Key::Num2 });
        assert!(window.query_by_label("Right.").is_none(), "nothing is said of what counts");
    }
    window.get_by_label("How deep is the point?");
    to_picture(&mut window);
    window.get_by_label("Depth: none chosen");
    press(&mut window, Key::Num3);
    press(&mut window, Key::ArrowRight);
    window.get_by_label("Depth chosen: 31 %");
    press(&mut window, Key::Enter);
    assert!(matches!(window.state().study.page(), Page::Feedback { answer: Answer::Percent(31), .. }));
    press(&mut window, Key::Escape);
    assert_eq!(window.state().study.page(), &Page::Left);
    let rows = records(&std::fs::read_to_string(&out).unwrap()).unwrap();
    assert_eq!(rows.len(), 4);
    assert_eq!(rows[0].score, Score::Correct(true));
    assert!(rows.iter().all(|row| row.time_s >= LOOKED.as_secs_f64() && row.time_s < 60.0), "{rows:?}");
    assert_eq!(rows.iter().filter(|row| row.practice).count(), 2);
}

/// Every page and picture fits small and large windows, light and dark, in both languages. Its pictures are looked at.
#[test]
fn every_task_fits_its_window() {
    let folder = tempfile::tempdir().unwrap();
    let looks =
        [("en", [1280.0, 800.0], (Language::En, false)), ("de", [1024.0, 640.0], (Language::De, true))];
    for (name, size, look) in looks {
        let out = folder.path().join(format!("{name}.csv"));
        let px = if std::env::var_os("GLIOSCOPE_TEST_PICTURES").is_some() { 768 } else { 128 };
        let mut window = window(&out, Task::VARIANTS, size, look, px);
        let screen = egui::Rect::from_min_size(egui::Pos2::ZERO, size.into());
        let fits = |window: &StudyWindow, least: usize, what: &str| {
            let named: Vec<egui::Rect> =
                window.query_all_by_label_contains("").map(|node| node.rect()).collect();
            assert!(named.len() >= least, "{name} {what}: {named:?}");
            assert!(named.iter().all(|rect| screen.contains_rect(*rect)), "{name} {what}: {named:?}");
        };
        window.run_steps(2);
        keep(&mut window, &format!("{name}-welcome"));
        fits(&window, 5, "welcome");
        press(&mut window, Key::Space);
        for task in Task::VARIANTS {
            keep(&mut window, &format!("{name}-{task}-asked"));
            fits(&window, 5, &format!("{task} is asked"));
            let mut is_first = true;
            while window.state().study.trial().is_some_and(|trial| trial.task == *task) {
                to_picture(&mut window);
                if *task == Task::Depth {
                    press(&mut window, Key::Num4);
                }
                if std::mem::take(&mut is_first) {
                    keep(&mut window, &format!("{name}-{task}"));
                    fits(&window, 4, &task.to_string());
                }
                press(&mut window, if *task == Task::Depth { Key::Enter } else { Key::ArrowRight });
                if matches!(window.state().study.page(), Page::Feedback { .. }) {
                    press(&mut window, Key::Space);
                }
            }
        }
        keep(&mut window, &format!("{name}-done"));
        assert_eq!(window.state().study.page(), &Page::Done);
    }
}
