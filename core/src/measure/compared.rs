//! The masks of a case compared by a named convention: every pair of a date, and all of them together.

use std::fmt;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::conventions::{Comparison, Domain, Ratings, Settings, Staple, compare};
use crate::{
    Cancelled, Mask, MaskBits, Progress,
    case::{Case, TimePoint, in_two_spaces},
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
    /// All pairs, in the order of [`super::pairs`]; only those of a reference that was named may be the other way around.
    pub pairs: Vec<PairComparison>,
    /// All masks; `None` for fewer than three, and where all are empty.
    pub raters: Option<Raters>,
}

/// What is compared at a date: a mask, or a region.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Operand {
    /// Label of the date.
    pub time: String,
    /// Ids of the masks: of a region those that are active in it, else those whose union is meant.
    pub masks: Vec<String>,
    /// Whether it is a region: where exactly these masks are active.
    pub is_region: bool,
}

impl fmt::Display for Operand {
    /// As [`Self::parse`] reads it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let region = if self.is_region { "=" } else { "" };
        write!(f, "{region}{}", self.masks.join("+"))?;
        if self.time.is_empty() { Ok(()) } else { write!(f, "@{}", self.time) }
    }
}

impl Operand {
    /// That of `ID`, `ID+ID` (a union) or `=ID+ID` (a region: exactly these masks), with `@DATE` unless the case has one date.
    ///
    /// # Errors
    /// What was found and expected, where the case has no such date or masks.
    pub fn parse(case: &Case, text: &str) -> Result<Self, String> {
        let has = |time: &TimePoint, id: &str| time.masks.iter().any(|m| m.mask.id() == id);
        let of_case = |id: &str| case.time_points.iter().any(|time| has(time, id));
        // A mask may have an @ in its name, and so may a date.
        let dated = || {
            let mut places = text.match_indices('@').map(|(at, _)| (&text[..at], &text[at + 1..]));
            let known = places.clone().find(|(_, label)| case.time_at(label).is_some());
            known.or_else(|| places.next_back())
        };
        let (names, label) = match if of_case(text) { None } else { dated() } {
            Some((names, label)) => (names, Some(label)),
            None => (text, None),
        };
        let labels = || case.time_labels().join(", ");
        let time = match (label, case.time_points.as_slice()) {
            (Some(label), all) => all
                .iter()
                .find(|time| time.label == label)
                .ok_or_else(|| format!("found date {label:?} in {text:?}, expected one of {}", labels()))?,
            (None, [only]) => only,
            (None, _) => {
                return Err(format!("found {text:?} without a date, expected ID@DATE, one of {}", labels()));
            }
        };
        // Or a + in it, or a = before it.
        let (is_region, names) = match names.strip_prefix('=') {
            Some(rest) if !has(time, names) => (true, rest),
            _ => (false, names),
        };
        let masks: Vec<String> = match has(time, names) {
            true => vec![names.to_owned()],
            false => names.split('+').map(|id| id.trim().to_owned()).collect(),
        };
        if let Some(id) = masks.iter().find(|id| !has(time, id)) {
            let ids: Vec<&str> = time.masks.iter().map(|m| m.mask.id()).collect();
            return Err(format!("found no mask {id:?} in {text:?}, expected some of {}", ids.join(", ")));
        }
        Ok(Self { time: time.label.clone(), masks, is_region })
    }

