//! Truths made by other programs: `truth.json` of the real data.

use std::path::Path;

use glioscope_core::Volume;
use glioscope_core::glam::{DMat4, DVec3};
use serde_json::Value;
use sha2::{Digest, Sha256};

/// The cases of a folder's `truth.json`.
pub fn cases(folder: &Path) -> Vec<(String, Value)> {
    let text = std::fs::read_to_string(folder.join("truth.json")).unwrap();
    let truth: Value = serde_json::from_str(&text).unwrap();
    truth["cases"].as_object().unwrap().iter().map(|(name, case)| (name.clone(), case.clone())).collect()
}

/// A volume with its axes along R, A and S: only permuted and flipped.
pub struct InRas {
    /// Voxels along R, A and S.
    pub dims: [usize; 3],
    /// Millimetres of those voxels.
    pub affine: DMat4,
    /// Linear index in the volume of each of them, R fastest.
    pub order: Vec<usize>,
}

/// The order of a volume's voxels along R, A and S.
pub fn in_ras(volume: &Volume) -> InRas {
    let grid = volume.grid();
    let codes = grid.axis_codes();
    // For each of R, A, S: the voxel axis along it, and whether it is reversed.
    let along = [['R', 'L'], ['A', 'P'], ['S', 'I']].map(|[forward, backward]| {
        let axis = codes.iter().position(|&c| c == forward || c == backward).unwrap();
        (axis, codes[axis] == backward)
    });
    let dims = along.map(|(axis, _)| grid.dims()[axis]);
    let source = |ras: [usize; 3]| {
        let mut ijk = [0; 3];
        for (i, (axis, is_back)) in along.into_iter().enumerate() {
            ijk[axis] = if is_back { dims[i] - 1 - ras[i] } else { ras[i] };
        }
        ijk
    };
    let mut order = Vec::with_capacity(grid.voxel_count());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                order.push(grid.linear(source([x, y, z])));
            }
        }
    }
    let matrix = grid.world_from_voxel().matrix3;
    let column = |i: usize| {
        let (axis, is_back) = along[i];
        (matrix.col(axis) * if is_back { -1.0 } else { 1.0 }).extend(0.0)
    };
    let origin = grid.center_of_voxel_mm(source([0; 3])).extend(1.0);
    InRas { dims, affine: DMat4::from_cols(column(0), column(1), column(2), origin), order }
}

/// SHA-256 in hexadecimal digits.
pub fn sha256(bytes: Vec<u8>) -> String {
    hex(Sha256::digest(bytes))
}

fn hex(digest: impl AsRef<[u8]>) -> String {
    digest.as_ref().iter().map(|b| format!("{b:02x}")).collect()
}

/// What differs from the truth of a volume; `None` where nothing does. `tolerance_mm`: of the affine. Some truths give
/// voxels alone.
pub fn difference(volume: &Volume, truth: &Value, tolerance_mm: f64) -> Option<String> {
    let ours = in_ras(volume);
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let dims: Vec<usize> = list(&truth["ras_dims"]).iter().map(|n| n.as_u64().unwrap() as usize).collect();
    if !dims.is_empty() && dims != ours.dims {
        return Some(format!("dims {:?}, truth {dims:?}", ours.dims));
    }
    for (r, row) in list(&truth["ras_affine"]).iter().enumerate() {
        for (c, value) in row.as_array().unwrap().iter().enumerate() {
            let (mine, theirs) = (ours.affine.col(c)[r], value.as_f64().unwrap());
            if (mine - theirs).abs() > tolerance_mm {
                return Some(format!("affine [{r}][{c}] {mine}, truth {theirs}"));
            }
        }
    }
    if let Some(hash) = truth.get("ras_u8_sha256").and_then(Value::as_str) {
        let bytes: Vec<u8> = ours.order.iter().map(|&at| volume.value(at) as u8).collect();
        if hex(Sha256::digest(&bytes)) != hash {
            let count = bytes.iter().filter(|&&b| b != 0).count();
            return Some(format!("voxels: {count} are set, truth {}", truth["counts"]));
        }
    }
    if let Some(hash) = truth.get("ras_f32le_sha256").and_then(Value::as_str) {
        let values = volume.to_f32();
        let bytes: Vec<u8> = ours.order.iter().flat_map(|&at| values[at].to_le_bytes()).collect();
        if hex(Sha256::digest(&bytes)) != hash {
            for sample in truth["samples"].as_array().into_iter().flatten() {
                let index: Vec<usize> = sample["ras_index"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|n| n.as_u64().unwrap() as usize)
                    .collect();
                let at = ours.order[(index[2] * dims[1] + index[1]) * dims[0] + index[0]];
                let (mine, theirs) = (volume.value(at), sample["value"].as_f64().unwrap());
                if (mine - theirs).abs() > 1e-6 * theirs.abs().max(1.0) {
                    return Some(format!("value {mine} at {index:?}, truth {theirs}"));
                }
            }
            return Some("values".into());
        }
    }
    None
}

/// Largest relative difference of values from the samples of a truth.
pub fn worst_sample(volume: &Volume, truth: &Value) -> f64 {
    let ours = in_ras(volume);
    let samples = truth["samples"].as_array().unwrap();
    samples
        .iter()
        .map(|sample| {
            let index: Vec<usize> = sample["ras_index"]
                .as_array()
                .unwrap()
                .iter()
                .map(|n| n.as_u64().unwrap() as usize)
                .collect();
            let at = ours.order[(index[2] * ours.dims[1] + index[1]) * ours.dims[0] + index[0]];
            let theirs = sample["value"].as_f64().unwrap();
            let place: Vec<f64> =
                sample["ras_mm"].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect();
            let mine = volume.grid().center_of_voxel_mm(volume.grid().ijk(at));
            assert!(mine.abs_diff_eq(DVec3::new(place[0], place[1], place[2]), 1e-3), "{mine} {place:?}");
            (volume.value(at) - theirs).abs() / theirs.abs().max(1e-12)
        })
        .fold(0.0, f64::max)
}
