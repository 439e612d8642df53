//! The calls at all dates, and why.

use egui::{CollapsingHeader, Color32, RichText, Ui};
use egui_extras::{Column, TableBuilder};
use glioscope_core::response::{
    Call, Criterion, DateResponse, Evaluated, Judgement, Mark, RULES, Rule, RuleId, SumReport,
};

use super::Status;
use crate::theme::Tokens;

/// Least width for columns with all they say, points.
const WIDE: f32 = 660.0;
/// Height of a row, points.
const ROW: f32 = 22.0;

/// How it stands with the calls, on a line that is always there while answers are given.
pub(super) fn head(ui: &mut Ui, evaluated: Option<&Evaluated>, status: &Status) {
    let warn = ui.visuals().warn_fg_color;
    let warnings = evaluated.map_or(0, |evaluated| evaluated.warnings.len());
    let open = evaluated.map_or(0, |evaluated| evaluated.response.missing_answers());
    let (text, color) = match (status, warnings) {
        (Status::Error(text), _) => (text.clone(), ui.visuals().error_fg_color),
        (Status::Warning(text), _) => (text.clone(), warn),
        // Why it can't be said.
        (Status::Nothing, _) if open == 1 => ("1 answer is missing, below".to_owned(), warn),
        (Status::Nothing, _) if open > 1 => (format!("{open} answers are missing, below"), warn),
        (_, 1) => ("1 warning, below the questions".to_owned(), warn),
        (_, n @ 2..) => (format!("{n} warnings, below the questions"), warn),
        (Status::Working(text), _) => (text.clone(), ui.visuals().weak_text_color()),
        (Status::Nothing, _) => (" ".to_owned(), warn),
    };
    ui.colored_label(color, text);
}

/// Why a call is what it is, in a tip.
fn reasons_of(judgement: &Judgement) -> String {
    let reasons = judgement.reasons.iter().map(|reason| reason.words.clone());
    let missing = judgement.to_state().map(|missing| format!("missing: {}", missing.words));
    reasons.chain(missing).collect::<Vec<_>>().join("\n")
}

/// The calls of the last date in one line, each with the change that it rests on and that change's margin.
pub(super) fn overall(ui: &mut Ui, dates: &[DateResponse]) {
    let Some(last) = dates.last() else { return };
    let tokens = *Tokens::in_ui(ui);
    ui.horizontal_wrapped(|ui| {
        ui.strong(&last.date);
        for (judgement, by) in [(&last.by_diameters, "by diameters"), (&last.by_volume, "by volume")] {
            // That a call is by images alone stands in the table below.
            let call = RichText::new(judgement.call.short()).color(color(judgement.call, &tokens)).heading();
            ui.label(call).on_hover_text(reasons_of(judgement));
            ui.label(by);
            if let Some(sum) = judgement.sums.first()
                && let Some((text, tip)) = change_with_margin(judgement.call, sum)
            {
                ui.label(text).on_hover_text(tip);
            }
        }
    });
}

/// The change that a call is about, with its margin, and what both are: from the baseline for a response, else from the lowest sum.
/// `None` where a sum is unknown, and at the baseline.
fn change_with_margin(call: Call, sum: &SumReport) -> Option<(String, String)> {
    let (change, margin, from) = if is_response(call) {
        (sum.change_from_baseline_percent, &sum.margin_from_baseline, "from the baseline")
    } else {
        (sum.change_from_nadir_percent, &sum.margin_from_nadir, "from the lowest sum")
    };
    let change = change?;
    Some(match margin {
        Some(margin) => (
            format!("{change:+.1} % ({:+.0} to {:+.0} %)", margin.low_percent, margin.high_percent),
            format!("Change {from}; 95 % of repeated measurements lie between"),
        ),
        None => (
            format!("{change:+.1} % (margin unknown)"),
            format!("Change {from}. State below how well measurements repeat"),
        ),
    })
}

fn is_response(call: Call) -> bool {
    matches!(
        call,
        Call::CompleteResponse
            | Call::UnconfirmedCompleteResponse
            | Call::PartialResponse
            | Call::UnconfirmedPartialResponse
            | Call::MinorResponse
            | Call::UnconfirmedMinorResponse
    )
}

