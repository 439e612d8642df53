//! The cohort in the window: a made one with known overlaps, and synthetic ones as large as a trial.

use std::{path::Path, time::Instant};

use egui::{Theme, accesskit::Role, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use glioscope::{
    command::{AppCommand, Workstation},
    model::{
        CaseRef,
        cohort::{Axis, CohortSetting, GlyphScale, Order},
    },
};
use glioscope_cohort::{Collected, Judgement, Quantity, Reduce, Verdict, Verdicts};
use glioscope_core::Progress;
use glioscope_tests::{
    MASK_COLORS, Window, count_color, error_text, perform, print_line, wait_for_workers,
    window_painted_on_cpu, window_with,
};

use crate::{glioscope_cohort, made, synthetic};

const SIZE: [f32; 2] = [1280.0, 720.0];

fn window(folder: &Path, theme: Theme) -> Window {
    let mut work = Workstation::default();
    work.open_cohort(folder);
    let mut window = window_with(work, SIZE, theme);
    wait_for_workers(&mut window);
    window
}

/// The setting that the window shows.
fn setting(window: &Window) -> CohortSetting {
    let cohort = window.state().work.cohort.as_ref().unwrap();
    let suited = || CohortSetting::suited_to(&Collected::read(&cohort.folder, &Progress::new()).unwrap());
    cohort.setting.clone().unwrap_or_else(suited)
}

fn set(window: &mut Window, change: impl FnOnce(&mut CohortSetting)) {
    let mut setting = setting(window);
    change(&mut setting);
    perform(window, AppCommand::SetCohort(Box::new(setting)));
}

/// The names of the cases in sight, in reading order, and the places of their cells.
fn cells(window: &Window) -> Vec<(String, egui::Rect)> {
    let mut cells: Vec<(String, egui::Rect)> = window
        .query_all_by_role(Role::Button)
        .filter_map(|node| {
            let label = node.accesskit_node().label()?;
            let name = label.split(',').next().filter(|name| name.starts_with("case-"))?;
            Some((name.to_owned(), node.rect()))
        })
        .collect();
    cells.sort_by(|(_, a), (_, b)| (a.top(), a.left()).partial_cmp(&(b.top(), b.left())).unwrap());
    cells
}

fn names(window: &Window) -> Vec<String> {
    cells(window).into_iter().map(|(name, _)| name).collect()
}

fn picture(window: &mut Window, name: &str) -> image::RgbaImage {
    let picture = window.render().unwrap();
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        picture.save(Path::new(&folder).join(format!("{name}.png"))).unwrap();
    }
    picture
}

/// A made cohort, computed and grouped, and where its input is.
fn computed(cases: usize) -> (tempfile::TempDir, std::path::PathBuf) {
    let (folder, input) = made::cohort(cases);
    let out = folder.path().join("out");
    let compute = ["participant", "--compute", "metrics,change"];
    for arguments in [compute.as_slice(), &["group"]] {
        let (code, _, stderr) = glioscope_cohort(&input, &out, arguments);
        assert_eq!(code, 0, "{stderr}");
    }
    (folder, out)
}

