//! The table of `lesions --csv`.

use crate::csv::{Table, text};

use super::{
    event::EventKind,
    links::LinkState,
    report::{LesionDate, LesionsReport},
};

/// One row per lesion and date, then one per date for all lesions together (`lesion` empty); unknown values empty, several
/// events joined by `;`.
pub fn csv(report: &LesionsReport) -> Vec<u8> {
    let mut table = Table::new([
        "lesion",
        "name",
        "date",
        "days",
        "volume_ml",
        "components",
        "d1_mm",
        "d2_mm",
        "product_mm2",
        "measurable",
        "small",
        "event",
        "state",
    ]);
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    for lesion in &report.lesions {
        for date in &lesion.dates {
            let LesionDate { time, days, volume_ml, d1_mm, d2_mm, product_mm2, measurable, .. } = date;
            let events: Vec<&str> =
                date.events.iter().map(<&EventKind as Into<&'static str>>::into).collect();
            table.row([
                lesion.id.clone(),
                text(lesion.name.as_deref().unwrap_or_default()),
                text(time),
                number(*days),
                number(*volume_ml),
                volume_ml.map(|_| date.parts.len().to_string()).unwrap_or_default(),
                number(*d1_mm),
                number(*d2_mm),
                number(*product_mm2),
                measurable.map(|flag| u8::from(flag).to_string()).unwrap_or_default(),
                u8::from(lesion.small).to_string(),
                events.join(";"),
                date.state
                    .as_ref()
                    .map(<&LinkState as Into<&'static str>>::into)
                    .unwrap_or_default()
                    .to_owned(),
            ]);
        }
    }
    for date in &report.dates {
        let components = date.components.map(|count| count.to_string()).unwrap_or_default();
        table.row([
            String::new(),
            String::new(),
            text(&date.time),
            number(date.days),
            number(date.volume_ml),
            components,
        ]);
    }
    table.into_bytes()
}
