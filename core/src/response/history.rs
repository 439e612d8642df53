//! The history of a patient, as the user states it: a TOML file of facts that images don't show, and, where the program
//! doesn't measure them itself, the measurements.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantArray};
use thiserror::Error;

use super::{
    fact::{Fact, Label, PROGRAM, Radiotherapy, Stated, When, text_of_day},
    rules::Criterion,
    trial::Trial,
};

/// The version read.
pub(super) const VERSION: i64 = 1;
/// Maximum number of scans.
pub(super) const MAX_SCANS: usize = 100;
/// Maximum number of measurements.
pub(super) const MAX_MEASUREMENTS: usize = 20_000;

/// A history that can't be used: one line.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{place}: found {found}, expected {expected}")]
pub struct HistoryError {
    /// Where it was found.
    pub place: String,
    /// What was found.
    pub found: String,
    /// What is accepted.
    pub expected: String,
}

/// What a trial of RANO 2.0 assesses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, VariantArray)]
#[serde(rename_all = "kebab-case")]
#[strum(serialize_all = "kebab-case")]
pub enum Assessment {
    /// Enhancing disease.
    Enhancing,
    /// Non-enhancing disease.
    NonEnhancing,
    /// Both, each on its own, then combined.
    Mixed,
}

/// Whether a lesion takes up contrast.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Compartment {
    /// It does.
    Enhancing,
    /// It doesn't: T2/FLAIR.
    NonEnhancing,
}

/// State of the disease at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Disease {
    /// Newly diagnosed.
    NewlyDiagnosed,
    /// Recurrent.
    Recurrent,
}

/// Kind of a treatment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TreatmentKind {
    /// Any drug that is none of the others.
    Drug,
    /// Immunotherapy.
    Immunotherapy,
    /// An antiangiogenic drug.
    Antiangiogenic,
}

/// A treatment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Treatment {
    /// Its first day.
    pub start: When,
    /// Its kind.
    pub kind: TreatmentKind,
    /// What it is.
    pub name: Option<String>,
    /// Who stated it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub author: Option<String>,
    /// Day on which it was entered.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "text_of_day")]
    pub entered: Option<String>,
}

/// A resection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surgery {
    /// Its day. A scan of this day counts as before it.
    pub date: When,
    /// The baseline after it; else the criterion's, else the first scan after it.
    pub baseline: Option<Label>,
    /// The targets after it; else all measurable lesions of that baseline.
    pub targets: Option<Vec<String>>,
    /// Who stated it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub author: Option<String>,
    /// Day on which it was entered.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "text_of_day")]
    pub entered: Option<String>,
}

/// Why steroids were raised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SteroidReason {
    /// Because of the tumour.
    Tumour,
    /// For another cause.
    Other,
}

/// The patient's clinical state, compared with baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clinical {
    /// The same.
    Stable,
    /// Better.
    Better,
    /// Worse, because of the tumour.
    Worse,
    /// Much worse: of iRANO; elsewhere as worse.
    MuchWorse,
}

/// State of the lesions that aren't targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NonTarget {
    /// There are none.
    None,
    /// All of them are gone.
    Gone,
    /// Present, not worse.
    NotWorse,
    /// Worse, without doubt.
    Worse,
}

/// New lesions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NewLesion {
    /// They were looked for, and there are none.
    None,
    /// There may be one.
    Equivocal,
    /// There is a measurable one.
    Measurable,
    /// There is one, not measurable.
    NonMeasurable,
}

/// T2/FLAIR as an observation beside the targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Flair {
    /// Not significantly more.
    NotWorse,
    /// Significantly more.
    Worse,
}

/// Where the growth lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Field {
    /// Inside the radiation field.
    Inside,
    /// Outside it.
    Outside,
}

/// What tissue showed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Histology {
    /// Nothing was taken.
    NotDone,
    /// Tumour.
    Tumour,
    /// Effects of treatment.
    TreatmentEffect,
}

