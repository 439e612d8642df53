//! What is said of one date in the window's mode for explaining: the page's words, without surfaces and pictures.

use glioscope_core::{
    Components, Connectivity,
    case::{Case, CaseMask, OrderBasis, TimePoint},
    components::Run,
    lesions::DEFAULT_SMALLEST_ML,
};

use super::{
    compare,
    sentences::words,
    text::{change, shared, size_of_one, size_range},
};
use crate::words::Language;

/// What is said of a date, and what is drawn in true size.
#[derive(Clone, Debug, PartialEq)]
pub struct Spoken {
    /// Sentences, in order, with the number of the mask that each is about; `None`: of all.
    pub sentences: Vec<(Option<usize>, String)>,
    /// Number of the largest mask.
    pub largest: usize,
    /// Diameter of a ball as large as the largest outline; `None` where nothing is outlined.
    pub ball_mm: Option<f64>,
    /// The everyday object that is nearest in size: what it is called, and its diameter.
    pub object: Option<(String, f64)>,
}

/// What is said of the date number `time`: how large the outlines are, and what became of them since the date before. Neither
/// names nor dates are said.
pub fn spoken(case: &Case, time: usize, language: Language) -> Spoken {
    let words = words(language);
    let Some(date) = case.time_points.get(time) else {
        return Spoken { sentences: Vec::new(), largest: 0, ball_mm: None, object: None };
    };
    let mut volumes_ml: Vec<f64> = date.masks.iter().map(|m| m.native_volume_ml).collect();
    volumes_ml.sort_by(f64::total_cmp);
    let mut sentences = Vec::new();
    match volumes_ml[..] {
        [] => sentences.push((None, words.get("size-none"))),
        [one] => sentences.push((Some(0), size_of_one(one, &words))),
        [least, .., most] => {
            sentences.push((None, size_range(least, most, &words)));
            sentences.push((None, shared(shared_ml(date), &words)));
        }
    }
    let before = time.checked_sub(1).and_then(|before| case.time_points.get(before));
    if let (Some(before), true) = (before, case.order != OrderBasis::Unknown) {
        for (n, m) in date.masks.iter().enumerate() {
            let Some(earlier) = before.masks.iter().find(|other| other.mask.id() == m.mask.id()) else {
                continue;
            };
            let name = match date.masks.len() {
                1 => words.get("outline-only"),
                _ => words.with("outline", &[("number", (n + 1).to_string())]),
            };
            sentences.push((Some(n), change(&name, earlier.native_volume_ml, m.native_volume_ml, &words)));
            let new = new_pieces(earlier, m);
            if new > 0 {
                sentences
                    .push((Some(n), words.with("text-new", &[("name", name), ("count", new.to_string())])));
            }
        }
    }
    let most = volumes_ml.last().copied().unwrap_or_default();
    let object = compare::nearest(most).map(|object| (words.get(object.key), object.diameter_mm));
    let is_largest = |m: &CaseMask| m.native_volume_ml.total_cmp(&most).is_eq();
    let largest = date.masks.iter().position(is_largest).unwrap_or_default();
    Spoken { sentences, largest, ball_mm: (most > 0.0).then(|| compare::ball_mm(most)), object }
}

/// Connected pieces of at least the smallest lesion's size that share no voxel with the earlier mask.
fn new_pieces(before: &CaseMask, after: &CaseMask) -> usize {
    let Ok(components) = Components::of_mask(after.mask.bits(), Connectivity::TwentySix) else { return 0 };
    let is_new = |runs: &[Run]| {
        let voxels: u64 = runs.iter().map(|run| u64::from(run.last - run.first) + 1).sum();
        let touches = runs.iter().any(|run| {
            (run.first..=run.last)
                .any(|x| before.mask.bits().get([x as usize, run.y as usize, run.z as usize]))
        });
        !touches && after.mask.grid().volume_ml(voxels) >= DEFAULT_SMALLEST_ML
    };
    let all = components.list().iter();
    all.filter(|component| is_new(components.runs(component))).count()
}

/// What all masks of a date hold.
fn shared_ml(date: &TimePoint) -> f64 {
    let all = (1_u64 << date.masks.len()) - 1;
    let of_all = date.regions.list().iter().find(|region| u64::from(region.bits) == all);
    of_all.map_or(0.0, |region| region.volume_ml)
}

#[cfg(test)]
mod tests {
    use glioscope_core::{Progress, case::LoadOptions, sample};

    use super::*;

    #[test]
    fn a_date_is_said_with_its_size_and_what_became_of_it() {
        let case =
            glioscope_core::case::load(&sample::sample_spec(), &LoadOptions::default(), &Progress::new())
                .unwrap();
        let first = spoken(&case, 0, Language::En);
        assert_eq!(first.sentences.len(), 2, "{:?}", first.sentences);
        assert!(first.sentences[0].1.contains("about as large as"), "{:?}", first.sentences);
        let later = spoken(&case, 1, Language::En);
        let new = later.sentences.iter().filter(|(_, text)| text.contains("new")).count();
        assert_eq!(new, 1, "the sample has a new lesion of T1: {:?}", later.sentences);
        assert_eq!(later.sentences.len(), 2 + case.time_points[1].masks.len() + new);
        // A ball of this diameter has the volume of the largest mask.
        let most = case.time_points[1].masks.iter().map(|m| m.native_volume_ml).fold(0.0, f64::max);
        let ball_ml = std::f64::consts::PI / 6.0 * later.ball_mm.unwrap().powi(3) / 1000.0;
        assert!((ball_ml - most).abs() < 1e-9 * most);
        for (_, text) in first.sentences.iter().chain(&later.sentences) {
            let names = case.time_points.iter().flat_map(|t| t.masks.iter().map(|m| m.mask.id()));
            assert!(names.into_iter().all(|id| !text.contains(id)) && !text.contains("20"), "{text}");
        }
        assert!(spoken(&case, 9, Language::De).sentences.is_empty());
    }
}
