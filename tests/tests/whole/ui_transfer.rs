//! 2-D transfer functions in the window: shapes on the joint histogram, files, and the command line's pictures.

use egui::{Key, Pos2, Theme, pos2, vec2};
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, PaneId, session, transfer_file},
};
use glioscope_core::files::write_whole;
use glioscope_render::{TransferForm, TransferFunction, TransferPreset, TransferShape};
use glioscope_tests::{
    Window, doc, error_text, issue, maximized, pane_picture, perform, refusal, run, wait_for_workers,
    window_on,
};

use crate::PROGRAM;

const SIZE: [f32; 2] = [1280.0, 860.0];

fn id_of_image(harness: &Window) -> String {
    let (id, _) = harness.state().work.world.context(doc(harness)).unwrap();
    id.to_owned()
}

fn transfer(harness: &Window) -> TransferFunction {
    doc(harness).edit.transfers.get(&id_of_image(harness)).unwrap().clone()
}

fn shapes(harness: &Window) -> Vec<TransferShape> {
    transfer(harness).shapes().unwrap().to_vec()
}

/// The editor, in which value and gradient were chosen, with its histogram counted.
fn editor(theme: Theme) -> Window {
    let mut harness = window_on(CaseRef::Sample, SIZE, theme);
    harness.run_ok();
    maximized(&mut harness, PaneId::Transfer);
    harness.get_by_label("value and gradient (2-D)").click();
    harness.run_ok();
    wait_for_workers(&mut harness);
    harness.run_ok();
    harness
}

fn drag(harness: &mut Window, from: Pos2, to: Pos2) {
    harness.hover_at(from);
    harness.run_ok();
    harness.drag_at(from);
    harness.run_ok();
    harness.hover_at(to);
    harness.run_ok();
    harness.drop_at(to);
    harness.run_ok();
}

/// One box in the middle of the plane, from 0.4 to 0.6 of its width and, by the root, of its height.
fn one_box(harness: &mut Window) -> ([f64; 2], f64, egui::Rect) {
    let image = {
        let state = harness.state_mut();
        state.results.image.last().unwrap().clone()
    };
    let joint = image.gradient_histogram();
    let ((low, high), highest) = (joint.range(), joint.highest_gradient());
    let at = |share: f64| low + share * (high - low);
    let form = TransferForm::Box {
        values: [at(0.4), at(0.6)],
        gradients_per_mm: [0.16 * highest, 0.36 * highest],
        soft: 0.0,
    };
    let mut transfer = transfer(harness);
    transfer.set_shapes(Some(vec![TransferShape { form, color: [255, 0, 0], opacity: 0.5 }])).unwrap();
    let id = id_of_image(harness);
    perform(harness, EditCommand::SetTransfer(id, Some(transfer)));
    harness.run_ok();
    let rect = harness.get_by_label("Shapes on values and gradient magnitudes").rect();
    ([low, high], highest, rect)
}

#[test]
fn shapes_are_added_dragged_reshaped_deleted_and_undone() {
    let mut harness = editor(Theme::Dark);
    assert!(!shapes(&harness).is_empty(), "a preset's shapes to begin with");
    let ([low, high], highest, rect) = one_box(&mut harness);
    let place =
        |across: f32, up: f32| pos2(rect.left() + across * rect.width(), rect.bottom() - up * rect.height());
    let share = |form: TransferForm| {
        let (values, gradients) = form.bounds();
        let across = values.map(|v| (v - low) / (high - low));
        [across[0], across[1], (gradients[0] / highest).sqrt(), (gradients[1] / highest).sqrt()]
    };
    let close =
        |found: [f64; 4], expected: [f64; 4]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3);
    // Whole, by a tenth to the right, and up from 0.25 to 0.49 of the gradients.
    drag(&mut harness, place(0.5, 0.5), place(0.6, 0.7));
    let moved = share(shapes(&harness)[0].form);
    assert!(close(moved, [0.5, 0.7, 0.4f64.sqrt(), 0.6f64.sqrt()]), "{moved:?}");
    // The upper right corner, which has a handle as the box is chosen now.
    drag(&mut harness, place(0.7, 0.6f32.sqrt()), place(0.9, 0.95));
    let reshaped = share(shapes(&harness)[0].form);
    assert!(close(reshaped, [0.5, 0.9, 0.4f64.sqrt(), 0.95]), "{reshaped:?}");
    // Beside it nothing is dragged.
    let before = transfer(&harness);
    drag(&mut harness, place(0.1, 0.1), place(0.3, 0.3));
    assert_eq!(transfer(&harness), before);
    // A second one lies above the first.
    harness.get_by_label("Add a blob").click();
    harness.run_ok();
    assert_eq!(shapes(&harness).len(), 2);
    assert!(matches!(shapes(&harness)[1].form, TransferForm::Blob { .. }));
    assert!(harness.query_by_label("Colour of the shape").is_some(), "the new shape is chosen");
    assert!(harness.query_by_label("Standard deviation of gradient").is_some());
    // The first is chosen in the list and deleted by its button, the second by the key.
    harness.get_by_label("1 box").click();
    harness.run_ok();
    assert!(harness.query_by_label("Softness of the shape's edges").is_some());
    harness.get_by_label("Delete").click();
    harness.run_ok();
    assert!(matches!(shapes(&harness)[..], [TransferShape { form: TransferForm::Blob { .. }, .. }]));
    let middle = place(0.5, 0.4);
    harness.hover_at(middle);
    harness.drag_at(middle);
    harness.drop_at(middle);
    harness.run_ok();
    harness.key_press(Key::Delete);
    harness.run_ok();
    assert!(shapes(&harness).is_empty());
    assert!(harness.query_by_label("No shape: everything is transparent").is_some());
    for expected in [1, 2, 1] {
        perform(&mut harness, EditCommand::Undo);
        harness.run_ok();
        assert_eq!(shapes(&harness).len(), expected);
    }
    assert_eq!(transfer(&harness), before);
    // Back to points, which were kept.
    harness.get_by_label("value").click();
    harness.run_ok();
    let points = transfer(&harness);
    assert!(points.shapes().is_none() && points.points() == before.points());
}