/// What of the technique changed since the scan before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Technique {
    /// The sequence.
    Sequence,
    /// The contrast agent or its dose.
    Contrast,
    /// The slice thickness.
    SliceThickness,
}

/// Facts of one scan. What isn't stated is unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScanFacts {
    /// The scan: an ISO date, or a label with `days`.
    pub date: Label,
    /// Day of a scan whose label doesn't begin with a date.
    pub days: Option<i32>,
    /// Steroids in mg of dexamethasone per day.
    pub steroids_mg: Option<Fact<f64>>,
    /// Why they were raised above the dose at baseline.
    pub steroids_reason: Option<Fact<SteroidReason>>,
    /// Clinical state.
    pub clinical: Option<Fact<Clinical>>,
    /// Lesions that aren't targets.
    pub non_target: Option<Fact<NonTarget>>,
    /// New lesions.
    pub new_lesion: Option<Fact<NewLesion>>,
    /// Whether new lesions were looked for: if not, `new_lesion = "none"` counts as unknown.
    pub new_lesions_looked_for: Option<Fact<bool>>,
    /// T2/FLAIR beside the targets.
    pub flair: Option<Fact<Flair>>,
    /// What of the technique changed since the scan before; an empty list: nothing.
    pub technique_changed: Option<Fact<Vec<Technique>>>,
    /// Where the growth lies.
    pub field: Option<Fact<Field>>,
    /// Histology.
    pub histology: Option<Fact<Histology>>,
}

/// A lesion at a date. A lesion without a measurement at a date is unknown there; one that is `gone` has size 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// The scan: an ISO date, or a label with `days`.
    pub date: Label,
    /// Day of a scan whose label doesn't begin with a date.
    pub days: Option<i32>,
    /// Name of the lesion, the same at all dates.
    pub lesion: String,
    /// Its compartment.
    pub compartment: Compartment,
    /// It was looked for and is no longer there.
    #[serde(default)]
    pub gone: bool,
    /// Longest diameter in mm.
    pub longest_mm: Option<f64>,
    /// Widest perpendicular diameter in mm.
    pub perpendicular_mm: Option<f64>,
    /// Their product in mm²; else that of the diameters.
    pub product_mm2: Option<f64>,
    /// Number of slices on which it is seen.
    pub slices: Option<u32>,
    /// Thickness of a slice in mm.
    pub slice_thickness_mm: Option<f64>,
    /// Volume in ml.
    pub volume_ml: Option<f64>,
}

impl Measurement {
    /// The product of its diameters, mm²: as stated, else of the two; `None` where it isn't known.
    pub fn product(&self) -> Option<f64> {
        self.product_mm2.or_else(|| Some(self.longest_mm? * self.perpendicular_mm?))
    }
}

/// How far repeated measurements of an unchanged sum differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeatability {
    /// Relative standard deviation of one measurement of the sum: 0.1 for 10 %.
    pub relative_sd: f64,
    /// Where it is from.
    pub source: String,
}

/// Stated repeatability; what is absent is unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeatabilities {
    /// Of sums of products of diameters.
    pub product: Option<Repeatability>,
    /// Of sums of longest diameters.
    pub longest: Option<Repeatability>,
    /// Of volumes.
    pub volume: Option<Repeatability>,
}

