//! The image of the 3D views: volume, histograms and transfer function.

use std::sync::Arc;

use glioscope_render::{
    ContextVolume, GradientHistogram, TransferFunction, TransferPreset, flat::PreparedContext,
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::model::Document;

/// The id of an image and the image.
pub type NamedImage<'a> = (&'a str, &'a Arc<PreparedContext>);

/// Results for the image last shown.
#[derive(Default)]
pub struct ImageResult {
    volume: Derived<Handle<PreparedContext>, ContextVolume>,
    second: Derived<Handle<PreparedContext>, ContextVolume>,
    gradients: Derived<Handle<PreparedContext>, GradientHistogram>,
    transfer: Option<Arc<TransferFunction>>,
}

impl ImageResult {
    /// The image as a volume; `None` without an image.
    pub fn volume(
        &mut self,
        context: Option<NamedImage<'_>>,
        ask: &Ask,
    ) -> Option<Lookup<'_, ContextVolume>> {
        let (_, image) = context?;
        let prepared = image.clone();
        Some(self.volume.get(Handle::of(image), ask, move |progress| {
            progress.say("preparing the image");
            Ok(ContextVolume::of_prepared(&prepared))
        }))
    }

    /// A second image as a volume.
    pub fn second(&mut self, image: &Arc<PreparedContext>, ask: &Ask) -> Lookup<'_, ContextVolume> {
        let prepared = image.clone();
        self.second.get(Handle::of(image), ask, move |progress| {
            progress.say("preparing the second image");
            Ok(ContextVolume::of_prepared(&prepared))
        })
    }

    /// Its voxel counts by value and gradient magnitude.
    pub fn gradients(
        &mut self,
        image: &Arc<PreparedContext>,
        volume: &Arc<ContextVolume>,
        ask: &Ask,
    ) -> Lookup<'_, GradientHistogram> {
        let volume = volume.clone();
        self.gradients.get(Handle::of(image), ask, move |_| Ok(volume.gradient_histogram().clone()))
    }

    /// The transfer function of the image; transparent without one. The `Arc` stays the same while the function does,
    /// so that it isn't uploaded again.
    pub fn transfer(&mut self, doc: &Document, context: Option<NamedImage<'_>>) -> Arc<TransferFunction> {
        let transfer = match context {
            Some((id, image)) => transfer_of(doc, id, image),
            None => TransferFunction::transparent(),
        };
        match &self.transfer {
            Some(cached) if **cached == transfer => cached.clone(),
            _ => self.transfer.insert(Arc::new(transfer)).clone(),
        }
    }

    /// The volume last prepared.
    pub fn last(&self) -> Option<&Arc<ContextVolume>> {
        self.volume.last()
    }

    /// Whether a worker is preparing it.
    pub fn working(&mut self) -> bool {
        self.volume.working() || self.second.working()
    }
}

/// The transfer function of an image: the user's, or the initial preset's.
pub fn transfer_of(doc: &Document, id: &str, image: &PreparedContext) -> TransferFunction {
    let initial = || TransferPreset::first_for(image.histogram(), id).transfer(image.histogram());
    doc.edit.transfers.get(id).cloned().unwrap_or_else(initial)
}
