//! Names and colours that the user gives to masks.

use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, HiddenRegions, PaneId, masks::MaskLook, session},
};
use glioscope_tests::{
    MASK_COLORS, Window, count_shades, crop, doc, pane_picture, perform, sample, window_on, write_cube,
};

#[test]
fn a_mask_is_renamed_in_the_dialog_everywhere_in_the_window() {
    let mut harness = sample();
    perform(&mut harness, AppCommand::ShowMasks);
    let width = harness.get_by_label("Name of T2").rect().width();
    assert!(width > 150.0, "a name of several words fits: {width}");
    harness.get_by_label("Name of T2").focus();
    harness.run_ok();
    harness.get_by_label("Name of T2").type_text("rater B");
    harness.run_ok();
    harness.key_press(Key::Escape);
    harness.run_ok();
    assert!(harness.query_by_label("Name of T2").is_none(), "Escape closes the dialog");
    for label in ["rater B only", "T1+rater B", "Show T1+rater B+PET"] {
        assert!(harness.query_by_label(label).is_some(), "{label}");
    }
    assert!(harness.query_by_label("T2 only").is_none());

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("named.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.masks, doc(&harness).edit.masks);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_ok();
    assert!(harness.query_by_label("T2 only").is_some(), "undone at once");
}

#[test]
fn one_mask_has_its_size_and_no_diagram() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.nii.gz");
    write_cube(&path, 8, 1.0, |at| u8::from(at.iter().all(|i| (2..6).contains(i))));
    let masks = vec![format!("A={}", path.display())];
    let case = CaseRef::Arguments { masks, contexts: Vec::new() };
    let mut harness = window_on(case, [1280.0, 720.0], egui::Theme::Dark);
    assert!(harness.query_by_label("One mask: no overlaps.").is_some());
    assert!(harness.query_by_label("Whole masks").is_none(), "one mask has no overlaps to tell apart");
    harness.get_by_label("Show A").click();
    harness.run_ok();
    assert_ne!(doc(&harness).edit.selection, HiddenRegions::none(), "hidden by a click on its row");
}

#[test]
fn a_mask_is_coloured_and_the_others_keep_their_colours() {
    let mut harness = sample();
    let count = |harness: &mut Window, color: [u8; 3]| {
        let picture = pane_picture(harness, PaneId::Closeup);
        // Without the legend, whose swatches have the same colours.
        let whole = egui::Rect::from_min_max(egui::pos2(0.0, 80.0), egui::pos2(2000.0, 2000.0));
        let below = crop(
            &picture,
            whole.intersect(egui::Rect::from_min_size(
                egui::Pos2::ZERO,
                egui::vec2(picture.width() as f32, picture.height() as f32),
            )),
        );
        count_shades(&below, color, 12.0)
    };
    let (red, teal, green) = (MASK_COLORS[0], MASK_COLORS[1], [40, 160, 40]);
    let before = [red, teal, green].map(|color| count(&mut harness, color));
    assert!(before[0] > 1000 && before[1] > 1000 && before[2] < 50, "{before:?}");
    let look = MaskLook { name: None, color: Some(green) };
    perform(&mut harness, EditCommand::SetMaskLook("T2".into(), look));
    let after = [red, teal, green].map(|color| count(&mut harness, color));
    assert!(after[1] < 50 && after[2] * 10 > before[1] * 9, "T2 is green: {before:?} {after:?}");
    assert!(after[0] * 10 > before[0] * 9, "T1 is still red: {before:?} {after:?}");
    perform(&mut harness, EditCommand::Undo);
    assert_eq!([red, teal, green].map(|color| count(&mut harness, color)), before);
}
