//! The image of the 3D views: its volume with histograms, and its transfer function.

use std::sync::Arc;

use glioscope_render::{
    ContextVolume, GradientHistogram, TransferFunction, TransferPreset, flat::PreparedContext,
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::model::Document;

/// An image and its id.
pub type Named<'a> = (&'a str, &'a Arc<PreparedContext>);

/// The image last shown.
#[derive(Default)]
pub struct ImageResult {
    volume: Derived<Handle<PreparedContext>, ContextVolume>,
    gradients: Derived<Handle<PreparedContext>, GradientHistogram>,
    transfer: Option<Arc<TransferFunction>>,
}

impl ImageResult {
    /// The image as a volume; `None` where the slices show none.
    pub fn volume(&mut self, context: Option<Named<'_>>, ask: &Ask) -> Option<Lookup<'_, ContextVolume>> {
        let (_, image) = context?;
        let prepared = image.clone();
        Some(self.volume.get(Handle::of(image), ask, move |progress| {
            progress.say("preparing the image");
            Ok(ContextVolume::of_prepared(&prepared))
        }))
    }

    /// How its voxels spread over value and gradient magnitude.
    pub fn gradients(
        &mut self,
        image: &Arc<PreparedContext>,
        volume: &Arc<ContextVolume>,
        ask: &Ask,
    ) -> Lookup<'_, GradientHistogram> {
        let volume = volume.clone();
        self.gradients.get(Handle::of(image), ask, move |_| Ok(volume.gradient_histogram().clone()))
    }

    /// The transfer function of the image: the same `Arc` as long as it is the same function, so that nothing is
    /// uploaded again.
    pub fn transfer(&mut self, doc: &Document, context: Option<Named<'_>>) -> Arc<TransferFunction> {
        let wanted = match context {
            Some((id, image)) => transfer_of(doc, id, image),
            None => TransferFunction::transparent(),
        };
        match &self.transfer {
            Some(have) if **have == wanted => have.clone(),
            _ => self.transfer.insert(Arc::new(wanted)).clone(),
        }
    }

    /// The volume last prepared.
    pub fn last(&self) -> Option<&Arc<ContextVolume>> {
        self.volume.last()
    }

    /// Whether a worker is at it.
    pub fn working(&self) -> bool {
        self.volume.working()
    }
}

/// The user's transfer function of an image, or the one to begin with.
pub fn transfer_of(doc: &Document, id: &str, image: &PreparedContext) -> TransferFunction {
    let first = || TransferPreset::first_for(image.histogram(), id).transfer(image.histogram());
    doc.edit.transfers.get(id).cloned().unwrap_or_else(first)
}
