//! Outputs of every kind, of made cases: what `schemas` holds against docs/schemas.

use std::{
    io::{BufRead, BufReader, Write},
    net::TcpListener,
    path::Path,
};

use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, PaneId, ResponseSetting, Ruler, Shape, Tool},
    report::recipe_in,
};
use glioscope_core::{
    Progress,
    case::{self, LoadOptions},
    glam::DVec3,
    lesions::{self, Anchor, Edit, Of, Options},
    response::Criterion,
    sample,
    study::COLUMNS,
};
use glioscope_render::{TransferForm, TransferPreset, TransferShape};
use glioscope_tests::{
    doc, error_text, issue, perform, run, wait_for_workers, window_on, write_cube, write_tck,
};
use serde_json::Value;
use strum::VariantArray;
use tempfile::TempDir;

use crate::PROGRAM;

/// What makes outputs of one schema.
pub type Outputs = fn(&Made) -> Vec<Value>;

/// Schemas by name, and what makes outputs that have all that they describe: answers of the command line.
pub const ANSWERS: [(&str, Outputs); 12] = [
    ("measure", measures),
    ("ellipsoids", ellipsoids),
    ("lesions", found_lesions),
    ("response", responses),
    ("change", changes),
    ("self-check", self_checks),
    ("info", infos),
    ("tracts", tracts),
    ("transform", transforms),
    ("register", registrations),
    ("pacs-list", archives),
    ("study", studies),
];

/// Likewise: what is drawn, exported from the window and written in reports.
pub const WRITTEN: [(&str, Outputs); 7] = [
    ("numbers", numbers),
    ("lines", lines),
    ("transfer", transfers),
    ("stats", stats),
    ("recipe", recipes),
    ("cohort-status", |made| cohort(made)[..2].to_vec()),
    ("cohort-tables", |made| cohort(made)[2..].to_vec()),
];

/// Side of the cubes with masks, voxels of 1 mm.
const SIDE: usize = 32;

/// The program's answer as JSON, and what it says on stderr.
pub fn answer(arguments: &[&str]) -> (Value, String) {
    glioscope_tests::answer(PROGRAM, arguments)
}

/// Files of made cases in a folder: a ball at two places, a smaller one with a fleck, one voxel, nothing.
pub struct Made(TempDir);

impl Made {
    pub fn new() -> Self {
        let made = Self(tempfile::tempdir().unwrap());
        let is_in = |at: [usize; 3], center: [usize; 3], radius: f64| {
            let [at, center] = [at, center].map(|place| DVec3::from_array(place.map(|x| x as f64)));
            at.distance(center) < radius
        };
        made.cube("large", |at| is_in(at, [12; 3], 9.0));
        made.cube("moved", |at| is_in(at, [14, 12, 12], 8.0));
        made.cube("small", |at| is_in(at, [12; 3], 6.0) || is_in(at, [27; 3], 4.0) || at == [2, 29, 2]);
        made.cube("far", |at| is_in(at, [26; 3], 3.0));
        made.cube("voxel", |at| at == [12; 3]);
        made.cube("empty", |_| false);
        made
    }

