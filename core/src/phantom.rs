//! The head phantom: a case made of analytic shapes, so that every volume in it is known.
//!
//! A head with scalp, skull, folded cortex, ventricles, eyes, nose and neck, and a tumour in the
//! **left frontal** lobe (x < 0, y > 0 in RAS+). Left and right differ: the tumour and a compressed
//! left ventricle, and a marker capsule stuck on the **right** forehead. Three images on three
//! grids, three masks on the grids of the images they were drawn on, at two dates:
//!
//! | id | image | mask | grid |
//! |---|---|---|---|
//! | T1 | `T1c` | enhancing tumour with its core, from the second date also a new lesion | LPS, 1×1×1.5 mm |
//! | T2 | `FLAIR` | oedema, with a satellite | tilted by 6°, 1×1×3 mm |
//! | PET | `PET` | hot spot | rotated by 4° and 3°, 3 mm |
//!
//! All seven regions of the three masks have voxels. Between the dates each mask's main body moves
//! single faces of its bounding box by known millimetres: see [`Mark::main_faces_mm`]. Nothing in
//! it shows a real patient. Images have slight noise from a hash: the same on every machine.

mod anatomy;
mod marks;
mod truth;

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use crate::{
    Grid, MaskBits, Progress, Samples, Scaling, Sides, Volume,
    case::{Case, CaseError, CaseSpec, ContextSpec, LoadOptions, MaskSpec, load_with},
    files::{FileError, Loaded, Source},
    grid::ijk,
};

pub use anatomy::Modality;
pub use marks::{Ellipsoid, MARK_IDS, Mark, TIMES, mark};
pub use truth::{MaskTruth, RegionTruth, TimeTruth, Truth, truth};

/// One file of the phantom.
#[derive(Clone, Debug, PartialEq)]
pub struct PhantomFile {
    /// Its file name: `t1c-2024-01-15.nii.gz`.
    pub name: &'static str,
    /// Its id in the case.
    pub id: &'static str,
    /// Its date, one of [`TIMES`].
    pub time: &'static str,
    /// Whether it is a mask; else an image.
    pub is_mask: bool,
    /// Its voxels, `u8`.
    pub volume: Volume,
}

/// Name, id, date index, and modality of the images and masks, in the case's order.
const FILES: [(&str, &str, usize, Modality, bool); 12] = [
    ("t1c-2024-01-15.nii.gz", "T1c", 0, Modality::T1c, false),
    ("flair-2024-01-15.nii.gz", "FLAIR", 0, Modality::Flair, false),
    ("pet-2024-01-15.nii.gz", "PET", 0, Modality::Pet, false),
    ("t1c-2024-04-15.nii.gz", "T1c", 1, Modality::T1c, false),
    ("flair-2024-04-15.nii.gz", "FLAIR", 1, Modality::Flair, false),
    ("pet-2024-04-15.nii.gz", "PET", 1, Modality::Pet, false),
    ("t1-mask-2024-01-15.nii.gz", "T1", 0, Modality::T1c, true),
    ("t2-mask-2024-01-15.nii.gz", "T2", 0, Modality::Flair, true),
    ("pet-mask-2024-01-15.nii.gz", "PET", 0, Modality::Pet, true),
    ("t1-mask-2024-04-15.nii.gz", "T1", 1, Modality::T1c, true),
    ("t2-mask-2024-04-15.nii.gz", "T2", 1, Modality::Flair, true),
    ("pet-mask-2024-04-15.nii.gz", "PET", 1, Modality::Pet, true),
];

/// Name of the phantom's case.
pub const CASE_NAME: &str = "Head phantom";

/// The grid of a modality. Numbers are rounded to `f32`, as a NIfTI header stores them.
fn grid_of(modality: Modality) -> Option<Grid> {
    let (dims, spacing_mm, rotation, center_mm) = match modality {
        Modality::T1c => {
            ([162, 212, 120], DVec3::new(-1.0, -1.0, 1.5), DMat3::IDENTITY, DVec3::new(0.0, 6.5, 1.25))
        }
        Modality::Flair => (
            [164, 216, 62],
            DVec3::new(1.0, 1.0, 3.0),
            DMat3::from_rotation_x(6_f64.to_radians()),
            DVec3::new(0.3, 6.0, 1.0),
        ),
        Modality::Pet => (
            [56, 74, 62],
            DVec3::splat(3.0),
            DMat3::from_rotation_z(4_f64.to_radians()) * DMat3::from_rotation_x(3_f64.to_radians()),
            DVec3::new(0.7, 6.0, 1.0),
        ),
    };
    let round = |v: DVec3| v.as_vec3().as_dvec3();
    let m = rotation * DMat3::from_diagonal(spacing_mm);
    let middle = DVec3::from_array(dims.map(|n: usize| (n - 1) as f64 / 2.0));
    let world_from_voxel = DAffine3 {
        matrix3: DMat3::from_cols(round(m.x_axis), round(m.y_axis), round(m.z_axis)),
        translation: round(center_mm - m * middle),
    };
    Grid::new(dims, world_from_voxel, Sides::Known).ok()
}

