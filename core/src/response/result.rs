//! What an evaluation gives. All of it can be serialised; field names are in `snake_case`.

use serde::Serialize;

use super::{
    history::{Assessment, Compartment},
    margin::Margin,
    missing::Input,
    phrases as say,
    rules::{Criterion, RuleId},
};
use crate::phrase::{Phrase, Template};

/// The call at a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Call {
    /// The scan is the baseline.
    Baseline,
    /// The scan is before the baseline.
    BeforeBaseline,
    /// CR, confirmed or where no confirmation is stated.
    CompleteResponse,
    /// CR without a confirming scan.
    UnconfirmedCompleteResponse,
    /// PR, confirmed or where no confirmation is stated.
    PartialResponse,
    /// PR without a confirming scan.
    UnconfirmedPartialResponse,
    /// MR, confirmed or where no confirmation is stated.
    MinorResponse,
    /// MR without a confirming scan.
    UnconfirmedMinorResponse,
    /// SD.
    StableDisease,
    /// PD.
    Progression,
    /// PD that the criterion doesn't take before it is confirmed.
    PreliminaryProgression,
    /// Neither SD nor PD: observe (RANO 2.0, steroids raised for other causes).
    Observe,
    /// The source or the inputs don't allow a call; the reasons and missing inputs say why.
    CannotSay,
}

impl Call {
    /// Its short name, in text.
    pub fn short(self) -> &'static str {
        self.template().english
    }

    /// Its short name, as a template.
    pub fn template(self) -> &'static Template {
        match self {
            Self::Baseline => say::CALL_BASELINE,
            Self::BeforeBaseline => say::CALL_BEFORE_BASELINE,
            Self::CompleteResponse => say::CALL_CR,
            Self::UnconfirmedCompleteResponse => say::CALL_CR_UNCONFIRMED,
            Self::PartialResponse => say::CALL_PR,
            Self::UnconfirmedPartialResponse => say::CALL_PR_UNCONFIRMED,
            Self::MinorResponse => say::CALL_MR,
            Self::UnconfirmedMinorResponse => say::CALL_MR_UNCONFIRMED,
            Self::StableDisease => say::CALL_SD,
            Self::Progression => say::CALL_PD,
            Self::PreliminaryProgression => say::CALL_PD_PRELIMINARY,
            Self::Observe => say::CALL_OBSERVE,
            Self::CannotSay => say::CALL_CANNOT_SAY,
        }
    }
}

impl Response {
    /// How many answers the calls of the last scan lack.
    pub fn missing_answers(&self) -> usize {
        let Some(last) = self.dates.last() else { return 0 };
        let mut distinct: Vec<&Missing> = Vec::new();
        for one in [&last.by_diameters, &last.by_volume].into_iter().flat_map(Judgement::to_state) {
            if !distinct.contains(&one) {
                distinct.push(one);
            }
        }
        distinct.len()
    }
}

/// Calls at all scans, in the order of days.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Response {
    /// The criteria.
    pub criterion: Criterion,
    /// What is assessed; `None` except for RANO 2.0.
    pub assessment: Option<Assessment>,
    /// One entry for each scan.
    pub dates: Vec<DateResponse>,
}

/// Calls at a scan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DateResponse {
    /// Label of the scan.
    pub date: String,
    /// Days since the baseline that it is compared with; `None` before it, or without one.
    pub days_from_baseline: Option<i32>,
    /// The call by diameters: products, or longest diameters for RANO-BM.
    pub by_diameters: Judgement,
    /// The call by volume.
    pub by_volume: Judgement,
}

/// One call, and what it rests on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judgement {
    /// The call.
    pub call: Call,
    /// The calls that the unknown inputs leave, where they leave several; else empty.
    pub possible: Vec<Call>,
    /// The scan from which progression is dated, if it is an earlier one.
    pub dated: Option<String>,
    /// Whether the call is confirmed; `None` for calls that nothing confirms.
    pub confirmation: Option<Confirmation>,
    /// Why.
    pub reasons: Vec<Reason>,
    /// The unknown inputs that can change the call.
    pub missing: Vec<Missing>,
    /// Dose of steroids or clinical state is unknown, and could change the call, which is by images alone.
    pub imaging_only: bool,
    /// Sums of the targets: one entry, or one for each compartment of mixed disease; none without targets.
    pub sums: Vec<SumReport>,
}

impl Judgement {
    /// The missing inputs that can be stated now: why steroids were raised is no question before a dose is known.
    pub fn to_state(&self) -> impl Iterator<Item = &Missing> {
        let lacks_dose = |of: &Missing| {
            self.missing.iter().any(|other| other.input == Input::Steroids && other.date == of.date)
        };
        self.missing.iter().filter(move |one| one.input != Input::SteroidsReason || !lacks_dose(one))
    }
}

