//! The table of rules: each criterion's statements and numbers, with what they rest on. The evaluator reads its numbers from
//! here. What no source that was read states is in [`UNSTATED`], and isn't applied.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};

use super::phrases as say;
use crate::phrase::{Phrase, Template, Value};

/// A set of response criteria.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, IntoStaticStr, VariantArray)]
pub enum Criterion {
    /// RANO of 2010, high-grade glioma.
    #[serde(rename = "rano-2010")]
    #[strum(serialize = "rano-2010")]
    Rano2010,
    /// RANO of 2011, low-grade glioma.
    #[serde(rename = "rano-lgg")]
    #[strum(serialize = "rano-lgg")]
    RanoLgg,
    /// Modified RANO of 2017.
    #[serde(rename = "mrano")]
    #[strum(serialize = "mrano")]
    ModifiedRano,
    /// RANO 2.0 of 2023.
    #[serde(rename = "rano-2.0")]
    #[strum(serialize = "rano-2.0")]
    Rano20,
    /// Immunotherapy RANO: RANO 2010 with a rule for early progression.
    #[serde(rename = "irano")]
    #[strum(serialize = "irano")]
    ImmunoRano,
    /// RANO for brain metastases.
    #[serde(rename = "rano-bm")]
    #[strum(serialize = "rano-bm")]
    RanoBm,
}

impl Criterion {
    /// All criteria.
    pub const ALL: [Self; 6] = [R10, LGG, MR17, R20, IR, BM];

    /// Its name in prose.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rano2010 => "RANO 2010",
            Self::RanoLgg => "RANO-LGG",
            Self::ModifiedRano => "mRANO",
            Self::Rano20 => "RANO 2.0",
            Self::ImmunoRano => "iRANO",
            Self::RanoBm => "RANO-BM",
        }
    }
}

/// How a rule is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// The source, its abstract or a reprint of its table was read.
    Read,
    /// A review, or code that quotes the source, was read.
    Secondary,
}

/// What a rule is about. One criterion has at most one row of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RuleId {
    /// Shortest longest diameter of a measurable lesion.
    MeasurableLongest,
    /// Shortest perpendicular diameter of a measurable lesion.
    MeasurablePerpendicular,
    /// Fewest slices of a measurable lesion.
    MeasurableSlices,
    /// Slice thickness above which diameters are compared with the thickness.
    ThickSlice,
    /// Diameters in thicknesses where slices are thick.
    ThickSliceFactor,
    /// Most target lesions.
    MaxTargets,
    /// Most target lesions of each compartment in mixed disease.
    MaxTargetsMixed,
    /// The first scan after radiotherapy is the baseline.
    BaselineAfterRadiotherapy,
    /// Earliest baseline after radiotherapy.
    BaselineEarliest,
    /// Latest baseline after radiotherapy.
    BaselineLatest,
    /// Earliest baseline before treatment.
    BaselineBeforeTreatment,
    /// Complete response.
    CompleteResponse,
    /// Decrease of a partial response, by diameters.
    PartialResponse,
    /// Decrease of a partial response, by volume.
    PartialResponseVolume,
    /// Decrease of a minor response, by diameters.
    MinorResponse,
    /// Increase of progression, by diameters.
    Progression,
    /// Increase of progression, by volume.
    ProgressionVolume,
    /// Stable disease: none of the others.
    StableDisease,
    /// Best call without measurable disease.
    NonMeasurableOnly,
    /// T2/FLAIR as an observation of its own.
    Flair,
    /// Lesions that are not targets.
    NonTarget,
    /// New lesions.
    NewLesion,
    /// New lesions under immunotherapy.
    NewLesionImmunotherapy,
    /// Equivocal new lesions.
    EquivocalNewLesion,
    /// Steroids and complete response.
    SteroidsNone,
    /// Steroids and other responses and stable disease.
    SteroidsNotRaised,
    /// A rise of steroids by itself.
    SteroidsAlone,
    /// A rise of steroids for other causes on a stable scan.
    SteroidsOther,
    /// A rise of steroids because of the tumour.
    SteroidsTumour,
    /// The patient's clinical state.
    Clinical,
    /// Interval after which a response is confirmed.
    ConfirmResponse,
    /// Window after radiotherapy in which progression is not taken at once.
    RadiotherapyWindow,
    /// What makes progression in that window.
    WindowAccepts,
    /// Earliest scan that confirms progression.
    ConfirmProgression,
    /// Latest scan that confirms progression.
    ConfirmProgressionLatest,
    /// Months from the start of immunotherapy in which progression needs confirmation.
    ImmunotherapyWindow,
    /// What makes progression in that window at once.
    ImmunotherapyMuchWorse,
    /// Mixed disease: progression.
    MixedProgression,
    /// Mixed disease: response and stable disease.
    MixedStable,
    /// Mixed disease: complete response and another call.
    MixedComplete,
    /// Mixed disease: the same call in both compartments.
    MixedAlike,
    /// Surgery.
    SurgeryResets,
    /// A lowest sum of zero.
    Reappearance,
    /// Changed technique.
    TechniqueChanged,
}

