//! What holds for all histories: order and scale don't matter, and the inputs listed as missing are those that matter. The
//! last is compared with evaluating every way in which the unknown inputs can be filled in, with nothing left unknown.

use proptest::prelude::*;

use super::{
    super::*,
    made::{date, toml},
};

/// Criteria with what is assessed, and the lesions.
const CRITERIA: [(Criterion, &str, &[&str]); 8] = [
    (Criterion::Rano2010, "", &["A"]),
    (Criterion::RanoLgg, "", &["F"]),
    (Criterion::ModifiedRano, "", &["A"]),
    (Criterion::Rano20, "assessment = \"enhancing\"", &["A"]),
    (Criterion::Rano20, "assessment = \"non-enhancing\"", &["F"]),
    (Criterion::Rano20, "assessment = \"mixed\"", &["A", "F"]),
    (Criterion::ImmunoRano, "", &["A"]),
    (Criterion::RanoBm, "", &["A"]),
];

/// Sizes of a lesion that is 20x10 mm and 10 ml at the baseline: every category of every criterion.
const SIZES: [&str; 9] =
    ["gone", "5x5/1", "10x10/3.5", "14x10/6", "15x10/7", "20x10/10", "24x10/13", "25x10/14", "40x10/30"];

/// The same, and sizes that are filled in only: one below and one above all others, so that each can be a rise, and one
/// between half and a quarter more than half.
const FILLED_SIZES: [&str; 12] = [
    "gone",
    "5x5/1",
    "10x10/3.5",
    "14x10/6",
    "15x10/7",
    "20x10/10",
    "24x10/13",
    "25x10/14",
    "40x10/30",
    "2x2/0.1",
    "90x60/3000",
    "11x10/4",
];

/// Inputs, by where they stand, with values that stand for all others.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Head(&'static str),
    /// A fact of scan 0, 1 or 2.
    Fact(usize, &'static str),
    /// The first lesion's size at a scan.
    Size(usize),
}

const INPUTS: [(Place, Input, &[&str]); 16] = [
    (Place::Fact(2, "new"), Input::NewLesion, &["none", "equivocal", "non-measurable", "measurable"]),
    (Place::Fact(2, "nt"), Input::NonTarget, &["none", "gone", "not-worse", "worse"]),
    (Place::Fact(2, "cl"), Input::Clinical, &["stable", "worse", "much-worse"]),
    (Place::Fact(2, "st"), Input::Steroids, &["0", "2", "8", "20"]),
    (Place::Fact(2, "fl"), Input::Flair, &["not-worse", "worse"]),
    (Place::Fact(2, "tech"), Input::Technique, &["[]", "[\"contrast\"]"]),
    (Place::Fact(2, "reason"), Input::SteroidsReason, &["other", "tumour"]),
    (Place::Fact(2, "field"), Input::Field, &["inside", "outside"]),
    (Place::Fact(2, "hist"), Input::Histology, &["not-done", "tumour"]),
    (Place::Size(2), Input::Sum, &FILLED_SIZES),
    (Place::Head("radiotherapy_end"), Input::RadiotherapyEnd, &["{-100}", "{-10}", "\"none\""]),
    (Place::Head("disease"), Input::Disease, &["\"newly-diagnosed\"", "\"recurrent\""]),
    (
        Place::Head("treatment"),
        Input::Treatment,
        &[
            "[]",
            "[{ start = {1}, kind = \"immunotherapy\" }]",
            "[{ start = {1}, kind = \"antiangiogenic\" }]",
            "[{ start = {-300}, kind = \"immunotherapy\" }]",
        ],
    ),
    // The last is above every dose of the last scan, and is filled in only, so that each dose can have been raised.
    (Place::Fact(0, "st"), Input::Steroids, &["0", "2", "8", "99"]),
    (Place::Size(1), Input::Sum, &FILLED_SIZES),
    (Place::Fact(1, "tech"), Input::Technique, &["[]", "[\"contrast\"]"]),
];

/// A value of every input, `None`: unknown.
type Values = [Option<usize>; INPUTS.len()];

fn text(criterion: usize, values: &Values, other_sizes: [usize; 2]) -> String {
    let (criterion, assessment, lesions) = CRITERIA[criterion];
    let mut head = format!("{assessment}\ntargets = {lesions:?}\n");
    let mut scans = [String::from("0"), String::from(" 28 reason=other field=inside"), String::from(" 56")];
    for lesion in lesions {
        scans[0] += &format!(" {lesion}=20x10/10");
    }
    for (lesion, k) in lesions.iter().skip(1).flat_map(|lesion| [(lesion, 1), (lesion, 2)]) {
        scans[k] += &format!(" {lesion}={}", SIZES[other_sizes[k - 1]]);
    }
    for ((place, _, all), value) in INPUTS.iter().zip(values) {
        let value = value.map(|value| all[value]);
        match (place, value) {
            (Place::Head(key), Some(value)) => head += &format!("{key} = {value}\n"),
            (Place::Head(key), None) => head += &format!("?{key}\n"),
            (Place::Fact(scan, key), Some(value)) => scans[*scan] += &format!(" {key}={value}"),
            (Place::Fact(scan, key), None) => scans[*scan] += &format!(" ?{key}"),
            (Place::Size(scan), Some(value)) => scans[*scan] += &format!(" {}={value}", lesions[0]),
            (Place::Size(_), None) => {}
        }
    }
    toml(criterion, &head, &scans.join("|"))
}

