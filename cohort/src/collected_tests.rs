//! Tables written by the writer of `group` and asked again, against values by hand.

use std::path::Path;

use glioscope_core::Progress;

use crate::{
    Collected, Date, KINDS, Quantity, Reduce,
    tables::{CHANGES, FAILURES, Field, MASKS, PAIRS, REGIONS, RESPONSES, Writer},
};

fn text(text: &str) -> Field {
    Field::Text(text.to_owned())
}

/// Writes tables with these rows; fields that a row lacks are null.
fn write(folder: &Path, rows: Vec<(usize, Vec<Field>)>) {
    let tables = folder.join("tables");
    std::fs::create_dir_all(&tables).unwrap();
    let mut writers: Vec<Writer> =
        KINDS[..7].iter().map(|kind| Writer::new(kind, &tables, "0").unwrap()).collect();
    for (table, mut row) in rows {
        row.resize(KINDS[table].columns.len(), Field::Null);
        writers[table].row(row).unwrap();
    }
    writers.into_iter().for_each(|writer| assert!(writer.close().is_ok()));
}

fn mask(case: &str, time: &str, id: &str, ml: f64) -> (usize, Vec<Field>) {
    (MASKS, vec![text(case), text(time), text(id), Field::Whole((ml * 1000.0) as i64), Field::Number(ml)])
}

fn region(case: &str, time: &str, ids: &str, voxels: i64, voxel_ml: f64) -> (usize, Vec<Field>) {
    let volume = Field::Number(voxels as f64 * voxel_ml);
    (REGIONS, vec![text(case), text(time), text(ids), Field::Null, Field::Whole(voxels), volume])
}

fn pair(case: &str, time: &str, [a, b]: [&str; 2], metric: &str, value: Option<f64>) -> (usize, Vec<Field>) {
    let null = Field::Null;
    let of = [null.clone(), null.clone(), null, text(metric), Field::number(value)];
    (PAIRS, [vec![text(case), text(time), text(a), text(b)], of.into()].concat())
}

fn made(folder: &Path) -> Collected {
    let change = |case: &str, from: f64, to: f64| {
        let labels = ["ref", "t1", "t2"].map(text);
        (CHANGES, [vec![text(case)], labels.into(), vec![Field::Number(from), Field::Number(to)]].concat())
    };
    let call = |case: &str, time: &str, call: &str| {
        let before =
            [text(case), text("rano-2.0"), text("bidimensional"), text(time), Field::Null, text("diameters")];
        (RESPONSES, [before.to_vec(), vec![text(call)]].concat())
    };
    let rows = vec![
        mask("b", "t1", "ref", 1.0),
        mask("b", "t1", "x+y", 2.0),
        mask("b", "t2", "ref", 3.0),
        mask("b", "t2", "x+y", 4.0),
        mask("a", "", "ref", 5.0),
        mask("c", "t1", "ref", 7.0),
        mask("c", "t2", "ref", 0.0),
        region("b", "t1", "ref", 10, 0.5),
        region("b", "t2", "ref", 20, 0.5),
        region("b", "t2", "ref+x+y", 30, 0.5),
        region("b", "t2", "ref+x+y+z", 7, 0.5),
        region("b", "t2", "z", 5, 0.5),
        region("a", "", "ref", 40, 0.25),
        // At its last date nothing is active.
        region("c", "t1", "ref", 50, 0.1),
        pair("b", "t1", ["ref", "x+y"], "dice", Some(0.5)),
        pair("b", "t1", ["ref", "x+y"], "hd95_mm", Some(4.0)),
        pair("b", "t2", ["ref", "x+y"], "dice", Some(0.25)),
        pair("b", "t2", ["ref", "z"], "dice", None),
        pair("a", "", ["ref", "z"], "dice", Some(0.75)),
        pair("c", "t1", ["ref", "x+y"], "hd95_mm", Some(f64::INFINITY)),
        change("b", 1.0, 3.0),
        change("c", 7.0, 0.0),
        call("b", "t1", "baseline"),
        call("b", "t2", "progression"),
        (FAILURES, vec![text("d"), text("measure"), Field::Whole(2), text("no image")]),
    ];
    write(folder, rows);
    Collected::read(folder, &Progress::new()).unwrap()
}