    /// Its date and voxels; the reason where the case lacks them.
    fn voxels(&self, case: &Case) -> Result<(usize, MaskBits), String> {
        let Self { time, masks, is_region } = self;
        let lacks = |what: &str, expected: &str| Err(format!("found no {what}, expected {expected}"));
        let Some(at) = case.time_at(time) else { return lacks(&format!("date {time}"), "one of the case") };
        let Some(date) = case.time_points.get(at) else { return lacks("date", "one of the case") };
        let known = |id: &&String| date.masks.iter().any(|m| m.mask.id() == id.as_str());
        if masks.is_empty() || !masks.iter().all(|id| known(&id)) {
            return lacks(&format!("masks {} at {time}", masks.join(", ")), "masks of that date");
        }
        let (of, others): (Vec<_>, Vec<_>) =
            date.masks.iter().map(|m| &m.mask).partition(|mask| masks.iter().any(|id| id == mask.id()));
        let mut bits =
            of.first().map_or_else(|| MaskBits::empty(case.grid.dims()), |mask| mask.bits().clone());
        let mut combine = |mask: &Mask, with: fn(u64, u64) -> u64| {
            bits.words_mut().iter_mut().zip(mask.bits().words()).for_each(|(a, b)| *a = with(*a, *b));
        };
        for mask in of.iter().skip(1) {
            combine(mask, if *is_region { |a, b| a & b } else { |a, b| a | b });
        }
        for mask in others.iter().filter(|_| *is_region) {
            combine(mask, |a, b| a & !b);
        }
        Ok((at, bits))
    }
}

/// Compares two masks or regions of any dates on the case grid, the first as the reference. The reason in one line where the
/// case lacks one, and where their dates don't lie in one space.
///
/// # Errors
/// [`Cancelled`].
pub fn compared_two(
    case: &Case,
    operands: &[Operand; 2],
    settings: &Settings,
    progress: &Progress,
) -> Result<Result<Comparison, String>, Cancelled> {
    let [a, b] = operands;
    let ((from, a_bits), (to, b_bits)) = match (a.voxels(case), b.voxels(case)) {
        (Ok(a), Ok(b)) => (a, b),
        (Err(why), _) | (_, Err(why)) => return Ok(Err(why)),
    };
    if from != to {
        let ids = [a, b].map(|of| of.masks.iter().map(String::as_str).collect::<Vec<_>>());
        let apart = in_two_spaces(case, [from, to], [&ids[0], &ids[1]], !case.one_space, progress)?;
        if let Some(why) = apart {
            return Ok(Err(why));
        }
    }
    Ok(compare(&a_bits, &b_bits, &case.grid, settings).map_err(|unequal| unequal.to_string()))
}

/// Compares the masks of date number `time` of `case`; no pairs where it has no such date.
///
/// # Errors
/// [`Cancelled`].
pub fn compared_at(
    case: &Case,
    time: usize,
    settings: &Settings,
    progress: &Progress,
) -> Result<DateComparison, Cancelled> {
    match case.time_points.get(time) {
        Some(time) => date(time, &[], settings, progress),
        None => Ok(DateComparison { time: String::new(), pairs: Vec::new(), raters: None }),
    }
}

/// Compares the masks of every date of `case` on the case grid; masks with these `references` as ids are the first of
/// their pairs.
///
/// # Errors
/// [`Cancelled`].
pub fn compared(
    case: &Case,
    references: &[String],
    settings: &Settings,
    progress: &Progress,
) -> Result<Vec<DateComparison>, Cancelled> {
    case.time_points.iter().map(|time| date(time, references, settings, progress)).collect()
}

