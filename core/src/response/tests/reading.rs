//! Reading of histories, their errors, BT-RADS, and the names in JSON.

use std::collections::BTreeMap;

use super::{
    super::*,
    made::{id_of, toml},
};

const GOOD: &str = r#"response = 1
criterion = "rano-2.0"
assessment = "enhancing"
disease = { value = "newly-diagnosed", author = "A. B.", entered = 2024-05-01 }
radiotherapy_end = 2024-01-03
baseline = 2024-02-01
targets = { value = ["A"], author = "A. B.", entered = 2024-05-01 }
non_targets = ["B"]
treatment = [{ start = 2024-02-05, kind = "drug", name = "temozolomide", author = "A. B.", entered = 2024-05-01 }]
[[surgery]]
date = 2023-11-20
author = "C. D."
entered = 2024-05-02
[repeatability.product]
relative_sd = 0.1
source = "own phantom"
[trial.confirm_response_days]
value = 28
source = "protocol, section 6"
[[date]]
date = 2024-02-01
steroids_mg = 2
[[date]]
date = "2024-03-01"
steroids_mg = { value = 4, author = "A. B.", entered = "2024-03-02" }
clinical = "worse"
technique_changed = ["contrast"]
[[measurement]]
date = 2024-02-01
lesion = "A"
compartment = "enhancing"
longest_mm = 20.0
perpendicular_mm = 10.0
slices = 3
slice_thickness_mm = 1.0
[[measurement]]
date = 2024-02-01
lesion = "B"
compartment = "enhancing"
product_mm2 = 40
[[measurement]]
date = 2024-03-01
lesion = "A"
compartment = "enhancing"
gone = true
"#;

#[test]
fn a_history_is_read() {
    let history = History::parse(GOOD).unwrap();
    assert_eq!(history.date[1].steroids_mg.as_ref().unwrap().author.as_deref(), Some("A. B."));
    assert_eq!(history.date[0].steroids_mg, Some(Fact::of(2.0)));
    assert_eq!(history.date[0].clinical, None);
    assert_eq!(history.disease.as_ref().unwrap().entered.as_deref(), Some("2024-05-01"));
    let treatment = &history.treatment.as_ref().unwrap()[0];
    assert_eq!(
        (treatment.author.as_deref(), treatment.entered.as_deref()),
        (Some("A. B."), Some("2024-05-01"))
    );
    assert_eq!(history.target_names(), Some(&["A".to_owned()][..]));
    assert_eq!(history.targets.as_ref().unwrap().author.as_deref(), Some("A. B."));
    assert_eq!(history.non_targets, Some(Fact::of(vec!["B".to_owned()])));
    let surgery = &history.surgery[0];
    assert_eq!((surgery.author.as_deref(), surgery.entered.as_deref()), (Some("C. D."), Some("2024-05-02")));
    // As a session keeps it.
    let kept = serde_json::to_string(&history).unwrap();
    assert_eq!(serde_json::from_str::<History>(&kept).unwrap(), history);
    let unnamed = serde_json::to_string(&history.clone().without_authors()).unwrap();
    for name in ["A. B.", "C. D.", "2024-05-0"] {
        assert!(kept.contains(name) && !unnamed.contains(name), "{name}: {unnamed}");
    }
    let response = evaluate(&history, &[]).unwrap();
    assert_eq!(response.dates.len(), 2);
    let last = &response.dates[1];
    assert_eq!((last.days_from_baseline, last.by_diameters.call), (Some(29), Call::PreliminaryProgression));
    assert!(last.by_diameters.reasons.iter().any(|r| r.words == "clinically worse"), "{last:#?}");
}

#[test]
fn a_line_is_that_of_the_text_whatever_criteria_are_asked_for() {
    let wrong = GOOD.replacen("steroids_mg = 2", "steroid = 2", 1);
    let line = 1 + wrong.lines().position(|line| line.contains("steroid =")).unwrap();
    // With comments above, a rewritten document has other lines.
    let wrong = format!("# one\n# two\n\n{wrong}");
    for criterion in [None, Some(Criterion::Rano2010), Some(Criterion::ModifiedRano)] {
        let error = History::parse_for(&wrong, criterion, None).unwrap_err();
        assert_eq!(error.place, format!("history, line {}", line + 3), "{criterion:?}: {error}");
    }
    // Without criteria of its own the text has another fault behind this one.
    let without = wrong.replacen("criterion = \"rano-2.0\"\n", "", 1);
    let error = History::parse_for(&without, Some(Criterion::Rano2010), None).unwrap_err();
    assert_eq!(error.place, format!("history, line {}", line + 2), "{error}");
}

