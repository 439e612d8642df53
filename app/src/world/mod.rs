//! Runtime state: the loaded case and the results derived from it. Never saved.

pub mod agreement;
pub mod cohort;
pub mod comparison;
pub mod ellipsoids;
pub mod image;
pub mod jobs;
pub mod lesions;
pub mod load;
pub mod make_mask;
pub mod numbers;
pub mod places;
pub mod response;
pub mod self_check;
mod session_case;
pub mod slice_plane;
pub mod spoken;
pub mod surroundings;
pub mod take_home;
pub mod tracts;

use std::sync::Arc;

use glam::DMat3;
use glioscope_core::{
    Check, RegionVolume, Selection, axes,
    case::{Case, TimePoint},
    files::FileMark,
};
use glioscope_render::{
    Gpu, MaskColors,
    flat::{PreparedContext, Window},
};

use crate::model::{
    Document,
    fusion::is_pet,
    made::{self, MadeMask},
    slice_axes::{AxesOf, SliceAxes},
};

/// A case and the data that every view needs of it, derived once per load. Clones share all of it.
#[derive(Clone)]
pub struct Loaded {
    /// The case as its files have it.
    base: Arc<Case>,
    /// The masks made from it.
    made: Vec<MadeMask>,
    /// The case with them.
    pub case: Arc<Case>,
    /// Images prepared for slicing: per time point, in the order of its contexts.
    contexts: Vec<Vec<Arc<PreparedContext>>>,
    /// Cropped region volume of each time point; `None` where no voxel is active.
    tumors: Vec<Option<Arc<RegionVolume>>>,
    /// Its files as they were read.
    files: Vec<FileMark>,
}

impl Loaded {
    /// Prepares the images and crops the regions.
    pub fn new(case: Case) -> Self {
        let case = Arc::new(case);
        Self::with_made(case.clone(), Vec::new(), case)
    }

    /// As [`Loaded::new`], of `base` with the masks made from it: `case` is the case with them.
    pub fn with_made(base: Arc<Case>, made: Vec<MadeMask>, case: Arc<Case>) -> Self {
        let contexts = case
            .time_points
            .iter()
            .map(|t| t.contexts.iter().map(|c| Arc::new(PreparedContext::new(c.volume.clone()))).collect())
            .collect();
        let tumors = tumors(&case);
        Self { base, made, case, contexts, tumors, files: Vec::new() }
    }

    /// With these masks made from those of the case's files, in place of others made before.
    pub fn set_made(&mut self, made: &[MadeMask]) {
        if self.made == made {
            return;
        }
        self.made = made.to_vec();
        self.case =
            if made.is_empty() { self.base.clone() } else { Arc::new(made::with_made(&self.base, made)) };
        self.tumors = tumors(&self.case);
    }

    /// With the marks of the case's files, for sessions.
    #[must_use]
    pub fn with_files(self, files: Vec<FileMark>) -> Self {
        Self { files, ..self }
    }
}

/// The cropped region volume of each time point.
fn tumors(case: &Case) -> Vec<Option<Arc<RegionVolume>>> {
    case.time_points.iter().map(|t| RegionVolume::of(&t.index, &t.regions).map(Arc::new)).collect()
}

/// The second image of slices.
#[derive(Clone, Copy)]
pub struct Second<'a> {
    /// Its id.
    pub id: &'a str,
    /// Label of its date; may be empty.
    pub time: &'a str,
    /// The image.
    pub image: &'a Arc<PreparedContext>,
    /// Its window.
    pub window: Window,
}

/// The loaded case, if any.
#[derive(Clone, Default)]
pub struct World {
    loaded: Option<Loaded>,
}

impl World {
    /// A world with a loaded case.
    pub fn new(loaded: Loaded) -> Self {
        Self { loaded: Some(loaded) }
    }

    /// The case.
    pub fn case(&self) -> Option<&Arc<Case>> {
        self.loaded.as_ref().map(|l| &l.case)
    }