fn judgements(criterion: usize, values: &Values, other_sizes: [usize; 2], by_volume: bool) -> [Judgement; 2] {
    let text = text(criterion, values, other_sizes);
    let history = History::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let response = evaluate(&history, &[]).unwrap();
    [1, 2].map(|k| {
        let date = &response.dates[k];
        if by_volume { date.by_volume.clone() } else { date.by_diameters.clone() }
    })
}

/// Every way to fill in the unknown inputs, with the calls at the last two scans.
fn filled(
    criterion: usize,
    values: &Values,
    other_sizes: [usize; 2],
    by_volume: bool,
) -> Vec<(Values, [Call; 2])> {
    let mut ways = vec![*values];
    for (k, (_, _, all)) in INPUTS.iter().enumerate() {
        if values[k].is_none() {
            let each = |way: &Values| {
                (0..all.len())
                    .map(|v| {
                        let mut way = *way;
                        way[k] = Some(v);
                        way
                    })
                    .collect::<Vec<_>>()
            };
            ways = ways.iter().flat_map(each).collect();
        }
    }
    ways.iter()
        .map(|way| {
            let both = judgements(criterion, way, other_sizes, by_volume);
            for judgement in &both {
                assert!(judgement.missing.is_empty(), "nothing is unknown: {:?}", judgement.missing);
            }
            (*way, both.map(|judgement| judgement.call))
        })
        .collect()
}

/// Whether two ways that differ in input `k` alone have different calls at scan `scan`.
fn matters(ways: &[(Values, [Call; 2])], k: usize, scan: usize) -> bool {
    let but = |values: &Values| {
        let mut values = *values;
        values[k] = None;
        values
    };
    ways.iter().enumerate().any(|(n, (a, calls))| {
        ways[n + 1..].iter().any(|(b, other)| but(a) == but(b) && calls[scan - 1] != other[scan - 1])
    })
}

