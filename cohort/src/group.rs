//! The tables of a cohort from the results of its cases, one case in memory at a time.

use std::{collections::BTreeMap, path::Path};

use glioscope_core::{
    Progress,
    files::{read_small, write_whole},
};
use serde_json::Value;

use crate::{
    CaseStatus, CohortCase, CohortError, Dictionary, KINDS, Place, State,
    rank::{Ranks, Values, corrected, interval, ranked_metric, signed_rank},
    tables::{FAILURES, Field, PairValue, RANKS, TESTS, Writer, pair_values, rows_of},
};

/// Maximum size of an answer in bytes.
const MAX_BYTES: u64 = 1 << 30;
/// Name of the data dictionary.
const DICTIONARY: &str = "dictionary.json";
/// The mean over metrics.
const ALL: &str = "all";

/// How masks are ranked.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranking {
    /// Id of the mask that the others are compared with. Several are one reference's parts of the tumour, `NAME-PART`: each is compared
    /// with the masks whose ids end in its part.
    pub references: Vec<String>,
    /// Keys of the metrics.
    pub metrics: Vec<String>,
    /// Fixes which cases the bootstrap draws.
    pub seed: u64,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Grouped {
    /// Names of the tables and numbers of their rows.
    pub tables: Vec<(&'static str, u64)>,
    /// Cases without results.
    pub missing: usize,
    /// Cases with a step that failed.
    pub failed: usize,
    /// What whoever reads the tables should know.
    pub notes: Vec<String>,
}

/// Writes the tables of `cases` from their results in `place`, all of them whole in place of earlier ones.
///
/// # Errors
/// [`CohortError`]: no case has results, results that can't be read, another run that writes the tables, a metric that isn't ranked or a
/// reference that no case has.
pub fn group(
    cases: &[CohortCase],
    place: &Place,
    ranking: Option<&Ranking>,
    version: &str,
    progress: &Progress,
) -> Result<Grouped, CohortError> {
    let tables = place.tables();
    let Some(lock) = place.lock_tables()? else {
        return Err(CohortError::at(&tables, "another run that writes them", "one at a time"));
    };
    let part = lock.part(None)?;
    let references = ranking.map(|ranking| parts(&ranking.references)).transpose()?.unwrap_or_default();
    let metrics = ranking.map(|ranking| ranking.metrics.as_slice()).unwrap_or_default();
    let kinds = if ranking.is_some() { KINDS } else { KINDS.get(..RANKS).unwrap_or(KINDS) };
    let writers = kinds.iter().map(|kind| Writer::new(kind, part.folder(), version));
    let mut writers = writers.collect::<Result<Vec<_>, _>>()?;
    let mut done = Grouped::default();
    let mut values = RankedValues::new();
    let mut made_by = BTreeMap::<String, usize>::new();
    progress.expect(cases.len() as u64);
    for case in cases {
        progress.advance(1)?;
        let (name, folder) = (&case.label, place.case(&case.label));
        let Some(status) = CaseStatus::read(&folder) else {
            done.missing += 1;
            writers[FAILURES].row(failure(name, None, None, Some("no results")))?;
            continue;
        };
        let options = serde_json::to_string(&status.options).unwrap_or_default();
        *made_by.entry(format!("{} {options}", status.glioscope)).or_default() += 1;
        done.failed += usize::from(status.state == State::Failed);
        for step in &status.steps {
            match (step.state, &step.output) {
                (State::Failed, _) => {
                    let word: &str = step.step.into();
                    writers[FAILURES].row(failure(
                        name,
                        Some(word),
                        step.exit_code,
                        step.error.as_deref(),
                    ))?;
                }
                (State::Done, Some(output)) if output.ends_with(".json") => {
                    let answer = answer(&folder.join(output))?;
                    for (table, row) in rows_of(step.step, name, &answer) {
                        writers[table].row(row)?;
                    }
                    for reference in &references {
                        for found in pair_values(&answer, &reference.id, metrics) {
                            add(&mut values, reference, name, found)?;
                        }
                    }
                }
                _ => {}
            }
        }
    }
    if done.missing == cases.len() {
        return Err(CohortError::at(
            place.folder(),
            "no results of any case",
            "those of cohort IN OUT participant",
        ));
    }
    if made_by.len() > 1 {
        done.notes.push(format!(
            "the cases were computed in {} different ways (versions or options)",
            made_by.len()
        ));
    }
    if let Some(ranking) = ranking {
        rank(ranking, (&references, &values), &mut writers, &mut done.notes)?;
    }
    let count = |(kind, writer): (&'static crate::Kind, Writer)| Ok((kind.name, writer.close()?));
    done.tables = kinds.iter().zip(writers).map(count).collect::<Result<_, CohortError>>()?;
    let dictionary = Dictionary { glioscope: version.to_owned(), tables: kinds };
    let path = part.folder().join(DICTIONARY);
    let mut bytes = serde_json::to_vec_pretty(&dictionary)
        .map_err(|e| CohortError::at(&path, format!("what JSON can't hold ({e})"), "a dictionary"))?;
    bytes.push(b'\n');
    write_whole(&path, &bytes)?;
    part.put()?;
    Ok(done)
}

/// Values by the reference's id and the metric.
type RankedValues = BTreeMap<(String, String), Values>;

/// A mask that others are compared with.
struct Reference {
    id: String,
    /// What its id ends in with the ids of the masks that are compared with it, from the dash on; empty: all.
    part: String,
}

impl Reference {
    /// The name of an algorithm among the ids: that of its mask without the part.
    fn name_of<'a>(&self, mask: &'a str) -> Option<&'a str> {
        mask.strip_suffix(self.part.as_str()).filter(|name| !name.is_empty())
    }
}

