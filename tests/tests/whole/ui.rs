//! The window without a display, driven by simulated input: egui_kittest on the software adapter.

use egui::{Modifiers, Theme};
use egui_kittest::{Harness, kittest::Queryable};
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, PaneId, session},
    views::closeup::CloseupPane,
    window::GlioscopeApp,
};
use glioscope_tests::{
    Dropped, MASK_COLORS, Window, count_color, crop, drafting_window_on, error_text, issue, sample, screens,
    window_on, write_cube,
};

const SIZE: [f32; 2] = [1280.0, 800.0];
/// The colour of T2, the sample's second mask.
const TEAL: [u8; 3] = MASK_COLORS[1];

fn closeup<'a>(harness: &'a Harness<'_, GlioscopeApp>) -> &'a CloseupPane {
    harness.state().panes.get(PaneId::Closeup).unwrap()
}

fn t2_only(harness: &Harness<'_, GlioscopeApp>) -> u32 {
    let app = harness.state();
    let time_point = app.work.world.time_point(app.work.doc.as_ref().unwrap()).unwrap();
    1 << time_point.regions.mask_ids().iter().position(|id| id == "T2").unwrap()
}

fn shows(harness: &Harness<'_, GlioscopeApp>, bits: u32) -> bool {
    let work = &harness.state().work;
    work.world.selection(work.doc.as_ref().unwrap()).shows(bits)
}

/// Number of T2's pixels in the closeup: the region of T2 alone, visible inside the lens.
fn t2_in_closeup(harness: &mut Window) -> usize {
    let rect = harness.state().pane_rect(PaneId::Closeup).unwrap();
    let picture = harness.render().unwrap();
    // Exclude the legend, whose swatches have its colour too.
    let rect = egui::Rect::from_min_max(rect.min + egui::vec2(0.0, 130.0), rect.max);
    count_color(&crop(&picture, rect), TEAL, 40)
}

#[test]
fn clicking_a_segment_hides_its_region_everywhere_and_undo_restores_it() {
    let mut harness = sample();
    let bits = t2_only(&harness);
    let before = t2_in_closeup(&mut harness);
    assert!(before > 2000, "T2 alone is visible in the closeup: {before} pixels");

    harness.get_all_by_label_contains("T2 only,").next().unwrap().click();
    harness.run_ok();
    assert!(!shows(&harness, bits));
    let hidden = t2_in_closeup(&mut harness);
    assert!(hidden * 20 < before, "hidden in the closeup: {hidden} of {before} pixels");
    assert!(harness.query_by_label_contains("6 of 7 shown").is_some());

    harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::Z);
    harness.run_ok();
    assert!(shows(&harness, bits));
    assert_eq!(t2_in_closeup(&mut harness), before);

    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, egui::Key::Z);
    harness.run_ok();
    assert!(!shows(&harness, bits), "redo hides it again");
}

#[test]
fn the_table_check_box_hides_a_region() {
    let mut harness = sample();
    let bits = t2_only(&harness);
    harness.get_by_label("Show T2").click();
    harness.run_ok();
    assert!(!shows(&harness, bits));
    harness.get_by_label("Show all").click();
    harness.run_ok();
    assert!(shows(&harness, bits));
}

#[test]
fn hovering_the_closeup_shows_the_slices_of_the_surface_and_a_click_pins_them() {
    let mut harness = sample();
    let before = harness.state().work.doc.as_ref().unwrap().nav.cursor_mm;
    let rect = harness.state().pane_rect(PaneId::Closeup).unwrap();
    harness.hover_at(rect.center());
    harness.run_ok();
    let app = harness.state();
    let doc = app.work.doc.as_ref().unwrap();
    let picked = *closeup(&harness).canvas.hover().expect("the tumour is in the middle of the closeup");
    assert_eq!(doc.nav.crosshair_mm(), picked.world_mm);
    assert_ne!(picked.world_mm, before);
    assert_eq!(doc.nav.cursor_mm, before, "hovering pins nothing");
    // 0.1 mm further along the line of sight lies the picked region.
    let inwards = (picked.world_mm - doc.nav.camera.eye_mm()).try_normalize().unwrap() * 0.1;
    let index = &app.work.world.time_point(doc).unwrap().index;
    assert_eq!(index.at_mm(picked.world_mm + inwards), picked.bits);
    let crosshair = |harness: &Window| harness.state().work.doc.as_ref().unwrap().nav.crosshair_mm();
    // Over a pane without places, the crosshair returns to where it is pinned.
    let elsewhere = harness.state().pane_rect(PaneId::Overlap).unwrap().center();
    harness.hover_at(elsewhere);
    harness.run_ok();
    assert_eq!(crosshair(&harness), before);
    harness.hover_at(rect.center());
    harness.drag_at(rect.center());
    harness.drop_at(rect.center());
    harness.run_ok();
    harness.hover_at(elsewhere);
    harness.run_ok();
    assert_eq!(crosshair(&harness), picked.world_mm, "pinned by the click");
}

