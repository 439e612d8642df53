//! Measurements and new lesions as the masks of a case show them.

use serde::Serialize;

use super::{
    evaluate,
    fact::{Fact, Label, MASKS, Radiotherapy, When},
    history::{Assessment, Compartment, History, HistoryError, Measurement, NewLesion, ScanFacts},
    phrases as say,
    result::Response,
    rules::Criterion,
};
use crate::{
    dates::leading_date,
    lesions::{EventKind, LesionDate, LesionReport, LesionsReport, largest, new_lesions},
    phrase::{Phrase, Value},
};

/// A response of lesions, and what it rests on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluated {
    /// The masks measured, with their compartments.
    pub of: Vec<(Compartment, String)>,
    /// Links between lesions that no reader has verified.
    pub proposed_links: usize,
    /// Where the history and the masks contradict each other, in one line each.
    pub warnings: Vec<String>,
    /// What was stated.
    #[serde(skip)]
    pub stated: History,
    /// `warnings`, for other languages.
    #[serde(skip)]
    pub contradictions: Vec<Phrase>,
    /// The calls.
    #[serde(flatten)]
    pub response: Response,
}

/// Evaluates a history with the lesions of one compartment or two, as [`evaluate`] does.
///
/// # Errors
/// As [`evaluate`].
pub fn evaluate_lesions(
    mut history: History,
    reports: &[(Compartment, &LesionsReport)],
) -> Result<Evaluated, HistoryError> {
    let (mut all, mut of, mut proposed_links) = (Vec::<Measurement>::new(), Vec::new(), 0);
    let stated = history.clone();
    let mut contradictions = Vec::new();
    for (compartment, report) in reports {
        let mut measured = measurements(report, *compartment);
        if !all.is_empty() {
            // Lesions of another mask have names of their own.
            measured.iter_mut().for_each(|m| m.lesion = format!("{} {}", report.of, m.lesion));
        }
        all.extend(with_days(measured, &history));
        contradictions.extend(contradictions_of(&history, report));
        history = with_new_lesions(history, report);
        proposed_links += report.proposed().count();
        of.push((*compartment, report.of.clone()));
    }
    let response = evaluate(&history, &all)?;
    for date in response.dates.iter().filter(|date| date.by_diameters.call == super::Call::Baseline) {
        // Behind how it was chosen: what the criteria say against it.
        contradictions.extend(date.by_diameters.reasons.iter().skip(1).map(|why| {
            say::BASELINE_DOUBTED
                .with([("scan", date.date.as_str().into()), ("why", why.phrase.clone().into())])
        }));
    }
    let last = response.dates.iter().filter_map(|date| leading_date(&date.date)).max();
    let end = stated.radiotherapy_end.as_ref().map(|fact| fact.value);
    if let (Some(Radiotherapy::Ended(end @ When::Date(day))), Some(last)) = (end, last)
        && day > last
    {
        contradictions.push(say::RADIOTHERAPY_AFTER_SCANS.with([("end", Value::Text(end.to_string()))]));
    }
    let warnings = contradictions.iter().map(Phrase::to_string).collect();
    Ok(Evaluated { of, proposed_links, warnings, contradictions, stated, response })
}

/// The compartments that a history measures: the mask of `of`, and that of non-enhancing disease where it `has_other`.
pub fn measured_compartments(history: &History, has_other: bool) -> &'static [Compartment] {
    let is_non_enhancing =
        history.criterion == Criterion::RanoLgg || history.assessment == Some(Assessment::NonEnhancing);
    match (is_non_enhancing, has_other) {
        (true, _) => &[Compartment::NonEnhancing],
        (false, false) => &[Compartment::Enhancing],
        (false, true) => &[Compartment::Enhancing, Compartment::NonEnhancing],
    }
}

/// The lesions of `report` as measurements of `compartment`, from the date at which each is first there. A lesion that a
/// later date doesn't have is gone; where that isn't known it has no measurement.
fn measurements(report: &LesionsReport, compartment: Compartment) -> Vec<Measurement> {
    let all = report.lesions.iter();
    all.flat_map(|lesion| of_lesion(lesion, name_of(lesion, &report.lesions), compartment)).collect()
}