#[test]
fn a_cohort_is_sorted_filtered_and_opens_its_cases() {
    let (folder, out) = computed(6);
    let mut window = window(&out, Theme::Light);
    assert!(window.query_by_label("6 of 6 cases shown").is_some());
    // Case n has b moved by 1 + n % 4 of 12 voxels at the last date: its Dice with the reference is known.
    let dice =
        |reduce| Quantity { of: vec!["ref".into(), "b".into()], ..Quantity::new("pairs", "dice", reduce) };
    set(&mut window, |setting| {
        (setting.sort, setting.order) = (Some(dice(Reduce::Last)), Order::Ascending);
        (setting.color, setting.cell_points) = (Some(dice(Reduce::Last)), 100.0);
    });
    let expected = ["case-003", "case-002", "case-001", "case-005", "case-000", "case-004"];
    assert_eq!(names(&window), expected);
    let value = made::dice_of(4, made::BOX + 2);
    let label = format!("case-003, last dice, ref with b: {value:.4}");
    assert!(window.query_by_label(&label).is_some(), "{label}");
    set(&mut window, |setting| setting.order = Order::Descending);
    // Equals stay in the order of their names.
    assert_eq!(names(&window), ["case-000", "case-004", "case-001", "case-005", "case-002", "case-003"]);
    // The pixels of a cell: all three masks that are drawn, none below the grid.
    set(&mut window, |setting| setting.masks = ["ref", "a", "b"].map(str::to_owned).into());
    let seen = picture(&mut window, "cohort-made");
    for (name, rect) in cells(&window) {
        let cell = glioscope_tests::crop(&seen, rect);
        let counts = MASK_COLORS.map(|color| count_color(&cell, color, 2));
        assert!(counts.iter().all(|count| *count > 100), "{name}: {counts:?}");
    }
    // At most 11 of 12 voxels: what is less than the axis allows is left out, and a name.
    set(&mut window, |setting| {
        setting.axes =
            vec![Axis { range: Some([value - 0.01, value + 0.1]), ..Axis::new(dice(Reduce::Last)) }];
    });
    assert_eq!(names(&window), ["case-002", "case-003"]);
    assert!(window.query_by_label("2 of 6 cases shown").is_some());
    set(&mut window, |setting| setting.search = "003".into());
    assert_eq!(names(&window), ["case-003"]);
    window.get_by_label(&label).click();
    wait_for_workers(&mut window);
    let work = &window.state().work;
    assert_eq!(error_text(&window), "");
    let opened = work.doc.as_ref().map(|doc| doc.case.clone());
    assert_eq!(opened, Some(CaseRef::Path(folder.path().join("in/case-003"))));
    assert!(work.cohort_in_front().is_none(), "the case is in front");
    window.key_press(egui::Key::F4);
    window.run_ok();
    assert_eq!(names(&window), ["case-003"], "back as it was");
    // The files have moved.
    std::fs::rename(folder.path().join("in"), folder.path().join("moved")).unwrap();
    window.get_by_label(&label).click();
    wait_for_workers(&mut window);
    let error = error_text(&window);
    assert!(
        error.contains("case-003: found nothing there, expected the files of case-003")
            && !error.contains('\n'),
        "{error}"
    );
    assert!(window.state().work.cohort_in_front().is_some());
    // A key of the case that isn't seen changes nothing.
    let before = window.state().work.doc.clone();
    window.key_press(egui::Key::L);
    window.run_ok();
    assert_eq!(window.state().work.doc, before);
}

#[test]
fn a_brush_filters_and_a_click_clears_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    synthetic::cohort(&out, 60);
    let mut window = window(&out, Theme::Dark);
    let label = "Distribution of least dice over 60 cases";
    let rect = window.get_by_label(label).rect();
    let at = |share: f32| rect.left_center() + vec2(rect.width() * share, 0.0);
    let press = |window: &mut Window, at: egui::Pos2, pressed: bool| {
        let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
        window.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
        window.run_ok();
    };
    for (place, pressed) in [(0.5, Some(true)), (0.7, None), (1.0, None), (1.0, Some(false))] {
        window.event(egui::Event::PointerMoved(at(place)));
        window.run_ok();
        if let Some(pressed) = pressed {
            press(&mut window, at(place), pressed);
        }
    }
    let of = |window: &Window| setting(window).axes[0].clone();
    let axis = of(&window);
    let [low, high] = axis.range.unwrap();
    assert!(high.is_infinite(), "to the end of the axis");
    let collected = Collected::read(&out, &Progress::new()).unwrap();
    let passing = collected.numbers(&axis.quantity).into_iter().filter(|dice| *dice >= low).count();
    assert!((1..60).contains(&passing));
    assert!(window.query_by_label(&format!("{passing} of 60 cases shown")).is_some(), "{passing}");
    picture(&mut window, "cohort-brushed");
    for pressed in [true, false] {
        press(&mut window, at(0.2), pressed);
    }
    assert_eq!(of(&window).range, None);
    assert!(window.query_by_label("60 of 60 cases shown").is_some());
}