fn date(
    time: &TimePoint,
    references: &[String],
    settings: &Settings,
    progress: &Progress,
) -> Result<DateComparison, Cancelled> {
    progress.say("comparing masks");
    let masks = &time.masks;
    let is_reference = |k: usize| references.iter().any(|id| id == masks[k].mask.id());
    let in_order = |a: usize, b: usize| if is_reference(b) && !is_reference(a) { [b, a] } else { [a, b] };
    let numbers: Vec<[usize; 2]> =
        (0..masks.len()).flat_map(|a| (a + 1..masks.len()).map(move |b| in_order(a, b))).collect();
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
        let all = compared(&case, &[], &Settings::default(), &Progress::new()).unwrap();
        assert_eq!(all.len(), 2);
        for (n, (date, time)) in all.iter().zip(&case.time_points).enumerate() {
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
            // With a reference: its pairs alone turn around, and what isn't the same both ways with them.
            let turned = compared(&case, &["T2".to_owned()], &Settings::default(), &Progress::new())
                .unwrap()
                .remove(n);
            for (found, turned) in date.pairs.iter().zip(&turned.pairs) {
                let is_turned = found.b == "T2";
                let (a, b) = if is_turned { (&found.b, &found.a) } else { (&found.a, &found.b) };
                assert_eq!((&turned.a, &turned.b), (a, b));
                let of = |key: &str| turned.comparison.value(key);
                let expected = if is_turned { "precision" } else { "sensitivity" };
                assert_eq!(of("sensitivity"), found.comparison.value(expected));
                assert_eq!(of("dice"), found.comparison.value("dice"));
            }
            assert!(date.pairs.iter().any(|pair| pair.b == "T2"));
            let raters = date.raters.as_ref().unwrap();
            assert!(raters.majority_ml > 0.0 && raters.majority_ml < time.regions.union_ml());
        }
    }

    #[test]
    fn any_two_are_the_regions_and_masks_that_they_name() {
        let spec = sample::sample_spec();
        let case = crate::case::load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
        let of = |time: usize, masks: &[&str], is_region: bool| Operand {
            time: case.time_points[time].label.clone(),
            masks: masks.iter().map(|id| (*id).to_owned()).collect(),
            is_region,
        };
        let compare = |a: Operand, b: Operand| {
            compared_two(&case, &[a, b], &Settings::default(), &Progress::new()).unwrap()
        };
        // Two masks of one date are the pair of the table.
        let date = compared_at(&case, 0, &Settings::default(), &Progress::new()).unwrap();
        let two = compare(of(0, &["T1"], false), of(0, &["T2"], false)).unwrap();
        assert_eq!(two, date.pairs[0].comparison);
        // A region against itself and its mask: its voxels by the list of regions.
        let regions = &case.time_points[0].regions;
        for region in regions.list() {
            let ids = regions.mask_ids();
            let active: Vec<&str> =
                (0..ids.len()).filter(|k| region.bits >> k & 1 == 1).map(|k| ids[k].as_str()).collect();
            let own = compare(of(0, &active, true), of(0, &active[..1], false)).unwrap();
            assert_eq!(own.overlap.reference, region.voxels);
            assert_eq!(own.overlap.both, region.voxels, "a region lies in its masks");
        }
        // A mask at two dates: as much in common as the change keeps.
        let dates = compare(of(0, &["T1"], false), of(1, &["T1"], false)).unwrap();
        let [a, b] =
            [0, 1].map(|t: usize| case.time_points[t].masks.iter().find(|m| m.mask.id() == "T1").unwrap());
        let both = a
            .mask
            .bits()
            .words()
            .iter()
            .zip(b.mask.bits().words())
            .map(|(a, b)| (a & b).count_ones())
            .sum::<u32>();
        assert_eq!(dates.overlap.both, u64::from(both));
        for one in [of(0, &["T1"], false), of(1, &["T1", "PET"], true)] {
            assert_eq!(Operand::parse(&case, &one.to_string()), Ok(one));
        }
        let first = &case.time_points[0].label;
        let unknown = format!("X+T1@{first}");
        for (wrong, said) in
            [("T1", "without a date"), ("T1@never", "date \"never\""), (unknown.as_str(), "no mask \"X\"")]
        {
            let found = Operand::parse(&case, wrong).unwrap_err();
            assert!(found.contains(said), "{wrong}: {found}");
        }
        for wrong in [
            of(0, &["no such"], false),
            of(0, &[], true),
            Operand { time: "never".into(), ..of(0, &["T1"], false) },
        ] {
            assert!(compare(of(0, &["T1"], false), wrong).unwrap_err().contains("expected"));
        }
    }
}