/// The references with their parts: of one reference all masks, of several what follows their common beginning.
///
/// # Errors
/// [`CohortError`] where several don't begin alike up to a dash.
fn parts(ids: &[String]) -> Result<Vec<Reference>, CohortError> {
    let one = |id: &String, part: &str| Reference { id: id.clone(), part: part.to_owned() };
    if let [only] = ids {
        return Ok(vec![one(only, "")]);
    }
    let name = ids.first().map(String::as_str).unwrap_or_default();
    let mut dashes = name.match_indices('-').map(|(at, _)| at).rev();
    let is_common = |at: &usize| ids.iter().all(|id| id.len() > at + 1 && id.get(..=*at) == name.get(..=*at));
    let Some(at) = dashes.find(is_common) else {
        let expected = "one, or the parts of one, whose ids begin alike up to a dash: ref-WT, ref-TC";
        return Err(CohortError::wrong("--reference", ids.join(", "), expected));
    };
    Ok(ids.iter().map(|id| one(id, id.get(at..).unwrap_or_default())).collect())
}

/// Adds a value of a case to those that are ranked.
fn add(
    values: &mut RankedValues,
    reference: &Reference,
    case: &str,
    found: PairValue,
) -> Result<(), CohortError> {
    let PairValue { date, mask, metric, value, is_reference_first } = found;
    if reference.name_of(&mask).is_none() {
        return Ok(());
    }
    let ranked = ranked_metric(&metric);
    if !is_reference_first && ranked.is_some_and(|ranked| ranked.is_directed) {
        let reference = &reference.id;
        return Err(CohortError::wrong(
            "--rank-by",
            format!("{metric} with {mask} as the reference (case {case})"),
            format!(
                "that with {reference}: results of participant --compute metrics --reference {reference}"
            ),
        ));
    }
    let value = value.map(|value| ranked.map_or(value, |ranked| ranked.better.of(value)));
    values.entry((reference.id.clone(), metric)).or_default().add(case, &date, &mask, value);
    Ok(())
}