    fn cube(&self, name: &str, is_in: impl Fn([usize; 3]) -> bool) {
        write_cube(&self.0.path().join(format!("{name}.nii")), SIDE, 1.0, |at| u8::from(is_in(at)));
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// A file with this text.
    fn file(&self, name: &str, text: &str) -> String {
        std::fs::write(self.0.path().join(name), text).unwrap();
        self.path(name)
    }

    /// Masks of one date, with these ids.
    fn masks(&self, names: &[&str]) -> Vec<String> {
        names
            .iter()
            .flat_map(|name| ["--mask".to_owned(), format!("{name}={}", self.path(&format!("{name}.nii")))])
            .collect()
    }

    /// One mask M at several dates.
    fn dates(&self, of_dates: &[(&str, &str)]) -> Vec<String> {
        let mask = |(name, date): &(&str, &str)| {
            ["--mask".to_owned(), format!("M={}@{date}", self.path(&format!("{name}.nii")))]
        };
        of_dates.iter().flat_map(mask).collect()
    }
}

/// The answer of a subcommand to a case and more.
fn of_case(task: &str, case: &[String], more: &[&str]) -> Value {
    let case: Vec<&str> = case.iter().map(String::as_str).collect();
    answer(&[&[task, "--json"], &case[..], more].concat()).0
}

/// Five participants with everything, one that lacks a light, one alone with depths, and one that prefers.
fn studies(made: &Made) -> Vec<Value> {
    let head = COLUMNS.join(",");
    let row =
        |participant: u32, task: &str, trial: u32, practice: u8, light: &str, result: &str, time_s: u32| {
            format!(
                "{participant},1,0.1.0,{task},{trial},{practice},{light},{trial},0.1,,{result},{time_s}.5"
            )
        };
    let mut rows = vec![head.clone(), row(1, "nearer", 1, 1, "traced,", "left,0,", 3)];
    for participant in 1..=6 {
        for (n, light) in ["traced,", "slices,", "cones,"].into_iter().enumerate().take(if participant == 6 {
            2
        } else {
            3
        }) {
            for again in 0..2 {
                let n = n as u32;
                let is = (participant * 5 + n * 3 + again * (participant + n)) % 3 % 2;
                let time_s = 1 + (participant * 7 + n * n * 2 + again * 5) % 6;
                rows.push(row(
                    participant,
                    "nearer",
                    2 * n + again + 1,
                    0,
                    light,
                    &format!("left,{is},"),
                    time_s,
                ));
            }
        }
    }
    rows.push(row(1, "depth", 1, 0, "traced,", "40,,2.5", 2));
    rows.push(row(1, "preference", 1, 0, "traced,cones", "left,,", 2));
    let file = made.file("answers.csv", &(rows.join("\n") + "\n"));
    let alone =
        [head, row(1, "depth", 1, 0, "traced,", "40,,2.5", 2), row(1, "depth", 2, 0, "cones,", "40,,2.5", 2)];
    let alone = made.file("alone.csv", &(alone.join("\n") + "\n"));
    [file, alone].map(|file| answer(&["study", "analyse", "--json", &file]).0).into()
}

fn measures(made: &Made) -> Vec<Value> {
    let mut out = vec![
        answer(&["measure", "--sample", "--json"]).0,
        answer(&["measure", "--sample", "--metrics", "--statistics", "--json"]).0,
        of_case("measure", &made.masks(&["empty"]), &["--metrics", "--statistics"]),
        of_case(
            "measure",
            &made.masks(&["large", "small"]),
            &["--metrics", "--percentile", "99.5", "--tau", "0"],
        ),
    ];
    for convention in ["deepmind", "metrics-reloaded", "medpy", "brats", "panoptica"] {
        let masks = made.masks(&["large", "moved", "far", "voxel", "empty"]);
        out.push(of_case("measure", &masks, &["--metrics", "--convention", convention]));
    }
    let image = format!("I={}", made.path("large.nii"));
    out.push(of_case("measure", &made.masks(&["voxel", "empty"]), &["--context", &image, "--statistics"]));
    // A date without a mask, and one that is moved.
    let moved = format!(
        "M@b={}:ras-moving-from-fixed",
        made.file("moved.txt", "1 0 0 2\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    );
    let image = format!("I={}@c", made.path("large.nii"));
    let dates = made.dates(&[("large", "a"), ("small", "b")]);
    out.push(of_case("measure", &dates, &["--transform", &moved, "--context", &image, "--order", "a,b,c"]));
    out
}

fn ellipsoids(made: &Made) -> Vec<Value> {
    vec![
        answer(&["ellipsoids", "--sample", "--json"]).0,
        of_case("ellipsoids", &made.masks(&["voxel", "small"]), &["--connectivity", "6"]),
        of_case("ellipsoids", &made.masks(&["empty"]), &[]),
    ]
}

fn found_lesions(made: &Made) -> Vec<Value> {
    let months =
        ["2024-01-01", "2024-02-01", "2024-03-01", "2024-04-01", "2024-05-01", "2024-06-01", "2024-07-01"];
    let names = ["large", "small", "moved", "large", "small", "moved", "far"];
    let long: Vec<_> = names.into_iter().zip(months).collect();
    let image = format!("I={}@2024-08-01", made.path("large.nii"));
    let product = ["--diameters", "largest-product", "--within", "0"];
    vec![
        answer(&["lesions", "--sample", "--of", "T1,PET", "--json"]).0,
        of_case("lesions", &made.dates(&long), &["--context", &image, "--image", "I", "--surface"]),
        answer(&["lesions", "--sample", "--image", "PET", "--surface", "--json"]).0,
        of_case("lesions", &made.dates(&[("empty", "pre"), ("voxel", "post")]), &product),
        of_case(
            "lesions",
            &made.dates(&[("far", "2024-01-01"), ("voxel", "2024-02-01")]),
            &["--within", "100"],
        ),
        edited(),
    ]
}

/// Lesions of the sample with every edit, once where it means something and once where it doesn't.
fn edited() -> Value {
    let case = case::load(&sample::sample_spec(), &LoadOptions::default(), &Progress::new()).unwrap();
    let options = Options::new(Of::Mask("T1".into()));
    let report = |edits: &[Edit]| lesions::report(&case, &options, edits, &Progress::new()).unwrap();
    let plain = report(&[]);
    let link = plain.links.first().unwrap();
    let (from, to) = (link.from.clone().unwrap(), link.to.clone().unwrap());
    let nowhere = Anchor { at_mm: DVec3::splat(9e3), ..from.clone() };
    let seeds_mm = [DVec3::ZERO; 2];
    let edits = [
        Edit::Name { at: from.clone(), name: "left".into() },
        Edit::Verify { from: from.clone(), to: to.clone() },
        Edit::Unlink { from: from.clone(), to: to.clone() },
        Edit::Ignore { at: to.clone() },
        Edit::Link { from: nowhere.clone(), to: to.clone() },
        Edit::Unlink { from: nowhere.clone(), to: to.clone() },
        Edit::Merge { from: nowhere.clone(), to: from },
        Edit::Verify { from: nowhere.clone(), to },
        Edit::Split { at: nowhere.clone(), seeds_mm },
        Edit::Ignore { at: nowhere.clone() },
        Edit::Name { at: nowhere, name: "right".into() },
        Edit::VerifyAll,
    ];
    let report = report(&edits);
    assert!(report.edits_not_applied.len() >= 7 && !report.unlinked.is_empty() && !report.ignored.is_empty());
    serde_json::to_value(report).unwrap()
}

fn responses(made: &Made) -> Vec<Value> {
    let scans =
        [("large", "2024-01-01"), ("small", "2024-02-01"), ("moved", "2024-03-01"), ("empty", "2024-04-01")];
    let case = made.dates(&scans);
    let criteria = ["rano-2010", "rano-lgg", "mrano", "rano-2.0", "irano", "rano-bm"];
    let mut out: Vec<Value> =
        criteria.iter().map(|criteria| of_case("response", &case, &["--criteria", criteria])).collect();
    let history = made.file("history.toml", HISTORY);
    out.push(of_case("response", &case, &["--history", &history]));
    let mixed = ["--criteria", "rano-2.0", "--assessment", "mixed", "--of", "M", "--non-enhancing", "M"];
    out.push(of_case("response", &case, &mixed));
    out
}

const HISTORY: &str = r#"
response = 1
criterion = "rano-2010"
baseline = "2024-01-01"
radiotherapy_end = "none"
treatment = []
[repeatability.product]
relative_sd = 0.2
source = "own phantom"
[[date]]
date = "2024-02-01"
steroids_mg = 0
clinical = "stable"
new_lesion = "none"
flair = "not-worse"
non_target = "none"
technique_changed = []
[[date]]
date = "2024-03-01"
new_lesion = "measurable"
"#;

/// With an image and without one; of one run, which has no standard error.
fn self_checks(made: &Made) -> Vec<Value> {
    let few = ["--unchanged", "2", "--runs", "1"];
    vec![
        answer(&[&["self-check", "--sample", "--json"][..], &few].concat()).0,
        of_case("self-check", &made.masks(&["large"]), &["--unchanged", "1", "--runs", "2"]),
        of_case("self-check", &made.dates(&[("large", "2024-01-01"), ("small", "2024-02-01")]), &few),
    ]
}

fn changes(made: &Made) -> Vec<Value> {
    let change = |names: [&str; 2], more: &[&str]| {
        of_case("change", &made.dates(&[(names[0], "2024-01-01"), (names[1], "2024-02-01")]), more)
    };
    let moved = made.file("moved.txt", "1 0 0 1\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    let moved = format!("M@2024-02-01={moved}:ras-moving-from-fixed");
    vec![
        answer(&["change", "--sample", "--json"]).0,
        change(["large", "moved"], &["--level", "2", "--transform", &moved]),
        change(["small", "large"], &[]),
        change(["large", "small"], &["--self-check"]),
        change(["large", "large"], &[]),
        change(["large", "voxel"], &[]),
        change(["large", "empty"], &[]),
        change(["empty", "large"], &[]),
        change(["empty", "empty"], &[]),
        change(["voxel", "far"], &[]),
    ]
}

fn infos(made: &Made) -> Vec<Value> {
    let nrrd =
        made.file("a.nrrd", "NRRD0004\ntype: uint8\ndimension: 2\nsizes: 2 2\nencoding: ascii\n\n1 0 1 0\n");
    let segmented = made.path("a.seg.nrrd");
    let (study, dicom) = (made.0.path().join("study"), made.path("study/a.dcm"));
    std::fs::create_dir(study).unwrap();
    let first = sample::sample_spec().masks.first().and_then(|mask| mask.time.clone()).unwrap();
    for (format, out) in [("seg.nrrd", &segmented), ("dicom-seg", &dicom)] {
        let output =
            run(PROGRAM, &["export", "--sample", "--time", &first, "--format", format, "--out", out]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let tck = made.path("a.tck");
    write_tck(Path::new(&tck), &[vec![[0.0; 3], [1.0; 3]]]);
    let labels = format!(
        "glioscope = 1\n[[mask]]\nid = \"a\"\nfile = \"large.nii\"\nlabels = [1]\n[[tracts]]\nid = \"t\"\nfile = \"{tck}\"\n"
    );
    let manifest = made.file("labels.toml", &labels);
    let [file, missing] = ["large.nii", "voxel.nii"].map(|name| made.path(name));
    vec![
        answer(&["info", "--sample", "--json"]).0,
        answer(&["info", &manifest, "--json"]).0,
        answer(&["info", &file, "--json"]).0,
        answer(&["info", &missing, "--cross-check", "--json"]).0,
        answer(&["info", &nrrd, "--json"]).0,
        answer(&["info", &segmented, "--json"]).0,
        answer(&["info", &dicom, "--json"]).0,
        answer(&["info", &made.path("study"), "--json"]).0,
    ]
}

fn tracts(made: &Made) -> Vec<Value> {
    let tck = made.path("line.tck");
    write_tck(
        Path::new(&tck),
        &[vec![[0.0, 12.0, 12.0], [31.0, 12.0, 12.0]], vec![[0.0, 0.0, 31.0], [5.0, 0.0, 31.0]]],
    );
    vec![
        of_case("tracts", &made.masks(&["large"]), &["--tracts", &tck]),
        of_case("tracts", &made.masks(&["large"]), &["--tracts", &tck, "--select", "none"]),
        of_case("tracts", &made.masks(&["empty"]), &["--tracts", &tck, "--within", "0"]),
    ]
}

fn transforms(made: &Made) -> Vec<Value> {
    let file = made.file("matrix.txt", "0 -1 0 2\n1 0 0 3\n0 0 1.1 4\n0 0 0 1\n");
    let itk = made.path("written.tfm");
    vec![
        answer(&["transform", &file, "--convention", "niftyreg", "--out", &itk, "--json"]).0,
        answer(&["transform", &itk, "--json"]).0,
    ]
}

fn registrations(made: &Made) -> Vec<Value> {
    let case = made.path("sample");
    assert!(run(PROGRAM, &["sample", "--out", &case]).status.success());
    // Onto itself: quicker than onto another sequence.
    let image = format!("{case}/t1c-2024-01-15.nii.gz");
    vec![answer(&["register", "--fixed", &image, "--moving", &image, "--model", "affine", "--json"]).0]
}

/// What an archive answers to a search: one study and one series that say all, one of each that say nothing.
fn archives(made: &Made) -> Vec<Value> {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/dicom-web", listener.local_addr().unwrap());
    // It ends with the test.
    std::thread::spawn(move || {
        for mut stream in listener.incoming().flatten() {
            let mut head = BufReader::new(&stream).lines().map_while(Result::ok);
            let asked = head.next().unwrap_or_default();
            head.find(String::is_empty);
            let body = if asked.contains("/series") { SERIES } else { STUDIES };
            let length = body.len();
            let _ = write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Type: application/dicom+json\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
            );
        }
    });
    let list = |more: &[&str]| {
        let mut command = std::process::Command::new(PROGRAM);
        command.env("GLIOSCOPE_CONFIG", made.path("config")).env("GLIOSCOPE_CACHE", made.path("cache"));
        let output = command.args(["pacs", "list", "--pacs", &url, "--json"]).args(more).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let all = list(&["--study", "1.2.3"]);
    assert_eq!([&all["studies"], &all["series"]].map(|list| list.as_array().unwrap().len()), [2, 2], "{all}");
    vec![list(&[]), all]
}

const STUDIES: &str = r#"[{"0020000D":{"vr":"UI","Value":["1.2.3"]},"00100020":{"vr":"LO","Value":["7"]},
"00100010":{"vr":"PN","Value":[{"Alphabetic":"Doe^Jane"}]},"00100030":{"vr":"DA","Value":["19700101"]},
"00080020":{"vr":"DA","Value":["20240101"]},"00080030":{"vr":"TM","Value":["101500"]},"00080050":{"vr":"SH","Value":["A1"]},
"00081030":{"vr":"LO","Value":["head"]},"00080061":{"vr":"CS","Value":["MR","PT"]},"00201206":{"vr":"IS","Value":[2]},
"00201208":{"vr":"IS","Value":[40]}},{"00081030":{"vr":"LO","Value":["other"]}}]"#;
const SERIES: &str = r#"[{"0020000E":{"vr":"UI","Value":["1.2.3.4"]},"00080060":{"vr":"CS","Value":["MR"]},
"00200011":{"vr":"IS","Value":[3]},"0008103E":{"vr":"LO","Value":["T1"]},"00201209":{"vr":"IS","Value":[20]}},
{"00080060":{"vr":"CS","Value":["PT"]}}]"#;

fn numbers(made: &Made) -> Vec<Value> {
    let sample = exported(made, CaseRef::Sample, &AppCommand::ExportMeasurementsTo, false);
    let empty =
        CaseRef::Arguments { masks: vec![format!("e={}", made.path("empty.nii"))], contexts: Vec::new() };
    let empty = exported(made, empty, &AppCommand::ExportMeasurementsTo, true);
    assert!(
        !sample["lens"].is_null()
            && !sample["response"].is_null()
            && !sample["lesions"].is_null()
            && empty["response"].is_null()
            && !sample["change"].is_null()
            && empty["lens"].is_null()
            && empty["change"].is_null()
    );
    vec![sample, empty]
}

fn lines(made: &Made) -> Vec<Value> {
    vec![exported(made, CaseRef::Sample, &AppCommand::ExportRulersTo, false)]
}

/// The transfer functions that the window writes: of points alone, with a factor by gradients, with each form.
fn transfers(made: &Made) -> Vec<Value> {
    let path = made.0.path().join("a.transfer.json");
    let mut harness = window_on(CaseRef::Sample, [800.0, 600.0], egui::Theme::Light);
    let (id, statistics) = {
        let world = &harness.state().work.world;
        let (id, image) = world.context(doc(&harness)).unwrap();
        (id.to_owned(), image.histogram().clone())
    };
    let presets = [TransferPreset::MrTissue, TransferPreset::MrBorders, TransferPreset::CtBoneShapes];
    let mut functions: Vec<_> = presets.iter().map(|preset| preset.transfer(&statistics)).collect();
    let form = TransferForm::Blob {
        value: 0.5,
        gradient_per_mm: 0.5,
        value_deviation: 0.25,
        gradient_deviation_per_mm: 0.25,
    };
    let mut blob = functions[0].clone();
    blob.set_shapes(Some(vec![TransferShape { form, color: [1, 2, 3], opacity: 0.5 }])).unwrap();
    functions.push(blob);
    let write = |transfer| {
        perform(&mut harness, EditCommand::SetTransfer(id.clone(), Some(transfer)));
        issue(&mut harness, AppCommand::SaveTransferTo(path.clone()));
        serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap()
    };
    functions.into_iter().map(write).collect()
}

/// What the window exports of a case with a line and a hidden region.
fn exported(
    made: &Made,
    case: CaseRef,
    command: &dyn Fn(std::path::PathBuf) -> AppCommand,
    toggles_lens: bool,
) -> Value {
    let path = made.0.path().join("exported.json");
    let mut harness = window_on(case, [800.0, 600.0], egui::Theme::Light);
    let (name, view) = ("Line 1".to_owned(), PaneId::Axial);
    let ends_mm = [DVec3::ZERO, DVec3::X];
    for tool in Tool::VARIANTS {
        let [from_mm, to_mm] = ends_mm;
        let shape = Shape::drawn(*tool, ends_mm, DVec3::Z);
        let line = Ruler { name: name.clone(), from_mm, to_mm, shape, view, time: 0 };
        perform(&mut harness, EditCommand::AddRuler(Box::new(line)));
    }
    perform(&mut harness, EditCommand::SetRegion(1, false));
    if toggles_lens {
        perform(&mut harness, EditCommand::ToggleLens);
    } else {
        let mut response = ResponseSetting::default();
        response.set_criterion(Some(Criterion::Rano2010));
        perform(&mut harness, EditCommand::SetResponse(Box::new(response)));
    }
    issue(&mut harness, command(path.clone()));
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    let exported = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    std::fs::remove_file(path).unwrap();
    exported
}

fn stats(made: &Made) -> Vec<Value> {
    let picture = made.path("x.png");
    let draw = |more: &[&str]| {
        let plain = ["render", "--sample", "--software", "--size", "48x48", "--stats", "--out", &picture];
        answer(&[&plain[..], more].concat()).0
    };
    vec![
        draw(&["--view", "overlap"]),
        draw(&["--view", "closeup", "--light-error"]),
        draw(&["--view", "context", "--light", "slices", "--quality", "draft"]),
        draw(&["--view", "context", "--light", "cones", "--quality", "draft", "--light-error"]),
    ]
}

fn recipes(made: &Made) -> Vec<Value> {
    let history = made.file("history.toml", HISTORY);
    let case = made.dates(&[("large", "2024-01-01"), ("small", "2024-02-01"), ("moved", "2024-03-01")]);
    let case: Vec<&str> = case.iter().map(String::as_str).collect();
    let out = made.path("report.html");
    let recipe = |more: &[&str]| {
        let output = run(PROGRAM, &[&["report", "--software", "--force", "--out", &out], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        recipe_in(&std::fs::read(&out).unwrap()).unwrap().unwrap()
    };
    let full = ["--history", &history, "--identity", "full", "--language", "de", "--criteria", "rano-2010"];
    vec![recipe(&[&case[..], &full].concat()), recipe(&[&case[..], &["--criteria", "rano-bm"]].concat())]
}

/// Of a cohort of two cases, one of which lacks a file: both statuses and the dictionary.
fn cohort(made: &Made) -> Vec<Value> {
    let (input, out) = (made.path("cohort"), made.path("cohort-results"));
    for (case, later) in [("a", "moved"), ("b", "absent")] {
        std::fs::create_dir_all(Path::new(&input).join(case)).unwrap();
        let masks = [("large", "2024-01-01"), (later, "2024-02-01")].map(|(file, date)| {
            format!("[[mask]]\nid = \"M\"\nfile = \"../../{file}.nii\"\ntime = \"{date}\"\n")
        });
        made.file(&format!("cohort/{case}/case.toml"), &format!("glioscope = 1\n{}", masks.concat()));
    }
    let options = ["--compute", "metrics,change", "--tau", "2", "--one-space"];
    assert_eq!(
        run(PROGRAM, &[&["cohort", &input, &out, "participant"], &options[..]].concat()).status.code(),
        Some(1)
    );
    assert!(run(PROGRAM, &["cohort", &input, &out, "group"]).status.success());
    ["cases/a/status.json", "cases/b/status.json", "tables/dictionary.json"]
        .map(|file| serde_json::from_slice(&std::fs::read(Path::new(&out).join(file)).unwrap()).unwrap())
        .to_vec()
}

/// Arguments whose answers fit a schema, of a folder of real data.
pub fn of_real_data(folder: &Path) -> Vec<(&'static str, Vec<String>)> {
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let mask = |id: &str, file: &str, end: &str| ["--mask".to_owned(), format!("{id}={}{end}", path(file))];
    let arguments = |task: &str, case: &[String], more: &[&str]| -> Vec<String> {
        let all = [task, "--json"].into_iter().chain(more.iter().copied()).map(str::to_owned);
        all.chain(case.iter().cloned()).collect()
    };
    let mut out = Vec::new();
    match folder.file_name().and_then(|name| name.to_str()).unwrap() {
        "glioma-5-algorithms" => {
            let files = ["scan-20.nii.gz", "isen-20.nii.gz", "consensus.nii.gz"];
            let masks = ["a", "b", "c"]
                .iter()
                .zip(files)
                .flat_map(|(id, file)| mask(id, file, ":4"))
                .collect::<Vec<_>>();
            out.push(("measure", arguments("measure", &masks, &["--metrics", "--convention", "brats"])));
            let days = ["@2024-01-01", "@2024-02-01", "@2024-03-01"];
            let dates = days
                .iter()
                .zip(files)
                .flat_map(|(day, file)| mask("M", file, &format!(":4{day}")))
                .collect::<Vec<_>>();
            out.push(("lesions", arguments("lesions", &dates, &[])));
            out.push(("response", arguments("response", &dates, &["--criteria", "rano-2.0"])));
            out.push(("change", arguments("change", &dates, &[])));
        }
        "sarcoma-ct-mr-pet" => {
            let case = [folder.to_str().unwrap().to_owned()];
            out.push(("measure", arguments("measure", &case, &["--metrics", "--statistics"])));
            out.push(("ellipsoids", arguments("ellipsoids", &case, &[])));
        }
        "masks-degenerate" => {
            let files = ["empty", "full", "one_voxel", "disconnected"];
            let masks = files
                .iter()
                .flat_map(|name| mask(name, &format!("{name}_mask.nii.gz"), ""))
                .collect::<Vec<_>>();
            for convention in ["deepmind", "panoptica"] {
                out.push((
                    "measure",
                    arguments("measure", &masks, &["--metrics", "--convention", convention]),
                ));
            }
            out.push(("ellipsoids", arguments("ellipsoids", &masks, &[])));
        }
        // Folders and files.
        "dicom-multimodal" | "dicom-series" => {
            out.push(("info", arguments("info", &[folder.to_str().unwrap().to_owned()], &[])));
            for name in ["CT", "CT-rtstruct.dcm", "plain-axial"].map(path) {
                let first = Path::new(&name)
                    .is_dir()
                    .then(|| std::fs::read_dir(&name).unwrap().next().unwrap().unwrap().path());
                let file = first.unwrap_or_else(|| name.clone().into());
                if file.is_file() {
                    out.push(("info", arguments("info", &[file.to_str().unwrap().to_owned()], &[])));
                }
            }
        }
        _ => {
            let files = [
                "lps-gzip.nrrd",
                "raw.mha",
                "lps-ascii.nrrd",
                "one-layer.seg.nrrd",
                "big.nii.gz",
                "f32.nii.gz",
                "5D_small.nii",
                "rgb",
            ];
            for file in files.map(path).into_iter().filter(|file| Path::new(file).is_file()) {
                let more: &[&str] = if file.contains(".nii") { &["--cross-check"] } else { &[] };
                out.push(("info", arguments("info", &[file], more)));
            }
        }
    }
    out
}