/// One value per voxel, slices in parallel; `value` gets the voxel centre in world millimetres.
fn paint(grid: &Grid, value: impl Fn(DVec3) -> f32 + Sync) -> Vec<f32> {
    let [nx, ny, nz] = grid.dims();
    let slices: Vec<Vec<f32>> = (0..nz)
        .into_par_iter()
        .map(|z| {
            let voxels = (0..nx * ny).map(|i| value(grid.center_of_voxel_mm([i % nx, i / nx, z])));
            voxels.collect()
        })
        .collect();
    slices.concat()
}

/// Smooths by [1 2 1]/4 along each axis: the partial volume effect that sharp shapes lack.
fn smooth(values: &mut Vec<f32>, dims: [usize; 3]) {
    let mut stride = 1;
    for n in dims {
        let old = std::mem::take(values);
        let at = |i: usize, along: usize| {
            let before = if along > 0 { old[i - stride] } else { old[i] };
            let after = if along + 1 < n { old[i + stride] } else { old[i] };
            (before + 2.0 * old[i] + after) / 4.0
        };
        *values = (0..old.len()).into_par_iter().map(|i| at(i, i / stride % n)).collect();
        stride *= n;
    }
}

/// -6 or 6 with probability 1/32 each, else 0, from the voxel's linear index and a seed (SplitMix64's
/// finaliser): slight noise that still compresses well.
fn noise(linear: usize, seed: u64) -> f32 {
    let mut h = (linear as u64).wrapping_add(seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    match h >> 59 {
        0 => -6.0,
        1 => 6.0,
        _ => 0.0,
    }
}

fn image(modality: Modality, time: usize) -> Option<Volume> {
    let grid = grid_of(modality)?;
    let marks = [mark("T1", time)?, mark("T2", time)?, mark("PET", time)?];
    let mut values = paint(&grid, |p| anatomy::intensity(modality, &marks, p));
    smooth(&mut values, grid.dims());
    let seed = (time as u64 + 1) << 32 | modality as u64;
    let samples = values.par_iter().enumerate().map(|(linear, &v)| {
        // Air stays 0, and steps of 6 are fine enough: the sample has to stay small.
        if v < 4.0 { 0 } else { ((v + noise(linear, seed)) / 6.0).round().clamp(0.0, 42.0) as u8 * 6 }
    });
    Volume::new(grid, Samples::U8(samples.collect()), modality.scaling())
}

fn mask(id: &str, modality: Modality, time: usize) -> Option<Volume> {
    let grid = grid_of(modality)?;
    let mark = mark(id, time)?;
    let samples = paint(&grid, |p| f32::from(u8::from(mark.contains(p)))).iter().map(|&v| v as u8).collect();
    Volume::new(grid, Samples::U8(samples), Scaling::NONE)
}

/// Every file of the phantom, images before masks, in the order of the case. Takes a second or so.
pub fn phantom() -> Vec<PhantomFile> {
    let make =
        |&(name, id, time, modality, is_mask): &(&'static str, &'static str, usize, Modality, bool)| {
            let volume = if is_mask { mask(id, modality, time) } else { image(modality, time) }?;
            Some(PhantomFile { name, id, time: TIMES[time], is_mask, volume })
        };
    // Each is made on a valid constant grid, so none is missing: a test counts them.
    FILES.iter().filter_map(make).collect()
}

/// The phantom's case, its files located by `source`.
pub fn spec(source: impl Fn(&'static str) -> Source) -> CaseSpec {
    let mut spec = CaseSpec { name: CASE_NAME.into(), ..CaseSpec::default() };
    for &(name, id, time, _, is_mask) in &FILES {
        let (id, source, time) = (id.to_owned(), source(name), Some(TIMES[time].to_owned()));
        if is_mask {
            // No colours of its own: the palette's red, green and blue add up in overlaps.
            spec.masks.push(MaskSpec {
                id,
                source,
                labels: None,
                above: None,
                time,
                color: None,
                name: None,
            });
        } else {
            spec.contexts.push(ContextSpec { id, source, time });
        }
    }
    spec
}

/// The phantom loaded as a case without any file: for tests and benchmarks. The embedded sample
/// ([`crate::sample`]) is the same case, read from its files.
///
/// # Errors
/// As [`crate::case::load`]; none is expected.
pub fn phantom_case() -> Result<Case, CaseError> {
    let files = phantom();
    let read = |source: &Source| {
        let name = source.name();
        let volume = files.iter().find(|f| f.name == name).map(|f| f.volume.clone());
        let missing = || FileError::Wrong {
            file: name,
            found: "no such file in the phantom".into(),
            expected: "one of its files".into(),
        };
        Ok(Loaded { volume: volume.ok_or_else(missing)?, frames: 1, checks: Vec::new(), origin: None })
    };
    let spec = spec(|name| Source::Embedded { name, bytes: &[] });
    load_with(&spec, &LoadOptions::default(), &Progress::new(), &read)
}

/// A mark's voxels on any grid: what a perfect rater would draw there.
pub fn mark_on(mark: &Mark, grid: &Grid) -> MaskBits {
    let dims = grid.dims();
    let center_mm = |l: usize| grid.center_of_voxel_mm(ijk(dims, l));
    MaskBits::from_fn(grid.dims(), |linear| mark.contains(center_mm(linear)))
}

#[cfg(test)]
mod tests;
