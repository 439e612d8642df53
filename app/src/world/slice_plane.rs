//! The axial slice as a semi-transparent plane in the 3D views (thesis 7.4).

use std::sync::Arc;

use glioscope_render::{
    SlicePlane,
    flat::{
        ContextLayer, Convention, Plane, PreparedContext, SliceLayers, SliceStyle, SliceView, Window,
        render_slice,
    },
};

use super::{image::NamedImage, jobs::Handle};
use crate::model::Document;

/// Side length of the plane's texture.
const SIDE_PX: u32 = 384;
const OPACITY: f64 = 0.55;

/// Pixels darker than this grey value fade out, as air would only hide the ellipsoids.
const FADE_BELOW: f32 = 56.0;

/// Sets each pixel's alpha by its brightness; 0 outside the image.
fn fade_dark_pixels(rgba: &mut [u8]) {
    for pixel in rgba.chunks_exact_mut(4) {
        let is_outside = pixel[..3] == SliceStyle::DARK.outside;
        let brightest = f32::from(pixel[0].max(pixel[1]).max(pixel[2]));
        let alpha = if is_outside { 0.0 } else { (brightest / FADE_BELOW).min(1.0) };
        pixel[3] = (255.0 * alpha) as u8;
    }
}

/// The plane last rendered, cached until slice, image or window change.
#[derive(Default)]
pub struct PlaneResult {
    cached: Option<(SliceView, Handle<PreparedContext>, Window, SlicePlane)>,
}

impl PlaneResult {
    /// The axial slice through the crosshair; `None` without an image.
    pub fn get(&mut self, doc: &Document, context: Option<NamedImage<'_>>) -> Option<SlicePlane> {
        let (id, image) = context?;
        let window = doc.window_of(id, image);
        let bounds_mm = image.volume().grid().bounds_mm();
        let cursor_mm = doc.nav.crosshair_mm();
        let orientation = (Convention::Radiological, doc.nav.turn_of(Plane::Axial));
        let slice =
            SliceView::fit_turned(Plane::Axial, orientation, bounds_mm, cursor_mm, [SIDE_PX, SIDE_PX]);
        if let Some((cached_slice, cached_image, cached_window, plane)) = &self.cached
            && *cached_slice == slice
            && *cached_image == Handle::of(image)
            && *cached_window == window
        {
            return Some(plane.clone());
        }
        let layers = SliceLayers {
            context: Some(ContextLayer { image, window }),
            second: None,
            masks: None,
            style: SliceStyle::DARK,
        };
        let mut rendered = render_slice(&slice, &layers);
        fade_dark_pixels(&mut rendered.rgba);
        let side_mm = slice.mm_per_pixel * f64::from(SIDE_PX);
        let (right, down) = (slice.right() * side_mm, slice.down() * side_mm);
        let plane = SlicePlane {
            rgba: Arc::new(rendered.rgba),
            size_px: rendered.size,
            corner_mm: slice.center_mm - right / 2.0 - down / 2.0,
            right_mm: right,
            down_mm: down,
            opacity: OPACITY,
        };
        self.cached = Some((slice, Handle::of(image), window, plane.clone()));
        Some(plane)
    }
}
