//! `glioscope response`: response by criteria of brain tumours, at every date, by diameters and by volume.

use std::{path::PathBuf, sync::Arc};

use clap::Args;
use glioscope_core::{
    case::Case,
    files::read_small_text,
    lesions::LesionsReport,
    response::{
        Assessment, Compartment, Criterion, DateResponse, Evaluated, History, HistoryError, Judgement,
        Response, evaluate_lesions, measured_compartments,
    },
};
use serde::Serialize;

use super::{
    case::CaseArguments,
    lesions::{LesionOptions, found},
    parse::keyword,
    terminal,
};
use crate::{
    error::AppError,
    model::{LesionSetting, ResponseSetting, session},
    world::{load::ReadCase, response::Answered},
};

/// Maximum size of a history file.
const MAX_BYTES: u64 = 1 << 20;

/// Which criteria are evaluated, on what.
#[derive(Clone, Debug, Args)]
pub struct ResponseOptions {
    /// The criteria; default: those of the history.
    #[arg(long, value_name = "CRITERIA", value_parser = keyword::<Criterion>())]
    pub criteria: Option<Criterion>,
    /// RANO 2.0: what the trial assesses; default: that of the history, else enhancing.
    #[arg(long, value_name = "WHAT", value_parser = keyword::<Assessment>())]
    pub assessment: Option<Assessment>,
    /// What images don't show, as a TOML file: treatment, steroids, clinical state, baseline, targets. See docs/response.md.
    #[arg(long, value_name = "FILE")]
    pub history: Option<PathBuf>,
    /// The mask of non-enhancing disease, where that is assessed, too.
    #[arg(long, value_name = "ID,...", value_delimiter = ',')]
    pub non_enhancing: Vec<String>,
    /// Which components are lesions, and how they are measured.
    #[command(flatten)]
    pub lesions: LesionOptions,
}

impl ResponseOptions {
    /// Whether a response is asked for.
    pub(super) fn is_asked(&self) -> bool {
        self.criteria.is_some() || self.history.is_some()
    }

    /// The text of the history.
    pub(super) fn history_text(&self) -> Result<Option<String>, AppError> {
        let read = |path: &PathBuf| read_small_text(path, MAX_BYTES, "a history");
        Ok(self.history.as_ref().map(read).transpose()?)
    }
}

/// Arguments of `response`.
#[derive(Debug, Args)]
pub struct ResponseArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// Which criteria are evaluated, on what.
    #[command(flatten)]
    pub options: ResponseOptions,
    /// As JSON: see docs/response.md.
    #[arg(long)]
    pub json: bool,
}

/// What `response --json` writes.
#[derive(Serialize)]
struct Answer<'a> {
    case: &'a str,
    #[serde(flatten)]
    evaluated: &'a Evaluated,
}

pub(super) fn run(arguments: &ResponseArguments) -> Result<(), AppError> {
    let text = arguments.options.history_text()?;
    let is_asked = arguments.options.is_asked();
    let may_state = arguments.case.path.as_ref().is_some_and(|path| session::is_session(path));
    if is_asked || !may_state {
        // Before seconds of reading.
        history(&arguments.options, text.as_deref(), None)?;
    }
    let ReadCase { case, document, .. } = arguments.case.read(false)?;
    let (lesions, response) =
        document.map(|document| (document.edit.lesions, document.edit.response)).unwrap_or_default();
    if !is_asked && response.history.is_none() {
        return Err(AppError::arguments(
            "a session without criteria",
            "--criteria, or --history with a criterion",
        ));
    }
    let Answered { evaluated, .. } =
        evaluated(&case, (&lesions, &response), &arguments.options, text.as_deref(), false)?;
    if arguments.json {
        return terminal::print_json(&Answer { case: &case.name, evaluated: &evaluated });
    }
    terminal::print(&table(&case, &evaluated.response))
}

/// The response of a case, with the lesions and statements of its session; `text`: a history in their place, whose authors aren't
/// named where `hides_authors`.
pub(super) fn evaluated(
    case: &Case,
    (setting, own): (&LesionSetting, &ResponseSetting),
    options: &ResponseOptions,
    text: Option<&str>,
    hides_authors: bool,
) -> Result<Answered, AppError> {
    let mut history = history(options, text, own.history.as_ref())?;
    if hides_authors {
        history = history.without_authors();
    }
    let mut other = options.non_enhancing.clone();
    if other.is_empty() {
        other.extend(own.other_mask(case).filter(|_| text.is_none()).cloned());
    }
    let masks = [options.lesions.of.as_slice(), other.as_slice()];
    let mut reports = Vec::new();
    for compartment in measured_compartments(&history, !masks[1].is_empty()) {
        let is_other = *compartment == Compartment::NonEnhancing && !masks[1].is_empty();
        reports.push((
            *compartment,
            Arc::new(found(case, (&options.lesions, (None, false)), masks[usize::from(is_other)], setting)?),
        ));
    }
    if let Some((_, main)) = reports.first().filter(|_| text.is_none()) {
        own.follow_targets(&mut history, main)?;
    }
    let of_compartments: Vec<(Compartment, &LesionsReport)> =
        reports.iter().map(|(c, report)| (*c, report.as_ref())).collect();
    let evaluated = evaluate_lesions(history, &of_compartments).map_err(|e| wrong(options, e))?;
    warn_of(&evaluated);
    Ok(Answered { evaluated, lesions: reports })
}