#[test]
fn clicking_a_slice_moves_the_shared_crosshair() {
    let mut harness = sample();
    let rect = harness.state().pane_rect(PaneId::Axial).unwrap();
    let before = harness.state().work.doc.as_ref().unwrap().nav.cursor_mm;
    let at = rect.center() + egui::vec2(12.0, -9.0);
    harness.hover_at(at);
    harness.drag_at(at);
    harness.drop_at(at);
    harness.run_ok();
    let after = harness.state().work.doc.as_ref().unwrap().nav.cursor_mm;
    assert_ne!(after, before);
    assert_eq!(after.z, before.z, "an axial click stays on its slice");
}

#[test]
fn dragging_the_closeup_rotates_the_camera_about_the_lens() {
    let mut harness = sample();
    let before = harness.state().work.doc.as_ref().unwrap().nav.camera;
    let rect = harness.state().pane_rect(PaneId::Closeup).unwrap();
    harness.hover_at(rect.center());
    harness.drag_at(rect.center());
    harness.hover_at(rect.center() + egui::vec2(60.0, 0.0));
    harness.run_ok();
    harness.drop_at(rect.center() + egui::vec2(60.0, 0.0));
    harness.run_ok();
    let after = harness.state().work.doc.as_ref().unwrap().nav.camera;
    assert_ne!(after.world_from_camera, before.world_from_camera);
    assert_eq!(after.focus_mm, before.focus_mm);
}

#[test]
fn a_moving_closeup_draws_drafts_and_is_refined_when_still() {
    let mut harness = drafting_window_on(CaseRef::Sample, SIZE);
    harness.run_ok();
    let drawn = |harness: &Harness<'_, GlioscopeApp>| {
        let frame = closeup(harness).canvas.screen.frame().unwrap();
        (frame.size_px, frame.asked_px)
    };
    let rect = harness.state().pane_rect(PaneId::Closeup).unwrap();
    harness.hover_at(rect.center());
    harness.drag_at(rect.center());
    harness.run_steps(2);
    // A machine that draws full frames within the budget reaches them after a few frames.
    let mut moving = Vec::new();
    for step in 1..6_u8 {
        harness.hover_at(rect.center() + egui::vec2(12.0 * f32::from(step), 0.0));
        harness.run_steps(1);
        moving.push(drawn(&harness));
    }
    let is_draft =
        |(size, requested): &([u32; 2], [u32; 2])| size[0] < requested[0] && size[1] < requested[1];
    assert!(moving.iter().any(is_draft), "{moving:?} while it moves");
    harness.drop_at(rect.center() + egui::vec2(60.0, 0.0));
    harness.run_steps(40);
    let (size, requested) = drawn(&harness);
    assert_eq!(size, requested, "full resolution when still");
}

#[test]
fn an_idle_window_draws_nothing() {
    let mut harness = sample();
    let frames = |harness: &mut Window| {
        [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids].map(|p| screens(harness, p).frames_drawn())
    };
    let before = frames(&mut harness);
    assert!(before.iter().all(|&drawn| drawn > 0), "every 3D view was drawn");
    harness.run_steps(20);
    assert_eq!(frames(&mut harness), before);
    assert!(!harness.ctx.has_requested_repaint(), "nothing requests another frame");
}

#[test]
fn the_command_palette_finds_and_performs_a_command() {
    let mut harness = sample();
    harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::P);
    harness.run_ok();
    harness.get_by_label("Search commands").type_text("lens on");
    harness.run_ok();
    harness.key_press(egui::Key::Enter);
    harness.run_ok();
    assert!(!harness.state().work.doc.as_ref().unwrap().edit.lens_on);
}

#[test]
fn panes_are_maximised_and_restored() {
    let mut harness = sample();
    harness.get_by_label("Maximise the closeup").click();
    harness.run_ok();
    let wide = harness.state().pane_rect(PaneId::Closeup).unwrap();
    assert!(wide.width() > SIZE[0] * 0.95);
    assert_eq!(harness.state().pane_rect(PaneId::Overlap), None);
    harness.get_by_label("Restore the closeup").click();
    harness.run_ok();
    assert!(harness.state().pane_rect(PaneId::Overlap).is_some());
}

