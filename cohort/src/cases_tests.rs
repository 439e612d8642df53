//! Tests of finding cases.

use std::path::Path;

use glioscope_core::files::write_whole;

use crate::find;

fn put(folder: &Path, name: &str, text: &str) {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_whole(&path, text.as_bytes()).unwrap();
}

fn labels(input: &Path, chosen: &[&str]) -> Result<Vec<String>, String> {
    let chosen: Vec<String> = chosen.iter().map(|label| (*label).to_owned()).collect();
    find(input, &chosen, true)
        .map(|cases| cases.into_iter().map(|case| case.label).collect())
        .map_err(|error| error.to_string())
}

#[test]
fn folders_are_cases_and_bids_names_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["BraTS-GLI-00002-000/x", "BraTS-GLI-00001-000/x", ".hidden/x", "notes.txt"] {
        put(at, name, "");
    }
    assert_eq!(labels(at, &[]).unwrap(), ["BraTS-GLI-00001-000", "BraTS-GLI-00002-000"]);
    for name in ["sub-02/x", "sub-01/x", "derivatives/x"] {
        put(at, name, "");
    }
    let error = labels(at, &[]).unwrap_err();
    assert!(
        error.contains("dataset_description.json: found no such file") && error.contains("--skip-bids"),
        "{error}"
    );
    put(at, "dataset_description.json", "{\"Name\": \"x\"}");
    assert!(labels(at, &[]).unwrap_err().contains("found no BIDSVersion"));
    assert_eq!(find(at, &[], false).unwrap().len(), 2);
    put(at, "dataset_description.json", "{\"Name\": \"x\", \"BIDSVersion\": \"1.9.0\"}");
    assert_eq!(labels(at, &[]).unwrap(), ["sub-01", "sub-02"]);
    assert_eq!(labels(at, &["02"]).unwrap(), ["sub-02"]);
    assert_eq!(labels(at, &["sub-01"]).unwrap(), ["sub-01"]);
    assert!(
        labels(at, &["03"]).unwrap_err().contains("--participant-label: found \"03\", expected cases of")
    );
}

#[test]
fn manifests_are_cases_named_as_their_files() {
    let folder = tempfile::tempdir().unwrap();
    put(folder.path(), "b.toml", "glioscope = 1\n");
    put(folder.path(), "a.toml", "# a case\nglioscope = 1\n");
    put(folder.path(), "pyproject.toml", "[project]\n");
    put(folder.path(), "images/x", "");
    let cases = find(folder.path(), &[], true).unwrap();
    assert_eq!(cases.iter().map(|case| case.label.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!(cases[0].path, folder.path().join("a.toml"));
}

#[test]
fn a_table_names_cases_and_what_is_wrong_with_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let (csv, tsv) = (folder.path().join("cohort.csv"), folder.path().join("participants.tsv"));
    put(folder.path(), "cohort.csv", "\u{feff}case,age,path,history\r\nb,40,x/b.toml,\r\na,n/a,,h.toml\r\n");
    let cases = find(&csv, &[], true).unwrap();
    assert_eq!(cases[0].path, folder.path().join("a"));
    assert_eq!(cases[0].history, Some(folder.path().join("h.toml")));
    assert_eq!((cases[1].path.clone(), cases[1].history.clone()), (folder.path().join("x/b.toml"), None));
    put(folder.path(), "participants.tsv", "participant_id\tsex\nsub-01\tF\n");
    assert_eq!(find(&tsv, &[], true).unwrap()[0].path, folder.path().join("sub-01"));
    for (text, expected) in [
        ("name,path\na,b\n", "no column \"case\""),
        ("case,path\na\n", "a table with as many fields"),
        ("case,path\n", "no row"),
        ("case,path\n,x\n", "no case in line 2"),
        ("case,path\n../a,x\n", "a name for a folder"),
        ("case,path\n.a,x\n", "a name for a folder"),
        ("case,path\nA,x\na,y\n", "two cases"),
    ] {
        put(folder.path(), "cohort.csv", text);
        let error = labels(&csv, &[]).unwrap_err();
        assert!(error.contains(expected) && !error.contains('\n'), "{text:?}: {error}");
    }
    assert!(labels(&folder.path().join("none"), &[]).unwrap_err().contains("expected a folder of cases"));
    put(folder.path(), "other.xlsx", "");
    assert!(labels(&folder.path().join("other.xlsx"), &[]).unwrap_err().contains("a file of another kind"));
}
