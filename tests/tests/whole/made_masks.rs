//! Masks that the user makes of what is shown: like any other, undone like any deed, kept in the session.

use std::path::Path;

use egui::{Key, Modifiers};
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand, LookCommand},
    model::session,
};
use glioscope_core::Mask;
use glioscope_tests::{Window, doc, perform, run, sample, wait_for_workers};
use serde_json::Value;

use crate::PROGRAM;

/// Voxels of the last mask of the date shown, if it has this id.
fn last_mask(harness: &Window, id: &str) -> Option<Mask> {
    let work = &harness.state().work;
    let mask = &work.world.time_point(doc(harness)).unwrap().masks.last().unwrap().mask;
    (mask.id() == id).then(|| mask.clone())
}

fn make_with_dialog(harness: &mut Window, choice: &str, name: &str) {
    perform(harness, AppCommand::ShowMakeMask);
    harness.get_by_label_contains(choice).click();
    harness.run_ok();
    let field = harness.get_by_label("Name");
    field.focus();
    harness.run_ok();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.get_by_label("Name").type_text(name);
    harness.run_ok();
    harness.get_by_label("Make it").click();
    harness.run_ok();
    assert!(harness.query_by_label("Make it").is_none(), "the dialog is closed");
    wait_for_workers(harness);
}

