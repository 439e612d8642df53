//! The tables of a cohort from the results of its cases, one case in memory at a time.

use std::{collections::BTreeMap, path::Path};

use glioscope_core::{
    Progress,
    files::{read_small, write_whole},
};
use serde_json::Value;

use crate::{
    CaseStatus, CohortCase, CohortError, Dictionary, KINDS, Place, State,
    rank::{Ranks, Values, corrected, interval, more_is_better, signed_rank},
    tables::{FAILURES, Field, RANKS, TESTS, Writer, pair_values, rows_of},
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
    /// Id of the mask that the others are compared with.
    pub reference: String,
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
                    if let Some(ranking) = ranking {
                        for (date, mask, metric, value) in
                            pair_values(&answer, &ranking.reference, &ranking.metrics)
                        {
                            values.entry(metric).or_default().add(name, &date, &mask, value);
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
        rank(ranking, &values, &mut writers, &mut done.notes)?;
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

/// Values by metric.
type RankedValues = BTreeMap<String, Values>;

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
    values: &RankedValues,
    writers: &mut [Writer],
    notes: &mut Vec<String>,
) -> Result<(), CohortError> {
    let Ranking { reference, metrics, seed } = ranking;
    let mut all: BTreeMap<String, Vec<Ranks>> = BTreeMap::new();
    for metric in metrics {
        let Some(more) = more_is_better(metric) else {
            let expected = crate::rank::ranked_metrics();
            return Err(CohortError::wrong("--rank-by", format!("\"{metric}\""), expected));
        };
        let Some(of_metric) = values.get(metric) else {
            let expected = format!(
                "a metric that the cases have beside a mask {reference} (--compute metrics has distances)"
            );
            return Err(CohortError::wrong("--rank-by", format!("\"{metric}\""), expected));
        };
        let algorithms: Vec<&str> = of_metric.algorithms().collect();
        let ranks = of_metric.ranks(&algorithms, more);
        write_ranks(&mut writers[RANKS], (reference, metric), &ranks, *seed)?;
        for ranks in ranks {
            all.entry(ranks.algorithm.clone()).or_default().push(ranks);
        }
        let pairs: Vec<(&str, &str)> = algorithms
            .iter()
            .enumerate()
            .flat_map(|(n, a)| algorithms[n + 1..].iter().map(move |b| (*a, *b)))
            .collect();
        write_tests(&mut writers[TESTS], (reference, metric), of_metric, &pairs)?;
    }
    let cases: Vec<usize> = all.values().flatten().map(|ranks| ranks.by_case.len()).collect();
    let most = cases.iter().max().copied().unwrap_or_default();
    if cases.iter().any(|count| *count != most) {
        notes.push("not every case has every metric that is ranked".into());
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
    write_ranks(&mut writers[RANKS], (reference, ALL), &all, *seed)
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
