//! Layouts as pictures to look at, and what slices side by side cost. Run by hand, as both take minutes:
//! `GLIOSCOPE_TEST_PICTURES=FOLDER cargo nextest run -p glioscope-tests -E 'test(ui_layouts)' --run-ignored all --no-capture`

use std::{path::Path, time::Instant};

use egui::{Event, Modifiers, MouseWheelSource, MouseWheelUnit, Theme, TouchPhase, Vec2};
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{EditCommand, LookCommand},
    model::{
        CaseRef, Fusion, PaneId, SecondImage,
        layout::{Held, Task},
    },
};
use glioscope_core::with_samples;
use glioscope_render::{ColorMap, flat::Mixing};
use glioscope_tests::{
    Window, error_text, maximized, perform, print_line, real_data, wait_for_workers, window_as_opened,
    window_painted_on_cpu,
};

const RATERS: [&str; 5] = ["hnfnetv1-20", "isen-20", "scan-20", "sanet0-20", "yixinmpl-20"];

/// A case of the glioma: so many masks at so many dates, with these images; at each date other raters, so that something changes.
fn glioma(folder: &Path, masks: usize, dates: usize, images: &[&str]) -> CaseRef {
    let file = |name: &str| folder.join(format!("{name}.nii.gz")).display().to_string();
    let time = |date: usize| if dates > 1 { format!("@2024-0{}-01", date + 1) } else { String::new() };
    let mask = |date: usize, mask: usize| {
        let rater = RATERS[(mask + date) % RATERS.len()];
        format!("M{}={}:1,2,4{}", mask + 1, file(rater), time(date))
    };
    let image = |date: usize, name: &str| format!("{name}={}{}", file(name), time(date));
    CaseRef::Arguments {
        masks: (0..dates).flat_map(|date| (0..masks).map(move |n| mask(date, n))).collect(),
        contexts: (0..dates).flat_map(|date| images.iter().map(move |name| image(date, name))).collect(),
    }
}

fn fuse(harness: &mut Window, id: &str) {
    let second = Some(SecondImage { id: id.into(), time: None });
    let fusion = Fusion { second, mixing: Mixing::Over, map: ColorMap::Hot, ..Fusion::default() };
    perform(harness, EditCommand::SetFusion(Box::new(fusion)));
}

#[test]
#[ignore = "writes pictures to the folder in GLIOSCOPE_TEST_PICTURES"]
fn layouts_of_few_and_many_masks_and_dates_as_pictures() {
    let (Ok(out), Some(folder)) =
        (std::env::var("GLIOSCOPE_TEST_PICTURES"), real_data("glioma-5-algorithms"))
    else {
        return;
    };
    // Every layout that suits the case, and the one that it opens with.
    let all = [Task::CompareMasks, Task::FollowUp, Task::Response, Task::Fusion, Task::Explain, Task::Read];
    let tasks = std::iter::once(None).chain(all.map(Some));
    let mut count = 0;
    for (masks, dates) in [1, 3, 5].into_iter().flat_map(|masks| (1..=4).map(move |dates| (masks, dates))) {
        for task in tasks.clone() {
            let held = Held { dates, images: 2, has_pet: false, masks };
            if task.is_some_and(|task| !task.suits(held)) {
                continue;
            }
            // Light and dark, small and large in turn, each with every layout.
            count += 1;
            let (is_dark, is_large) = (count % 2 == 0, count / 2 % 2 == 0);
            let case = glioma(&folder, masks, dates, &["t1c", "fla"]);
            let theme = if is_dark { Theme::Dark } else { Theme::Light };
            let (size, scale) = if is_large { ([1920.0, 1080.0], 2.0) } else { ([1280.0, 720.0], 1.0) };
            let mut harness = window_as_opened(case, size, theme, scale);
            harness.run_ok();
            if let Some(task) = task {
                perform(&mut harness, EditCommand::SetTask(task));
            }
            if task == Some(Task::Fusion) {
                fuse(&mut harness, "fla");
            }
            wait_for_workers(&mut harness);
            assert_eq!(error_text(&harness), "", "{task:?}");
            let picture = harness.render().unwrap();
            assert_eq!(
                [picture.width(), picture.height()],
                if is_large { [3840, 2160] } else { [1280, 720] }
            );
            let name = format!(
                "{masks}-masks-{dates}-dates-{}-{}-{}x{}.png",
                task.map_or("as opened", Task::name).to_lowercase().replace(' ', "-"),
                if is_dark { "dark" } else { "light" },
                picture.width(),
                picture.height()
            );
            picture.save(Path::new(&out).join(&name)).unwrap();
            print_line(&name);
        }
    }
}

