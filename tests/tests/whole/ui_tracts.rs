//! Fibre tracts in the context view: rendered from files on the command line, in the window, in sessions. The fibres
//! are synthetic.

use std::path::Path;

use egui::{Theme, vec2};
use egui_kittest::{
    Harness,
    kittest::{NodeT, Queryable},
};
use glioscope::{
    command::{AppCommand, EditCommand, Workstation},
    model::{CaseRef, PaneId, session},
    window::GlioscopeApp,
};
use glioscope_core::optics::Camera;
use glioscope_render::tract_color;
use glioscope_tests::{
    Dropped, Window, error_text, perform, run, screens, wait_for_workers, window_with, workstation, write_tck,
};

use crate::PROGRAM;

/// Centre of the lens, which is on the sample's tumour.
fn tumor_mm() -> [f32; 3] {
    let work = workstation(CaseRef::Sample);
    let doc = work.doc.unwrap();
    doc.edit.lens.center_mm.as_vec3().to_array()
}

/// A bundle `anterior_mm` anterior to the tumour: arcs that run superiorly.
fn bundle(anterior_mm: f32) -> Vec<Vec<[f32; 3]>> {
    let [x, y, z] = tumor_mm();
    (0..24)
        .map(|n| {
            let (u, v) = ((n % 6) as f32 * 1.3 - 3.0, (n / 6) as f32 * 1.3);
            (0..90)
                .map(|k| {
                    let t = k as f32 / 89.0 - 0.5;
                    [x + u + 6.0 * t * t, y + anterior_mm + v - 10.0 * t * t, z + 50.0 * t]
                })
                .collect()
        })
        .collect()
}

/// Number of pixels of a tract's hue: shading scales the channels of a colour equally.
fn count_hue(picture: &image::RgbaImage, color: [u8; 3]) -> usize {
    let [r, g, b] = color.map(f32::from);
    picture
        .pixels()
        .filter(|p| {
            let [pr, pg, pb, _] = p.0.map(f32::from);
            let scale = pr / r;
            (0.35..1.02).contains(&scale) && (pg - g * scale).abs() < 5.0 && (pb - b * scale).abs() < 5.0
        })
        .count()
}

fn png(path: &Path) -> image::RgbaImage {
    image::open(path).unwrap().to_rgba8()
}

#[test]
fn rendering_with_tracts_shows_them() {
    let folder = tempfile::tempdir().unwrap();
    let (cst, far, out) =
        (folder.path().join("CST.tck"), folder.path().join("far.tck"), folder.path().join("out.png"));
    write_tck(&cst, &bundle(35.0));
    write_tck(&far, &bundle(-500.0));
    let draw = |more: &[&str]| {
        let mut arguments = vec!["render", "--sample", "--view", "context", "--camera", "0,0", "--software"];
        arguments.extend(["--size", "500x500", "--transfer", "mr-tissue", "--out", out.to_str().unwrap()]);
        arguments.extend(more);
        let output = run(PROGRAM, &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        (png(&out), String::from_utf8(output.stdout).unwrap())
    };
    let color = tract_color(0);
    let (plain, plan) = draw(&["--explain"]);
    assert!(plan.contains("left out tubes: no fibre tracts"), "{plan}");
    let (with, plan) = draw(&["--tracts", cst.to_str().unwrap(), "--explain"]);
    assert!(plan.contains("runs     tubes\n") && plan.contains("runs     tubes_merge\n"), "{plan}");
    let (before, after) = (count_hue(&plain, color), count_hue(&with, color));
    println!("{before} pixels of the tract's hue without the tract, {after} with it");
    assert!(after > before + 400, "{before} {after}");
    // Tract colours follow the order of the arguments: the far bundle, behind the head, has the first one.
    let (both, _) = draw(&["--tracts", far.to_str().unwrap(), "--tracts", cst.to_str().unwrap()]);
    assert!(count_hue(&both, tract_color(1)) > 400);
    // Missing files and files without tracts are named.
    for (file, word) in [("nowhere.tck", "nowhere.tck"), (PROGRAM, "expected tracts")] {
        let output = run(PROGRAM, &["render", "--sample", "--tracts", file, "--out", out.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stderr).contains(word));
    }
}

#[test]
fn info_reports_the_tracts_of_a_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let sample = folder.path().join("sample");
    let output = run(PROGRAM, &["sample", "--out", sample.to_str().unwrap()]);
    assert!(output.status.success());
    let manifest = sample.join("case.toml");
    let mut text = std::fs::read_to_string(&manifest).unwrap();
    text.push_str("\n[[tracts]]\nid = \"CST left\"\nfile = \"cst.tck\"\n");
    std::fs::write(&manifest, text).unwrap();
    write_tck(&sample.join("cst.tck"), &bundle(35.0));
    let output = run(PROGRAM, &["info", manifest.to_str().unwrap()]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("tracts CST left") && text.contains("cst.tck"), "{text}");
    let output = run(PROGRAM, &["info", manifest.to_str().unwrap(), "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["tracts"][0]["id"], "CST left");
}

const SIZE: [f32; 2] = [900.0, 700.0];

/// The window with the context view maximised, looking from the front.
fn window(mut work: Workstation) -> Window {
    let doc = work.doc.as_mut().unwrap();
    doc.edit.maximized = Some(PaneId::Context);
    doc.nav.camera.world_from_camera = Camera::orientation(0.0, 0.0);
    let mut harness = window_with(work, SIZE, Theme::Light);
    harness.run_ok();
    harness
}

/// Drops files onto the window and waits until they are loaded.
fn drop_files(harness: &mut Window, files: &[&Path]) {
    for file in files {
        harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(file.to_path_buf())));
    }
    harness.run_steps(1);
    wait_for_workers(harness);
}