/// Warnings, and the reasons of the date `shown`, or of the last.
pub(super) fn reasons(ui: &mut Ui, evaluated: &Evaluated, shown: Option<&str>) {
    ui.add_space(4.0);
    for warning in &evaluated.warnings {
        ui.colored_label(ui.visuals().warn_fg_color, warning);
    }
    let dates = &evaluated.response.dates;
    let chosen = shown.and_then(|label| dates.iter().find(|date| date.date == label)).or(dates.last());
    if let Some(date) = chosen {
        let criterion = evaluated.response.criterion;
        let (diameters, volume) = (&date.by_diameters, &date.by_volume);
        why(ui, criterion, &format!("{}, by diameters", date.date), diameters, None);
        why(ui, criterion, &format!("{}, by volume", date.date), volume, Some(diameters));
    }
}

/// The table of calls; a click on a date shows its reasons.
pub(super) fn table(ui: &mut Ui, dates: &[DateResponse], shown: &mut Option<String>) {
    let known = shown.as_ref().is_some_and(|label| dates.iter().any(|date| date.date == *label));
    if !known {
        *shown = None;
    }
    ui.scope(|ui| rows(ui, dates, shown));
}

fn rows(ui: &mut Ui, dates: &[DateResponse], shown: &mut Option<String>) {
    ui.spacing_mut().item_spacing.x = 4.0;
    let is_wide = ui.available_width() >= WIDE;
    let (call, percent) = if is_wide { (150.0, 100.0) } else { (116.0, 62.0) };
    let tokens = *Tokens::in_ui(ui);
    let current = shown.clone().or_else(|| dates.last().map(|date| date.date.clone()));
    let columns = [if is_wide { 110.0 } else { 84.0 }, call, call, percent];
    let mut table = TableBuilder::new(ui).id_salt("calls").vscroll(false).striped(true);
    for width in columns {
        table = table.column(Column::exact(width).clip(true));
    }
    table
        .column(Column::remainder().at_least(percent).clip(true))
        .header(ROW, |mut row| {
            for (text, narrow, tip) in [
                ("Scan", "Scan", "Click: why"),
                ("By diameters", "By diameters", ""),
                ("By volume", "By volume", ""),
                ("From baseline", "Baseline", "Change of the sum by diameters from the baseline"),
                (
                    "From the lowest",
                    "Lowest",
                    "Change of the sum by diameters from the lowest, and of how many scans that is the lowest",
                ),
            ] {
                row.col(|ui| {
                    let response = ui.strong(if is_wide { text } else { narrow });
                    if !tip.is_empty() {
                        response.on_hover_text(tip);
                    }
                });
            }
        })
        .body(|mut body| {
            for date in dates {
                body.row(ROW, |mut row| {
                    row.col(|ui| {
                        let is_shown = current.as_ref() == Some(&date.date);
                        let response = ui.selectable_label(is_shown, &date.date);
                        if response.clicked() {
                            *shown = Some(date.date.clone());
                        }
                        if let Some(days) = date.days_from_baseline {
                            response.on_hover_text(format!("{days} days after the baseline"));
                        }
                    });
                    for judgement in [&date.by_diameters, &date.by_volume] {
                        row.col(|ui| {
                            let text =
                                RichText::new(call_text(judgement)).color(color(judgement.call, &tokens));
                            ui.label(text.strong()).on_hover_text(reasons_of(judgement));
                        });
                    }
                    let sum = date.by_diameters.sums.first();
                    let percent = |of: &dyn Fn(&SumReport) -> Option<f64>| {
                        sum.and_then(of).map(|p| format!("{p:+.1} %")).unwrap_or_default()
                    };
                    row.col(|ui| {
                        ui.label(percent(&|sum| sum.change_from_baseline_percent));
                    });
                    row.col(|ui| {
                        let scans = sum.and_then(|sum| sum.nadir.as_ref()).map(|nadir| nadir.scans);
                        let of = scans.map(|scans| format!("lowest of {scans}"));
                        let text = percent(&|sum| sum.change_from_nadir_percent);
                        match of {
                            _ if text.is_empty() => {}
                            Some(of) if is_wide => {
                                ui.label(format!("{text}  ({of})"));
                            }
                            Some(of) => {
                                ui.label(text).on_hover_text(of);
                            }
                            None => {
                                ui.label(text);
                            }
                        }
                    });
                });
            }
        });
}

fn call_text(judgement: &Judgement) -> String {
    let imaging = if judgement.imaging_only { " (imaging only)" } else { "" };
    format!("{}{imaging}", judgement.call.short())
}

