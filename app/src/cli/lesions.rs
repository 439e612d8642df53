//! `glioscope lesions`: the lesions of a mask at all dates, their diameters, and what became of them.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use glioscope_core::{
    case::Case,
    lesions::{self, LesionDate, LesionReport, LesionsReport, Of, Options, diameters::DiameterMode},
};

use super::{case::CaseArguments, parse, terminal};
use crate::{
    error::AppError,
    format,
    model::{
        ChangeSetting, LesionSetting,
        lesions::{SMALLEST_ML, WITHIN_MM},
    },
    output,
    world::load::ReadCase,
};

/// Edits without an effect that are named; others are counted.
const MOST_LOST: usize = 5;

/// How diameters are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Diameters {
    /// The longest, then the longest at right angles to it.
    #[default]
    LongestThenPerpendicular,
    /// The pair at right angles with the largest product.
    LargestProduct,
}

impl From<Diameters> for DiameterMode {
    fn from(diameters: Diameters) -> Self {
        match diameters {
            Diameters::LongestThenPerpendicular => Self::LongestThenPerpendicular,
            Diameters::LargestProduct => Self::LargestProduct,
        }
    }
}

/// Which components are lesions, and how they are measured.
#[derive(Clone, Debug, Args)]
pub struct LesionOptions {
    /// The mask, by id, or several whose union is taken: ID,ID. Without it the session's, else the first mask that all dates
    /// have.
    #[arg(long, value_name = "ID,...", value_delimiter = ',')]
    pub of: Vec<String>,
    /// Smaller components are counted, but are neither new, gone nor pieces of a split; default: the session's, else 0.1.
    #[arg(long, value_name = "ML", value_parser = parse::within(SMALLEST_ML), allow_hyphen_values = true)]
    pub smallest: Option<f64>,
    /// Components without a common voxel are taken for one lesion up to this distance; default: the session's, else 4.
    #[arg(long, value_name = "MM", value_parser = parse::within(WITHIN_MM), allow_hyphen_values = true)]
    pub within: Option<f64>,
    /// How diameters are measured.
    #[arg(long, value_enum, default_value_t)]
    pub diameters: Diameters,
}

impl LesionOptions {
    /// With what a session has where nothing is given.
    pub(super) fn or(&self, setting: &LesionSetting) -> LesionSetting {
        let of = setting.of.clone();
        let (smallest_ml, within_mm) =
            (self.smallest.unwrap_or(setting.smallest_ml), self.within.unwrap_or(setting.within_mm));
        LesionSetting { of, smallest_ml, within_mm, ..setting.clone() }
    }

    /// The options for the masks `of` of a case, else for those of `setting`.
    fn of_case(&self, case: &Case, of: &[String], setting: &LesionSetting) -> Options {
        let setting = self.or(setting);
        let chosen = setting.options(case, &ChangeSetting::default());
        let beside = chosen.as_ref().map(|options| (options.image.clone(), options.surface));
        let (image, surface) = beside.unwrap_or_default();
        let of = match of {
            [] => chosen.map_or_else(|| Of::Union(Vec::new()), |options| options.of),
            [one] => Of::Mask(one.clone()),
            several => Of::Union(several.to_vec()),
        };
        Options {
            smallest_ml: setting.smallest_ml,
            within_mm: setting.within_mm,
            mode: self.diameters.into(),
            asks_images: !case.one_space,
            image,
            surface,
            ..Options::new(of)
        }
    }
}

/// Arguments of `lesions`.
#[derive(Debug, Args)]
pub struct LesionArguments {
    /// The case.
    #[command(flatten)]
    pub case: CaseArguments,
    /// Which components are lesions, and how they are measured.
    #[command(flatten)]
    pub options: LesionOptions,
    /// Also the values of this image in each lesion: mean, most, peak in 1 ml, mean times volume; default: the session's image.
    #[arg(long, value_name = "ID")]
    pub image: Option<String>,
    /// Also how the surface of each lesion moved since the date before.
    #[arg(long)]
    pub surface: bool,
    /// As JSON: see docs/lesions.md.
    #[arg(long)]
    pub json: bool,
    /// Also write one row per lesion and date to this file.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write over a file that exists.
    #[arg(long, requires = "csv")]
    pub force: bool,
}

pub(super) fn run(arguments: &LesionArguments) -> Result<(), AppError> {
    let ReadCase { case, document, .. } = arguments.case.read(false)?;
    arguments.csv.iter().try_for_each(|path| output::refuse(path, &case.inputs, arguments.force))?;
    let setting = document.map(|document| document.edit.lesions).unwrap_or_default();
    let beside = (arguments.image.as_deref(), arguments.surface);
    let report = found(&case, (&arguments.options, beside), &arguments.options.of, &setting)?;
    if let Some(path) = &arguments.csv {
        output::write(path, &case.inputs, &lesions::csv(&report))?;
    }
    if arguments.json { terminal::print_json(&report) } else { terminal::print(&table(&report)) }
}

