//! What is alive: the loaded case and what is derived from it. Never saved.

pub mod comparison;
pub mod ellipsoids;
pub mod image;
pub mod jobs;
pub mod load;
pub mod numbers;
pub mod slice_plane;
pub mod tracts;

use std::sync::Arc;

use glioscope_core::{
    Check, RegionVolume,
    case::{Case, TimePoint},
};
use glioscope_render::{Gpu, MaskColors, flat::PreparedContext};

use crate::model::Document;

/// A case and what every view needs of it, made once per load.
pub struct Loaded {
    /// The case.
    pub case: Arc<Case>,
    /// Images ready to slice, in the order of each time point's contexts.
    contexts: Vec<Vec<Arc<PreparedContext>>>,
    /// Cropped regions of each time point; `None` where no voxel is active.
    tumors: Vec<Option<Arc<RegionVolume>>>,
}

impl Loaded {
    /// Derives what views need.
    pub fn new(case: Case) -> Self {
        let contexts = case
            .time_points
            .iter()
            .map(|t| t.contexts.iter().map(|c| Arc::new(PreparedContext::new(c.volume.clone()))).collect())
            .collect();
        let tumors =
            case.time_points.iter().map(|t| RegionVolume::of(&t.index, &t.regions).map(Arc::new)).collect();
        Self { case: Arc::new(case), contexts, tumors }
    }
}

/// The loaded case.
#[derive(Default)]
pub struct World {
    loaded: Option<Loaded>,
}

impl World {
    /// A world with a case in it.
    pub fn new(loaded: Loaded) -> Self {
        Self { loaded: Some(loaded) }
    }

    /// The case.
    pub fn case(&self) -> Option<&Arc<Case>> {
        self.loaded.as_ref().map(|l| &l.case)
    }

    /// Number of dates.
    pub fn time_point_count(&self) -> usize {
        self.case().map_or(0, |c| c.time_points.len())
    }

    /// The date the document looks at.
    pub fn time_point(&self, doc: &Document) -> Option<&TimePoint> {
        let case = self.case()?;
        case.time_points.get(doc.nav.time).or_else(|| case.time_points.first())
    }

    /// The image that the slices show.
    pub fn context(&self, doc: &Document) -> Option<(&str, &Arc<PreparedContext>)> {
        let time_point = self.time_point(doc)?;
        let id = doc.nav.context.as_ref()?;
        let at = time_point.contexts.iter().position(|c| c.id == *id)?;
        let prepared = self.loaded.as_ref()?.contexts.get(doc.nav.time)?.get(at)?;
        Some((time_point.contexts[at].id.as_str(), prepared))
    }

    /// Colours of the masks of the current date.
    pub fn colors(&self, doc: &Document) -> MaskColors {
        let asked: Vec<_> =
            self.time_point(doc).map(|t| t.masks.iter().map(|m| m.color).collect()).unwrap_or_default();
        MaskColors::new(doc.edit.palette, &asked).with_coloring(doc.edit.coloring)
    }

    /// The regions of the current date, cropped; `None` where no voxel is active.
    pub fn tumor(&self, doc: &Document) -> Option<&Arc<RegionVolume>> {
        self.loaded.as_ref()?.tumors.get(doc.nav.time)?.as_ref()
    }

    /// Everything noticed about the case.
    pub fn checks(&self) -> &[Check] {
        self.case().map_or(&[], |c| &c.checks)
    }
}

/// Everything that is derived from a case when a view first needs it.
#[derive(Default)]
pub struct Results {
    /// The image of context and change view, with its histograms.
    pub image: image::ImageResult,
    /// The comparison of two dates.
    pub comparison: comparison::Comparisons,
    /// Ellipsoids of all components.
    pub ellipsoids: ellipsoids::Ellipsoids,
    /// Fibre tracts as tubes, and their distances.
    pub tracts: tracts::TractResult,
    /// Agreement of masks, and what is in the lens.
    pub numbers: numbers::Numbers,
    /// The axial slice as a plane in 3D.
    pub plane: slice_plane::PlaneResult,
}

impl Results {
    /// Nothing yet. `gpu` may compute where it is faster.
    pub fn new(gpu: Option<Gpu>) -> Self {
        Self { comparison: comparison::Comparisons::new(gpu), ..Self::default() }
    }

    /// Whether a worker is at something that a picture waits for.
    pub fn working(&self) -> bool {
        self.image.working()
            || self.comparison.working()
            || self.ellipsoids.working()
            || self.tracts.working()
            || self.numbers.working()
    }
}
