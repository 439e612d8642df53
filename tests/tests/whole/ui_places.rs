//! *Go to*: crosshair and lens move to regions, components, the largest growth and the largest disagreement.

use std::collections::BTreeSet;

use egui::Modifiers;
use egui_kittest::kittest::Queryable;
use glam::DVec3;
use glioscope::command::{AppCommand, EditCommand};
use glioscope_core::{
    Progress, TumorIndex,
    change::{self, ChangeOptions},
};
use glioscope_tests::{Window, doc, perform, sample};

/// Connected pieces, by flood filling over faces, edges and corners, of the voxels for which `active` holds.
fn pieces(index: &TumorIndex, active: impl Fn(u32) -> bool) -> Vec<BTreeSet<[usize; 3]>> {
    let grid = index.grid();
    let mut left: BTreeSet<[usize; 3]> =
        (0..grid.voxel_count()).filter(|i| active(index.get(*i))).map(|i| grid.ijk(i)).collect();
    let mut all = Vec::new();
    while let Some(first) = left.pop_first() {
        let (mut piece, mut open) = (BTreeSet::from([first]), vec![first]);
        while let Some([x, y, z]) = open.pop() {
            for shift in 0..27_usize {
                let [dx, dy, dz] = [shift % 3, shift / 3 % 3, shift / 9];
                let neighbor = [(x + dx).wrapping_sub(1), (y + dy).wrapping_sub(1), (z + dz).wrapping_sub(1)];
                if left.remove(&neighbor) {
                    piece.insert(neighbor);
                    open.push(neighbor);
                }
            }
        }
        all.push(piece);
    }
    all.sort_by_key(|piece| std::cmp::Reverse(piece.len()));
    all
}

/// Whether lens, crosshair and camera are at one voxel of `piece`.
fn is_in(harness: &Window, piece: &BTreeSet<[usize; 3]>) -> bool {
    let center_mm = doc(harness).edit.lens.center_mm;
    assert_eq!(doc(harness).nav.crosshair_mm(), center_mm);
    assert_eq!(doc(harness).nav.camera.focus_mm, center_mm);
    assert!(doc(harness).edit.lens_on);
    let grid = harness.state().work.world.time_point(doc(harness)).unwrap().index.grid().clone();
    piece.iter().any(|voxel| grid.center_of_voxel_mm(*voxel).distance(center_mm) < 1e-9)
}

#[test]
fn disagreement_regions_and_components_are_found_where_a_flood_fill_finds_them() {
    let mut harness = sample();
    let index = {
        let state = harness.state();
        state.work.world.time_point(doc(&harness)).unwrap().index.clone()
    };
    let before = doc(&harness).edit.clone();
    harness.key_press_modifiers(Modifiers::SHIFT, egui::Key::G);
    harness.run_ok();
    let disagreeing = pieces(&index, |bits| bits != 0 && bits != 0b111);
    assert!(disagreeing.len() == 1 || disagreeing[0].len() > disagreeing[1].len());
    assert!(is_in(&harness, &disagreeing[0]));
    perform(&mut harness, EditCommand::Undo);
    assert_eq!(doc(&harness).edit, before, "one deed");

    for bits in 1..=7_u32 {
        let of_region = pieces(&index, |b| b == bits);
        perform(&mut harness, AppCommand::GoToRegion(bits));
        assert!(is_in(&harness, &of_region[0]), "region {bits}");
        let last = of_region.len();
        // Components of one size have no order to rely on.
        if last > 1 && of_region[last - 1].len() < of_region[last - 2].len() {
            perform(&mut harness, AppCommand::GoToComponent(bits, last));
            assert!(is_in(&harness, &of_region[last - 1]), "component {last} of {bits}");
        }
    }
}

#[test]
fn the_largest_growth_is_the_longest_vector_at_the_later_date() {
    let mut harness = sample();
    let case = harness.state().work.world.case().unwrap().clone();
    let choice = doc(&harness).edit.change.chosen(&case).unwrap();
    let (report, found) =
        change::between(&case, &choice, &ChangeOptions::default(), None, &Progress::new()).unwrap();
    harness.key_press(egui::Key::G);
    harness.run_ok();
    let sure = found.vectors.iter().filter(|v| !v.flags.within_uncertainty && v.signed_mm > 0.0);
    let longest_mm = sure.map(|v| v.signed_mm).fold(0.0, f64::max);
    assert_eq!(Some(longest_mm), report.growth.max_mm, "in the sample the longest is beyond uncertainty");
    let ends: Vec<DVec3> =
        found.vectors.iter().filter(|v| v.signed_mm == longest_mm).map(|v| v.to_mm).collect();
    assert!(ends.contains(&doc(&harness).edit.lens.center_mm));
    assert_eq!(doc(&harness).nav.crosshair_mm(), doc(&harness).edit.lens.center_mm);
    assert_eq!(doc(&harness).nav.time, choice.dates[1]);
}

#[test]
fn the_palette_finds_a_region_by_its_name() {
    let mut harness = sample();
    harness.key_press_modifiers(Modifiers::COMMAND, egui::Key::P);
    harness.run_ok();
    harness.get_by_label("Search commands").type_text("go to t1+t2+pet");
    harness.run_ok();
    harness.key_press(egui::Key::Enter);
    harness.run_ok();
    let index = {
        let state = harness.state();
        state.work.world.time_point(doc(&harness)).unwrap().index.clone()
    };
    assert_eq!(index.at_mm(doc(&harness).edit.lens.center_mm), 0b111);
}