/// One rule.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Rule {
    /// The criteria that state it.
    pub criteria: &'static [Criterion],
    /// What it is about.
    pub id: RuleId,
    /// The rule in plain words.
    pub statement: &'static str,
    /// Its number, where it has one.
    pub number: Option<f64>,
    /// Unit of the number: `mm`, `%`, `days`, `months`, `slices`, `lesions`, or empty.
    pub unit: &'static str,
    /// How it is known.
    pub mark: Mark,
    /// What it rests on.
    pub source: &'static str,
}

use Criterion::{
    ImmunoRano as IR, ModifiedRano as MR17, Rano20 as R20, Rano2010 as R10, RanoBm as BM, RanoLgg as LGG,
};
use RuleId as Id;

const REVIEWS: &str = "reviews: PMC10584081 table 1; PMC6499019 table 2";
const QUOTED: &str = "quoted by cai4cai/rano2.0-assist, CFB-GBM v2.0 and prateekkarkare/lumiere-rano";
const BOTH: &str =
    "reviews: PMC10584081 table 1; PMC6499019 table 2; quoted by cai4cai/rano2.0-assist, CFB-GBM v2.0";
const IRANO: &str = "abstract of iRANO: PMC4638131";
const RANO_BM: &str = "reprint of the RANO-BM table: PMC6499019 table 4";
const RADIOPAEDIA: &str = "Radiopaedia on RANO-BM; PMC6499019 table 4";
const MRANO: &str = "abstract of mRANO";
const ENGINES: &str = "faults found in public engines on the LUMIERE data set";

const fn row(
    criteria: &'static [Criterion],
    id: RuleId,
    number: f64,
    unit: &'static str,
    mark: Mark,
    source: &'static str,
    statement: &'static str,
) -> Rule {
    Rule { criteria, id, statement, number: Some(number), unit, mark, source }
}

const fn said(
    criteria: &'static [Criterion],
    id: RuleId,
    mark: Mark,
    source: &'static str,
    statement: &'static str,
) -> Rule {
    Rule { criteria, id, statement, number: None, unit: "", mark, source }
}

use Mark::{Read, Secondary};