/// Pixels of the first and the second tract's hue.
fn shown(harness: &mut Window) -> [usize; 2] {
    let picture = harness.render().unwrap();
    [0, 1].map(|n| count_hue(&picture, tract_color(n)))
}

#[test]
fn tracts_are_added_hidden_named_and_saved() {
    let folder = tempfile::tempdir().unwrap();
    let (near, beside, saved) = (
        folder.path().join("near.tck"),
        folder.path().join("beside.tck"),
        folder.path().join("a.glioscope.json"),
    );
    write_tck(&near, &bundle(35.0));
    let aside: Vec<Vec<[f32; 3]>> =
        bundle(35.0).iter().map(|f| f.iter().map(|p| [p[0] + 14.0, p[1], p[2]]).collect()).collect();
    write_tck(&beside, &aside);
    let mut harness = window(workstation(CaseRef::Sample));
    let none = shown(&mut harness);
    perform(&mut harness, EditCommand::ToggleAllTracts);
    // A malformed file is named and changes nothing.
    let broken = folder.path().join("broken.trk");
    std::fs::write(&broken, b"no tracts").unwrap();
    drop_files(&mut harness, &[&broken]);
    let error = error_text(&harness);
    assert!(error.contains("broken.trk") && error.contains("expected"), "{error}");
    assert!(harness.state().work.doc.as_ref().unwrap().tracts.is_empty());
    drop_files(&mut harness, &[&near, &beside]);
    assert_eq!(error_text(&harness), "");
    let ids = |harness: &Harness<'_, GlioscopeApp>| -> Vec<String> {
        let case = harness.state().work.world.case().unwrap();
        case.tracts.iter().map(|t| t.id.clone()).collect()
    };
    assert_eq!(ids(&harness), ["near", "beside"]);
    let both = shown(&mut harness);
    println!("{none:?} pixels without tracts, {both:?} with both");
    assert!(both[0] > none[0] + 400 && both[1] > none[1] + 400, "{none:?} {both:?}");

    // A click on the list hides one; undo restores it.
    harness.get_by_label("Show or hide fibre tracts near").click();
    harness.run_ok();
    let one = shown(&mut harness);
    assert!(one[0] < both[0] - 400 && one[1] >= both[1], "{both:?} {one:?}");
    perform(&mut harness, EditCommand::Undo);
    // The difference allows for the hover highlight in the list.
    let undone = shown(&mut harness);
    assert!((0..2).all(|n| undone[n].abs_diff(both[n]) < 40), "{both:?} {undone:?}");
    perform(&mut harness, EditCommand::ToggleAllTracts);
    let hidden = shown(&mut harness);
    assert!((0..2).all(|n| hidden[n] < none[n] + 200), "{none:?} {hidden:?}");
    let reason = |harness: &mut Window| {
        let plan = screens(harness, PaneId::Context).plan().unwrap().0.clone();
        plan.omitted.iter().find(|o| o.0.name() == "tubes").map(|o| o.1)
    };
    assert_eq!(reason(&mut harness), Some("fibre tracts are hidden"));
    perform(&mut harness, EditCommand::ToggleAllTracts);

    // Hovering a fibre reports its tract and its distance from the selection.
    let rect = harness.state().pane_rect(PaneId::Context).unwrap();
    let mut label = String::new();
    'search: for dy in [-20.0, 0.0, 20.0] {
        for dx in -12..=12 {
            harness.hover_at(rect.center() + vec2(dx as f32 * 6.0, dy));
            harness.run_ok();
            let under = harness.query_all_by_label_contains("Context view of").next();
            label = under.and_then(|node| node.accesskit_node().label()).unwrap_or_default();
            if label.contains(", fibre ") {
                break 'search;
            }
        }
    }
    assert!(label.contains(" mm from the selection"), "{label}");

    // A session restores its tracts and their visibility.
    perform(&mut harness, EditCommand::ToggleTracts("beside".into()));
    perform(&mut harness, AppCommand::SaveSessionTo(saved.clone()));
    let document = session::load(&saved).unwrap().document;
    assert_eq!(document.tracts.len(), 2);
    let mut again = window(workstation(CaseRef::Sample));
    perform(&mut again, AppCommand::OpenSession(saved.clone()));
    wait_for_workers(&mut again);
    assert_eq!(error_text(&again), "");
    assert_eq!(ids(&again), ["near", "beside"]);
    let reopened = shown(&mut again);
    assert!(reopened[0] > none[0] + 400 && reopened[1] < both[1] - 400, "{both:?} {reopened:?}");
    // Sessions from before tracts were added still open.
    let text = std::fs::read_to_string(&saved).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["document"].as_object_mut().unwrap().remove("tracts").unwrap();
    value["document"]["edit"].as_object_mut().unwrap().remove("hidden_tracts").unwrap();
    std::fs::write(&saved, value.to_string()).unwrap();
    let old = session::load(&saved).unwrap().document;
    assert!(old.tracts.is_empty() && old.edit.hidden_tracts.is_empty());
}