    /// Makes the case have these masks beside those of its files.
    pub fn set_made(&mut self, made: &[MadeMask]) {
        if let Some(loaded) = &mut self.loaded {
            loaded.set_made(made);
        }
    }

    /// Number of time points; 0 without a case.
    pub fn time_point_count(&self) -> usize {
        self.case().map_or(0, |c| c.time_points.len())
    }

    /// The document's current time point, or the first where the case has no such index.
    pub fn time_point(&self, doc: &Document) -> Option<&TimePoint> {
        let case = self.case()?;
        case.time_points.get(doc.nav.time).or_else(|| case.time_points.first())
    }

    /// The image that the slices show, with its id; `None` where none is selected or the current time point lacks it.
    pub fn context(&self, doc: &Document) -> Option<(&str, &Arc<PreparedContext>)> {
        let time_point = self.time_point(doc)?;
        let id = doc.nav.context.as_ref()?;
        let index = time_point.contexts.iter().position(|c| c.id == *id)?;
        let prepared = self.loaded.as_ref()?.contexts.get(doc.nav.time)?.get(index)?;
        Some((time_point.contexts[index].id.as_str(), prepared))
    }

    /// The axes of `of`, as they are now; `None` where nothing is shown, or there is no image.
    pub fn slice_axes(&self, doc: &Document, of: AxesOf) -> Option<SliceAxes> {
        let turn = match of {
            AxesOf::Patient => DMat3::IDENTITY,
            AxesOf::Image => {
                let (id, shown) = self.context(doc)?;
                let first = self.case()?.time_points.first()?.contexts.iter().find(|image| image.id == id);
                axes::of_grid(first.map_or(shown.volume().grid(), |image| image.volume.grid()))
            }
            AxesOf::Tumor => axes::of_selection(&self.time_point(doc)?.index, &self.selection(doc))?,
        };
        Some(SliceAxes { of, turn })
    }

    /// The second image that the slices show; `None` where none is chosen, where the case lacks it, and where it is the
    /// first one.
    pub fn second<'a>(&'a self, doc: &Document) -> Option<Second<'a>> {
        let loaded = self.loaded.as_ref()?;
        let chosen = doc.edit.fusion.second.as_ref()?;
        let time = match &chosen.time {
            Some(label) => loaded.case.time_at(label)?,
            None => doc.nav.time,
        };
        let time_point = loaded.case.time_points.get(time)?;
        let index = time_point.contexts.iter().position(|c| c.id == chosen.id)?;
        let image = loaded.contexts.get(time)?.get(index)?;
        let first = self.context(doc);
        if first.is_some_and(|(_, first)| Arc::ptr_eq(first, image)) {
            return None;
        }
        // An image of the same kind as the first one looks as it does.
        let of_first = first.filter(|(id, _)| *id == chosen.id);
        let window = match of_first {
            Some((id, first)) => doc.window_of(id, first).matched(first.histogram(), image.histogram()),
            // A small hot lesion lies beyond the percentiles of its initial window.
            None => match image.histogram().range() {
                Some((low, high)) if is_pet(&chosen.id) && !doc.edit.windows.contains_key(&chosen.id) => {
                    Window { low: low.max(0.0), high }
                }
                _ => doc.window_of(&chosen.id, image),
            },
        };
        let id = time_point.contexts[index].id.as_str();
        Some(Second { id, time: &time_point.label, image, window })
    }

    /// The regions shown at the current time point.
    pub fn selection(&self, doc: &Document) -> Selection {
        self.time_point(doc).map(|t| doc.edit.selection.at(&t.regions)).unwrap_or_default()
    }

    /// The images of a time point, prepared for slicing, in the order of its contexts.
    pub fn images(&self, time: usize) -> &[Arc<PreparedContext>] {
        self.loaded
            .as_ref()
            .and_then(|loaded| loaded.contexts.get(time))
            .map(Vec::as_slice)
            .unwrap_or_default()
    }

    /// Colours of the masks of the current time point.
    pub fn colors(&self, doc: &Document) -> MaskColors {
        self.time_point(doc)
            .map(|t| colors_of(doc, t))
            .unwrap_or_else(|| MaskColors::new(doc.edit.palette, &[]))
    }

    /// The cropped region volume of the current time point; `None` where no voxel is active.
    pub fn tumor(&self, doc: &Document) -> Option<&Arc<RegionVolume>> {
        self.loaded.as_ref()?.tumors.get(doc.nav.time)?.as_ref()
    }

    /// The case's files as they were read; empty where that isn't known.
    pub fn files(&self) -> &[FileMark] {
        self.loaded.as_ref().map_or(&[], |l| &l.files)
    }

    /// Findings of the checks of the case.
    pub fn checks(&self) -> &[Check] {
        self.case().map_or(&[], |c| &c.checks)
    }
}

