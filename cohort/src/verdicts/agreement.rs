//! Agreement of readers: Cohen's kappa of two, Fleiss' kappa of all, and the intraclass correlation ICC(2,1) of their stars.

use super::{Judgement, Verdict, Verdicts};

/// How far readers agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// The coefficient.
    pub name: &'static str,
    /// The readers.
    pub readers: Vec<String>,
    /// Cases on which all of them have said something.
    pub cases: usize,
    /// Its value; `None` where it is undefined: no case, or nothing differs.
    pub value: Option<f64>,
}

/// The agreement of all readers: Cohen's kappa of the verdicts of every two, Fleiss' kappa of the verdicts of all, ICC(2,1) of the stars of
/// all, each over the cases that all of its readers have judged. Nothing with fewer than two readers.
pub fn agreement(lists: &[Verdicts]) -> Vec<Agreement> {
    if lists.len() < 2 {
        return Vec::new();
    }
    let mut all = Vec::new();
    let judgement = |verdict: &Verdict| verdict.judgement;
    for (n, a) in lists.iter().enumerate() {
        for b in &lists[n + 1..] {
            let table = common(&[a, b], &judgement);
            let pairs: Vec<[Judgement; 2]> =
                table.iter().filter_map(|row| Some([*row.first()?, *row.get(1)?])).collect();
            all.push(Agreement {
                name: "Cohen's kappa",
                readers: vec![a.reader.clone(), b.reader.clone()],
                cases: pairs.len(),
                value: cohen(&pairs),
            });
        }
    }
    let every: Vec<&Verdicts> = lists.iter().collect();
    let readers: Vec<String> = lists.iter().map(|list| list.reader.clone()).collect();
    let table = common(&every, &judgement);
    let counts = |row: &Vec<Judgement>| {
        [Judgement::Accept, Judgement::Mend, Judgement::Reject]
            .map(|kind| row.iter().filter(|found| **found == kind).count())
            .to_vec()
    };
    let counted: Vec<Vec<usize>> = table.iter().map(counts).collect();
    all.push(Agreement {
        name: "Fleiss' kappa",
        readers: readers.clone(),
        cases: counted.len(),
        value: fleiss(&counted),
    });
    let stars = common(&every, &|verdict: &Verdict| verdict.stars.map(f64::from));
    all.push(Agreement { name: "ICC(2,1) of stars", readers, cases: stars.len(), value: icc(&stars) });
    all
}

/// What all readers say of the cases on which all of them say something: a row for each case.
fn common<T>(lists: &[&Verdicts], said: &dyn Fn(&Verdict) -> Option<T>) -> Vec<Vec<T>> {
    let by_case: Vec<std::collections::BTreeMap<&str, &Verdict>> = lists
        .iter()
        .map(|list| list.cases.iter().map(|(case, verdict)| (case.as_str(), verdict)).collect())
        .collect();
    let Some(first) = by_case.first() else { return Vec::new() };
    let row = |case: &&str| by_case.iter().map(|of| said(of.get(*case)?)).collect::<Option<Vec<T>>>();
    first.keys().filter_map(row).collect()
}

/// Cohen's kappa (1960), unweighted: `None` where both always say the same one thing, and without a case.
fn cohen(pairs: &[[Judgement; 2]]) -> Option<f64> {
    let count = pairs.len() as f64;
    let observed = pairs.iter().filter(|[a, b]| a == b).count() as f64 / count;
    let share = |reader: usize, kind: Judgement| {
        pairs.iter().filter(|pair| pair[reader] == kind).count() as f64 / count
    };
    let kinds = [Judgement::Accept, Judgement::Mend, Judgement::Reject];
    let expected: f64 = kinds.iter().map(|kind| share(0, *kind) * share(1, *kind)).sum();
    kappa(observed, expected)
}

/// Fleiss' kappa (1971): `counts` has a row for each case, how many readers chose each category; as many readers in every row.
fn fleiss(counts: &[Vec<usize>]) -> Option<f64> {
    let readers = counts.first()?.iter().sum::<usize>() as f64;
    let cases = counts.len() as f64;
    let agreeing = |row: &Vec<usize>| {
        let squares: f64 = row.iter().map(|count| (*count as f64).powi(2)).sum();
        (squares - readers) / (readers * (readers - 1.0))
    };
    let observed = counts.iter().map(agreeing).sum::<f64>() / cases;
    let categories = counts.first()?.len();
    let share = |kind: usize| counts.iter().map(|row| row[kind]).sum::<usize>() as f64 / (cases * readers);
    let expected: f64 = (0..categories).map(|kind| share(kind).powi(2)).sum();
    kappa(observed, expected)
}

fn kappa(observed: f64, expected: f64) -> Option<f64> {
    let value = (observed - expected) / (1.0 - expected);
    (expected < 1.0 && value.is_finite()).then_some(value)
}