#[test]
fn shapes_are_drawn_and_saved_in_sessions() {
    let mut harness = window_on(CaseRef::Sample, SIZE, Theme::Light);
    harness.run_ok();
    let first = pane_picture(&mut harness, PaneId::Context);
    let statistics = harness.state().work.world.context(doc(&harness)).unwrap().1.histogram().clone();
    let id = id_of_image(&harness);
    let shaped = TransferPreset::T1cShapes.transfer(&statistics);
    perform(&mut harness, EditCommand::SetTransfer(id.clone(), Some(shaped.clone())));
    let with_shapes = pane_picture(&mut harness, PaneId::Context);
    assert_ne!(with_shapes, first);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    let saved = session::load(&path).unwrap();
    assert_eq!(saved.document.edit.transfers.get(&id), Some(&shaped));
    assert!(saved.findings.is_empty(), "{:?}", saved.findings);
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(pane_picture(&mut harness, PaneId::Context), first);

    // As a file, and back.
    let session_path = path;
    let path = folder.path().join("a.transfer.json");
    perform(&mut harness, EditCommand::Redo);
    issue(&mut harness, AppCommand::SaveTransferTo(path.clone()));
    harness.run_ok();
    assert_eq!(transfer_file::load(&path).unwrap(), shaped);
    perform(&mut harness, EditCommand::Undo);
    issue(&mut harness, AppCommand::OpenTransferFrom(path));
    harness.run_ok();
    assert_eq!(transfer(&harness), shaped);
    issue(&mut harness, AppCommand::OpenTransferFrom(folder.path().join("none.transfer.json")));
    harness.run_ok();
    assert!(error_text(&harness).contains("none.transfer.json"), "{}", error_text(&harness));
    // Not over what the case or its session was read from.
    issue(&mut harness, AppCommand::SaveTransferTo(session_path.clone()));
    assert!(error_text(&harness).contains("another name for the output"), "{}", error_text(&harness));
    assert_eq!(session::load(&session_path).unwrap(), saved);
}

#[test]
fn render_draws_a_transfer_function_of_a_file() {
    let mut harness = window_on(CaseRef::Sample, [800.0, 600.0], Theme::Light);
    harness.run_ok();
    let statistics = harness.state().work.world.context(doc(&harness)).unwrap().1.histogram().clone();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let file = path("own.transfer.json");
    transfer_file::save(file.as_ref(), &TransferPreset::T1cShapes.transfer(&statistics)).unwrap();
    let draw = |more: &[&str]| {
        let out = path("x.png");
        let plain =
            ["render", "--sample", "--software", "--size", "160x120", "--view", "context", "--out", &out];
        let output = run(PROGRAM, &[&plain[..], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read(&out).unwrap()
    };
    let by_preset = draw(&["--transfer", "t1c-shapes"]);
    assert_eq!(draw(&["--transfer", &file]), by_preset);
    assert_ne!(draw(&[]), by_preset);
    let refuse = |transfer: &str| {
        refusal(
            PROGRAM,
            &[
                "render",
                "--sample",
                "--software",
                "--view",
                "context",
                "--out",
                &path("y.png"),
                "--transfer",
                transfer,
            ],
        )
    };
    // Not over the file itself, under another name.
    #[cfg(unix)]
    {
        let content = std::fs::read(&file).unwrap();
        let link = path("link.png");
        std::os::unix::fs::symlink(&file, &link).unwrap();
        let arguments = ["render", "--sample", "--software", "--view", "context", "--transfer", &file];
        let said = refusal(PROGRAM, &[&arguments[..], &["--out", &link]].concat());
        assert!(said.contains("another name for the output"), "{said}");
        assert_eq!(std::fs::read(&file).unwrap(), content);
    }
    write_whole(file.as_ref(), br#"{"glioscope_transfer": 1, "shapes": [], "shape": 1}"#).unwrap();
    assert!(
        refuse(&file).contains("own.transfer.json: found unknown keys shape, expected"),
        "{}",
        refuse(&file)
    );
    assert!(refuse("t1c").contains("pet-shapes or a file .json"), "{}", refuse("t1c"));
    assert!(refuse(&path("none.json")).contains("none.json"));
}

/// Every word of the editor is inside the pane, light and dark, also where it is narrow.
#[test]
fn nothing_of_the_editor_is_cut() {
    for theme in [Theme::Light, Theme::Dark] {
        let mut harness = editor(theme);
        one_box(&mut harness);
        harness.get_by_label("1 box").click();
        harness.run_ok();
        let pane = harness.state().pane_rect(PaneId::Transfer).unwrap();
        for label in [
            "Add a trapezoid",
            "Delete",
            "Lowest value",
            "Highest gradient",
            "Shapes on values and gradient magnitudes",
            "Save…",
        ] {
            assert!(
                pane.expand2(vec2(0.5, 0.5)).contains_rect(harness.get_by_label(label).rect()),
                "{label}"
            );
        }
        if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
            let picture = harness.render().unwrap();
            picture
                .save(std::path::Path::new(&folder).join(format!("transfer-shapes-{theme:?}.png")))
                .unwrap();
        }
    }
}
