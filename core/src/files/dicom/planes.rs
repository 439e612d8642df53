//! The slices of images on which segmentations and contours are placed.

use std::collections::BTreeMap;

use glam::DVec3;

use super::super::FileError;
use super::data_set::Unusable;
use super::instance::Place;
use super::scan::{Header, Kind};
use super::series::Series;
use super::stack;
use crate::Grid;

/// The slices of one volume of an image.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    pub first: Place,
    pub step_mm: DVec3,
    pub dims: [usize; 3],
    /// Series Instance UID of the image; empty for slices made up for a mask.
    pub series: String,
}

impl Planes {
    pub fn grid(&self) -> Result<Grid, Unusable> {
        stack::grid(self.dims, &self.first, self.step_mm)
    }

    /// Voxel coordinates (column, row, slice) of a point in LPS millimetres.
    pub fn voxel(&self, point_mm: DVec3) -> DVec3 {
        let Place { position_mm, along_row, along_column, pixel_spacing_mm, .. } = self.first;
        let columns = [along_row * pixel_spacing_mm[1], along_column * pixel_spacing_mm[0], self.step_mm];
        let matrix = glam::DMat3::from_cols(columns[0], columns[1], columns[2]);
        matrix.inverse() * (point_mm - position_mm)
    }
}

/// The images among `headers` in the frame of reference `uid` of the patient of `own`, largest first.
pub(super) fn in_frame_of_reference(own: &Header, headers: &[Header], uid: &str) -> Vec<Planes> {
    let mut series: BTreeMap<&str, Vec<&Header>> = BTreeMap::new();
    let is_wanted = |h: &&Header| {
        let is_there = h.identity.frame_of_reference == uid && !uid.is_empty();
        h.kind == Kind::Image && is_there && !is_other_patient(own, h)
    };
    for header in headers.iter().filter(is_wanted) {
        series.entry(&header.identity.series).or_default().push(header);
    }
    let mut all = Vec::new();
    for (uid, files) in series {
        // What can't be opened as an image is no place for a mask either.
        let Ok(series) = Series::of(files, uid) else { continue };
        for stack in series.stacks.iter().filter(|stack| !stack.is_localizer) {
            if let Ok(step) = &stack.step {
                let (first, dims) = (stack.first, stack.dims);
                all.push(Planes { first, step_mm: step.step_mm, dims, series: uid.to_owned() });
            }
        }
    }
    all.sort_by_key(|planes| std::cmp::Reverse(planes.dims[2]));
    all
}

fn is_other_patient(a: &Header, b: &Header) -> bool {
    a.origin().is_other_patient(&b.origin())
}

/// Refuses a mask whose images are another patient's, or in another frame of reference. `referenced`: the SOP Instance
/// UIDs that the mask names.
pub(super) fn refuse_strangers(
    own: &Header,
    frame_of_reference: &str,
    referenced: &[String],
    headers: &[Header],
) -> Result<(), FileError> {
    let images = || headers.iter().filter(|header| header.kind == Kind::Image);
    let is_in_same_place = |image: &Header| image.identity.frame_of_reference == frame_of_reference;
    let has_own = images().any(|image| is_in_same_place(image) && !is_other_patient(own, image));
    for image in images() {
        let is_referenced = referenced.contains(&image.identity.sop_instance);
        let is_in_same_place = is_in_same_place(image);
        // A stranger's image beside the patient's own is left aside.
        if !is_referenced && (!is_in_same_place || has_own) {
            continue;
        }
        let wrong = |found: &str, expected: &str| {
            Err(FileError::wrong(own.name(), format!("{found} of its image {}", image.name()), expected))
        };
        if is_other_patient(own, image) {
            return wrong("another patient than that", "one patient");
        }
        if is_referenced && !is_in_same_place && !image.identity.frame_of_reference.is_empty() {
            return wrong(
                "another frame of reference than that",
                "one frame of reference, or a registration",
            );
        }
    }
    Ok(())
}