/// The user's name of a lesion where no other has it, else its id.
pub fn name_of<'a>(lesion: &'a LesionReport, all: &[LesionReport]) -> &'a str {
    let is_taken = |name: &str| {
        all.iter().any(|o| o.id != lesion.id && (o.id == name || o.name.as_deref() == Some(name)))
    };
    lesion.name.as_deref().filter(|name| !name.is_empty() && !is_taken(name)).unwrap_or(&lesion.id)
}

fn of_lesion(lesion: &LesionReport, name: &str, compartment: Compartment) -> Vec<Measurement> {
    let is_there = |date: &LesionDate| !date.parts.is_empty();
    let first = lesion.dates.iter().position(is_there).unwrap_or(lesion.dates.len());
    let known = lesion.dates[first..].iter().filter(|date| date.volume_ml.is_some());
    known
        .map(|date| {
            let largest = largest(&date.parts);
            Measurement {
                date: Label(date.time.clone()),
                days: None,
                lesion: name.to_owned(),
                compartment,
                gone: date.parts.is_empty(),
                longest_mm: date.d1_mm,
                perpendicular_mm: date.d2_mm,
                product_mm2: date.product_mm2,
                slices: largest.map(|d| u32::try_from(d.slices).unwrap_or(u32::MAX)),
                slice_thickness_mm: largest.map(|d| d.slice_thickness_mm),
                volume_ml: date.volume_ml.filter(|_| is_there(date)),
            }
        })
        .collect()
}

/// `history` with the new lesions that the masks show, at dates for which it says nothing of new lesions itself. That masks
/// show none isn't taken for an answer: they may be of the known lesions alone.
///
/// Every date at which the mask was looked at becomes a scan, whether or not it has a lesion.
#[must_use]
fn with_new_lesions(mut history: History, report: &LesionsReport) -> History {
    for date in report.dates.iter().filter(|date| date.components.is_some()) {
        if !history.date.iter().any(|facts| facts.date.0 == date.time) {
            history.date.push(ScanFacts { date: Label(date.time.clone()), ..ScanFacts::default() });
        }
    }
    for lesion in &report.lesions {
        for date in lesion.dates.iter().filter(|date| date.events.contains(&EventKind::Born)) {
            let new = match date.measurable {
                Some(true) => NewLesion::Measurable,
                _ => NewLesion::NonMeasurable,
            };
            state(&mut history, &date.time, new);
        }
    }
    history
}

/// Where the masks show a new lesion and the history says that there is none, or the reverse; and scans without the mask, in one line each.
fn contradictions_of(history: &History, report: &LesionsReport) -> Vec<Phrase> {
    let born = report.lesions.iter().flat_map(|lesion| {
        let dates = lesion.dates.iter().filter(|date| date.events.contains(&EventKind::Born));
        dates.map(move |date| (lesion, date))
    });
    let stated = |time: &str| {
        let facts = history.date.iter().find(|facts| facts.date.0 == time);
        facts.and_then(|facts| facts.new_lesion.as_ref()).map(|fact| fact.value)
    };
    let mut said_otherwise: Vec<Phrase> = Vec::new();
    for date in report.dates.iter().filter(|date| stated(&date.time) == Some(NewLesion::Measurable)) {
        let new = || new_lesions(report).filter(|(_, new)| new.time == date.time);
        let is_known = date.components.is_some() && report.dates.first() != Some(date);
        if new().next().is_none() && is_known {
            said_otherwise.push(say::SAID_NEW.with([("date", date.time.as_str().into())]));
        } else if new().next().is_some() && new().all(|(_, new)| new.measurable == Some(false)) {
            let names = new().map(|(name, _)| name).collect::<Vec<_>>().join(", ");
            said_otherwise.push(
                say::SAID_MEASURABLE
                    .with([("date", date.time.as_str().into()), ("lesions", names.as_str().into())]),
            );
        }
    }
    let without_mask = report.dates.iter().filter(|date| date.components.is_none()).map(|date| {
        say::SCAN_WITHOUT_MASK
            .with([("date", date.time.as_str().into()), ("mask", report.of.as_str().into())])
    });
    born.filter(|(_, date)| stated(&date.time) == Some(NewLesion::None))
        .map(|(lesion, date)| {
            let ml = date.volume_ml.unwrap_or_default();
            say::CONTRADICTION.with([
                ("date", date.time.as_str().into()),
                ("lesion", lesion.id.as_str().into()),
                ("mask", report.of.as_str().into()),
                ("ml", Value::number(format!("{ml:.2}"))),
            ])
        })
        .chain(said_otherwise)
        .chain(without_mask)
        .collect()
}