/// Results derived from a case, each when a view first needs it.
#[derive(Default)]
pub struct Results {
    /// The image of context and change view as a volume, with its histograms.
    pub image: image::ImageResult,
    /// The comparison of two time points.
    pub comparison: comparison::Comparisons,
    /// The check of the comparison on the case itself.
    pub self_check: self_check::SelfChecks,
    /// The tissue around what the comparison found.
    pub surroundings: surroundings::Looks,
    /// Ellipsoids of all connected components.
    pub ellipsoids: ellipsoids::Ellipsoids,
    /// Fibre tracts as tubes, and the selection for distance queries.
    pub tracts: tracts::TractResult,
    /// Agreement of masks, and voxel counts inside the lens.
    pub numbers: numbers::Numbers,
    /// Metrics of agreement.
    pub agreement: agreement::Agreements,
    /// Lesions over time.
    pub lesions: lesions::Lesions,
    /// Response by criteria.
    pub response: response::Responses,
    /// What is said to a patient.
    pub spoken: spoken::Sayings,
    /// Words of the page that the patient takes home.
    pub page: take_home::Proposals,
    /// Places worth a look.
    pub places: places::Places,
    /// The axial slice as a plane in 3D.
    pub plane: slice_plane::PlaneResult,
    /// The tables of the open cohort.
    pub cohort: cohort::Cohorts,
}

impl Results {
    /// No results yet. `gpu`, where given, may be used for computation where it is faster.
    pub fn new(gpu: Option<Gpu>) -> Self {
        Self { comparison: comparison::Comparisons::new(gpu), ..Self::default() }
    }

    /// Forgets what was derived of a case that is no longer open, so that nothing of it is shown while the new one's is computed; the
    /// cohort stays.
    pub fn forget_case(&mut self, gpu: Option<Gpu>) {
        let cohort = std::mem::take(&mut self.cohort);
        *self = Self { cohort, ..Self::new(gpu) };
    }

    /// Whether a worker is computing a result that pictures wait for.
    pub fn working(&mut self) -> bool {
        // Each takes what is finished.
        self.image.working()
            | self.comparison.working()
            | self.ellipsoids.working()
            | self.tracts.working()
            | self.numbers.working()
            | self.agreement.working()
            | self.spoken.working()
            | self.page.working()
            | self.lesions.working()
            | self.response.working()
            | self.cohort.working()
    }
}

/// Colours of the masks of a time point.
pub fn colors_of(doc: &Document, time_point: &TimePoint) -> MaskColors {
    let masks = time_point.masks.as_slice();
    let preferred: Vec<_> = masks.iter().map(|m| m.color).collect();
    let of_case = MaskColors::new(doc.edit.palette, &preferred);
    let chosen: Vec<_> = masks.iter().map(|m| doc.edit.masks.get(m.mask.id()).color).collect();
    let colors = if chosen.iter().any(Option::is_some) {
        // The other masks keep their colours.
        let all: Vec<_> = chosen.iter().enumerate().map(|(k, own)| own.or(Some(of_case.mask(k)))).collect();
        MaskColors::new(doc.edit.palette, &all)
    } else {
        of_case
    };
    colors.with_coloring(doc.edit.coloring)
}