#[test]
fn two_surgeries_on_a_day_and_more_than_all_of_a_volume_are_refused() {
    let twice = "[[surgery]]\ndate = 2024-01-03\n".repeat(2);
    let error = History::parse(&format!("{GOOD}{twice}")).unwrap_err().to_string();
    assert!(error.contains("found 2024-01-03 twice, expected one surgery a day"), "{error}");
    let mut trial = History::parse(GOOD).unwrap();
    let of = TrialNumber::MinorResponseVolumePercent;
    of.set(&mut trial.trial, Some((100.0, "protocol".into())));
    trial.check().unwrap();
    of.set(&mut trial.trial, Some((101.0, "protocol".into())));
    let error = trial.check().unwrap_err().to_string();
    assert!(error.contains("found value = 101, expected a number from 0 to 100"), "{error}");
}

#[test]
fn each_error_is_one_line_with_what_was_found_and_expected() {
    let replaced = |from: &str, to: &str| {
        assert!(GOOD.contains(from), "{from}");
        GOOD.replacen(from, to, 1)
    };
    let added = |text: &str| format!("{GOOD}{text}");
    let cases = [
        (replaced("response = 1", "response = 2"), "found response = 2, expected response = 1"),
        (
            replaced("\"rano-2.0\"", "\"recist\""),
            "line 2: found unknown variant `recist`, expected one of `rano-2010`",
        ),
        (replaced("assessment = \"enhancing\"\n", ""), "found no assessment, expected assessment = "),
        (replaced("\"rano-2.0\"", "\"mrano\""), "found an assessment with mRANO, expected "),
        (replaced("steroids_mg = 2", "steroid = 2"), "found unknown key `steroid`, expected one of `date`"),
        (
            replaced("author = \"A. B.\", entered = \"", "auther = \"A. B.\", entered = \""),
            "found unknown key `auther`",
        ),
        (
            replaced("entered = \"2024-03-02\"", "entered = \"yesterday\""),
            "found entered = \"yesterday\", expected an ISO date",
        ),
        (
            replaced("entered = 2024-05-01 }\nradio", "entered = true }\nradio"),
            "found entered = \"true\", expected an ISO date",
        ),
        (
            replaced("author = \"A. B.\", entered = 2024-05-01 }]", "author = \" \" }]"),
            "found author = \" \", expected a text",
        ),
        (replaced("\"worse\"", "\"bad\""), "found unknown variant `bad`, expected one of `stable`"),
        (
            replaced("steroids_mg = 2", "steroids_mg = -2"),
            "found steroids_mg = -2, expected a number from 0 to 1000",
        ),
        (
            replaced("steroids_mg = 2", "steroids_mg = nan"),
            "found steroids_mg = NaN, expected a number from 0 to 1000",
        ),
        (
            replaced("2024-01-03", "\"2024-02-31\""),
            "found \"2024-02-31\", expected an ISO date or a number of days",
        ),
        (replaced("2024-01-03", "17"), "expected dates only, or numbers of days only"),
        (
            replaced("baseline = 2024-02-01", "baseline = 2024-02-02"),
            "found baseline = 2024-02-02, expected a scan",
        ),
        (
            replaced("value = [\"A\"]", "value = [\"Z\"]"),
            "found Z among targets or non_targets, expected a measured",
        ),
        (replaced("value = [\"A\"]", "value = [\"A\", \"A\"]"), "found A twice in targets"),
        (replaced("non_targets = [\"B\"]", "non_targets = [\"A\"]"), "found A as target and as non-target"),
        (
            replaced("relative_sd = 0.1", "relative_sd = 0"),
            "found relative_sd = 0, expected a number from 0.000001 to 2",
        ),
        (replaced("source = \"own phantom\"", "source = \"\""), "found source = \"\", expected a text"),
        (
            replaced("confirm_response_days", "confirm_progression_days"),
            "found a value with RANO 2.0, expected criteria",
        ),
        (
            replaced("longest_mm = 20.0", "longest_mm = 2.0"),
            "found perpendicular_mm = 10, expected at most longest_mm = 2",
        ),
        (replaced("slices = 3", "product_mm2 = 100"), "found product_mm2 = 100, expected at least 200"),
        (replaced("slices = 3", "slices = 0"), "found slices = 0, expected at least 1"),
        (
            replaced("longest_mm = 20.0", "longest_mm = -20.0"),
            "found longest_mm = -20, expected a number above 0, at most 1000",
        ),
        (
            replaced("gone = true", "gone = true\nvolume_ml = 1"),
            "found gone = true and a size, expected one of them",
        ),
        (added("[[date]]\ndate = 2024-02-01\n"), "[[date]] 2024-02-01: found this date twice"),
        (
            added("[[date]]\ndate = \"2024-02-01 late\"\n"),
            "found \"2024-02-01\" and \"2024-02-01 late\" on one day",
        ),
        (added("[[date]]\ndate = \"week 3\"\n"), "found neither an ISO date nor days"),
        (added("[[date]]\ndate = \"week 3\"\ndays = 3\n"), "expected dates only, or numbers of days only"),
        (
            added("[[measurement]]\ndate = 2024-02-01\nlesion = \"A\"\ncompartment = \"enhancing\"\n"),
            "measurement of A at 2024-02-01: found this lesion and date twice",
        ),
        (
            added("[[measurement]]\ndate = 2024-04-01\nlesion = \"A\"\ncompartment = \"non-enhancing\"\n"),
            "found another compartment than at another date",
        ),
        (format!("# {}", "x".repeat(1 << 20)), "bytes, expected at most 1048576"),
        ("<html>".to_owned(), "line 1: found "),
    ];
    for (text, expected) in cases {
        let error =
            History::parse(&text).and_then(|history| evaluate(&history, &[])).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}\n  expected {expected}");
        assert!(!error.contains('\n') && error.contains(", expected "), "{error}");
    }
}

