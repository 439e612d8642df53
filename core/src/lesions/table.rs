//! The table of `lesions --csv`.

use crate::{
    change::Lengths,
    csv::{Table, text},
};

use super::{
    event::EventKind,
    links::LinkState,
    report::{LesionDate, LesionsReport},
    values::{SurfaceMove, Values},
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
        "image",
        "mean",
        "max",
        "peak",
        "mean_times_ml",
        "growth_p95_mm",
        "recession_p95_mm",
    ]);
    let number = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    for lesion in &report.lesions {
        for date in &lesion.dates {
            let LesionDate { time, days, volume_ml, d1_mm, d2_mm, product_mm2, measurable, .. } = date;
            let events: Vec<&str> =
                date.events.iter().map(<&EventKind as Into<&'static str>>::into).collect();
            let of_image = |value: fn(&Values) -> Option<f64>| number(date.values.as_ref().and_then(value));
            let moved = |lengths: fn(&SurfaceMove) -> &Lengths| {
                number(date.surface.as_ref().and_then(|surface| lengths(surface).p95_mm))
            };
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
                text(date.values.as_ref().map(|values| values.image.as_str()).unwrap_or_default()),
                of_image(|values| values.mean),
                of_image(|values| values.max),
                of_image(|values| values.peak),
                of_image(|values| values.mean_times_ml),
                moved(|surface| &surface.growth),
                moved(|surface| &surface.recession),
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
