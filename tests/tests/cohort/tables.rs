//! Tables against what is known of the made cohort and against the command line's JSON.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use glioscope_cohort::{KINDS, Type};
use glioscope_tests::answer;

use crate::{
    PROGRAM, glioscope_cohort,
    made::{BOX, DATES, MASKS, cohort, dice_of},
};

/// The rows of a table, by column.
pub fn read(out: &Path, table: &str) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(out.join("tables").join(format!("{table}.csv"))).unwrap();
    let head = reader.headers().unwrap().clone();
    let row = |record: csv::Result<csv::StringRecord>| {
        head.iter().map(str::to_owned).zip(record.unwrap().iter().map(str::to_owned)).collect()
    };
    reader.records().map(row).collect()
}

#[test]
fn tables_have_what_is_known_and_what_the_command_line_answers() {
    let (folder, input) = cohort(5);
    let out = folder.path().join("out");
    let (code, _, stderr) = glioscope_cohort(
        &input,
        &out,
        &["participant", "--compute", "metrics,lesions,change,response", "--criteria", "rano-2.0"],
    );
    assert_eq!(code, 0, "{stderr}");
    let (code, stdout, stderr) =
        glioscope_cohort(&input, &out, &["group", "--reference", "ref", "--rank-by", "dice", "hd95_mm"]);
    assert!(code == 2 && stderr.contains("hd95_mm"), "one word for each list: {stdout}{stderr}");
    let (code, _, stderr) =
        glioscope_cohort(&input, &out, &["group", "--reference", "ref", "--rank-by", "dice,hd95_mm"]);
    assert_eq!(code, 0, "{stderr}");
    let masks = read(&out, "masks");
    assert_eq!(masks.len(), 5 * 2 * 4);
    for row in &masks {
        let (_, length) = DATES.into_iter().find(|(date, _)| *date == row["time"]).unwrap();
        assert_eq!(row["voxels"], (length * BOX * BOX).to_string(), "{row:?}");
        assert_eq!(row["volume_ml"].parse::<f64>().unwrap(), (length * BOX * BOX) as f64 / 1000.0);
    }
    let pairs = read(&out, "pairs");
    let dice = pairs.iter().filter(|row| row["metric"] == "dice" && row["a"] == "ref");
    let mut seen = 0;
    for row in dice {
        let n: usize = row["case"].strip_prefix("case-").unwrap().parse().unwrap();
        let (_, length) = DATES.into_iter().find(|(date, _)| *date == row["time"]).unwrap();
        let (_, moved) = MASKS.into_iter().find(|(id, _)| *id == row["b"]).unwrap();
        assert!((row["value"].parse::<f64>().unwrap() - dice_of(moved(n), length)).abs() < 1e-12, "{row:?}");
        seen += 1;
    }
    assert_eq!(seen, 5 * 2 * 3);
    // Every number of one answer, as it is there.
    let (json, _) =
        answer(PROGRAM, &["measure", input.join("case-001").to_str().unwrap(), "--metrics", "--json"]);
    for row in pairs.iter().filter(|row| row["case"] == "case-001" && !row["metric"].starts_with("lesions_"))
    {
        let times = json["time_points"].as_array().unwrap();
        let time = times.iter().find(|time| time["time"] == row["time"].as_str()).unwrap();
        let pair = time["pairs"]
            .as_array()
            .unwrap()
            .iter()
            .find(|pair| pair["a"] == row["a"].as_str() && pair["b"] == row["b"].as_str());
        let value = &pair.unwrap()[&row["metric"]];
        assert_eq!(row["value"].parse::<f64>().ok(), value.as_f64(), "{row:?}");
    }
    for row in read(&out, "changes") {
        let grown = 2.0 * (BOX * BOX) as f64 / 1000.0;
        assert!(
            (row["new_ml"].parse::<f64>().unwrap() - grown).abs() < 1e-12 && row["gone_ml"] == "0",
            "{row:?}"
        );
    }
    let lesions = read(&out, "lesions");
    assert!(lesions.iter().all(|row| row["components"] == "1" && row["small"] == "false"), "{lesions:?}");
    assert_eq!(
        (lesions.len(), read(&out, "responses").len(), read(&out, "failures").len()),
        (10, 5 * 2 * 2, 0)
    );
    // a is never moved more than b, and c is always moved most.
    let ranks = read(&out, "ranks");
    for metric in ["dice", "hd95_mm", "all"] {
        let places: Vec<&str> =
            ranks.iter().filter(|row| row["metric"] == metric).map(|row| row["place"].as_str()).collect();
        assert_eq!(places, ["1", "2", "3"], "{metric}: {ranks:?}");
    }
    let c = ranks.iter().find(|row| row["metric"] == "dice" && row["mask"] == "c").unwrap();
    assert_eq!(["mean_rank", "low", "high", "cases"].map(|key| c[key].as_str()), ["3", "3", "3", "5"]);
    let tests = read(&out, "tests");
    // Five cases, all one way: 2 / 2^5.
    let test =
        tests.iter().find(|row| row["metric"] == "dice" && row["a"] == "b" && row["b"] == "c").unwrap();
    assert!(test["method"] == "normal" || test["p"] == "0.0625", "{test:?}");
    assert_eq!(tests.len(), 6);
}

#[test]
fn tables_are_the_same_bytes_each_time() {
    let (folder, input) = cohort(2);
    let out = folder.path().join("out");
    assert_eq!(glioscope_cohort(&input, &out, &["participant"]).0, 0);
    let written = || {
        assert_eq!(glioscope_cohort(&input, &out, &["group"]).0, 0);
        crate::tree(&out.join("tables"))
    };
    let first = written();
    assert_eq!(first.len(), 7 * 2 + 1);
    assert!(first == written());
}

/// The data dictionary as the page has it.
fn dictionary_page() -> String {
    let mut page = String::new();
    for kind in KINDS {
        page += &format!(
            "\n### `{}`\n\nA row is {}.\n\n| column | type | unit | |\n|---|---|---|---|\n",
            kind.name, kind.about
        );
        for column in kind.columns {
            let of = match column.kind {
                Type::Text => "text",
                Type::Whole => "whole number",
                Type::Number => "number",
                Type::Bool => "true or false",
            };
            page += &format!("| `{}` | {of} | {} | {} |\n", column.name, column.unit, column.about);
        }
    }
    page
}

#[test]
fn the_page_has_the_dictionary() {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/cohort.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let (begin, end) =
        ("<!-- dictionary: written by tests/tests/cohort/tables.rs -->\n", "<!-- end of the dictionary -->");
    let (before, rest) = page.split_once(begin).unwrap();
    let (found, after) = rest.split_once(end).unwrap();
    let expected = format!("{}\n", dictionary_page());
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(&path, format!("{before}{begin}{expected}{end}{after}")).unwrap();
        return;
    }
    assert!(found == expected, "docs/cohort.md is older than the tables: UPDATE_DOCS=1 writes it");
}