#[test]
fn days_may_be_numbers() {
    let text = "response = 1\ncriterion = \"rano-2010\"\nradiotherapy_end = 0\nbaseline = \"week 4\"\n\
        [[date]]\ndate = \"week 4\"\ndays = 28\n[[date]]\ndate = \"week 12\"\ndays = 84\n\
        [[measurement]]\ndate = \"week 4\"\ndays = 28\nlesion = \"A\"\ncompartment = \"enhancing\"\nproduct_mm2 = 200\n\
        [[measurement]]\ndate = \"week 12\"\ndays = 84\nlesion = \"A\"\ncompartment = \"enhancing\"\nproduct_mm2 = 250\n";
    let text = text.replace("baseline =", "targets = [\"A\"]\nbaseline =");
    let response = evaluate(&History::parse(&text).unwrap(), &[]).unwrap();
    let last = &response.dates[1];
    assert_eq!((last.days_from_baseline, last.by_diameters.call), (Some(56), Call::CannotSay));
    assert!(last.by_diameters.missing.iter().any(|m| m.input == Input::Field), "{last:#?}");
}

#[test]
fn measurements_of_the_program_join_those_of_the_file() {
    let text = toml(Criterion::Rano2010, "", "0 A=20x10 | 56");
    let history = History::parse(&text).unwrap();
    let mut measured = history.measurement[0].clone();
    measured.date = history.date[1].date.clone();
    measured.longest_mm = Some(25.0);
    let response = evaluate(&history, std::slice::from_ref(&measured)).unwrap();
    assert_eq!(response.dates[1].by_diameters.call, Call::Progression);
    measured.date = history.date[0].date.clone();
    assert!(evaluate(&history, &[measured]).unwrap_err().to_string().contains("twice"));
}

