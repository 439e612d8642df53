//! The table of made histories, printed with what each rests on.

use super::{
    super::*,
    made::{Made, id_of},
    other_criteria, rano_20, rano_2010,
};

fn all() -> impl Iterator<Item = &'static Made> {
    [rano_2010::TABLE, other_criteria::TABLE, rano_20::TABLE].into_iter().flatten()
}

/// Whether a judgement rests on a rule: by a reason, or by its confirmation.
fn rests_on(judgement: &Judgement, rule: &str) -> bool {
    let by_reason = judgement.reasons.iter().filter_map(|reason| reason.rule).any(|id| id_of(&id) == rule);
    let by_confirmation = judgement.confirmation.is_some() && rule.starts_with("confirm_");
    let by_baseline =
        judgement.missing.iter().any(|m| m.input == Input::Baseline || m.input == Input::Targets);
    by_reason || by_confirmation || rule.is_empty() || (rule == "max_targets" && by_baseline)
}

/// The mark and source of a rule in the table, or that no source that was read states it.
fn source(criterion: Criterion, rule: &str) -> String {
    let stated = RULES.iter().find(|row| row.criteria.contains(&criterion) && id_of(&row.id) == rule);
    let unstated = UNSTATED.iter().any(|row| row.criteria.contains(&criterion) && id_of(&row.id) == rule);
    match stated {
        Some(row) => format!("{}: {}", id_of(&row.mark), row.source),
        None if unstated => "not stated by a source, not applied".to_owned(),
        None => "evaluator: unknown input".to_owned(),
    }
}

#[test]
fn made_histories_have_the_calls_that_the_sources_state() {
    let mut wrong = Vec::new();
    for made in all() {
        let judgement = made.judgement();
        let found = Made::found(&judgement);
        let source = source(made.criterion, made.rule);
        println!(
            "{} | {} | {} | {found} | {} | {source}",
            made.name,
            made.criterion.name(),
            made.expected,
            made.rule
        );
        if found != made.expected || !rests_on(&judgement, made.rule) {
            wrong.push(format!(
                "{}: expected {} by {}, found {found}: {judgement:#?}",
                made.name, made.expected, made.rule
            ));
        }
    }
    println!("{} histories", all().count());
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), all().count(), wrong.join("\n"));
    assert!(all().count() >= 80);
}

#[test]
fn names_of_made_histories_differ() {
    let mut names: Vec<_> = all().map(|made| (made.criterion.name(), made.name)).collect();
    names.sort_unstable();
    let count = names.len();
    names.dedup();
    assert_eq!(names.len(), count);
}

/// Every rule with a mark is what at least one made history rests on, or is named here with the test that has it.
#[test]
fn every_rule_is_tested() {
    let elsewhere = [
        "steroids_alone", // that steroids alone don't make progression: the histories with raised doses
        "max_targets_mixed", // counted as max_targets
        "baseline_latest", // counted as baseline_earliest
        "confirm_progression_latest", // counted as confirm_progression
        "measurable_longest",
        "measurable_perpendicular",
        "measurable_slices",
        "thick_slice",
        "thick_slice_factor",
        "mixed_complete",
    ];
    for row in RULES {
        let id = id_of(&row.id);
        for criterion in row.criteria {
            println!(
                "{} | {id} | {} | {} {} | {} | {}",
                criterion.name(),
                row.statement,
                row.number.map_or_else(String::new, |number| number.to_string()),
                row.unit,
                id_of(&row.mark),
                row.source
            );
        }
        let tested = all().any(|made| row.criteria.contains(&made.criterion) && made.rule == id);
        assert!(tested || elsewhere.contains(&id.as_str()), "{id} of {:?} has no history", row.criteria);
    }
}

#[test]
fn a_criterion_has_at_most_one_row_of_each_rule() {
    for criterion in Criterion::ALL {
        let mut ids: Vec<String> =
            RULES.iter().filter(|row| row.criteria.contains(&criterion)).map(|row| id_of(&row.id)).collect();
        ids.sort();
        let count = ids.len();
        ids.dedup();
        assert_eq!(ids.len(), count, "{criterion:?}");
    }
}

/// So that a language that has a sentence for each template with its places says every reason.
#[test]
fn what_made_histories_say_is_whole() {
    for made in all() {
        let judgement = made.judgement();
        let said = judgement.reasons.iter().map(|reason| (&reason.words, &reason.phrase));
        let confirmation = judgement.confirmation.iter().map(|it| (&it.words, &it.phrase));
        let missing = judgement.missing.iter().map(|missing| (&missing.words, &missing.phrase));
        let assumed = judgement.missing.iter().filter_map(|m| m.assumed.as_ref().zip(m.assumption.as_ref()));
        for (words, phrase) in said.chain(confirmation).chain(missing).chain(assumed) {
            assert!(phrase.is_whole(), "{}: {phrase:?}", made.name);
            assert_eq!(*words, phrase.to_string(), "{}", made.name);
        }
    }
}