/// Dates whose new lesions the masks alone tell of, in their order: no reader has stated what they are.
pub fn unstated_new<'a>(report: &'a LesionsReport, history: &History) -> Vec<&'a str> {
    let is_stated =
        |time: &str| history.date.iter().any(|facts| facts.date.0 == time && facts.new_lesion.is_some());
    let is_new = |time: &str| new_lesions(report).any(|(_, date)| date.time == time);
    let dates = report.dates.iter().map(|date| date.time.as_str());
    dates.filter(|time| is_new(time) && !is_stated(time)).collect()
}

/// `measurements` with the days that the history states for dates that aren't calendar dates.
#[must_use]
fn with_days(mut measurements: Vec<Measurement>, history: &History) -> Vec<Measurement> {
    for m in measurements.iter_mut().filter(|m| m.days.is_none()) {
        m.days = history.date.iter().find(|facts| facts.date == m.date).and_then(|facts| facts.days);
    }
    measurements
}

fn state(history: &mut History, time: &str, new: NewLesion) {
    let of_masks = |fact: &Fact<NewLesion>| fact.author.as_deref() == Some(MASKS);
    let fact = Fact { value: new, author: Some(MASKS.to_owned()), entered: None };
    let Some(facts) = history.date.iter_mut().find(|facts| facts.date.0 == time) else {
        let date = Label(time.to_owned());
        history.date.push(ScanFacts { date, new_lesion: Some(fact), ..ScanFacts::default() });
        return;
    };
    match &facts.new_lesion {
        None => facts.new_lesion = Some(fact),
        // A measurable one says more than one that isn't.
        Some(before) if of_masks(before) && new == NewLesion::Measurable => facts.new_lesion = Some(fact),
        Some(_) => {}
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        Grid, Progress, Samples, Scaling, Volume,
        case::{CaseSpec, LoadOptions, load},
        files::{WriteOptions, write_nifti},
        lesions::{Of, Options, report},
        response::{Assessment, Call, Criterion, evaluate},
    };

    /// A mask of boxes, each with its first voxel and its size.
    fn write(path: &std::path::Path, boxes: &[([usize; 3], usize)]) {
        let grid = Grid::axis_aligned([64; 3], DVec3::ONE, DVec3::ZERO).unwrap();
        let is_in = |at: usize| {
            let ijk = grid.ijk(at);
            boxes.iter().any(|(from, size)| (0..3).all(|a| (from[a]..from[a] + size).contains(&ijk[a])))
        };
        let voxels = (0..grid.voxel_count()).map(|at| u8::from(is_in(at))).collect();
        let volume = Volume::new(grid.clone(), Samples::U8(voxels), Scaling::NONE).unwrap();
        write_nifti(path, &volume, &WriteOptions::default()).unwrap();
    }

    #[test]
    fn masks_become_measurements_with_gone_and_new_lesions() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        // A shrinks from 20 to 12 mm; B of 12 mm vanishes; C of 14 mm is new.
        write(&path("a.nii"), &[([2, 2, 2], 20), ([40, 2, 2], 12)]);
        write(&path("b.nii"), &[([6, 6, 6], 12), ([40, 40, 40], 14)]);
        let masks = ["a", "b"].iter().zip(["2024-01-01", "2024-03-01"]);
        let masks: Vec<String> = masks
            .map(|(name, date)| format!("T={}@{date}", path(&format!("{name}.nii")).display()))
            .collect();
        let spec = CaseSpec::from_arguments(&masks, &[]).unwrap();
        let case = load(&spec, &LoadOptions::default(), &Progress::new()).unwrap();
        let lesions = report(&case, &Options::new(Of::Mask("T".into())), &[], &Progress::new()).unwrap();
        let all = measurements(&lesions, Compartment::Enhancing);
        let of = |lesion: &str| all.iter().filter(|m| m.lesion == lesion).collect::<Vec<_>>();
        let (a, b, c) = (of("A"), of("B"), of("C"));
        // A square's longest line is its diagonal, and its longest perpendicular the other one.
        let diagonal = |side: f64| side * 2.0_f64.sqrt();
        for (m, side) in a.iter().zip([20.0, 12.0]) {
            assert!((m.longest_mm.unwrap() - diagonal(side)).abs() < 1e-9);
            assert!((m.product_mm2.unwrap() - 2.0 * side * side).abs() < 1e-6);
            assert!((m.volume_ml.unwrap() - side.powi(3) / 1000.0).abs() < 1e-9);
            assert_eq!((m.slices, m.slice_thickness_mm), (Some(side as u32), Some(1.0)));
        }
        assert_eq!(b.iter().map(|m| m.gone).collect::<Vec<_>>(), [false, true]);
        assert_eq!(c.len(), 1, "nothing before it is there");
        let denied = ScanFacts {
            date: Label("2024-03-01".into()),
            new_lesion: Some(Fact::of(NewLesion::None)),
            ..ScanFacts::default()
        };
        let history =
            History { date: vec![denied], ..History::new(Criterion::Rano20, Some(Assessment::Enhancing)) };
        assert_eq!(contradictions_of(&history, &lesions).len(), 1);
        // What is stated to be measurable is: C has 14 mm. Were it small, it would be told.
        let mut said = history.clone();
        said.date[0].new_lesion = Some(Fact::of(NewLesion::Measurable));
        assert_eq!(contradictions_of(&said, &lesions), []);
        let mut small = lesions.clone();
        let dates = small.lesions.iter_mut().filter(|l| l.id == "C").flat_map(|l| &mut l.dates);
        dates.for_each(|date| date.measurable = Some(false));
        let told: Vec<String> = contradictions_of(&said, &small).iter().map(Phrase::to_string).collect();
        assert_eq!(told, ["2024-03-01: a new lesion is stated to be measurable, where the masks' C isn't"]);
        let mut none = lesions.clone();
        none.lesions.retain(|lesion| lesion.id != "C");
        let told: Vec<String> = contradictions_of(&said, &none).iter().map(Phrase::to_string).collect();
        assert_eq!(
            told,
            ["2024-03-01: a new lesion is stated to be measurable, where the masks show no new one"]
        );
        // A scan without the mask is told, whatever is stated of it.
        if let Some(last) = none.dates.last_mut() {
            last.components = None;
        }
        let told: Vec<String> = contradictions_of(&said, &none).iter().map(Phrase::to_string).collect();
        assert_eq!(
            told,
            [format!("2024-03-01: the scan has no mask of {}, so that it isn't judged", none.of)]
        );
        assert_eq!(
            contradictions_of(&with_new_lesions(history, &lesions), &lesions).len(),
            1,
            "it stays said"
        );

        let history = History::new(Criterion::Rano20, Some(Assessment::Enhancing));
        let history = with_new_lesions(history, &lesions);
        let new = history.date.iter().find(|facts| facts.date.0 == "2024-03-01").unwrap();
        assert_eq!(new.new_lesion.as_ref().unwrap().value, NewLesion::Measurable);
        let mut history = History { baseline: Some(Fact::of(Label("2024-01-01".into()))), ..history };
        history.radiotherapy_end = Some(Fact::of(Radiotherapy::None));
        // Radiotherapy that ends after all scans is mistyped, or another's.
        let told_of = |end: &str| {
            let text = format!(
                "response = 1\ncriterion = \"rano-2.0\"\nassessment = \"enhancing\"\nradiotherapy_end = {end}\n"
            );
            let of = History::parse(&text).unwrap();
            let found = evaluate_lesions(of, &[(Compartment::Enhancing, &lesions)]).unwrap();
            found
                .warnings
                .iter()
                .filter(|warning| warning.starts_with("radiotherapy"))
                .cloned()
                .collect::<Vec<_>>()
        };
        let expected = "radiotherapy is stated to have ended at 2025-01-01, after the last scan";
        assert_eq!(told_of("2025-01-01"), [expected]);
        assert_eq!(told_of("2023-06-30"), Vec::<String>::new());
        let calls = evaluate(&history, &all).unwrap();
        // A new measurable lesion is progression, though the sum fell.
        let last = &calls.dates[1].by_diameters;
        assert_eq!(last.call, Call::Progression, "{:?}", last.reasons);
        assert!(last.reasons.iter().any(|reason| reason.words.contains("the masks")), "{:?}", last.reasons);
    }
}