#[test]
fn what_the_criteria_say_against_a_stated_baseline_is_told() {
    let said = |scans: &str| {
        let head = "assessment = \"enhancing\"\nradiotherapy_end = {0}";
        let history = History::parse(&toml(Criterion::Rano20, head, scans)).unwrap();
        let judgement = &evaluate(&history, &[]).unwrap().dates[0].by_diameters;
        judgement.reasons.iter().map(|reason| reason.words.clone()).collect::<Vec<_>>()
    };
    assert_eq!(said("20 A=20x10 | 150 A=25x10")[1..], ["no scan 21 to 35 days after radiotherapy"]);
    let another = said("-20 A=30x10 | 28 A=20x10");
    assert!(
        another[1].starts_with("the criteria would choose another: baseline ")
            && another[1].ends_with("28 days after radiotherapy"),
        "{another:?}"
    );
    assert_eq!(said("28 A=20x10 | 150 A=25x10").len(), 1, "the same scan");
}

#[test]
fn a_proposed_baseline_counts_until_the_criteria_choose_one() {
    let said = |scans: &str| {
        let head = "#auto\nassessment = \"enhancing\"\nradiotherapy_end = {0}\ndisease = \"newly-diagnosed\"";
        let mut history = History::parse(&toml(Criterion::Rano20, head, scans)).unwrap();
        let first = history.measurement[0].date.clone();
        history.baseline = Some(Fact::proposed(first));
        // It stays a proposal where authors are left out.
        let history = history.without_authors();
        let response = evaluate(&history, &[]).unwrap();
        let of = response.dates.iter().map(|date| &date.by_diameters);
        of.map(|judgement| (judgement.call, judgement.reasons[0].words.clone())).collect::<Vec<_>>()
    };
    // 150 days after radiotherapy is no baseline of RANO 2.0, and neither is 36.
    let kept = said("36 A=20x10 | 150 A=25x10");
    assert_eq!((kept[0].0, kept[1].0), (Call::Baseline, Call::Progression));
    assert!(kept[0].1.ends_with("the only scan with a later one: proposed by the program"), "{kept:?}");
    // 28 days after it is.
    let given_up = said("-20 A=20x10 | 28 A=25x10");
    assert_eq!((given_up[0].0, given_up[1].0), (Call::BeforeBaseline, Call::Baseline), "{given_up:?}");
    assert!(given_up[1].1.ends_with("28 days after radiotherapy"), "{given_up:?}");
}

#[test]
fn why_steroids_were_raised_is_stated_after_the_dose() {
    let of = |input| Missing {
        input,
        date: Some("2024-03-01".into()),
        words: String::new(),
        assumed: None,
        phrase: input.template().into(),
        assumption: None,
    };
    let to_state = |all: &[Input]| {
        let judgement = Judgement {
            missing: all.iter().map(|input| of(*input)).collect(),
            ..plain(Call::CannotSay, Reason::plain(say::UNKNOWN))
        };
        judgement.to_state().map(|missing| missing.input).collect::<Vec<_>>()
    };
    assert_eq!(to_state(&[Input::SteroidsReason, Input::Steroids]), [Input::Steroids]);
    assert_eq!(to_state(&[Input::SteroidsReason, Input::Flair]), [Input::SteroidsReason, Input::Flair]);
}

#[test]
fn output_has_stable_names() {
    let text = toml(Criterion::Rano20, "assessment = \"enhancing\"", "0 A=20x10/5 | 56 A=10x10/2 ?new");
    let response = evaluate(&History::parse(&text).unwrap(), &[]).unwrap();
    let value = serde_json::to_value(&response).unwrap();
    assert_eq!(value["criterion"], "rano-2.0");
    let judgement = &value["dates"][1]["by_diameters"];
    let keys: Vec<&str> = judgement.as_object().unwrap().keys().map(String::as_str).collect();
    let mut expected =
        vec!["call", "possible", "dated", "confirmation", "reasons", "missing", "imaging_only", "sums"];
    expected.sort_unstable();
    let mut sorted = keys;
    sorted.sort_unstable();
    assert_eq!(sorted, expected);
    assert_eq!(judgement["call"], "cannot_say");
    assert_eq!(judgement["possible"][0], "partial_response");
    assert_eq!(judgement["missing"][0]["input"], "new_lesion");
    assert_eq!(judgement["sums"][0]["quantity"], "product_mm2");
    assert_eq!(judgement["sums"][0]["change_from_baseline_percent"], -50.0);
    assert_eq!(value["dates"][1]["by_volume"]["sums"][0]["quantity"], "volume_ml");
}

