//! The report: one model of what a reader hands over, written as HTML, PDF or Markdown.
//!
//! The same session and inputs give the same bytes: nothing in it depends on when or where it was made but the adapter that
//! drew the pictures, which it names.

mod agreement;
mod anonymous;
mod content;
mod document;
pub mod figures;
mod filed;
mod front;
mod html;
mod identity;
mod lesion_pictures;
mod markdown;
mod pdf;
mod plot;
mod recipe;
mod responses;
mod self_checks;
mod sentences;
mod stated;
mod targets;

use std::sync::Arc;

use glioscope_core::{
    Progress,
    case::Case,
    lesions::LesionsReport,
    response::{Evaluated, NewLesion},
};
use glioscope_render::flat::Convention;

pub use anonymous::{Anonymous, anonymous, anonymous_case, without_identity};
pub use document::{Block, Finding, Report, Table};
pub use filed::{FileKind, Filing};
pub use front::{Found, Front};
pub use identity::Identity;
pub use plot::{Anchor, Plot, Shape, TEXT_PT, shortened};
pub use recipe::{Recipe, ResponseRecipe, VERSION as RECIPE_VERSION, recipe_in};
pub use sentences::words;

use crate::{
    error::AppError,
    model::{Document, PaneId, overlap::MAX_RING_MASKS, session},
    words::{Language, Words},
    world::response::{Answered, answered_of},
};
use content::Content;
use document::Picture;
use identity::Redactor;
use recipe::Input;

/// The longer side of a kept view, pixels.
const LONGER_PX: f32 = 1100.0;
/// The size of a diagram of columns, pixels.
const PLOT_OF_MANY_PX: [u32; 2] = [1300, 1100];
/// The shorter side of one, at least.
const LEAST_PX: f32 = 300.0;

/// The size of a kept view's picture: with the sides' ratio that it had on the screen.
fn size_px(size_points: [f32; 2]) -> [u32; 2] {
    let longer = size_points[0].max(size_points[1]).max(1.0);
    size_points.map(|side| (side / longer * LONGER_PX).clamp(LEAST_PX, LONGER_PX).round() as u32)
}

/// Draws panes for a report.
pub trait Painter {
    /// A pane as RGBA, 8 bits, row by row.
    ///
    /// # Errors
    /// [`AppError`] where it can't be drawn.
    fn picture(&mut self, pane: PaneId, size: [u32; 2]) -> Result<Vec<u8>, AppError>;

    /// Shows another document of the same case from now on.
    fn show(&mut self, doc: &Document);

    /// What draws them.
    fn adapter(&self) -> String;
}

/// What a report is made with beside the case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// How much of the patient's identity it has.
    pub identity: Identity,
    /// Its language.
    pub language: Language,
    /// Whether it names its reader though it doesn't identify the patient in full.
    pub names_reader: bool,
}

/// The form of a report's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// One HTML file with its pictures.
    Html,
    /// PDF (PDF/A-3a, PDF/UA-1).
    Pdf,
    /// Markdown without pictures.
    Markdown,
}

impl Form {
    /// The form that a file's ending means.
    fn of(path: &std::path::Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_lowercase();
        match ending.as_str() {
            "html" | "htm" => Some(Self::Html),
            "pdf" => Some(Self::Pdf),
            "md" => Some(Self::Markdown),
            _ => None,
        }
    }

    fn has_pictures(self) -> bool {
        self != Self::Markdown
    }
}

/// The file of a report.
///
/// # Errors
/// [`AppError`] where PDF can't hold it.
pub fn write(report: &Report, form: Form, language: Language) -> Result<Vec<u8>, AppError> {
    let words = words(language);
    match form {
        Form::Html => Ok(html::html(report, &words)?.into_bytes()),
        Form::Markdown => Ok(markdown::markdown(report, &words).into_bytes()),
        Form::Pdf => pdf::pdf(report, &words)
            .map_err(|why| AppError::wrong("the report as PDF", why, "one that PDF/A can hold")),
    }
}