fn answer(path: &Path) -> Result<Value, CohortError> {
    let bytes = read_small(path, MAX_BYTES, "an answer of the program")?;
    serde_json::from_slice(&bytes)
        .map_err(|e| CohortError::at(path, format!("no JSON ({e})"), "an answer of the program"))
}

fn failure(case: &str, step: Option<&str>, exit_code: Option<i64>, error: Option<&str>) -> Vec<Field> {
    vec![
        Field::Text(case.to_owned()),
        Field::text(step),
        exit_code.map_or(Field::Null, Field::Whole),
        Field::text(error),
    ]
}

/// Writes ranks and tests.
fn rank(
    ranking: &Ranking,
    (references, values): (&[Reference], &RankedValues),
    writers: &mut [Writer],
    notes: &mut Vec<String>,
) -> Result<(), CohortError> {
    let Ranking { metrics, seed, .. } = ranking;
    let mut all: BTreeMap<String, Vec<Ranks>> = BTreeMap::new();
    for (reference, metric) in references.iter().flat_map(|r| metrics.iter().map(move |metric| (r, metric))) {
        let id = &reference.id;
        let Some(ranked) = ranked_metric(metric) else {
            let expected = crate::rank::ranked_metrics();
            return Err(CohortError::wrong("--rank-by", format!("\"{metric}\""), expected));
        };
        let Some(of_metric) = values.get(&(id.clone(), metric.clone())) else {
            let expected =
                format!("a metric that the cases have beside a mask {id} (--compute metrics has distances)");
            return Err(CohortError::wrong("--rank-by", format!("\"{metric}\""), expected));
        };
        let algorithms: Vec<&str> = of_metric.algorithms().collect();
        let ranks = of_metric.ranks(&algorithms, ranked.better);
        write_ranks(&mut writers[RANKS], (id, metric), &ranks, *seed)?;
        for ranks in ranks {
            let name = reference.name_of(&ranks.algorithm).unwrap_or(&ranks.algorithm).to_owned();
            all.entry(name).or_default().push(ranks);
        }
        let pairs: Vec<(&str, &str)> = algorithms
            .iter()
            .enumerate()
            .flat_map(|(n, a)| algorithms[n + 1..].iter().map(move |b| (*a, *b)))
            .collect();
        write_tests(&mut writers[TESTS], (id, metric), of_metric, &pairs)?;
    }
    let cases: Vec<usize> = all.values().flatten().map(|ranks| ranks.by_case.len()).collect();
    let most = cases.iter().max().copied().unwrap_or_default();
    if cases.iter().any(|count| *count != most) {
        notes.push("not every case has every metric that is ranked".into());
    }
    if all.values().any(|ranks| ranks.len() != references.len() * metrics.len()) {
        notes.push(
            "not every mask has every part of the reference: its mean rank is over those it has".into(),
        );
    }
    let mean = |(algorithm, of_metrics): (String, Vec<Ranks>)| {
        let mut by_case: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        for (case, rank) in of_metrics.iter().flat_map(|ranks| &ranks.by_case) {
            by_case.entry(case.clone()).or_default().push(*rank);
        }
        let mean = |ranks: Vec<f64>| ranks.iter().sum::<f64>() / ranks.len() as f64;
        let undefined = of_metrics.iter().map(|ranks| ranks.undefined).max().unwrap_or_default();
        Ranks {
            algorithm,
            by_case: by_case.into_iter().map(|(case, ranks)| (case, mean(ranks))).collect(),
            undefined,
        }
    };
    let all: Vec<Ranks> = all.into_iter().map(mean).collect();
    let name = references.first().and_then(|first| first.name_of(&first.id)).unwrap_or_default();
    write_ranks(&mut writers[RANKS], (name, ALL), &all, *seed)
}

