//! The page that a patient takes home, of an open case; the words that the program proposes for it are put together on a worker.

use std::sync::Arc;

use glioscope_core::{Progress, case::Case};
use glioscope_render::agreement_color;

use super::{
    colors_of,
    jobs::{Ask, Derived, Handle, Lookup},
};
use crate::{
    error::AppError,
    model::{Document, TakeHome},
    page::{self, Options, Page},
};

/// The page of a case, of `image` where it is named.
///
/// # Errors
/// [`AppError`]: no active voxel, an image that isn't in the case, and where the user cancels.
pub fn page_of(
    case: &Case,
    doc: &Document,
    setting: &TakeHome,
    image: Option<&str>,
    progress: &Progress,
) -> Result<Page, AppError> {
    let text = setting.text.as_deref().map(page::parse);
    let colors: Vec<_> = case.time_points.iter().map(|time| colors_of(doc, time)).collect();
    let color = |date: usize, mask: usize| colors.get(date).map_or([128; 3], |colors| colors.mask(mask));
    let name = |id: &str| if setting.has_names { doc.edit.masks.name(id) } else { String::new() };
    let options = Options {
        has_dates: setting.has_dates,
        image,
        text: text.as_deref(),
        agreement_color: &agreement_color,
    };
    Ok(page::content(case, &color, &name, &options, progress)?)
}

/// The words last proposed.
#[derive(Default)]
pub struct Proposals {
    result: Derived<(Handle<Case>, TakeHome, Vec<String>), String>,
}

impl Proposals {
    /// The program's words for the page, as a doctor edits them.
    pub fn get(&mut self, case: &Arc<Case>, doc: &Document, ask: &Ask) -> Lookup<'_, String> {
        let setting = TakeHome { text: None, ..doc.edit.take_home.clone() };
        let masks = case.time_points.iter().flat_map(|time| &time.masks);
        let names = masks.map(|mask| doc.edit.masks.name(mask.mask.id())).collect();
        let (of, doc) = (case.clone(), doc.clone());
        self.result.get((Handle::of(case), setting.clone(), names), ask, move |progress| {
            let page = page_of(&of, &doc, &setting, None, progress)?;
            Ok(page::default_text(&page, &page::words(setting.language)))
        })
    }

    /// Whether a worker is at it.
    pub fn working(&mut self) -> bool {
        self.result.working()
    }
}