/// What the user states about a patient.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct History {
    /// Version of the format.
    pub response: i64,
    /// The criteria.
    pub criterion: Criterion,
    /// What is assessed: RANO 2.0 needs it, the others have no choice.
    pub assessment: Option<Assessment>,
    /// State of the disease at the start.
    pub disease: Option<Fact<Disease>>,
    /// End of radiotherapy.
    pub radiotherapy_end: Option<Fact<Radiotherapy>>,
    /// The baseline; else the criterion's, if a source that was read states it.
    pub baseline: Option<Fact<Label>>,
    /// Names of the targets; else all measurable lesions of the baseline.
    pub targets: Option<Fact<Vec<String>>>,
    /// Names of lesions that are followed but aren't targets.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub non_targets: Option<Fact<Vec<String>>>,
    /// All treatments; absent: unknown, an empty list: none.
    pub treatment: Option<Vec<Treatment>>,
    /// Who stated that there was no treatment, where that is stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_treatment_by: Option<Stated>,
    /// All resections.
    #[serde(default)]
    pub surgery: Vec<Surgery>,
    /// Repeatability.
    #[serde(default)]
    pub repeatability: Repeatabilities,
    /// The trial's own values.
    #[serde(default)]
    pub trial: Trial,
    /// Facts of scans.
    #[serde(default)]
    pub date: Vec<ScanFacts>,
    /// Measurements.
    #[serde(default)]
    pub measurement: Vec<Measurement>,
}

impl History {
    /// Without who stated its facts, and when. What the program proposed stays told from what somebody stated.
    #[must_use]
    pub fn without_authors(mut self) -> Self {
        self.each_statement(&mut |author, entered| {
            author.take_if(|author| author != PROGRAM);
            *entered = None;
        });
        self
    }

    /// What was stated on `day` without a name gets `author`'s.
    pub fn sign(&mut self, author: &str, day: &str) {
        self.each_statement(&mut |own, entered| {
            if own.is_none() && entered.as_deref() == Some(day) {
                *own = Some(author.to_owned());
            }
        });
    }

    /// Calls `change` with author and day of each fact that has them.
    pub(super) fn each_statement(
        &mut self,
        change: &mut dyn FnMut(&mut Option<String>, &mut Option<String>),
    ) {
        fn on<T>(
            fact: &mut Option<Fact<T>>,
            change: &mut dyn FnMut(&mut Option<String>, &mut Option<String>),
        ) {
            if let Some(fact) = fact {
                change(&mut fact.author, &mut fact.entered);
            }
        }
        on(&mut self.disease, change);
        on(&mut self.radiotherapy_end, change);
        on(&mut self.baseline, change);
        on(&mut self.targets, change);
        on(&mut self.non_targets, change);
        if let Some(by) = &mut self.no_treatment_by {
            change(&mut by.author, &mut by.entered);
        }
        for surgery in &mut self.surgery {
            change(&mut surgery.author, &mut surgery.entered);
        }
        for treatment in self.treatment.iter_mut().flatten() {
            change(&mut treatment.author, &mut treatment.entered);
        }
        for facts in &mut self.date {
            on(&mut facts.steroids_mg, change);
            on(&mut facts.steroids_reason, change);
            on(&mut facts.clinical, change);
            on(&mut facts.non_target, change);
            on(&mut facts.new_lesion, change);
            on(&mut facts.new_lesions_looked_for, change);
            on(&mut facts.flair, change);
            on(&mut facts.technique_changed, change);
            on(&mut facts.field, change);
            on(&mut facts.histology, change);
        }
    }

    /// Names of the targets, where they are stated.
    pub fn target_names(&self) -> Option<&[String]> {
        self.targets.as_ref().map(|fact| fact.value.as_slice())
    }

    /// Names of lesions that are followed but aren't targets.
    pub fn non_target_names(&self) -> &[String] {
        self.non_targets.as_ref().map_or(&[], |fact| fact.value.as_slice())
    }

    /// A history of which nothing but the criteria is known.
    pub fn new(criterion: Criterion, assessment: Option<Assessment>) -> Self {
        Self {
            response: VERSION,
            criterion,
            assessment,
            disease: None,
            radiotherapy_end: None,
            baseline: None,
            targets: None,
            non_targets: None,
            treatment: None,
            no_treatment_by: None,
            surgery: Vec::new(),
            repeatability: Repeatabilities::default(),
            trial: Trial::default(),
            date: Vec::new(),
            measurement: Vec::new(),
        }
    }
}