/// Processor time of this process until now, seconds.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    // User and system time are fields 14 and 15, in hundredths; the name before them ends with a parenthesis.
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<f64>().unwrap() / 100.0).sum()
}

/// A number of /proc/self/status in MiB.
fn status_mib(key: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with(key)).unwrap();
    let kib: f64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    kib / 1024.0
}

#[test]
#[ignore = "measures time: run alone"]
fn scrolling_six_slices_side_by_side_four_of_them_fused() {
    let Some(folder) = real_data("glioma-5-algorithms") else { return };
    let mut harness =
        window_painted_on_cpu(glioma(&folder, 1, 2, &["t1c", "t2", "fla"]), [1920.0, 1080.0], Theme::Dark);
    harness.run_ok();
    perform(&mut harness, EditCommand::TogglePane(PaneId::SideBySide));
    let rect = maximized(&mut harness, PaneId::SideBySide);
    harness.get_by_label("All images").click_accesskit();
    fuse(&mut harness, "fla");
    wait_for_workers(&mut harness);
    harness.event(Event::PointerMoved(rect.min + rect.size() * egui::vec2(0.25, 0.15)));
    harness.run_ok();
    let (mut steps, mut with_picture, mut cpu) = (Vec::new(), Vec::new(), 0.0);
    for _ in 0..30 {
        let (started, cpu_before) = (Instant::now(), cpu_seconds());
        harness.event(Event::MouseWheel {
            unit: MouseWheelUnit::Line,
            delta: Vec2::new(0.0, -1.0),
            phase: TouchPhase::Move,
            modifiers: Modifiers::NONE,
            source: MouseWheelSource::Wheel,
        });
        harness.step();
        steps.push(started.elapsed().as_secs_f64() * 1e3);
        cpu += cpu_seconds() - cpu_before;
        let picture = harness.render().unwrap();
        with_picture.push(started.elapsed().as_secs_f64() * 1e3);
        assert_eq!(picture.width(), 1920);
    }
    for (what, times) in [("frame", &mut steps), ("frame and its picture read back", &mut with_picture)] {
        times.sort_by(f64::total_cmp);
        print_line(&format!("{what}: median {:.1} ms, {:.1} to {:.1}", times[15], times[0], times[29]));
    }
    print_line(&format!("processor time of a frame: {:.1} ms", cpu / 30.0 * 1e3));
    if let Ok(out) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        harness.render().unwrap().save(Path::new(&out).join("side-by-side.png")).unwrap();
    }
}

#[test]
#[ignore = "measures memory: run alone"]
fn memory_of_four_dates_of_four_images() {
    let Some(folder) = real_data("glioma-5-algorithms") else { return };
    let empty = status_mib("VmRSS");
    let case = glioma(&folder, 1, 4, &["t1", "t1c", "t2", "fla"]);
    let mut harness = window_painted_on_cpu(case, [1920.0, 1080.0], Theme::Dark);
    harness.run_ok();
    print_line(&format!("opened: {:.0} MiB", status_mib("VmRSS") - empty));
    perform(&mut harness, EditCommand::TogglePane(PaneId::SideBySide));
    maximized(&mut harness, PaneId::SideBySide);
    harness.get_by_label("All images").click_accesskit();
    wait_for_workers(&mut harness);
    for time in 0..4 {
        perform(&mut harness, LookCommand::SetTime(time));
        wait_for_workers(&mut harness);
    }
    let images = &harness.state().work.world.case().unwrap().time_points;
    let stored: usize = images
        .iter()
        .flat_map(|time| &time.contexts)
        .map(|c| with_samples!(c.volume.samples(), v => size_of_val(v.as_slice())))
        .sum();
    let (now, most) = (status_mib("VmRSS") - empty, status_mib("VmHWM") - empty);
    print_line(&format!(
        "stored {:.0} MiB; all shown: {now:.0} MiB, at most {most:.0} MiB, more than before the window",
        stored as f64 / 1048576.0
    ));
}