/// The lesions of the masks `of`, with the setting and the edits of the case's session; says what is uncertain.
pub(super) fn found(
    case: &Case,
    (options, (image, surface)): (&LesionOptions, (Option<&str>, bool)),
    of: &[String],
    setting: &LesionSetting,
) -> Result<LesionsReport, AppError> {
    let image = image.map(str::to_owned);
    let options = options.of_case(case, of, setting);
    let options = Options {
        image: image.or(options.image),
        // Of one mask; said where it was asked for here.
        surface: surface || (options.surface && matches!(options.of, Of::Mask(_))),
        ..options
    };
    let edits = setting.edits_of(&options.of.name());
    let report = terminal::with_progress(|progress| lesions::report(case, &options, &edits, progress))?;
    for lost in report.edits_not_applied.iter().take(MOST_LOST) {
        let reason: String = lost.reason.chars().take(300).collect();
        let text = format!("edit {} of the session has no effect: {reason}", lost.number + 1);
        terminal::warning("lesions-edit-lost", &text);
    }
    let more = report.edits_not_applied.len().saturating_sub(MOST_LOST);
    if more > 0 {
        terminal::warning("lesions-edit-lost", &format!("and {more} further edits have no effect"));
    }
    for warning in &report.warnings {
        terminal::warning("lesions", warning);
    }
    for pair in &report.pairs {
        if let Some(why) = &pair.not_linked {
            terminal::warning(
                "lesions-not-linked",
                &format!("{}: {why}; their lesions are not linked", report.of),
            );
        }
    }
    Ok(report)
}

/// The report as a text table.
fn table(report: &LesionsReport) -> String {
    let mut lines = vec![format!("{}: lesions of {}", report.case, report.of)];
    let small = report.lesions.iter().filter(|lesion| lesion.small).count();
    for lesion in report.lesions.iter().filter(|lesion| !lesion.small) {
        let name = lesion.name.as_ref().map(|name| format!(" ({name})")).unwrap_or_default();
        lines.push(format!("\nlesion {}{name}{}", lesion.id, growth(lesion)));
        lines.extend(lesion.dates.iter().map(|date| row(date, report.dates.len() > 1)));
    }
    if small > 0 {
        lines.push(format!("\n{small} more, never above {} ml", report.smallest_ml));
    }
    let proposed = report.proposed().count();
    if proposed > 0 {
        let links = if proposed == 1 {
            "1 link between dates is"
        } else {
            &format!("{proposed} links between dates are")
        };
        lines.push(format!("\n{links} proposed by the program, and not verified"));
    }
    lines.join("\n")
}

fn row(date: &LesionDate, has_dates: bool) -> String {
    let time = if has_dates { format!("{:12}", date.time) } else { String::new() };
    let Some(ml) = date.volume_ml else { return format!("  {time} unknown") };
    let events: Vec<&str> = date.events.iter().map(Into::into).collect();
    let events = events.join(", ").replace('_', " ");
    let (Some(d1), Some(d2), Some(product)) = (date.d1_mm, date.d2_mm, date.product_mm2) else {
        return format!("  {time} not there  {events}").trim_end().to_owned();
    };
    let measurable = if date.measurable == Some(true) { "" } else { "  not measurable" };
    let number = |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), format::four_digits);
    let values = date.values.as_ref().map_or_else(String::new, |values| {
        let [mean, max, peak] = [values.mean, values.max, values.peak].map(number);
        format!("  {}: mean {mean}, most {max}, peak {peak}", values.image)
    });
    let moved = date.surface.as_ref().map_or_else(String::new, |surface| {
        let mm = |value: Option<f64>| value.map_or_else(|| "0".to_owned(), |mm| format!("{mm:.1}"));
        let [grew, receded] = [&surface.growth, &surface.recession].map(|lengths| mm(lengths.p95_mm));
        format!("  grew up to {grew} mm, receded up to {receded} mm (95 %)")
    });
    let parts =
        if date.parts.len() > 1 { format!("  in {} pieces", date.parts.len()) } else { String::new() };
    format!(
        "  {time} {:>10}  {d1:5.1} × {d2:.1} mm  {product:7.0} mm²{measurable}{parts}  {events}{values}{moved}",
        format::ml(ml)
    )
    .trim_end()
    .to_owned()
}

fn growth(lesion: &LesionReport) -> String {
    let Some(growth) = &lesion.series.growth else { return String::new() };
    if growth.standard_error.is_some_and(|sd| growth.log_per_day.abs() <= 2.0 * sd) {
        return String::new();
    }
    match (growth.doubling_days, growth.halving_days) {
        (Some(days), _) => format!(": doubles in {days:.0} days, by {} dates", growth.dates),
        (_, Some(days)) => format!(": halves in {days:.0} days, by {} dates", growth.dates),
        _ => String::new(),
    }
}