/// All rules that are applied.
#[rustfmt::skip]
pub static RULES: &[Rule] = &[
    row(&[R10, IR, LGG, R20], Id::MeasurableLongest, 10.0, "mm", Secondary, BOTH, "measurable: longest diameter at least this, at baseline"),
    row(&[R10, IR, LGG, R20], Id::MeasurablePerpendicular, 10.0, "mm", Secondary, BOTH, "measurable: perpendicular diameter at least this, at baseline"),
    row(&[R10, IR, LGG, R20], Id::MeasurableSlices, 2.0, "slices", Secondary, BOTH, "measurable: seen on at least this many slices, at baseline"),
    row(&[R10, IR, LGG, R20], Id::ThickSlice, 5.0, "mm", Secondary, BOTH, "slices thicker than this: both diameters are compared with the thickness"),
    row(&[R10, IR, LGG, R20], Id::ThickSliceFactor, 2.0, "", Secondary, BOTH, "slices that are thick: both diameters at least this many thicknesses"),
    row(&[BM], Id::MeasurableLongest, 10.0, "mm", Secondary, RADIOPAEDIA, "measurable: longest diameter at least this, at baseline"),
    row(&[BM], Id::MeasurablePerpendicular, 5.0, "mm", Secondary, RADIOPAEDIA, "measurable: perpendicular diameter at least this, at baseline"),
    row(&[BM], Id::MeasurableSlices, 2.0, "slices", Secondary, RADIOPAEDIA, "measurable: seen on at least this many axial slices, at baseline"),
    row(&[R20], Id::MaxTargets, 3.0, "lesions", Secondary, QUOTED, "at most this many enhancing, or this many non-enhancing targets"),
    row(&[R20], Id::MaxTargetsMixed, 2.0, "lesions", Secondary, QUOTED, "mixed disease: at most this many targets of each compartment"),
    row(&[BM], Id::MaxTargets, 5.0, "lesions", Secondary, RADIOPAEDIA, "at most this many targets"),

    said(&[MR17], Id::BaselineAfterRadiotherapy, Read, MRANO, "newly diagnosed: the first scan after radiotherapy is the baseline"),
    row(&[R20], Id::BaselineEarliest, 21.0, "days", Secondary, QUOTED, "newly diagnosed: baseline at least this long after radiotherapy"),
    row(&[R20], Id::BaselineLatest, 35.0, "days", Secondary, QUOTED, "newly diagnosed: baseline at most this long after radiotherapy"),
    row(&[BM], Id::BaselineBeforeTreatment, 28.0, "days", Secondary, RADIOPAEDIA, "baseline at most this long before the start of treatment"),

    said(&[R10, IR, R20, MR17], Id::CompleteResponse, Secondary, BOTH, "complete response: all enhancing disease (of the compartment that is assessed) is gone"),
    said(&[LGG], Id::CompleteResponse, Secondary, REVIEWS, "complete response: all T2/FLAIR disease is gone"),
    said(&[BM], Id::CompleteResponse, Secondary, RADIOPAEDIA, "complete response: all lesions are gone"),
    row(&[R10, IR, LGG, MR17, R20], Id::PartialResponse, 50.0, "%", Secondary, BOTH, "partial response: sum of products of diameters lower than at baseline by at least this"),
    row(&[BM], Id::PartialResponse, 30.0, "%", Read, RANO_BM, "partial response: sum of longest diameters lower than at baseline by at least this"),
    row(&[MR17, R20], Id::PartialResponseVolume, 65.0, "%", Secondary, QUOTED, "partial response: volume lower than at baseline by at least this"),
    row(&[LGG], Id::MinorResponse, 25.0, "%", Secondary, REVIEWS, "minor response: lower than at baseline by at least this, and by less than a partial response"),
    row(&[R20], Id::MinorResponse, 25.0, "%", Secondary, "RANO-LGG table (PMC10584081 table 1) for its non-enhancing rule", "non-enhancing, minor response: lower than at baseline by at least this, and by less than a partial response"),
    row(&[R10, IR, LGG, MR17, R20], Id::Progression, 25.0, "%", Secondary, BOTH, "progression: sum of products of diameters above the lowest by at least this"),
    row(&[BM], Id::Progression, 20.0, "%", Read, RANO_BM, "progression: sum of longest diameters above the lowest by at least this"),
    row(&[MR17, R20], Id::ProgressionVolume, 40.0, "%", Secondary, QUOTED, "progression: volume above the lowest by at least this"),
    said(&[R10, IR, LGG, MR17, R20, BM], Id::StableDisease, Secondary, BOTH, "stable disease: neither response nor progression"),
    said(&[R10, IR], Id::NonMeasurableOnly, Secondary, REVIEWS, "without measurable disease the best call is stable disease"),

    said(&[R10, IR], Id::Flair, Secondary, REVIEWS, "a significant rise of T2/FLAIR is progression; no number is stated"),
    said(&[R20], Id::Flair, Secondary, QUOTED, "enhancing disease: T2/FLAIR counts under antiangiogenic treatment only"),
    said(&[R10, IR], Id::NonTarget, Secondary, REVIEWS, "response and stable disease need non-target disease that isn't worse; worse leaves progression"),
    said(&[R20], Id::NonTarget, Secondary, QUOTED, "non-target progression: it and the sum of targets and it both above their lowest by the progression threshold"),
    said(&[BM], Id::NonTarget, Read, RANO_BM, "unequivocal progression of non-target disease is progression"),
    said(&[R10, IR, LGG], Id::NewLesion, Secondary, REVIEWS, "a new lesion is progression"),
    said(&[R20], Id::NewLesion, Secondary, QUOTED, "a new measurable lesion is progression"),
    said(&[BM], Id::NewLesion, Read, RANO_BM, "a new lesion is progression, unless under immunotherapy"),
    said(&[BM], Id::NewLesionImmunotherapy, Read, RANO_BM, "under immunotherapy a new lesion alone isn't progression"),
    said(&[BM], Id::EquivocalNewLesion, Read, RANO_BM, "an equivocal new lesion: wait; if it turns out to be one, progression is dated back"),

    said(&[R10, IR], Id::SteroidsNone, Secondary, REVIEWS, "complete response needs no steroids"),
    said(&[R10, IR], Id::SteroidsNotRaised, Secondary, REVIEWS, "partial response and stable disease need no more steroids than at baseline"),
    said(&[R10, IR], Id::SteroidsAlone, Secondary, REVIEWS, "steroids by themselves don't make progression"),
    said(&[BM], Id::SteroidsNone, Read, RANO_BM, "complete response needs no steroids"),
    said(&[BM], Id::SteroidsNotRaised, Read, RANO_BM, "partial response and stable disease need steroids that aren't raised"),
    said(&[BM], Id::SteroidsAlone, Read, RANO_BM, "a rise of steroids alone isn't progression"),
    said(&[R20], Id::SteroidsAlone, Secondary, QUOTED, "a rise of steroids alone isn't progression"),
    said(&[R20], Id::SteroidsOther, Secondary, QUOTED, "stable scan and a rise for other causes: neither stable disease nor progression, observe; back at the baseline dose: stable disease"),
    said(&[R20], Id::SteroidsTumour, Secondary, QUOTED, "a rise because of the tumour is progression, dated at the first necessary rise"),
    said(&[R10, IR, R20], Id::Clinical, Secondary, BOTH, "clinically worse is progression; else stable or better"),
    said(&[BM], Id::Clinical, Read, RANO_BM, "clinically worse is progression"),

    row(&[R10, IR], Id::ConfirmResponse, 28.0, "days", Secondary, REVIEWS, "complete and partial response are confirmed by a scan at least this much later"),
    row(&[LGG], Id::ConfirmResponse, 28.0, "days", Secondary, REVIEWS, "partial response is confirmed by a scan at least this much later"),
    row(&[R10, IR, R20], Id::RadiotherapyWindow, 84.0, "days", Secondary, BOTH, "progression isn't taken at once up to this long after radiotherapy"),
    said(&[R10, IR], Id::WindowAccepts, Secondary, REVIEWS, "in that window progression needs growth outside the radiation field, or histology"),
    said(&[R20], Id::WindowAccepts, Secondary, QUOTED, "in that window progression of newly diagnosed disease needs a repeat scan, or histology"),
    row(&[R20], Id::ConfirmProgression, 28.0, "days", Secondary, QUOTED, "the repeat scan is at least this much later"),
    row(&[R20], Id::ConfirmProgressionLatest, 56.0, "days", Secondary, QUOTED, "the repeat scan is at most this much later"),
    row(&[IR], Id::ImmunotherapyWindow, 6.0, "months", Read, IRANO, "progression up to this long after the start of immunotherapy, new lesions included, needs confirmation on follow-up"),
    said(&[IR], Id::ImmunotherapyMuchWorse, Read, IRANO, "in that window a patient who is clinically much worse has progression without confirmation"),

    said(&[R20], Id::MixedProgression, Secondary, QUOTED, say::MIXED_PROGRESSION.english),
    said(&[R20], Id::MixedStable, Secondary, QUOTED, say::MIXED_STABLE.english),
    said(&[R20], Id::MixedComplete, Secondary, QUOTED, say::MIXED_COMPLETE.english),
    said(&[R20], Id::MixedAlike, Secondary, QUOTED, say::MIXED_ALIKE.english),

    said(&Criterion::ALL, Id::SurgeryResets, Secondary, ENGINES, "surgery resets baseline, lowest sum and targets"),
    said(&Criterion::ALL, Id::Reappearance, Secondary, ENGINES, "above a lowest sum of zero there is no ratio: reappearance is judged as a new lesion"),
    said(&Criterion::ALL, Id::TechniqueChanged, Secondary, ENGINES, "sums across a change of sequence, contrast or slice thickness aren't compared; those since the change are"),
];