#[test]
fn numbers_of_cases_are_those_of_their_rows() {
    let folder = tempfile::tempdir().unwrap();
    let collected = made(folder.path());
    assert_eq!(collected.cases(), ["a", "b", "c", "d"]);
    assert_eq!(collected.masks(), ["ref", "x+y"]);
    let numbers = |table: &'static str, column: &str, of: &[&str], reduce: Reduce| -> Vec<Option<f64>> {
        let of = of.iter().map(|of| (*of).to_owned()).collect();
        let quantity = Quantity { of, ..Quantity::new(table, column, reduce) };
        collected.numbers(&quantity).into_iter().map(|n| (!n.is_nan()).then_some(n)).collect()
    };
    use Reduce::{First, Greatest, Last, Least, Mean};
    let some = |a: f64, b: f64, c: f64| vec![Some(a), Some(b), Some(c), None];
    assert_eq!(numbers("masks", "volume_ml", &[], Least), some(5.0, 1.0, 0.0));
    assert_eq!(numbers("masks", "volume_ml", &[], Greatest), some(5.0, 4.0, 7.0));
    assert_eq!(numbers("masks", "volume_ml", &[], Mean), some(5.0, 2.5, 3.5));
    assert_eq!(numbers("masks", "volume_ml", &["ref"], First), some(5.0, 1.0, 7.0));
    assert_eq!(numbers("masks", "volume_ml", &["ref"], Last), some(5.0, 3.0, 0.0));
    assert_eq!(numbers("masks", "volume_ml", &["x+y"], Last), [None, Some(4.0), None, None]);
    assert_eq!(numbers("pairs", "dice", &[], Least), [Some(0.75), Some(0.25), None, None]);
    assert_eq!(numbers("pairs", "dice", &["ref", "z"], Least), [Some(0.75), None, None, None]);
    assert_eq!(numbers("pairs", "hd95_mm", &[], Greatest), [None, Some(4.0), Some(f64::INFINITY), None]);
    assert_eq!(numbers("changes", "grown_ml", &[], Last), [None, Some(2.0), Some(-7.0), None]);
    assert_eq!(numbers("pairs", "no such metric", &[], Last), [None; 4]);
    assert_eq!(numbers("nothing", "volume_ml", &[], Last), [None; 4]);
    let words = |reduce| collected.words(&Quantity::new("responses", "call", reduce));
    assert_eq!(words(Last), [None, Some("progression"), None, None]);
    assert_eq!(words(First), [None, Some("baseline"), None, None]);
    assert_eq!(collected.failures().into_iter().collect::<Vec<_>>(), [(3, "measure: no image".to_owned())]);
}

#[test]
fn overlaps_are_those_of_the_masks_asked_for_at_one_date() {
    let folder = tempfile::tempdir().unwrap();
    let collected = made(folder.path());
    let masks = ["ref".to_owned(), "x+y".to_owned()];
    let last = collected.overlaps(&masks, Date::Last);
    // z isn't asked for: what lies in it and in both others counts for these.
    assert_eq!((last[1].voxels, last[1].voxel_ml), ([0, 20, 0, 37, 0, 0, 0, 0], 0.5));
    assert_eq!((last[0].voxels[1], last[0].voxel_ml), (40, 0.25));
    assert_eq!(last[2].voxels, [0; 8], "the last date has no region, the first one isn't it");
    let first = collected.overlaps(&masks, Date::First);
    assert_eq!((first[1].voxels[1], first[2].voxels[1], first[3].voxels), (10, 50, [0; 8]));
    assert_eq!(collected.overlaps(&["z".to_owned()], Date::Last)[1].voxels[1], 12);
}

#[test]
fn what_is_offered_has_values_and_units() {
    let folder = tempfile::tempdir().unwrap();
    let offered = made(folder.path()).offered();
    let names: Vec<(&str, &str, &str, bool)> =
        offered.iter().map(|offer| (offer.table, offer.column.as_str(), offer.unit, offer.is_text)).collect();
    assert_eq!(
        names,
        [
            ("masks", "voxels", "", false),
            ("masks", "volume_ml", "ml", false),
            ("regions", "voxels", "", false),
            ("regions", "volume_ml", "ml", false),
            ("pairs", "dice", "", false),
            ("pairs", "hd95_mm", "mm", false),
            ("changes", "from_ml", "ml", false),
            ("changes", "to_ml", "ml", false),
            ("changes", "grown_ml", "ml", false),
            ("responses", "assessment", "", true),
            ("responses", "by", "", true),
            ("responses", "call", "", true),
            ("failures", "exit_code", "", false),
            ("failures", "error", "", true),
        ]
    );
}

#[test]
fn what_is_no_cohort_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let error = |folder: &Path| Collected::read(folder, &Progress::new()).unwrap_err().to_string();
    assert!(error(folder.path()).contains("no tables of a cohort"));
    let tables = folder.path().join("tables");
    std::fs::create_dir(&tables).unwrap();
    glioscope_core::files::write_whole(&tables.join("masks.parquet"), b"PAR1 is not enough PAR1").unwrap();
    let found = error(folder.path());
    assert!(found.contains("masks.parquet: found no Parquet") && !found.contains('\n'), "{found}");
    // A table of another kind under the name.
    let other = tempfile::tempdir().unwrap();
    write(other.path(), vec![(FAILURES, vec![text("a")])]);
    std::fs::copy(other.path().join("tables/failures.parquet"), tables.join("masks.parquet")).unwrap();
    let collected = Collected::read(folder.path(), &Progress::new()).unwrap();
    assert_eq!((collected.cases(), collected.masks().len()), (&["a".to_owned()][..], 0));
    // Where its files were isn't known, or they are gone.
    let found = collected.source("a").unwrap_err().to_string();
    assert!(found.contains("no status.json that says where its files are"), "{found}");
}