fn measured(session: &Path) -> Value {
    let output = run(PROGRAM, &["measure", session.to_str().unwrap(), "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_consensus_is_made_by_clicking_and_is_a_mask_like_any_other() {
    let mut harness = sample();
    let first = harness.state().work.world.time_point(doc(&harness)).unwrap().clone();
    let expected: u64 = first.regions.list().iter().filter(|r| r.mask_count() >= 2).map(|r| r.voxels).sum();
    make_with_dialog(&mut harness, "Where at least", "majority");
    let made = last_mask(&harness, "majority").unwrap();
    assert_eq!(made.voxels(), expected);
    let own = &doc(&harness).edit.made[0];
    assert_eq!(own.parents, ["T1", "T2", "PET"]);
    assert_eq!(own.how, "where at least 2 of 3 masks are active");
    assert!(harness.query_by_label("Show T1+T2+PET+majority").is_some(), "in the table of regions");

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.made, doc(&harness).edit.made);
    let numbers = measured(&path);
    let masks = numbers["time_points"][0]["masks"].as_array().unwrap();
    assert_eq!((masks.len(), &masks[3]["voxels"]), (4, &Value::from(expected)));
    assert!(numbers["warnings"].to_string().contains("where at least 2 of 3 masks are active"));

    // Exported like the others, and read again.
    let out = folder.path().join("majority.nii.gz");
    let (session, file) = (path.to_str().unwrap(), out.to_str().unwrap());
    let date = &first.label;
    let arguments =
        ["export", session, "--select", "majority", "--format", "nifti", "--time", date, "--out", file];
    let output = run(PROGRAM, &arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let again = run(PROGRAM, &["measure", "--mask", &format!("m={}", out.display()), "--json"]);
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(again["time_points"][0]["masks"][0]["voxels"], expected);

    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run_ok();
    assert!(last_mask(&harness, "majority").is_none() && doc(&harness).edit.made.is_empty(), "undone");
    assert_eq!(
        harness.state().work.world.time_point(doc(&harness)).unwrap(),
        &first,
        "sources are unchanged"
    );
    harness.key_press_modifiers(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    harness.run_ok();
    assert_eq!(last_mask(&harness, "majority"), Some(made), "done again");
    perform(&mut harness, AppCommand::ShowMasks);
    harness.get_by_label("Delete").click();
    harness.run_ok();
    assert!(doc(&harness).edit.made.is_empty());
}

#[test]
fn what_is_in_the_lens_and_one_piece_become_masks() {
    let mut harness = sample();
    perform(&mut harness, EditCommand::OnlyRegion(0b010));
    make_with_dialog(&mut harness, "inside the lens", "in lens");
    let mask = last_mask(&harness, "in lens").unwrap();
    let lens = doc(&harness).edit.lens;
    let time_point = harness.state().work.world.time_point(doc(&harness)).unwrap().clone();
    let grid = mask.grid().clone();
    let mut voxels = 0_u64;
    for at in 0..grid.voxel_count() {
        let inside = grid.center_of_voxel_mm(grid.ijk(at)).distance(lens.center_mm) <= lens.radius_mm;
        let expected = inside && time_point.index.get(at) & 0b111 == 0b010;
        assert_eq!(mask.bits().get(grid.ijk(at)), expected);
        voxels += u64::from(expected);
    }
    assert!(voxels > 100, "{voxels}");

    // The piece at a voxel of T2 alone, against a flood fill.
    let is_in = |at: [usize; 3]| time_point.index.get(grid.linear(at)) & 0b111 == 0b010;
    let seed = (0..grid.voxel_count()).map(|at| grid.ijk(at)).find(|at| is_in(*at)).unwrap();
    let (mut found, mut open) = (std::collections::HashSet::from([seed]), vec![seed]);
    while let Some(at) = open.pop() {
        for n in 0..27 {
            let step = [n % 3, n / 3 % 3, n / 9];
            let next: [usize; 3] = std::array::from_fn(|axis| (at[axis] + step[axis]).wrapping_sub(1));
            let inside = (0..3).all(|axis| next[axis] < grid.dims()[axis]);
            if inside && is_in(next) && found.insert(next) {
                open.push(next);
            }
        }
    }
    perform(&mut harness, EditCommand::Undo);
    perform(&mut harness, LookCommand::SetCursor(grid.center_of_voxel_mm(seed)));
    make_with_dialog(&mut harness, "the piece at the crosshair", "piece");
    let piece = last_mask(&harness, "piece").unwrap();
    assert_eq!(piece.voxels(), found.len() as u64);
    assert!(found.iter().all(|at| piece.bits().get(*at)));
    // Elsewhere there is none, and the dialog says so.
    perform(&mut harness, LookCommand::SetCursor(grid.center_of_voxel_mm([0; 3])));
    perform(&mut harness, AppCommand::ShowMakeMask);
    harness.get_by_label_contains("the piece at the crosshair").click();
    harness.run_ok();
    harness.get_by_label("Make it").click();
    harness.run_ok();
    assert!(harness.query_by_label_contains("click there first").is_some());
    assert_eq!(doc(&harness).edit.made.len(), 1);
}

#[test]
fn names_that_are_taken_or_mean_something_else_are_refused() {
    let mut harness = sample();
    perform(&mut harness, AppCommand::ShowMakeMask);
    for (name, why) in
        [("T1", "This date has a mask T1."), ("a=b", "stand for something else"), (" ", "needs a name")]
    {
        harness.get_by_label("Name").focus();
        harness.run_ok();
        harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        harness.get_by_label("Name").type_text(name);
        harness.run_ok();
        assert!(harness.query_by_label_contains(why).is_some(), "{name:?}");
        harness.get_by_label("Make it").click();
        harness.run_ok();
        assert!(doc(&harness).edit.made.is_empty(), "{name:?}");
    }
    harness.key_press(Key::Escape);
    harness.run_ok();
    assert!(harness.query_by_label("Make it").is_none());
}

#[test]
fn a_session_with_voxels_that_do_not_fit_is_refused() {
    let mut harness = sample();
    make_with_dialog(&mut harness, "What is selected", "all");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    let text = std::fs::read_to_string(&path).unwrap();
    let runs = text.find("\"runs\": \"").unwrap() + 9;
    std::fs::write(&path, format!("{}99999999999 {}", &text[..runs], &text[runs..])).unwrap();
    let output = run(PROGRAM, &["measure", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("voxels don't fit its grid"));
}
