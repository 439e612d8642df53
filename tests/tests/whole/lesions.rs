//! Metrics by convention, lesions over dates, and response, from the command line.

use std::path::Path;

use glioscope_core::{
    Grid, Samples, Volume,
    files::{WriteOptions, write_nifti},
    glam::DVec3,
    volume::Scaling,
};
use glioscope_tests::run;
use serde_json::Value;

use crate::PROGRAM;

/// A mask of balls: centre and radius in millimetres.
pub(crate) fn balls(path: &Path, balls: &[([f64; 3], f64)]) -> String {
    let grid = Grid::axis_aligned([60, 60, 40], DVec3::ONE, DVec3::ZERO).unwrap();
    let is_in = |at: usize| {
        let place = grid.center_of_voxel_mm(grid.ijk(at));
        balls.iter().any(|(center, radius)| place.distance(DVec3::from_array(*center)) < *radius)
    };
    let voxels = (0..grid.voxel_count()).map(|at| u8::from(is_in(at))).collect();
    let volume = Volume::new(grid.clone(), Samples::U8(voxels), Scaling::NONE).unwrap();
    write_nifti(path, &volume, &WriteOptions::default()).unwrap();
    path.to_str().unwrap().to_owned()
}

fn answer(arguments: &[&str]) -> (Value, String) {
    glioscope_tests::answer(PROGRAM, arguments)
}

fn refusal(arguments: &[&str]) -> String {
    glioscope_tests::refusal(PROGRAM, arguments)
}

#[test]
fn a_shifted_ball_is_as_far_away_as_it_was_shifted_by_every_convention() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let a = format!("A={}", balls(&path("a.nii"), &[([20.0, 20.0, 20.0], 8.0)]));
    let b = format!("B={}", balls(&path("b.nii"), &[([24.0, 20.0, 20.0], 8.0)]));
    for convention in ["deepmind", "metrics-reloaded", "medpy", "brats", "panoptica"] {
        let arguments =
            ["measure", "--mask", &a, "--mask", &b, "--metrics", "--convention", convention, "--json"];
        let (json, _) = answer(&arguments);
        let pair = &json["time_points"][0]["pairs"][0];
        assert_eq!((pair["a"].as_str(), pair["b"].as_str()), (Some("A"), Some("B")));
        assert_eq!(pair["convention"], convention);
        assert_eq!(pair["hd_mm"], 4.0, "{convention}: a shape moved by 4 mm");
        let hd95 = pair["hd95_mm"].as_f64().unwrap();
        assert!(hd95 > 2.0 && hd95 <= 4.0, "{convention}: {hd95}");
        assert_eq!(pair["volume_similarity"], 1.0);
        assert!(json["time_points"][0]["raters"].is_null(), "two masks are no raters");
    }
    let output = run(PROGRAM, &["measure", "--mask", &a, "--mask", &b, "--metrics", "--tau", "5"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("by deepmind") && text.contains("Surface Dice                 1.0000"), "{text}");
    // What needs --metrics is refused without it, and an unknown convention always.
    assert!(refusal(&["measure", "--mask", &a, "--tau", "2"]).contains("--metrics"));
    let line = refusal(&["measure", "--mask", &a, "--metrics", "--convention", "own"]);
    assert!(line.contains("expected deepmind, metrics-reloaded"), "{line}");
}

