//! How far the masks of a date agree, by a named convention: every pair, overlaps, then surfaces and lesions; and all as raters.

use glioscope_core::measure::{
    DateComparison, PairComparison, Raters,
    conventions::{Comparison, LesionReport, METRICS},
};

use super::document::{Block, Table};
use crate::words::Words;

/// Metrics of overlap, by their keys.
const OVERLAPS: [&str; 7] = [
    "dice",
    "jaccard",
    "volume_similarity",
    "relative_volume_difference",
    "sensitivity",
    "precision",
    "kappa",
];

/// Metrics of surfaces.
const SURFACES: [&str; 5] = ["hd_mm", "hd95_mm", "assd_mm", "masd_mm", "nsd"];

/// Every pair of masks of a date: overlaps in one table, surfaces and matched lesions in another. `name`: what a mask is called.
pub fn pairs(compared: &DateComparison, name: &dyn Fn(&str) -> String, words: &Words) -> Vec<Block> {
    let Some(first) = compared.pairs.first() else { return Vec::new() };
    let Comparison { convention, percentile, tolerance_mm, .. } = first.comparison;
    let variables = [
        ("tolerance", words.number(&tolerance_mm.to_string())),
        ("convention", convention.row().title.to_owned()),
        ("percentile", words.number(&percentile.to_string())),
    ];
    let of = |keys: &[&'static str], with_lesions: bool| {
        let titles = keys.iter().map(|key| words.get(&format!("metric-{}", key.replace('_', "-"))));
        let titles = titles.chain(lesion_titles(with_lesions, words));
        let head =
            ["first-mask", "second-mask"].map(|key| words.get(key)).into_iter().chain(titles).collect();
        let row = |pair: &PairComparison| {
            let ids = [name(&pair.a), name(&pair.b)].into_iter();
            let values = keys.iter().map(|key| value(&pair.comparison, key, words));
            let lesions = with_lesions.then(|| of_lesions(pair.comparison.lesions.as_ref(), words));
            ids.chain(values).chain(lesions.into_iter().flatten()).collect()
        };
        let note = words.with(if keys == OVERLAPS { "by-overlaps" } else { "by-distances" }, &variables);
        let rows = compared.pairs.iter().map(row).collect();
        Block::Table(Table { head, text_columns: 2, rows, note: Some(note) })
    };
    let has_lesions = compared.pairs.iter().any(|pair| pair.comparison.lesions.is_some());
    vec![of(&OVERLAPS, false), of(&SURFACES, has_lesions)]
}

/// A value, found by its place: the robust distance's key has its percentile.
fn value(comparison: &Comparison, key: &str, words: &Words) -> String {
    let at = METRICS.iter().position(|metric| metric.key == key);
    let value = at.and_then(|at| Some((METRICS.get(at)?, comparison.values.get(at)?.1)));
    match value {
        Some((metric, Some(value))) if value.is_finite() => {
            let is_length = metric.unit == "mm";
            words.number(&if is_length { format!("{value:.1} mm") } else { format!("{value:.3}") })
        }
        Some((_, Some(_))) => words.get("infinite"),
        _ => words.get("unknown"),
    }
}

fn lesion_titles(are_shown: bool, words: &Words) -> Vec<String> {
    let keys: &[&str] = if are_shown { &["metric-lesions", "metric-f1", "metric-pq"] } else { &[] };
    keys.iter().map(|key| words.get(key)).collect()
}

/// Found, missed and false ones; F1 of detection and panoptic quality.
fn of_lesions(lesions: Option<&LesionReport>, words: &Words) -> [String; 3] {
    let Some(lesions) = lesions else { return [(); 3].map(|()| words.get("unknown")) };
    let share =
        |value: Option<f64>| value.map_or_else(|| words.get("unknown"), |v| words.number(&format!("{v:.3}")));
    let counts = [lesions.found, lesions.missed, lesions.false_positives].map(|count| count.to_string());
    [counts.join(" / "), share(lesions.f1), share(lesions.pq)]
}

/// Majority, STAPLE and Fleiss' kappa.
pub fn raters(raters: &Raters, words: &Words) -> Block {
    let mut facts = vec![(words.get("majority"), words.ml(raters.majority_ml))];
    facts.extend(raters.staple_ml.map(|ml| (words.get("staple"), words.ml(ml))));
    facts.extend(raters.fleiss_kappa_union_box.map(|kappa| {
        let kappa = words.number(&format!("{kappa:.3}"));
        (words.get("fleiss-kappa"), words.with("fleiss-line", &[("box", kappa)]))
    }));
    Block::Facts(facts)
}

#[cfg(test)]
mod tests {
    use glioscope_core::{
        Grid, MaskBits,
        glam::DVec3,
        measure::conventions::{Convention, Settings, compare},
    };

    use super::*;
    use crate::{report::sentences::words, words::Language};

    /// Two boxes of 4 and 6 voxels along x, 2 of them shared; by panoptica, whose lesions they don't match.
    fn compared(convention: Convention) -> DateComparison {
        let grid = Grid::axis_aligned([8, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let [a, b] = [|i: usize| i < 4, |i: usize| i >= 2].map(|of| MaskBits::from_fn([8, 1, 1], of));
        let settings = Settings { convention, ..Settings::default() };
        let comparison = compare(&a, &b, &grid, &settings).unwrap();
        let pair = PairComparison { a: "a".into(), b: "b".into(), comparison };
        DateComparison { time: String::new(), pairs: vec![pair], raters: None }
    }

    fn tables(compared: &DateComparison, language: Language) -> Vec<Table> {
        let table = |block| match block {
            Block::Table(table) => table,
            other => panic!("{other:?}"),
        };
        pairs(compared, &|id| id.to_owned(), &words(language)).into_iter().map(table).collect()
    }

    #[test]
    fn every_metric_stands_with_its_convention() {
        let shown = tables(&compared(Convention::Panoptica), Language::En);
        let [overlaps, surfaces] = shown.as_slice() else { panic!("{shown:?}") };
        // Dice 4/10, Jaccard 2/8, volumes 4 and 6.
        assert_eq!(overlaps.rows[0][2..8], ["0.400", "0.250", "0.800", "0.500", "0.500", "0.333"]);
        assert_eq!(surfaces.rows[0].len(), surfaces.head.len());
        // A Jaccard index of 0.25 is no match: one missed, one false.
        assert_eq!(surfaces.rows[0][7..], ["0 / 1 / 1", "0.000", "0.000"]);
        for table in &shown {
            assert!(table.note.as_ref().unwrap().contains("panoptica"), "{table:?}");
        }
    }

    #[test]
    fn every_column_has_its_words_in_every_language() {
        for language in [Language::En, Language::De] {
            for table in tables(&compared(Convention::Brats), language) {
                assert!(!table.head.iter().any(|title| title.starts_with("metric-")), "{table:?}");
                assert_eq!(table.rows[0].len(), table.head.len());
            }
            // Without lesions there are no columns of them.
            assert_eq!(tables(&compared(Convention::Deepmind), language)[1].head.len(), 7);
        }
    }
}