#[test]
fn the_grid_is_written_as_svg_and_pdf() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    synthetic::cohort(&out, 60);
    let mut window = window(&out, Theme::Dark);
    set(&mut window, |setting| setting.search = "case-0001".into());
    let write = |window: &mut Window, name: &str| {
        let path = folder.path().join(name);
        perform(window, AppCommand::ExportCohortTo(path.clone()));
        wait_for_workers(window);
        assert_eq!(error_text(window), "");
        std::fs::read(path).unwrap()
    };
    let svg = String::from_utf8(write(&mut window, "a.svg")).unwrap();
    let named = (0..60).filter(|n| svg.contains(&format!(">case-{n:05}<"))).collect::<Vec<_>>();
    assert_eq!(named, (10..20).collect::<Vec<_>>(), "those shown, and no other");
    assert!(svg.contains("cases 1 to 10 of 10 shown (60 in the cohort)") && svg.contains(">net<"), "{svg}");
    // Every region has a polygon for each of its masks: at least one ring of nine layers and three sectors, and the bar.
    let polygons = svg.matches("<polygon").count();
    assert!((10 * 10..10 * 13 + 20).contains(&polygons), "{polygons}");
    let pdf = write(&mut window, "a.pdf");
    assert!(
        pdf.starts_with(b"%PDF-") && pdf == write(&mut window, "b.pdf"),
        "the same figure, the same bytes"
    );
    if let Ok(pictures) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        for name in ["a.svg", "a.pdf"] {
            std::fs::copy(folder.path().join(name), Path::new(&pictures).join(format!("cohort-{name}")))
                .unwrap();
        }
    }
}

#[test]
fn cases_are_read_in_a_random_order_without_names_and_verdicts_are_saved_at_once() {
    let (_folder, out) = computed(4);
    let mut window = window(&out, Theme::Light);
    let begin = || AppCommand::BeginReading { reader: "Dr A".into(), seed: 5, names_hidden: true };
    perform(&mut window, begin());
    wait_for_workers(&mut window);
    assert_eq!(error_text(&window), "");
    let lists = || Verdicts::all(&out).unwrap().remove(0);
    let order: Vec<String> = lists().cases.into_iter().map(|(case, _)| case).collect();
    assert_eq!(window.state().work.read_case(), Some(order[0].as_str()));
    let hidden = |window: &Window| {
        let work = &window.state().work;
        let ids = ["ref", "a", "b", "c"];
        let mut names = ids.map(|id| work.doc.as_ref().unwrap().edit.masks.name(id));
        let of_ids = names.clone();
        names.sort();
        assert_eq!(names, ["Mask A", "Mask B", "Mask C", "Mask D"]);
        assert!(!work.has_unsaved_work(), "the reader did nothing");
        of_ids
    };
    let mut seen = vec![hidden(&window)];
    picture(&mut window, "cohort-reading");
    window.get_by_label("Mend").click();
    window.run_ok();
    window.get_by_label("4 of 5 stars").click();
    window.run_ok();
    let given = lists().of(&order[0]);
    assert_eq!((given.judgement, given.stars), (Some(Judgement::Mend), Some(4)), "saved at once");
    assert!(window.query_by_label("1 of 4 cases read").is_some());
    for case in &order[1..] {
        window.key_press(egui::Key::F8);
        window.run_ok();
        wait_for_workers(&mut window);
        assert_eq!(window.state().work.read_case(), Some(case.as_str()));
        seen.push(hidden(&window));
    }
    seen.dedup();
    assert!(seen.len() > 1, "another order of names for each case");
    // The cohort's tables name who made what.
    window.key_press(egui::Key::F4);
    window.run_ok();
    assert!(cells(&window).is_empty());
    perform(&mut window, AppCommand::EndReading);
    wait_for_workers(&mut window);
    assert_eq!(cells(&window).len(), 4);
    // Another reader, who sees names, agrees on the one case that both have judged.
    let mut other = Verdicts::begin(&out, "B", 9, false, &order).unwrap();
    let mend = Verdict { judgement: Some(Judgement::Mend), stars: Some(2), reasons: "=1".into() };
    other.give(&out, &order[0], mend).unwrap();
    perform(&mut window, begin());
    wait_for_workers(&mut window);
    assert_eq!(
        window.state().work.read_case(),
        Some(order[1].as_str()),
        "goes on with the first one without a verdict"
    );
    let path = out.with_file_name("verdicts.csv");
    perform(&mut window, AppCommand::ExportVerdictsTo(path.clone()));
    assert_eq!(error_text(&window), "");
    let csv = std::fs::read_to_string(&path).unwrap();
    let position = other.cases.iter().position(|(case, _)| *case == order[0]).unwrap() + 1;
    assert!(csv.contains(&format!("B,9,false,{position},{},mend,2,'=1\r\n", order[0])), "{csv}");
    let agreement = std::fs::read_to_string(out.with_file_name("verdicts-agreement.csv")).unwrap();
    assert!(
        agreement.contains("Cohen's kappa,B; Dr A,1,") && agreement.contains("ICC(2,1) of stars"),
        "{agreement}"
    );
}