/// What a criterion may state, but no source that was read does. It isn't applied.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Unstated {
    /// The criteria.
    pub criteria: &'static [Criterion],
    /// The rule that lacks its number or statement.
    pub id: RuleId,
    /// What isn't stated.
    pub what: &'static str,
    /// The same, for other languages.
    #[serde(skip)]
    pub template: &'static Template,
    /// The key under `[trial]` by which the user can state it; empty: none.
    pub trial: &'static str,
}

const fn unstated(
    criteria: &'static [Criterion],
    id: RuleId,
    template: &'static Template,
    trial: &'static str,
) -> Unstated {
    Unstated { criteria, id, what: template.english, template, trial }
}

/// All that isn't applied because no source that was read states it.
#[rustfmt::skip]
pub static UNSTATED: &[Unstated] = &[
    unstated(&[MR17], Id::MeasurableLongest, say::WHICH_MEASURABLE, "follow_2010 \"measurable\""),
    unstated(&[R10, IR, LGG, MR17], Id::MaxTargets, say::NUMBER_OF_TARGETS, "max_targets"),
    unstated(&[R10, IR, LGG], Id::BaselineAfterRadiotherapy, say::WHICH_BASELINE, say::BASELINE_ITSELF.english),
    unstated(&[MR17, R20], Id::BaselineBeforeTreatment, say::BASELINE_OF_RECURRENT, say::BASELINE_ITSELF.english),
    unstated(&[R20], Id::MinorResponse, say::VOLUME_OF_MINOR, "minor_response_volume_percent"),
    unstated(&[LGG, MR17], Id::NonTarget, say::WORSE_NON_TARGET_MEANS, "follow_2010 \"non-target\""),
    unstated(&[MR17], Id::NewLesion, say::NEW_LESION_MEANS, ""),
    unstated(&[LGG, MR17, R20], Id::SteroidsNotRaised, say::DOSES_ALLOWED, "follow_2010 \"steroids\""),
    unstated(&[LGG, MR17], Id::Clinical, say::WORSE_CLINICAL_MEANS, "follow_2010 \"clinical\""),
    unstated(&[LGG], Id::NewLesion, say::NEW_ENHANCEMENT, ""),
    unstated(&[LGG, MR17, R20, BM], Id::ConfirmResponse, say::RESPONSE_CONFIRMED, "confirm_response_days"),
    unstated(&[MR17, IR], Id::ConfirmProgression, say::PROGRESSION_CONFIRMED, "confirm_progression_days"),
    unstated(&[LGG, MR17, R20, BM], Id::NonMeasurableOnly, say::CALL_WITHOUT_MEASURABLE, ""),
    unstated(&[R10, IR, LGG, R20, MR17], Id::EquivocalNewLesion, say::EQUIVOCAL_MEANS, ""),
    unstated(&[BM], Id::Progression, say::LEAST_RISE, "progression_absolute_mm"),
    unstated(&[MR17, R20], Id::PartialResponseVolume, say::MEASURABLE_BY_VOLUME, ""),
];

/// The row of `criterion` about `id`.
pub fn rule(criterion: Criterion, id: RuleId) -> Option<&'static Rule> {
    RULES.iter().find(|rule| rule.id == id && rule.criteria.contains(&criterion))
}

/// What `criterion` doesn't state about `id`, and how the user can.
pub(super) fn unstated_phrase(criterion: Criterion, id: RuleId) -> Phrase {
    let row = UNSTATED.iter().find(|row| row.id == id && row.criteria.contains(&criterion));
    let what = row.map_or(say::THIS, |row| row.template);
    let way = row.filter(|row| !row.trial.is_empty()).map(|row| {
        let is_baseline = row.trial == say::BASELINE_ITSELF.english;
        let key = if is_baseline { Phrase::from(say::BASELINE_ITSELF).into() } else { row.trial.into() };
        say::WAY.with([("key", key)])
    });
    say::UNSTATED.with([
        ("criteria", criterion.name().into()),
        ("what", Phrase::from(what).into()),
        ("way", Value::after("; ", way)),
    ])
}