fn scenario() -> impl Strategy<Value = (usize, Values, [usize; 2], bool)> {
    let values: Vec<_> = INPUTS
        .iter()
        .map(|(_, _, all)| {
            // Harmless values more often, else most histories are progression.
            let count = if all.contains(&"99") { 3 } else { all.len() };
            prop_oneof![2 => Just(0_usize), 1 => 0..count]
        })
        .collect();
    let unknown = prop::collection::vec(0..INPUTS.len(), 0..=3);
    (
        0..CRITERIA.len(),
        values,
        unknown,
        [0..SIZES.len(), 0..SIZES.len()],
        0..SIZES.len(),
        0..SIZES.len(),
        any::<bool>(),
    )
        .prop_map(|(criterion, values, unknown, other_sizes, middle, last, by_volume)| {
            let mut values: Values = std::array::from_fn(|k| Some(values[k]));
            for (k, (place, _, _)) in INPUTS.iter().enumerate() {
                match place {
                    Place::Size(1) => values[k] = Some(middle),
                    Place::Size(_) => values[k] = Some(last),
                    _ => {}
                }
            }
            for k in unknown {
                values[k] = None;
            }
            // Criteria without a rule by volume have nothing to ask.
            let by_volume =
                by_volume && matches!(CRITERIA[criterion].0, Criterion::Rano20 | Criterion::ModifiedRano);
            (criterion, values, other_sizes, by_volume)
        })
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 100_000, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn an_input_is_listed_exactly_if_it_can_change_the_call((criterion, values, other_sizes, by_volume) in scenario()) {
        let ways = filled(criterion, &values, other_sizes, by_volume);
        let [_, last] = judgements(criterion, &values, other_sizes, by_volume);
        for (k, (place, input, _)) in INPUTS.iter().enumerate().filter(|(k, _)| values[*k].is_none()) {
            let day = match place {
                Place::Head(_) => None,
                Place::Fact(scan, _) | Place::Size(scan) => Some(date([0, 28, 56][*scan])),
            };
            let at_scan = |m: &&Missing| m.date == day;
            let is_same = |m: &Missing| m.input == *input || (*input == Input::Sum && matches!(m.input, Input::SumEnhancing | Input::SumNonEnhancing));
            // What is unknown of the scan between can matter by its sum, or by what it shows.
            let is_listed = last.missing.iter().filter(at_scan).any(|m| is_same(m) || (m.input == Input::CallAt && day == Some(date(28))));
            let by_call = last.missing.iter().any(|m| m.input == Input::CallAt);
            let matters = matters(&ways, k, 2);
            // An unknown input of the patient or the baseline can matter through the call at the scan between.
            let through_other = by_call && matches!(place, Place::Head(_) | Place::Fact(0 | 1, _));
            prop_assert!(
                is_listed == matters || (through_other && matters),
                "{input:?} of {day:?}: listed {is_listed}, matters {matters}; {:?}\n{}", last.missing, text(criterion, &values, other_sizes)
            );
        }
        if last.missing.is_empty() {
            prop_assert!(ways.iter().all(|way| way.1[1] == last.call), "{ways:?} {last:#?}");
        }
    }

    #[test]
    fn the_call_is_what_its_assumptions_leave((criterion, values, other_sizes, by_volume) in scenario()) {
        let ways = filled(criterion, &values, other_sizes, by_volume);
        let [_, last] = judgements(criterion, &values, other_sizes, by_volume);
        // The assumptions: first values of these inputs. A scan between that isn't measured has no filled-in value of its
        // own ("not lower"), and is left to the test above.
        prop_assume!(values[14].is_some());
        let assumed = [Input::Clinical, Input::Technique, Input::Histology];
        let follows = |way: &Values| INPUTS.iter().enumerate().all(|(k, (place, input, all))| {
            let is_first = way[k] == Some(0);
            let not_raised = *place == Place::Fact(0, "st") && way[k] == Some(all.len() - 1);
            values[k].is_some() || is_first && *place != Place::Fact(0, "st") || not_raised || !(assumed.contains(input) || *input == Input::Steroids)
        });
        let mut calls: Vec<Call> = ways.iter().filter(|way| follows(&way.0)).map(|way| way.1[1]).collect();
        calls.dedup();
        let expected = if calls.iter().all(|call| *call == calls[0]) { calls[0] } else { Call::CannotSay };
        prop_assert_eq!(last.call, expected, "{:?} {:?}\n{}", calls, last.missing, text(criterion, &values, other_sizes));
    }

    #[test]
    fn what_is_unknown_of_a_later_scan_is_listed_as_its_call((criterion, values, other_sizes, by_volume) in scenario()) {
        // Unknown inputs of the last scan only.
        prop_assume!(values[10..].iter().all(Option::is_some));
        let ways = filled(criterion, &values, other_sizes, by_volume);
        let [middle, _] = judgements(criterion, &values, other_sizes, by_volume);
        let varies = ways.iter().any(|way| way.1[0] != ways[0].1[0]);
        let listed: Vec<(Input, Option<&str>)> = middle.missing.iter().map(|m| (m.input, m.date.as_deref())).collect();
        let last = date(56);
        let expected = if varies { vec![(Input::CallAt, Some(last.as_str()))] } else { vec![] };
        prop_assert_eq!(listed, expected, "{}", text(criterion, &values, other_sizes));
    }

    #[test]
    fn order_does_not_matter((criterion, values, other_sizes, _) in scenario(), seed in any::<u64>()) {
        let history = History::parse(&text(criterion, &values, other_sizes)).unwrap();
        let expected = evaluate(&history, &[]).unwrap();
        let mut shuffled = history;
        let mut state = seed | 1;
        let mut next = |n: usize| { state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407); (state >> 33) as usize % n };
        for k in (1..shuffled.measurement.len()).rev() {
            shuffled.measurement.swap(k, next(k + 1));
        }
        for k in (1..shuffled.date.len()).rev() {
            shuffled.date.swap(k, next(k + 1));
        }
        prop_assert_eq!(&evaluate(&shuffled, &[]).unwrap(), &expected);
        let given = std::mem::take(&mut shuffled.measurement);
        prop_assert_eq!(&evaluate(&shuffled, &given).unwrap(), &expected, "given instead of in the file");
    }

    /// At a factor of at least 1 what is measurable stays so.
    #[test]
    fn scale_does_not_matter((criterion, values, other_sizes, _) in scenario(), factor in 1.0..20.0_f64) {
        let history = History::parse(&text(criterion, &values, other_sizes)).unwrap();
        let mut scaled = history.clone();
        for m in &mut scaled.measurement {
            for length in [&mut m.longest_mm, &mut m.perpendicular_mm].into_iter().flatten() {
                *length *= factor;
            }
            if let Some(volume) = &mut m.volume_ml {
                *volume *= factor.powi(3).min(100.0);
            }
        }
        let strip = |response: Response| response.dates.into_iter().flat_map(|date| [date.by_diameters, date.by_volume])
            .map(|j| (j.call, j.possible, j.dated, j.confirmation, j.missing, j.reasons.into_iter().map(|r| r.rule).collect::<Vec<_>>()))
            .collect::<Vec<_>>();
        prop_assert_eq!(strip(evaluate(&scaled, &[]).unwrap()), strip(evaluate(&history, &[]).unwrap()));
    }
}

/// Below a factor of 1 measurability is lost at the baseline, and at no other scan.
#[test]
fn scale_changes_measurability_alone() {
    let judge = |scans: &str| {
        let history = History::parse(&toml(Criterion::Rano2010, "", scans)).unwrap();
        evaluate(&history, &[]).unwrap().dates[1].by_diameters.clone()
    };
    assert_eq!(judge("0 A=20x10 | 56 A=25x10").call, Call::Progression);
    let small = judge("0 A=19.8x9.9 | 56 A=24.75x9.9");
    assert_eq!((small.call, small.sums.len()), (Call::StableDisease, 0));
}