/// The report of a case as its document shows it, both as [`anonymous`] gives them. `response`: what is evaluated of that case, and
/// with what; `None`: what the document states. Pictures are drawn only where the form has them.
///
/// # Errors
/// [`AppError`] where a picture can't be drawn or an input can't be read.
pub fn make(
    (case, doc): (&Arc<Case>, &Document),
    (options, form): (Options, Form),
    response: Option<&(Answered, ResponseRecipe)>,
    painter: &mut dyn Painter,
    progress: &Progress,
) -> Result<Report, AppError> {
    let found = Found::of(case, doc, response.map(|(answered, _)| answered), false, progress)?;
    let answered = response.map(|(answered, _)| answered).or(found.response.as_ref());
    let evaluated = answered.map(|answered| &answered.evaluated);
    let words = words(options.language);
    let redactor = Redactor::new(case, options.identity, words.get("removed"));
    let content = found.content((case, doc), (&words, &redactor), options.identity);
    let is_named = options.identity == Identity::Full;
    // What a session says is in the recipe itself.
    let read = case.inputs.paths().iter().filter(|path| !session::is_session(path));
    let inputs = read.map(|path| Input::of(path, is_named, progress));
    let recipe = Recipe {
        glioscope_report: recipe::VERSION,
        program: format!("Glioscope {}", env!("CARGO_PKG_VERSION")),
        adapter: painter.adapter(),
        identity: options.identity,
        names_reader: options.names_reader,
        language: options.language,
        inputs: inputs.collect::<Result<_, _>>()?,
        response: response.map(|(_, recipe)| recipe.clone()),
        session: session::value(doc, case, is_named)?,
    };
    let Front { title, mut blocks, notes } = found.front(&content, answered, false);
    if form.has_pictures() {
        blocks.push(Block::Heading(words.get("section-pictures")));
        blocks.extend(pictures(
            case,
            &pictured(case, doc, answered),
            (&content, answered),
            painter,
            progress,
        )?);
    }
    if answered.is_some() {
        blocks.extend(content.summary(false));
    }
    let earlier = evaluated.map(|evaluated| responses::earlier(evaluated, &words, &redactor));
    blocks.extend(earlier.into_iter().flatten());
    blocks.extend(responses::bt_rads(case, &doc.edit.response, &words, is_named));
    blocks.extend(content.changes());
    blocks.extend(content.lesions());
    blocks.extend(content.dates());
    blocks.extend(notes);
    blocks.extend(how_made(&recipe, &content));
    Ok(Report { language: words.get("language-code"), title, signed: content.signed(), blocks, recipe })
}

/// The calls of the last date in a sentence, and in another the new lesions of the masks there, unless the reader states that there are none.
pub fn calls_in_words(
    evaluated: &Evaluated,
    lesions: Option<&LesionsReport>,
    words: &Words,
) -> Option<String> {
    let calls = responses::sentence(evaluated, words)?;
    let none_stated = |report: &&LesionsReport| {
        let last = report.dates.last().map(|date| date.time.as_str());
        let facts = evaluated.stated.date.iter().find(|facts| Some(facts.date.0.as_str()) == last);
        let stated = facts.and_then(|facts| facts.new_lesion.as_ref());
        stated.is_some_and(|stated| stated.value == NewLesion::None)
    };
    let new = lesions.filter(|report| !none_stated(report));
    let new = new.and_then(|report| responses::new_in_words(report, words));
    Some([Some(calls), new].into_iter().flatten().collect::<Vec<_>>().join(" "))
}

/// The measurements of a case and document, both as [`anonymous`] gives them, as a DICOM structured report, with the response: `answered`, or
/// that of the document.
///
/// # Errors
/// [`AppError`] for a case without masks; cancelled.
pub fn structured(
    case: &Case,
    doc: &Document,
    filing: &Filing,
    answered: Option<&Answered>,
    progress: &Progress,
) -> Result<Vec<u8>, AppError> {
    let (lesions, own) = answered_of(case, doc, answered, progress)?;
    filing.structured(case, doc, lesions.as_deref(), answered.or(own.as_ref()))
}

/// The panes that a report shows, with the keys of their captions.
fn panes(case: &Case) -> Vec<(PaneId, &'static str)> {
    let time_points = &case.time_points;
    let has_image = time_points.iter().any(|time| !time.contexts.is_empty());
    let has_overlap = time_points.iter().any(|time| time.masks.len() > 1);
    let all = [
        (PaneId::Closeup, "picture-closeup", true),
        (PaneId::Context, "picture-context", has_image),
        (PaneId::Overlap, "picture-overlap", has_overlap),
        (PaneId::Change, "picture-change", time_points.len() > 1),
        (PaneId::SideBySide, "picture-side-by-side", time_points.len() > 1 && has_image),
        // It has the axial slice of every date.
        (PaneId::Axial, "picture-axial", !(time_points.len() > 1 && has_image)),
        (PaneId::Coronal, "picture-coronal", true),
        (PaneId::Sagittal, "picture-sagittal", true),
    ];
    all.into_iter().filter(|(.., wanted)| *wanted).map(|(pane, key, _)| (pane, key)).collect()
}

/// What the pictures show: of a report of a response without kept views the last date, which its calls are about.
fn pictured(case: &Case, doc: &Document, answered: Option<&Answered>) -> Document {
    let mut shown = doc.clone();
    let last = case.time_points.len().saturating_sub(1);
    if answered.is_some() && doc.edit.pictures.is_empty() && doc.nav.time != last {
        shown.go_to_current(case);
        shown.nav.time = last;
        shown.edit.lens_on &= doc.edit.lens_on;
    }
    shown
}