/// ICC(2,1) of Shrout and Fleiss (1979): two-way random effects, absolute agreement, a single reader. `rows`: the numbers of all readers for
/// each case. `None` with fewer than two cases or readers, and where nothing differs.
fn icc(rows: &[Vec<f64>]) -> Option<f64> {
    let (cases, readers) = (rows.len(), rows.first()?.len());
    if cases < 2 || readers < 2 {
        return None;
    }
    let (n, k) = (cases as f64, readers as f64);
    let mean = rows.iter().flatten().sum::<f64>() / (n * k);
    let of_case = |row: &Vec<f64>| row.iter().sum::<f64>() / k;
    let of_reader = |reader: usize| rows.iter().map(|row| row[reader]).sum::<f64>() / n;
    let square = |number: f64| number * number;
    let between_cases = k * rows.iter().map(|row| square(of_case(row) - mean)).sum::<f64>();
    let between_readers = n * (0..readers).map(|reader| square(of_reader(reader) - mean)).sum::<f64>();
    let total: f64 = rows.iter().flatten().map(|number| square(number - mean)).sum();
    let rest = total - between_cases - between_readers;
    let ms_cases = between_cases / (n - 1.0);
    let ms_readers = between_readers / (k - 1.0);
    let ms_rest = rest / ((n - 1.0) * (k - 1.0));
    let value = (ms_cases - ms_rest) / (ms_cases + (k - 1.0) * ms_rest + k * (ms_readers - ms_rest) / n);
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Judgement::{Accept, Mend, Reject};

    #[test]
    fn cohens_kappa_is_that_of_the_two_by_two_table() {
        // Both accept 20, both reject 15, one alone accepts 5 and 10: (0.7 - 0.5) / (1 - 0.5).
        let of = |count: usize, a, b| std::iter::repeat_n([a, b], count);
        let pairs: Vec<_> = of(20, Accept, Accept)
            .chain(of(5, Accept, Reject))
            .chain(of(10, Reject, Accept))
            .chain(of(15, Reject, Reject))
            .collect();
        assert!((cohen(&pairs).unwrap() - 0.4).abs() < 1e-12);
        assert_eq!(cohen(&[[Mend, Mend]; 3]), None);
        assert_eq!(cohen(&[]), None);
        let all: Vec<_> = [Accept, Mend, Reject].map(|kind| [kind, kind]).into();
        assert_eq!(cohen(&all), Some(1.0));
    }

    #[test]
    fn fleiss_kappa_is_that_of_the_published_example() {
        // Ten cases, fourteen readers, five categories; fleiss_kappa of statsmodels 0.15.0 gives 0.20993070442195522.
        let counts = [
            [0, 0, 0, 0, 14],
            [0, 2, 6, 4, 2],
            [0, 0, 3, 5, 6],
            [0, 3, 9, 2, 0],
            [2, 2, 8, 1, 1],
            [7, 7, 0, 0, 0],
            [3, 2, 6, 3, 0],
            [2, 5, 3, 2, 2],
            [6, 5, 2, 1, 0],
            [0, 2, 2, 3, 7],
        ]
        .map(Vec::from);
        assert!((fleiss(&counts).unwrap() - 0.209_930_704_421_955_22).abs() < 1e-12);
        assert_eq!(fleiss(&[vec![3, 0, 0], vec![3, 0, 0]]), None);
    }

    #[test]
    fn icc_is_that_of_shrout_and_fleiss() {
        // Their table 2: six subjects, four judges; table 4 has 0.29 for ICC(2,1), pingouin 0.7.0's ICC(A,1) 0.289764.
        let rows = [
            [9.0, 2.0, 5.0, 8.0],
            [6.0, 1.0, 3.0, 2.0],
            [8.0, 4.0, 6.0, 8.0],
            [7.0, 1.0, 2.0, 6.0],
            [10.0, 5.0, 6.0, 9.0],
            [6.0, 2.0, 4.0, 7.0],
        ]
        .map(Vec::from);
        assert!((icc(&rows).unwrap() - 0.289_764).abs() < 5e-7, "{:?}", icc(&rows));
        // Readers that agree, and one that is always one star higher: variance 1 between cases, 1/2 between readers.
        assert_eq!(icc(&[vec![1.0, 1.0], vec![3.0, 3.0]]), Some(1.0));
        let shifted = [1.0, 2.0, 3.0].map(|stars| vec![stars, stars + 1.0]);
        assert!((icc(&shifted).unwrap() - 1.0 / 1.5).abs() < 1e-12);
        assert_eq!(icc(&[vec![2.0, 2.0], vec![2.0, 2.0]]), None);
    }

    #[test]
    fn only_cases_that_all_have_judged_count() {
        let list = |reader: &str, said: &[(&str, Option<Judgement>, Option<u8>)]| Verdicts {
            reader: reader.into(),
            seed: 0,
            names_hidden: false,
            cases: said
                .iter()
                .map(|(case, judgement, stars)| {
                    (
                        (*case).to_owned(),
                        Verdict { judgement: *judgement, stars: *stars, reasons: String::new() },
                    )
                })
                .collect(),
        };
        let a = list("a", &[("1", Some(Accept), Some(5)), ("2", Some(Mend), Some(3)), ("3", None, Some(1))]);
        let b =
            list("b", &[("3", Some(Mend), Some(1)), ("2", Some(Mend), Some(3)), ("1", Some(Accept), None)]);
        let found = agreement(&[a.clone(), b]);
        let said: Vec<_> = found.iter().map(|one| (one.name, one.cases, one.value)).collect();
        assert_eq!(
            said,
            [
                ("Cohen's kappa", 2, Some(1.0)),
                ("Fleiss' kappa", 2, Some(1.0)),
                ("ICC(2,1) of stars", 2, Some(1.0))
            ]
        );
        assert!(agreement(&[a]).is_empty());
    }
}