fn color(call: Call, tokens: &Tokens) -> Color32 {
    match call {
        Call::Progression | Call::PreliminaryProgression => tokens.growth,
        call if is_response(call) => tokens.shrinkage,
        Call::CannotSay => tokens.warning,
        _ => tokens.text,
    }
}

/// The reasons of a call, each with its rule's source; its margin; and what is missing; without what stands in `above` already.
fn why(ui: &mut Ui, criterion: Criterion, title: &str, judgement: &Judgement, above: Option<&Judgement>) {
    let warn = ui.visuals().warn_fg_color;
    ui.strong(format!("{title}: {}", call_text(judgement)));
    ui.indent(title, |ui| {
        if !judgement.possible.is_empty() {
            let all: Vec<&str> = judgement.possible.iter().map(|call| call.short()).collect();
            ui.colored_label(warn, format!("without assumptions it may be: {}", all.join("; ")));
        }
        if let Some(dated) = &judgement.dated {
            ui.label(format!("dated at {dated}"));
        }
        let mut same = false;
        let mut is_new = |is_above: bool| {
            same |= is_above;
            !is_above
        };
        for reason in &judgement.reasons {
            if !is_new(above.is_some_and(|above| above.reasons.contains(reason))) {
                continue;
            }
            let response = ui.label(&reason.words);
            // *Rules* below has them all.
            if let Some(source) = reason.rule.and_then(|id| source(criterion, id)) {
                response.on_hover_text(source);
            }
        }
        let confirmed = above.and_then(|above| above.confirmation.as_ref());
        let confirmation = judgement.confirmation.as_ref();
        if let Some(confirmation) = confirmation.filter(|of| is_new(confirmed == Some(of))) {
            ui.label(&confirmation.words);
        }
        for sum in &judgement.sums {
            sum_text(ui, sum);
        }
        let missing = judgement.to_state();
        let missing: Vec<_> =
            missing.filter(|one| is_new(above.is_some_and(|above| above.missing.contains(one)))).collect();
        // They are the questions above: what is assumed of them is a click away.
        if !missing.is_empty() {
            let count = match missing.len() {
                1 => "1 answer is missing".to_owned(),
                several => format!("{several} answers are missing"),
            };
            CollapsingHeader::new(RichText::new(count).color(warn)).id_salt((title, "missing")).show(
                ui,
                |ui| {
                    for missing in missing {
                        let date = missing.date.as_ref().map(|date| format!(", {date}")).unwrap_or_default();
                        let assumed =
                            missing.assumed.as_ref().map(|assumed| format!(" (assumed: {assumed})"));
                        ui.label(format!("{}{date}{}", missing.words, assumed.unwrap_or_default()));
                    }
                },
            );
        }
        if same {
            ui.weak("Else as by diameters");
        }
    });
}

fn sum_text(ui: &mut Ui, sum: &SumReport) {
    let warn = ui.visuals().warn_fg_color;
    for (from, margin) in [("baseline", &sum.margin_from_baseline), ("the lowest", &sum.margin_from_nadir)] {
        let Some(margin) = margin else { continue };
        let text = format!(
            "change from {from} between {:+.0} and {:+.0} % (95 %, relative SD {}, {})",
            margin.low_percent, margin.high_percent, margin.relative_sd, margin.source
        );
        if margin.straddles_percent.is_empty() {
            ui.label(text);
        } else {
            let thresholds: Vec<String> =
                margin.straddles_percent.iter().map(|percent| format!("{percent:+.0} %")).collect();
            ui.colored_label(warn, format!("{text}: on both sides of {}", thresholds.join(" and ")));
        }
    }
    if let Some(noise) = sum.noise_alone {
        ui.label(format!("noise alone makes this call in {:.1} % of unchanged tumours", 100.0 * noise));
    }
}

/// What a rule rests on.
fn source(criterion: Criterion, id: RuleId) -> Option<String> {
    let rule = RULES.iter().find(|rule| rule.id == id && rule.criteria.contains(&criterion))?;
    Some(known_by(rule))
}

/// What a rule rests on, in words.
pub(super) fn known_by(rule: &Rule) -> String {
    format!("{}: {}", mark(rule.mark), rule.source)
}

/// How a rule is known, in a word.
pub(super) fn mark(mark: Mark) -> &'static str {
    match mark {
        Mark::Read => "read",
        Mark::Secondary => "secondary",
    }
}