/// The views that the reader kept; without any, all that the case has.
fn pictures(
    case: &Case,
    doc: &Document,
    (content, answered): (&Content<'_>, Option<&Answered>),
    painter: &mut dyn Painter,
    progress: &Progress,
) -> Result<Vec<Block>, AppError> {
    let words = content.words;
    let mut blocks = Vec::new();
    painter.show(doc);
    if doc.edit.pictures.is_empty() {
        for (pane, key) in panes(case) {
            progress.check()?;
            let Some(size) = pane.row().report_px else { continue };
            let many = case.time_points.iter().any(|time| time.masks.len() > MAX_RING_MASKS);
            let size = if pane == PaneId::Overlap && many { PLOT_OF_MANY_PX } else { size };
            let (of_lesions, has_targets) = match pane {
                PaneId::SideBySide | PaneId::Axial => {
                    lesion_pictures::blocks((case, doc), (pane, size), content, answered, painter)?
                }
                _ => (Vec::new(), false),
            };
            // Slices of the targets say more than that of the tumour's middle.
            if has_targets {
                blocks.splice(0..0, of_lesions);
            } else {
                let rgba = painter.picture(pane, size)?;
                let caption = caption_of(case, doc, pane, &words.get(own_key(doc, pane, key)), words);
                let name = pane.row().cli.unwrap_or(key).to_owned();
                blocks.push(Block::Picture(Picture { name, caption, size, rgba }));
                blocks.extend(of_lesions);
            }
        }
        return Ok(blocks);
    }
    let known = panes(case);
    for (n, kept) in doc.edit.pictures.iter().enumerate() {
        progress.check()?;
        let pane = kept.pane;
        let shown = kept.document(doc);
        painter.show(&shown);
        let size = size_px(kept.size_points);
        let rgba = painter.picture(pane, size)?;
        let key = known.iter().find(|(known, _)| *known == pane).map(|(_, key)| *key);
        let own = match (kept.caption.trim(), key) {
            ("", Some(key)) => words.get(own_key(&shown, pane, key)),
            ("", None) => pane.tab().to_owned(),
            (caption, _) => caption.to_owned(),
        };
        let caption = caption_of(case, &shown, pane, &own, words);
        let name = format!("{}-{}", n + 1, pane.row().cli.unwrap_or("view"));
        blocks.push(Block::Picture(Picture { name, caption, size, rgba }));
    }
    painter.show(doc);
    Ok(blocks)
}

/// The key of a pane's caption: without the lens nothing is cut open.
fn own_key(doc: &Document, pane: PaneId, key: &'static str) -> &'static str {
    if pane == PaneId::Closeup && doc.active_lens().is_none() { "picture-closeup-whole" } else { key }
}

/// A caption with its date, and with which side is which.
fn caption_of(case: &Case, doc: &Document, pane: PaneId, own: &str, words: &Words) -> String {
    let side = match doc.nav.convention {
        Convention::Radiological => "picture-side-radiological",
        Convention::Neurological => "picture-side-neurological",
    };
    let mut caption = own.to_owned();
    if matches!(pane, PaneId::Axial | PaneId::Coronal) {
        caption = format!("{caption} {}", words.get(side));
    }
    let date = case.time_points.get(doc.nav.time).map_or("", |time| time.label.as_str());
    let is_of_dates = pane.row().needs_dates;
    if date.is_empty() || is_of_dates { caption } else { format!("{date}: {caption}") }
}

/// Versions, settings, and the files that were read.
fn how_made(recipe: &Recipe, content: &Content<'_>) -> Vec<Block> {
    let words = content.words;
    let edit = &content.doc.edit;
    let compared = &edit.agreement;
    let mut facts = vec![
        (words.get("program"), recipe.program.clone()),
        (words.get("adapter"), recipe.adapter.clone()),
        (words.get("case-grid"), content.grid()),
    ];
    if content.compared.iter().any(|date| !date.pairs.is_empty()) {
        let variables = [
            ("convention", compared.convention.name().to_owned()),
            ("tolerance", words.number(&format!("{} mm", compared.tolerance_mm))),
            ("percentile", words.number(&compared.percentile.to_string())),
        ];
        facts.push((words.get("settings-agreement"), words.with("settings-agreement-are", &variables)));
    }
    if let Some(lesions) = content.lesions {
        let variables = [
            ("smallest", words.ml(lesions.smallest_ml)),
            ("within", words.number(&format!("{} mm", lesions.within_mm))),
        ];
        facts.push((words.get("settings-lesions"), words.with("settings-lesions-are", &variables)));
    }
    facts.push((words.get("settings-all"), recipe.settings_sha256()));
    let inputs = recipe.inputs.iter().enumerate().map(|(n, input)| {
        let name = input.name.clone().unwrap_or_else(|| (n + 1).to_string());
        (name, input.sha256.clone())
    });
    let mut blocks = vec![Block::Heading(words.get("section-made")), Block::Facts(facts)];
    if !recipe.inputs.is_empty() {
        blocks.push(Block::Text(format!("{}:", words.get("inputs"))));
        blocks.push(Block::Facts(inputs.collect()));
    }
    blocks.push(Block::Text(words.get("not-a-device")));
    blocks
}
