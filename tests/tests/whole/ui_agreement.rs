//! Metrics of agreement in the window: the command line's numbers, any two masks, and where surfaces are farthest apart.

use std::path::Path;

use egui_kittest::kittest::Queryable;
use glioscope::{
    command::EditCommand,
    model::{CaseRef, PaneId},
    theme::RULER,
};
use glioscope_tests::{
    Window, answer, choose, count_color, doc, issue, pane_picture, wait_for_workers, window_on,
};

use crate::PROGRAM;

fn opened() -> Window {
    let mut harness = window_on(CaseRef::Sample, [1280.0, 900.0], egui::Theme::Dark);
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Agreement));
    wait_for_workers(&mut harness);
    harness
}

#[test]
fn every_convention_has_the_numbers_of_the_command_line() {
    let mut harness = opened();
    for (title, name) in
        [("DeepMind", "deepmind"), ("MedPy", "medpy"), ("BraTS 2023", "brats"), ("panoptica", "panoptica")]
    {
        choose(&mut harness, "Convention", title);
        let (json, _) =
            answer(PROGRAM, &["measure", "--sample", "--metrics", "--convention", name, "--json"]);
        for pair in json["time_points"][0]["pairs"].as_array().unwrap() {
            for key in ["dice", "kappa"] {
                let text = format!("{:.3}", pair[key].as_f64().unwrap());
                assert!(harness.query_all_by_label(&text).count() > 0, "{name} {key} {text}");
            }
            let text = format!("{:.2} mm", pair["hd95_mm"].as_f64().unwrap());
            assert!(harness.query_all_by_label(&text).count() > 0, "{name} {text}");
        }
    }
    assert!(harness.query_by_label("Panoptic quality").is_some());
    assert!(harness.query_by_label("Fleiss' kappa").is_some());
    assert_eq!(doc(&harness).edit.agreement.convention.name(), "panoptica");
    let picture = pane_picture(&mut harness, PaneId::Agreement);
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        picture.save(Path::new(&folder).join("agreement.png")).unwrap();
    }
}

#[test]
fn a_hausdorff_distance_leads_to_its_two_points_and_any_two_are_compared() {
    let mut harness = opened();
    let (json, _) = answer(PROGRAM, &["measure", "--sample", "--metrics", "--json"]);
    let hausdorff = &json["time_points"][0]["pairs"][0]["hausdorff"];
    harness.get_by_label("Show the two points of Hausdorff T1 – T2").click();
    wait_for_workers(&mut harness);
    let line = doc(&harness).edit.rulers.last().unwrap().clone();
    assert!((line.length_mm() - hausdorff["distance_mm"].as_f64().unwrap()).abs() < 1e-9);
    let on = |key: &str| hausdorff[key].as_array().unwrap()[0].as_f64().unwrap();
    assert_eq!((line.from_mm.x, line.to_mm.x), (on("on_reference_mm"), on("on_compared_mm")));
    let lens = doc(&harness).edit.lens;
    assert!(lens.center_mm.distance(line.from_mm) <= lens.radius_mm, "both in the lens");
    // Every 3D view shows it, though the pane of the link was maximised.
    for pane in [PaneId::Closeup, PaneId::Context, PaneId::Ellipsoids] {
        let picture = pane_picture(&mut harness, pane);
        let [r, g, b, _] = RULER.to_array();
        let drawn = count_color(&picture, [r, g, b], 40);
        assert!(drawn >= 8, "{}: {drawn} pixels of the line", pane.title());
    }
    let lines = doc(&harness).edit.rulers.len();
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Agreement));
    wait_for_workers(&mut harness);
    harness.get_by_label("Show the two points of Hausdorff T1 – T2").click();
    wait_for_workers(&mut harness);
    assert_eq!(doc(&harness).edit.rulers.len(), lines, "one line for two points");
    issue(&mut harness, EditCommand::MaximizePane(PaneId::Agreement));
    wait_for_workers(&mut harness);

    harness.get_by_label("Any two").click();
    wait_for_workers(&mut harness);
    let dates: Vec<String> = json["time_points"]
        .as_array()
        .unwrap()
        .iter()
        .map(|t| t["time"].as_str().unwrap().to_owned())
        .collect();
    choose(&mut harness, "Compared", &format!("T1 at {}", dates[1]));
    let (change, _) = answer(PROGRAM, &["change", "--sample", "--of", "T1", "--json"]);
    let [kept, from, to] = ["kept_ml", "from_ml", "to_ml"].map(|key| change[key].as_f64().unwrap());
    let dice = format!("{:.3}", 2.0 * kept / (from + to));
    assert!(harness.query_all_by_label(&dice).count() > 0, "Dice of T1 at two dates: {dice}");
}