/// What is measured is printed, with pictures where they are asked for; what is asserted is generous.
#[test]
fn ten_thousand_cases_are_drawn_as_quickly_as_two_hundred() {
    for cases in [200, 10_000] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        synthetic::cohort(&out, cases);
        let started = Instant::now();
        let collected = Collected::read(&out, &Progress::new()).unwrap();
        let read = started.elapsed();
        assert_eq!(collected.cases().len(), cases);
        for (theme, name) in [(Theme::Dark, "dark"), (Theme::Light, "light")] {
            let mut window = window(&out, theme);
            picture(&mut window, &format!("cohort-{cases}-{name}"));
            set(&mut window, |setting| (setting.cell_points, setting.scale) = (44.0, GlyphScale::Same));
            picture(&mut window, &format!("cohort-{cases}-small-{name}"));
        }
        // As in a window on a software adapter.
        let mut window = window_painted_on_cpu(CaseRef::Sample, SIZE, Theme::Dark);
        perform(&mut window, AppCommand::OpenCohortAt(out.clone()));
        wait_for_workers(&mut window);
        for cell in [84.0, 44.0] {
            set(&mut window, |setting| setting.cell_points = cell);
            let middle = egui::pos2(640.0, 300.0);
            window.event(egui::Event::PointerMoved(middle));
            window.run_ok();
            let mut times = Vec::new();
            for _ in 0..40 {
                let (unit, phase) = (egui::MouseWheelUnit::Point, egui::TouchPhase::Move);
                window.event(egui::Event::MouseWheel {
                    unit,
                    delta: vec2(0.0, -60.0),
                    phase,
                    source: egui::MouseWheelSource::Wheel,
                    modifiers: egui::Modifiers::NONE,
                });
                let started = Instant::now();
                window.step();
                times.push(started.elapsed());
            }
            times.sort();
            let (median, slow) = (times[times.len() / 2], times[times.len() * 95 / 100]);
            print_line(&format!(
                "cohort of {cases}: tables read in {:.0} ms; frame of the grid with cells of {cell} points, scrolled: median {:.1} ms, p95 {:.1} ms",
                read.as_secs_f64() * 1e3,
                median.as_secs_f64() * 1e3,
                slow.as_secs_f64() * 1e3
            ));
            assert!(median.as_secs_f64() < 1.0, "{median:?}");
        }
        // Only what is in sight is drawn.
        assert!(cells(&window).len() < 700, "{}", cells(&window).len());
    }
}
