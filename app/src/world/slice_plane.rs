//! The axial slice as a semi-transparent plane in the 3D views (thesis 7.4).

use std::sync::Arc;

use glioscope_render::{
    SlicePlane,
    flat::{
        ContextLayer, Convention, Plane, PreparedContext, SliceLayers, SliceStyle, SliceView, Window,
        render_slice,
    },
};

use super::{image::Named, jobs::Handle};
use crate::model::Document;

/// Pixels along the plane's sides.
const SIDE_PX: u32 = 384;
const OPACITY: f64 = 0.55;

/// Greys below this fade out: air and what is outside the image would only hide the ellipsoids.
const FAINTEST: f32 = 56.0;

/// Gives each pixel an opacity by its brightness.
fn clear_air(rgba: &mut [u8]) {
    for pixel in rgba.chunks_exact_mut(4) {
        let is_outside = pixel[..3] == SliceStyle::DARK.outside;
        let brightest = f32::from(pixel[0].max(pixel[1]).max(pixel[2]));
        let share = if is_outside { 0.0 } else { (brightest / FAINTEST).min(1.0) };
        pixel[3] = (255.0 * share) as u8;
    }
}

/// The plane last made: made again when slice, image or window changed.
#[derive(Default)]
pub struct PlaneResult {
    made: Option<(SliceView, Handle<PreparedContext>, Window, SlicePlane)>,
}

impl PlaneResult {
    /// The axial slice through the crosshair; `None` without an image.
    pub fn get(&mut self, doc: &Document, context: Option<Named<'_>>) -> Option<SlicePlane> {
        let (id, image) = context?;
        let window = doc.window_of(id, image);
        let bounds_mm = image.volume().grid().bounds_mm();
        let cursor_mm = doc.nav.cursor_mm;
        let slice =
            SliceView::fit(Plane::Axial, Convention::Radiological, bounds_mm, cursor_mm, [SIDE_PX, SIDE_PX]);
        if let Some((at, of, with, plane)) = &self.made
            && *at == slice
            && *of == Handle::of(image)
            && *with == window
        {
            return Some(plane.clone());
        }
        let layers = SliceLayers {
            context: Some(ContextLayer { image, window }),
            masks: None,
            style: SliceStyle::DARK,
        };
        let mut picture = render_slice(&slice, &layers);
        clear_air(&mut picture.rgba);
        let side_mm = slice.mm_per_pixel * f64::from(SIDE_PX);
        let (right, down) = (slice.right() * side_mm, slice.down() * side_mm);
        let plane = SlicePlane {
            rgba: Arc::new(picture.rgba),
            size_px: picture.size,
            corner_mm: slice.center_mm - right / 2.0 - down / 2.0,
            right_mm: right,
            down_mm: down,
            opacity: OPACITY,
        };
        self.made = Some((slice, Handle::of(image), window, plane.clone()));
        Some(plane)
    }
}