fn write_ranks(
    writer: &mut Writer,
    (reference, metric): (&str, &str),
    ranks: &[Ranks],
    seed: u64,
) -> Result<(), CohortError> {
    let means = ranks.iter().map(|ranks| ranks.by_case.values().sum::<f64>() / ranks.by_case.len() as f64);
    let means: Vec<f64> = means.collect();
    for (ranks, mean) in ranks.iter().zip(&means) {
        let own: Vec<f64> = ranks.by_case.values().copied().collect();
        let interval = interval(&own, seed);
        writer.row(vec![
            Field::Text(reference.to_owned()),
            Field::Text(metric.to_owned()),
            Field::Text(ranks.algorithm.clone()),
            Field::Whole(own.len() as i64),
            Field::Whole(ranks.undefined as i64),
            Field::Number(*mean),
            Field::number(interval.map(|interval| interval.low)),
            Field::number(interval.map(|interval| interval.high)),
            Field::Whole(1 + means.iter().filter(|other| *other < mean).count() as i64),
        ])?;
    }
    Ok(())
}

fn write_tests(
    writer: &mut Writer,
    (reference, metric): (&str, &str),
    values: &Values,
    pairs: &[(&str, &str)],
) -> Result<(), CohortError> {
    let paired: Vec<Vec<[f64; 2]>> = pairs.iter().map(|(a, b)| values.pairs(a, b)).collect();
    let tests: Vec<_> = paired.iter().map(|paired| signed_rank(paired)).collect();
    // Where nothing differs nothing is tested, but it counts as a test.
    let probabilities: Vec<f64> = tests.iter().map(|test| test.p.unwrap_or(1.0)).collect();
    for (((pair, paired), test), p_holm) in
        pairs.iter().zip(&paired).zip(&tests).zip(corrected(&probabilities))
    {
        let method: &str = test.method.into();
        writer.row(vec![
            Field::Text(reference.to_owned()),
            Field::Text(metric.to_owned()),
            Field::Text(pair.0.to_owned()),
            Field::Text(pair.1.to_owned()),
            Field::Whole(paired.len() as i64),
            Field::Whole(test.differing as i64),
            Field::number(median_difference(paired)),
            Field::Number(test.statistic),
            Field::Text(method.to_owned()),
            Field::number(test.p),
            Field::number(test.p.map(|_| p_holm)),
        ])?;
    }
    Ok(())
}

/// The median of a − b; equal values, also infinite ones, differ by 0.
fn median_difference(pairs: &[[f64; 2]]) -> Option<f64> {
    let mut differences: Vec<f64> = pairs.iter().map(|[a, b]| if a == b { 0.0 } else { a - b }).collect();
    differences.sort_by(f64::total_cmp);
    let middle = differences.len().checked_sub(1)? / 2;
    let [low, high] = [differences[middle], differences[differences.len() / 2]];
    // Two infinite ones of either sign have no middle.
    Some(if low == high { low } else { (low + high) / 2.0 }).filter(|median| !median.is_nan())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_references_are_parts_of_one() {
        let of = |ids: &[&str]| {
            let ids: Vec<String> = ids.iter().map(|id| (*id).to_owned()).collect();
            parts(&ids)
                .map(|all| all.into_iter().map(|one| one.part).collect::<Vec<_>>())
                .map_err(|e| e.to_string())
        };
        assert_eq!(of(&["ref-WT"]).unwrap(), [""]);
        assert_eq!(of(&["my-ref-WT", "my-ref-ET"]).unwrap(), ["-WT", "-ET"]);
        assert_eq!(of(&["r-T-1", "r-T-2"]).unwrap(), ["-1", "-2"]);
        for wrong in [["ref", "other"], ["ref-WT", "other-WT"], ["ref-", "ref-WT"]] {
            assert!(of(&wrong).unwrap_err().contains("begin alike up to a dash"), "{wrong:?}");
        }
        let reference = Reference { id: "ref-WT".into(), part: "-WT".into() };
        let names = ["net-WT", "net-TC", "-WT"].map(|mask| reference.name_of(mask));
        assert_eq!(names, [Some("net"), None, None]);
    }
}