/// State of a confirmation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Confirmed {
    /// Another scan confirms the call.
    Yes,
    /// No scan confirms the call.
    No,
    /// No source that was read states when the call is confirmed.
    NotStated,
}

/// Whether another scan confirms a call.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Confirmation {
    /// Whether it does.
    pub state: Confirmed,
    /// The scan that does.
    pub by: Option<String>,
    /// In words.
    pub words: String,
    /// The same, for other languages.
    #[serde(skip)]
    pub phrase: Phrase,
}

impl Confirmation {
    pub(super) fn of(state: Confirmed, by: Option<&str>, phrase: Phrase) -> Self {
        Self { state, by: by.map(str::to_owned), words: phrase.to_string(), phrase }
    }
}

/// A reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Reason {
    /// The rule; `None` for what no rule is about.
    pub rule: Option<RuleId>,
    /// The rule with the numbers of this scan, in words.
    pub words: String,
    /// The same, for other languages.
    #[serde(skip)]
    pub phrase: Phrase,
}

impl Reason {
    pub(super) fn of(rule: RuleId, phrase: impl Into<Phrase>) -> Self {
        Self { rule: Some(rule), ..Self::plain(phrase) }
    }

    pub(super) fn plain(phrase: impl Into<Phrase>) -> Self {
        let phrase = phrase.into();
        Self { rule: None, words: phrase.to_string(), phrase }
    }
}

/// An unknown input that can change the call.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Missing {
    /// The input.
    pub input: Input,
    /// Its scan; `None`: of the patient.
    pub date: Option<String>,
    /// In words, with the lesions that lack a measurement.
    pub words: String,
    /// What the call assumes of it; `None`: nothing, so that the call can't be made if it depends on it.
    pub assumed: Option<String>,
    /// `words`, for other languages.
    #[serde(skip)]
    pub phrase: Phrase,
    /// `assumed`, for other languages.
    #[serde(skip)]
    pub assumption: Option<Phrase>,
}

impl Missing {
    pub(super) fn of(input: Input, date: Option<&str>, phrase: Phrase, assumption: Option<Phrase>) -> Self {
        Self {
            input,
            date: date.map(str::to_owned),
            words: phrase.to_string(),
            assumed: assumption.as_ref().map(Phrase::to_string),
            phrase,
            assumption,
        }
    }
}

/// What is summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Products of the longest and the widest perpendicular diameter, mm².
    ProductMm2,
    /// Longest diameters, mm.
    LongestMm,
    /// Volumes, ml.
    VolumeMl,
}

/// What a sum is compared with.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reference {
    /// Label of the scan.
    pub date: String,
    /// Its sum.
    pub sum: f64,
    /// Number of scans of which it is the lowest; 1 for the baseline.
    pub scans: usize,
}

/// A target or another lesion of the compartment at the baseline.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TargetReport {
    /// Name of the lesion.
    pub lesion: String,
    /// Whether it is a target.
    pub target: bool,
    /// Whether it is measurable at the baseline; `None`: unknown, or no source that was read states the rule.
    pub measurable: Option<bool>,
    /// What decides it, in words.
    pub words: String,
}

/// A sum of targets and its changes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SumReport {
    /// The compartment.
    pub compartment: Compartment,
    /// What is summed.
    pub quantity: Quantity,
    /// The sum; `None` if a target isn't measured.
    pub sum: Option<f64>,
    /// The baseline.
    pub baseline: Option<Reference>,
    /// The lowest measured sum from the baseline to the scan before.
    pub nadir: Option<Reference>,
    /// Change from the baseline in %; `None` where a sum is unknown or the baseline is 0.
    pub change_from_baseline_percent: Option<f64>,
    /// Change from the lowest sum in %; `None` where a sum is unknown or the lowest is 0.
    pub change_from_nadir_percent: Option<f64>,
    /// What the sum alone says, whatever else is known.
    pub by_sum: Option<Category>,
    /// Margin of the change from the baseline.
    pub margin_from_baseline: Option<Margin>,
    /// Margin of the change from the lowest sum.
    pub margin_from_nadir: Option<Margin>,
    /// Probability that noise alone makes `by_sum` of an unchanged tumour; `None` for other than progression and partial
    /// or minor response, and without a stated repeatability.
    pub noise_alone: Option<f64>,
    /// The lesions of the compartment at the baseline.
    pub lesions: Vec<TargetReport>,
}

/// What sums alone say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Category {
    /// All targets are gone.
    Complete,
    /// As much lower than the baseline as a partial response.
    Partial,
    /// As much lower than the baseline as a minor response.
    Minor,
    /// Lower than the baseline by less than a partial response; how much a minor one needs isn't stated.
    MinorOrStable,
    /// Neither.
    Stable,
    /// As much higher than the lowest sum as progression.
    Progression,
    /// Targets reappeared after a lowest sum of 0.
    Reappeared,
}