fn answers(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
    pairs.iter().map(|&(question, answer)| (question.to_owned(), answer.to_owned())).collect()
}

/// Answers, and the category or the next question.
#[test]
fn bt_rads_leads_to_each_category() {
    let worse = [("prior", "yes"), ("change", "worse"), ("early", "no")];
    let both = [&worse[..], &[("what", "both")]].concat();
    let table: Vec<(Vec<(&str, &str)>, &str)> = vec![
        (vec![], "prior"),
        (vec![("prior", "no")], "0"),
        (vec![("prior", "no"), ("change", "worse")], "0"),
        (vec![("prior", "yes")], "change"),
        (vec![("prior", "yes"), ("change", "better")], "drug"),
        (vec![("prior", "yes"), ("change", "better"), ("drug", "no")], "1a"),
        (vec![("prior", "yes"), ("change", "better"), ("drug", "yes")], "1b"),
        (vec![("prior", "yes"), ("change", "same")], "2"),
        (vec![("prior", "yes"), ("change", "worse"), ("early", "yes")], "3a"),
        (worse.to_vec(), "what"),
        ([&worse[..], &[("what", "flair")]].concat(), "3b"),
        ([&worse[..], &[("what", "enhancement")]].concat(), "3b"),
        ([&both[..], &[("large", "yes")]].concat(), "4"),
        ([&both[..], &[("large", "no"), ("progressive", "yes")]].concat(), "4"),
        ([&both[..], &[("large", "no"), ("progressive", "no")]].concat(), "3c"),
    ];
    for (given, expected) in table {
        let found = match bt_rads(&answers(&given)).unwrap() {
            BtRads::Next(question) => question.id.to_owned(),
            BtRads::Result { category, reason, .. } => {
                assert!(reason.starts_with("Is there an earlier scan"), "{reason}");
                category.id.to_owned()
            }
        };
        println!("BT-RADS {given:?}: expected {expected}, found {found}");
        assert_eq!(found, expected, "{given:?}");
    }
    let error = bt_rads(&answers(&[("prior", "perhaps")])).unwrap_err().to_string();
    assert_eq!(error, "BT-RADS: found prior = perhaps, expected one of yes, no");
    assert!(bt_rads(&answers(&[("size", "large")])).unwrap_err().to_string().contains("found question size"));
}

#[test]
fn names_of_criteria_are_those_of_the_files() {
    let ids: Vec<String> = Criterion::ALL.iter().map(id_of).collect();
    assert_eq!(ids, ["rano-2010", "rano-lgg", "mrano", "rano-2.0", "irano", "rano-bm"]);
}

/// Nothing but some sizes is known of many scans: still quick, and no more is said than follows.
#[test]
fn many_unknown_inputs_are_bounded() {
    let unknown = "?new ?nt ?cl ?st ?fl ?tech ?hist";
    let scans: Vec<String> = (0..40)
        .map(|k| {
            let size = if k % 3 == 0 || k == 39 { "A=20x10" } else { "" };
            format!("{} {size} {unknown}", 28 * k)
        })
        .collect();
    for known in [false, true] {
        let mut scans = scans.clone();
        if known {
            scans[39] = format!("{} A=20x10", 28 * 39);
        }
        let history = History::parse(&toml(Criterion::Rano2010, "", &scans.join("|"))).unwrap();
        let response = evaluate(&history, &[]).unwrap();
        let last = &response.dates[39].by_diameters;
        // With the facts of the scan known, the assumptions of the rest leave one call.
        assert_eq!(last.call, if known { Call::StableDisease } else { Call::CannotSay });
        assert!(!last.missing.is_empty());
    }
}

#[test]
fn a_history_is_written_and_read_again_as_json_and_as_toml() {
    let mut history = History::parse(GOOD).unwrap();
    // Each of both may be missing.
    history.baseline =
        Some(Fact { entered: Some("2024-05-01".into()), ..Fact::of(Label("2024-02-01".into())) });
    let json = serde_json::to_string(&history).unwrap();
    assert_eq!(serde_json::from_str::<History>(&json).unwrap(), history);
    let text = ::toml::to_string(&history).unwrap();
    assert_eq!(History::parse(&text).unwrap(), history);
}
