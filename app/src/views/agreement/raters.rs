//! All masks of a date as raters of one tumour, and lesions matched between two masks.

use egui::{Grid, Ui};
use glioscope_core::measure::{DateComparison, conventions::LesionReport};

use crate::{format, views::pane::Input};

/// A row of numbers of matched lesions: title, tip, value of each pair.
pub(super) type LesionRow = (&'static str, &'static str, Vec<String>);

/// Rows about lesions; none where no pair has them.
pub(super) fn lesion_rows<'a>(pairs: impl Iterator<Item = Option<&'a LesionReport>>) -> Vec<LesionRow> {
    let pairs: Vec<Option<&LesionReport>> = pairs.collect();
    if pairs.iter().all(Option::is_none) {
        return Vec::new();
    }
    type Value = fn(&LesionReport) -> String;
    let rows: [(&str, &str, Value); 7] = [
        ("Lesions found", "Of the reference", |l| l.found.to_string()),
        ("Lesions missed", "Of the reference", |l| l.missed.to_string()),
        ("False lesions", "Of the compared mask, none of the reference's", |l| l.false_positives.to_string()),
        ("Detection F1", "Also recognition quality", |l| share(l.f1)),
        ("Segmentation quality", "Mean Jaccard index of matched lesions", |l| share(l.sq)),
        ("Panoptic quality", "F1 times segmentation quality", |l| share(l.pq)),
        ("Lesion-wise Dice", "Mean over lesions", |l| share(l.dice)),
    ];
    let of = |value: Value| pairs.iter().map(|l| l.map_or_else(|| "–".to_owned(), value)).collect();
    rows.into_iter().map(|(title, tip, value)| (title, tip, of(value))).collect()
}

fn share(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.3}"))
}

/// STAPLE, majority and Fleiss' kappa; nothing for fewer than three masks.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, date: &DateComparison) {
    let Some(raters) = &date.raters else { return };
    ui.add_space(6.0);
    ui.strong("All masks as raters of one tumour");
    Grid::new("raters").striped(true).num_columns(2).spacing([12.0, 3.0]).show(ui, |ui| {
        let mut row = |title: &str, tip: &str, value: String| {
            ui.label(title).on_hover_text(tip);
            ui.label(value);
            ui.end_row();
        };
        row("Majority", "Where more than half of the masks are", format::ml(raters.majority_ml));
        row(
            "Fleiss' kappa",
            "Agreement beyond chance within the box around all masks, which depends on no background beyond it",
            share(raters.fleiss_kappa_union_box),
        );
        row("STAPLE", "Volume of the estimate", raters.staple_ml.map_or_else(|| "–".to_owned(), format::ml));
        if let Some(staple) = &raters.staple {
            let each = raters.masks.iter().zip(staple.sensitivity.iter().zip(&staple.specificity));
            for (id, (sensitivity, specificity)) in each {
                row(
                    &input.doc.edit.masks.name(id),
                    "Sensitivity and specificity by STAPLE",
                    format!("sensitivity {sensitivity:.3}, specificity {specificity:.4}"),
                );
            }
        }
    });
}
