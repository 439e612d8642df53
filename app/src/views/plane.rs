//! The axial slice as a semi-transparent plane in the 3D views (thesis 7.4).

use std::sync::Arc;

use glioscope_render::{
    SlicePlane,
    slices::{
        ContextLayer, Convention, Plane, PreparedContext, SliceLayers, SliceStyle, SliceView, Window,
        render_slice,
    },
};

use super::{Handle, ViewContext, slices};

/// Pixels along the plane's sides.
const SIDE_PX: u32 = 384;
const OPACITY: f64 = 0.55;

/// The plane last made: made again when slice, image or window changed.
#[derive(Default)]
pub struct PlaneState {
    made: Option<(SliceView, Handle<PreparedContext>, Window, SlicePlane)>,
}

impl PlaneState {
    /// The axial slice through the crosshair; `None` without an image.
    pub fn get(&mut self, view: &ViewContext<'_>) -> Option<SlicePlane> {
        let (id, image) = view.context?;
        let window = slices::window_of(view, id, image);
        let bounds_mm = image.volume().grid().bounds_mm();
        let cursor_mm = view.doc.nav.cursor_mm;
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
        let picture = render_slice(&slice, &layers);
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