#[test]
fn lesions_are_followed_and_judged_with_what_the_history_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    // A shrinks from 24 to 14 mm across: its product falls by two thirds. A fleck doesn't count.
    let first = balls(&path("1.nii"), &[([20.0, 20.0, 20.0], 12.0), ([50.0, 50.0, 5.0], 1.5)]);
    let second = balls(&path("2.nii"), &[([20.0, 20.0, 20.0], 7.0)]);
    let third = balls(&path("3.nii"), &[([20.0, 20.0, 20.0], 7.0), ([45.0, 45.0, 20.0], 7.0)]);
    let dated = |file: &str, date: &str| format!("T={file}@{date}");
    let masks = [dated(&first, "2024-02-01"), dated(&second, "2024-03-14"), dated(&third, "2024-06-01")];
    let case: Vec<&str> = masks.iter().flat_map(|mask| ["--mask", mask.as_str()]).collect();
    let csv = path("lesions.csv");
    let (json, _) = answer(&[&["lesions"], &case[..], &["--json", "--csv", csv.to_str().unwrap()]].concat());
    let lesions = json["lesions"].as_array().unwrap();
    let events = |lesion: &Value| -> Vec<String> {
        let dates = lesion["dates"].as_array().unwrap();
        dates.iter().map(|date| date["events"].to_string()).collect()
    };
    assert_eq!(
        lesions.iter().map(|l| l["small"].as_bool().unwrap()).collect::<Vec<_>>(),
        [false, false, true]
    );
    assert_eq!(events(&lesions[0]), ["[]", "[\"continued\"]", "[\"continued\"]"]);
    assert_eq!(events(&lesions[1]), ["[]", "[]", "[\"born\"]"]);
    let rows = std::fs::read_to_string(&csv).unwrap();
    assert!(rows.starts_with("lesion,name,date,days,volume_ml,"), "{rows}");
    assert!(rows.lines().any(|row| row.starts_with("A,,2024-03-14,42,")), "{rows}");

    // Without a history nothing can be called, and what is missing is said.
    let call =
        |json: &Value, date: usize| json["dates"][date]["by_diameters"]["call"].as_str().unwrap().to_owned();
    let response = |more: &[&str]| answer(&[&["response"], &case[..], &["--json"], more].concat());
    let (json, _) = response(&["--criteria", "rano-2.0"]);
    assert_eq!(call(&json, 1), "cannot_say");
    assert!(!json["dates"][1]["by_diameters"]["missing"].as_array().unwrap().is_empty());
    let history = path("history.toml");
    let facts = "steroids_mg = 0\nclinical = { value = \"stable\", author = \"Dr. Readerson\" }\nnon_target = \"none\"\ntechnique_changed = []\n";
    let text = format!(
        "response = 1\ncriterion = \"rano-2.0\"\nassessment = \"enhancing\"\ndisease = \"recurrent\"\n\
         radiotherapy_end = \"none\"\nbaseline = \"2024-02-01\"\ntreatment = []\n\
         [[date]]\ndate = \"2024-02-01\"\n{facts}[[date]]\ndate = \"2024-03-14\"\n{facts}new_lesion = \"none\"\n\
         [[date]]\ndate = \"2024-06-01\"\n{facts}"
    );
    glioscope_core::files::write_whole(&history, text.as_bytes()).unwrap();
    let (json, stderr) = response(&["--history", history.to_str().unwrap()]);
    let of_second = &json["dates"][1]["by_diameters"];
    assert_eq!(call(&json, 0), "baseline");
    // (14/24)² - 1 is -66 %; the next scan, with a new lesion, doesn't confirm it.
    assert!(call(&json, 1).contains("partial_response"), "{of_second}");
    let change = of_second["sums"][0]["change_from_baseline_percent"].as_f64().unwrap();
    assert!((-68.0..-60.0).contains(&change), "{change}");
    // The masks show a new measurable lesion.
    assert_eq!(call(&json, 2), "progression", "{}", json["dates"][2]["by_diameters"]);
    assert!(json["proposed_links"].as_u64() >= Some(2) && stderr.contains("[lesions-proposed]"), "{stderr}");

    // The same calls in a report, which is made again with them.
    let page = path("report.html");
    let arguments = ["--history", history.to_str().unwrap(), "--software", "--out", page.to_str().unwrap()];
    let output = run(PROGRAM, &[&["report"], &case[..], &arguments[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let html = std::fs::read_to_string(&page).unwrap();
    for expected in ["Response by RANO 2.0", "PD, progression", "Lesions of T"] {
        assert!(html.contains(expected), "{expected}");
    }
    // The history names its author and may say anything: it isn't in a report that names nobody.
    assert!(!html.contains("clinical = ") && !html.contains("Dr. Readerson"), "the history itself");
    let replay = ["replay", "--software", page.to_str().unwrap()];
    let line = refusal(&[&replay[..], &case[..]].concat());
    assert!(line.contains("expected --history FILE"), "{line}");
    let given = ["--history", history.to_str().unwrap()];
    let output = run(PROGRAM, &[&replay[..], &case[..], &given[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // Neither a table nor a history is written over.
    let line = refusal(&[&["lesions"], &case[..], &["--csv", csv.to_str().unwrap()]].concat());
    assert!(line.contains("found a file that exists"), "{line}");
    let html_history = path("history.html");
    std::fs::copy(&history, &html_history).unwrap();
    let arguments =
        ["--history", html_history.to_str().unwrap(), "--force", "--out", html_history.to_str().unwrap()];
    let line = refusal(&[&["report"], &case[..], &arguments[..]].concat());
    assert!(line.contains("found a file that the case was read from"), "{line}");
    // Where the history denies what the masks show, that is said beside the call.
    let denied = format!("{text}new_lesion = \"none\"\n");
    glioscope_core::files::write_whole(&history, denied.as_bytes()).unwrap();
    let (json, stderr) = response(&["--history", history.to_str().unwrap()]);
    assert!(stderr.contains("[history-contradicts-masks]") && stderr.contains("lesion B new"), "{stderr}");
    assert_eq!(json["warnings"].as_array().unwrap().len(), 1);
    let arguments =
        ["--history", history.to_str().unwrap(), "--software", "--force", "--out", page.to_str().unwrap()];
    let output = run(PROGRAM, &[&["report"], &case[..], &arguments[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let html = std::fs::read_to_string(&page).unwrap();
    let front = html.split("Summary</h2>").next().unwrap();
    assert!(
        front.contains("found lesion B new") && !front.contains("nothing to warn of"),
        "warnings are in front"
    );
    // The history's criteria can be others, and dates may be days.
    let lgg = answer(
        &[
            &["response"],
            &case[..],
            &["--json", "--history", history.to_str().unwrap(), "--criteria", "rano-lgg"],
        ]
        .concat(),
    );
    assert_eq!(lgg.0["criterion"], "rano-lgg");
    let undated = [format!("T={first}@pre"), format!("T={second}@post")];
    let days = "response = 1\ncriterion = \"rano-2010\"\nbaseline = \"pre\"\n[[date]]\ndate = \"pre\"\ndays = 0\n\
                [[date]]\ndate = \"post\"\ndays = 42\n";
    glioscope_core::files::write_whole(&history, days.as_bytes()).unwrap();
    let arguments = [
        "response",
        "--mask",
        &undated[0],
        "--mask",
        &undated[1],
        "--json",
        "--history",
        history.to_str().unwrap(),
    ];
    let (json, _) = answer(&arguments);
    assert_eq!(json["dates"][1]["days_from_baseline"], 42);

    glioscope_core::files::write_whole(&history, b"response = 1\ncriterion = \"rano-3\"\n").unwrap();
    let line = refusal(&[&["response"], &case[..], &["--history", history.to_str().unwrap()]].concat());
    assert!(line.contains("history.toml, history, line 2: found") && line.contains("rano-2.0"), "{line}");
    assert!(refusal(&[&["response"], &case[..]].concat()).contains("no criteria"));
    let line = refusal(&[&["lesions"], &case[..], &["--of", "X"]].concat());
    assert!(line.contains("found no mask X at any date, expected one of T"), "{line}");
}

#[test]
fn a_lesion_has_the_values_of_its_voxels_and_the_movement_of_its_own_surface() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (grows, stays) = ([20.0, 20.0, 20.0], [45.0, 45.0, 20.0]);
    let masks = [
        format!("T={}@2024-01-01", balls(&path("a.nii"), &[(grows, 7.0), (stays, 6.0)])),
        format!("T={}@2024-03-01", balls(&path("b.nii"), &[(grows, 9.0), (stays, 6.0)])),
    ];
    // 1 within 4 mm of the growing lesion's middle, 0 elsewhere.
    let image = format!("I={}@2024-03-01", balls(&path("i.nii"), &[(grows, 4.0)]));
    let arguments = ["lesions", "--mask", &masks[0], "--mask", &masks[1], "--context", &image];
    let (json, _) = answer(&[&arguments[..], &["--image", "I", "--surface", "--json"]].concat());
    let [larger, smaller] = [0, 1].map(|n: usize| &json["lesions"][n]["dates"][1]);
    let hot = {
        let of = answer(&["measure", "--mask", &image.replace("@2024-03-01", ""), "--json"]).0;
        of["time_points"][0]["masks"][0]["voxels"].as_f64().unwrap()
    };
    let voxels = larger["values"]["voxels"].as_f64().unwrap();
    let near = |value: &Value, expected: f64| (value.as_f64().unwrap() - expected).abs() < 1e-9;
    assert!(near(&larger["values"]["mean"], hot / voxels) && near(&larger["values"]["max"], 1.0), "{larger}");
    assert!(near(&larger["values"]["mean_times_ml"], hot / 1000.0));
    assert!(near(&smaller["values"]["max"], 0.0));
    assert!(json["lesions"][0]["dates"][0]["values"].is_null(), "no image at that date");
    let grown = larger["surface"]["growth"]["p50_mm"].as_f64().unwrap();
    assert!((grown - 2.0).abs() < 0.7 && larger["surface"]["recession"]["count"] == 0, "{grown}");
    assert_eq!(smaller["surface"]["growth"]["count"], 0, "it stays");
    assert_eq!(larger["surface"]["from_time"], "2024-01-01");
    assert!(json["lesions"][0]["dates"][0]["surface"].is_null(), "nothing is before it");
    let line = refusal(&[&arguments[..], &["--image", "nosuch"]].concat());
    assert!(line.contains("found the image nosuch, expected one of the case"), "{line}");
}