/// Says what a response rests on.
fn warn_of(Evaluated { proposed_links, warnings, .. }: &Evaluated) {
    if *proposed_links > 0 {
        let text = format!(
            "calls rest on links between lesions of several dates that the program proposes, and no reader has verified: {proposed_links}"
        );
        terminal::warning("lesions-proposed", &text);
    }
    warnings.iter().for_each(|text| terminal::warning("history-contradicts-masks", text));
}

fn wrong(options: &ResponseOptions, error: HistoryError) -> AppError {
    let HistoryError { place, found, expected } = error;
    let file = options.history.as_ref().map(|file| format!("{}, {place}", file.display()));
    AppError::wrong(file.unwrap_or(place), found, expected)
}

/// The history with the criteria that are asked for.
fn history(
    options: &ResponseOptions,
    text: Option<&str>,
    own: Option<&History>,
) -> Result<History, AppError> {
    let ResponseOptions { criteria, assessment, .. } = options;
    if let (None, Some(own)) = (text, own) {
        let mut history = own.clone();
        history.criterion = criteria.unwrap_or(history.criterion);
        let is_rano_20 = history.criterion == Criterion::Rano20;
        let stated = assessment.or(history.assessment);
        history.assessment = match criteria {
            Some(_) if is_rano_20 => Some(stated.unwrap_or(Assessment::Enhancing)),
            Some(_) => *assessment,
            None => stated,
        };
        return Ok(history);
    }
    let Some(text) = text else {
        let criteria = criteria
            .ok_or_else(|| AppError::arguments("no criteria", "--criteria, or --history with a criterion"))?;
        let assessment = assessment.or((criteria == Criterion::Rano20).then_some(Assessment::Enhancing));
        return Ok(History::new(criteria, assessment));
    };
    History::parse_for(text, *criteria, *assessment).map_err(|e| wrong(options, e))
}

/// The calls as text.
fn table(case: &Case, response: &Response) -> String {
    let mut lines = vec![format!("{}: {}", case.name, response.criterion.name())];
    lines.push("imaging criteria from public descriptions, not for clinical use: docs/response.md".into());
    for date in &response.dates {
        lines.push(format!("\n{}{}", date.date, since(date)));
        lines.extend(judgement("by diameters", &date.by_diameters));
        lines.extend(judgement("by volume", &date.by_volume));
    }
    lines.join("\n")
}

fn since(date: &DateResponse) -> String {
    date.days_from_baseline
        .filter(|days| *days > 0)
        .map(|days| format!(", {days} days after the baseline"))
        .unwrap_or_default()
}

fn judgement(by: &str, judgement: &Judgement) -> Vec<String> {
    let imaging = if judgement.imaging_only { " (imaging only)" } else { "" };
    let possible: Vec<&str> = judgement.possible.iter().map(|call| call.short()).collect();
    let possible =
        if possible.is_empty() { String::new() } else { format!("; possible: {}", possible.join(", ")) };
    let mut lines = vec![format!("  {by:13} {}{imaging}{possible}", judgement.call.short())];
    lines.extend(judgement.reasons.iter().map(|reason| format!("    {}", reason.words)));
    lines.extend(judgement.confirmation.iter().map(|confirmation| format!("    {}", confirmation.words)));
    for sum in &judgement.sums {
        let margins = [&sum.margin_from_baseline, &sum.margin_from_nadir];
        let straddled = margins.into_iter().flatten().filter(|margin| !margin.straddles_percent.is_empty());
        lines.extend(straddled.map(|margin| {
            format!(
                "    within the margin of measurement: {:+.0} to {:+.0} % (relative SD {}, {})",
                margin.low_percent, margin.high_percent, margin.relative_sd, margin.source
            )
        }));
        if let Some(noise) = sum.noise_alone {
            lines.push(format!(
                "    noise alone makes this call in {:.1} % of unchanged tumours",
                noise * 100.0
            ));
        }
    }
    for missing in &judgement.missing {
        let assumed = missing.assumed.as_ref().map(|assumed| format!(" (assumed: {assumed})"));
        lines.push(format!("    missing: {}{}", missing.words, assumed.unwrap_or_default()));
    }
    lines
}
