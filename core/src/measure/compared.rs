//! The masks of a case compared by a named convention: every pair of a date, and all of them together.

use rayon::prelude::*;
use serde::Serialize;

use super::conventions::{Comparison, Domain, Ratings, Settings, Staple, compare};
use crate::{
    Cancelled, Progress,
    case::{Case, TimePoint},
};

/// Fewest masks that are compared as raters of one tumour.
const FEWEST_RATERS: usize = 3;

/// Two masks of a date: the first is the reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairComparison {
    /// Id of the first mask, the reference.
    pub a: String,
    /// Id of the second mask.
    pub b: String,
    /// Its values.
    #[serde(flatten)]
    pub comparison: Comparison,
}

/// Agreement of all masks of a date, taken as raters of one tumour.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Raters {
    /// The masks, in the order of the estimates.
    pub masks: Vec<String>,
    /// Volume that more than half of the masks have.
    pub majority_ml: f64,
    /// Fleiss' kappa over the bounding box of the union; `None` where all voxels are rated alike.
    pub fleiss_kappa_union_box: Option<f64>,
    /// Fleiss' kappa over the case grid, which depends on how much background that has.
    pub fleiss_kappa_whole_grid: Option<f64>,
    /// STAPLE over the case grid; `None` where it has no estimate.
    pub staple: Option<Staple>,
    /// Volume of STAPLE's estimate.
    pub staple_ml: Option<f64>,
}

/// The masks of a date compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DateComparison {
    /// Label of the date.
    pub time: String,
    /// All pairs, in the order of [`super::pairs`].
    pub pairs: Vec<PairComparison>,
    /// All masks; `None` for fewer than three, and where all are empty.
    pub raters: Option<Raters>,
}

/// Compares the masks of every date of `case` on the case grid.
///
/// # Errors
/// [`Cancelled`].
pub fn compared(
    case: &Case,
    settings: &Settings,
    progress: &Progress,
) -> Result<Vec<DateComparison>, Cancelled> {
    case.time_points.iter().map(|time| date(time, settings, progress)).collect()
}

fn date(time: &TimePoint, settings: &Settings, progress: &Progress) -> Result<DateComparison, Cancelled> {
    progress.say("comparing masks");
    let masks = &time.masks;
    let numbers: Vec<[usize; 2]> =
        (0..masks.len()).flat_map(|a| (a + 1..masks.len()).map(move |b| [a, b])).collect();
    let pairs: Vec<Option<PairComparison>> = numbers
        .par_iter()
        .map(|pair| {
            progress.check()?;
            let [a, b] = pair.map(|k| &masks[k].mask);
            // All masks of a case lie on the case grid.
            let comparison = compare(a.bits(), b.bits(), time.index.grid(), settings).ok();
            Ok(comparison.map(|comparison| PairComparison {
                a: a.id().to_owned(),
                b: b.id().to_owned(),
                comparison,
            }))
        })
        .collect::<Result<_, Cancelled>>()?;
    Ok(DateComparison {
        time: time.label.clone(),
        pairs: pairs.into_iter().flatten().collect(),
        raters: raters(time),
    })
}

fn raters(time: &TimePoint) -> Option<Raters> {
    let grid = time.index.grid();
    let ratings = |domain| Ratings::of(&time.regions, grid, domain);
    let (whole, boxed) = (ratings(Domain::WholeGrid)?, ratings(Domain::UnionBox)?);
    if time.masks.len() < FEWEST_RATERS {
        return None;
    }
    let staple = whole.staple();
    Some(Raters {
        masks: time.regions.mask_ids().to_vec(),
        majority_ml: grid.volume_ml(whole.majority_voxels()),
        fleiss_kappa_union_box: boxed.fleiss_kappa(),
        fleiss_kappa_whole_grid: whole.fleiss_kappa(),
        staple_ml: staple.as_ref().map(|staple| grid.volume_ml(staple.voxels)),
        staple,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{case::LoadOptions, measure, sample};

    #[test]
    fn every_pair_of_every_date_is_compared_and_overlaps_are_those_of_the_tables() {
        let spec = sample::sample_spec();
        let case = crate::case::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
        let all = compared(&case, &Settings::default(), &Progress::new()).unwrap();
        assert_eq!(all.len(), 2);
        for (date, time) in all.iter().zip(&case.time_points) {
            let pairs = measure::pairs(&time.index, &time.regions);
            assert_eq!(date.pairs.len(), 3);
            for (found, pair) in date.pairs.iter().zip(&pairs) {
                assert_eq!((&found.a, &found.b), (&pair.a, &pair.b));
                assert_eq!(found.comparison.value("dice"), pair.value("dice"));
                let [hd, hd95] = ["hd_mm", "hd95_mm"].map(|key| found.comparison.value(key).unwrap());
                assert!(hd >= hd95 && hd95 > 0.0, "{hd} {hd95}");
                let points = found.comparison.hausdorff.unwrap();
                let apart_mm = points.on_reference_mm.distance(points.on_compared_mm);
                assert!((apart_mm - hd).abs() < 1e-9, "{apart_mm} {hd}");
            }
            let raters = date.raters.as_ref().unwrap();
            assert!(raters.majority_ml > 0.0 && raters.majority_ml < time.regions.union_ml());
        }
    }
}