#[test]
fn a_session_is_saved_completely_and_reopens() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("visit.glioscope.json");
    let mut harness = sample();
    let bits = t2_only(&harness);
    issue(&mut harness, EditCommand::ToggleRegion(bits));
    issue(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    harness.run_ok();
    assert_eq!(error_text(&harness), "");
    let saved = harness.state().work.doc.clone().unwrap();
    assert_eq!(session::load(&path).unwrap().document, saved);

    let mut other = sample();
    issue(&mut other, AppCommand::OpenSession(path));
    for _ in 0..400 {
        other.run_steps(1);
        if other.state().work.job.is_none() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(25));
    }
    other.run_ok();
    assert_eq!(other.state().work.doc.as_ref().unwrap().edit.selection, saved.edit.selection);
}

#[test]
fn a_guessed_case_is_shown_before_it_is_opened() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("case");
    glioscope_core::sample::write_sample(&out).unwrap();
    std::fs::remove_file(out.join("case.toml")).unwrap();
    for entry in std::fs::read_dir(&out).unwrap() {
        let path = entry.unwrap().path();
        if path.to_string_lossy().contains("04-15") || path.extension().is_some_and(|e| e == "json") {
            std::fs::remove_file(path).unwrap();
        }
    }
    let mut harness = sample();
    let open = AppCommand::Open(CaseRef::Path(out));
    issue(&mut harness, open);
    for _ in 0..400 {
        harness.run_steps(1);
        if harness.state().work.job.is_none() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(25));
    }
    harness.run_ok();
    assert_eq!(error_text(&harness), "");
    assert!(harness.state().work.guess.is_some());
    assert_eq!(harness.state().work.doc.as_ref().unwrap().case, CaseRef::Sample, "not used yet");
    harness.get_by_label("Open it like this").click();
    harness.run_ok();
    assert!(harness.state().work.guess.is_none());
}

#[test]
fn a_pane_screenshot_matches_the_pane() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("overlap.png");
    let mut harness = sample();
    let picture = AppCommand::ScreenshotTo(Some(PaneId::Overlap), path.clone());
    issue(&mut harness, picture);
    harness.run_steps(3);
    assert_eq!(error_text(&harness), "");
    let written = image::open(&path).unwrap().to_rgba8();
    let rect = harness.state().pane_rect(PaneId::Overlap).unwrap();
    let window = harness.render().unwrap();
    assert_eq!(count_color(&written, TEAL, 0), count_color(&crop(&window, rect), TEAL, 0));
    assert!(count_color(&written, TEAL, 0) > 5000);
}

#[test]
fn dropped_folders_open_and_invalid_files_report_an_error_and_keep_the_case() {
    let folder = tempfile::tempdir().unwrap();
    let case = folder.path().join("case");
    glioscope_core::sample::write_sample(&case).unwrap();
    let invalid = folder.path().join("wrong.nii");
    std::fs::write(&invalid, b"no image").unwrap();
    let mut harness = sample();
    let wait = |harness: &mut Window| {
        harness.run_steps(1);
        for _ in 0..400 {
            if harness.state().work.job.is_none() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(25));
            harness.run_steps(1);
        }
        harness.run_ok();
    };
    harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(invalid)));
    wait(&mut harness);
    let error = error_text(&harness);
    assert!(error.contains("wrong.nii") && error.contains("found") && error.contains("expected"), "{error}");
    assert_eq!(harness.state().work.doc.as_ref().unwrap().case, CaseRef::Sample);
    harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(case.clone())));
    wait(&mut harness);
    assert_eq!(error_text(&harness), "");
    assert_eq!(harness.state().work.doc.as_ref().unwrap().case, CaseRef::Path(case));
}

#[test]
fn warnings_are_listed_above_the_views() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.nii.gz");
    write_cube(&path, 8, 1.0, |_| 0);
    let case = CaseRef::Arguments { masks: vec![format!("T1={}", path.display())], contexts: vec![] };
    let mut harness = window_on(case, SIZE, Theme::Dark);
    harness.run_ok();
    assert!(harness.query_by_label_contains("1 warning").is_some());
    assert!(harness.query_by_label_contains("No active voxels").is_some());
    harness.get_by_label("Show warnings").click();
    harness.run_ok();
    assert!(harness.query_by_label("mask-empty").is_some());
}
