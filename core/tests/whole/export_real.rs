//! Surfaces of real masks: closed, with the volume of their voxels, and as many faces as NumPy counts.

use std::collections::HashMap;

use crate::common::{read, real_data};
use glioscope_core::export::{Mesh, SurfaceKind, mesh};
use glioscope_core::{Mask, MaskBits, Progress};

/// Masks and their faces towards the background: `numpy.abs(numpy.diff(numpy.pad(mask, 1), axis=a)).sum()` over
/// the axes.
const FACES: [(&str, &[(&str, usize)]); 2] = [
    (
        "glioma-5-algorithms",
        &[
            ("hnfnetv1-20", 11_184),
            ("isen-20", 15_880),
            ("sanet0-20", 10_510),
            ("scan-20", 8_300),
            ("yixinmpl-20", 14_522),
            ("consensus", 12_386),
        ],
    ),
    ("sarcoma-ct-mr-pet", &[("CT_mask", 7_560), ("MR_T1_mask", 7_560), ("PET_mask", 686)]),
];

/// Whether each edge is used equally often in both directions.
fn is_closed(mesh: &Mesh) -> bool {
    let mut balance = HashMap::<[u32; 2], i32>::new();
    for &[a, b, c] in mesh.triangles() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *balance.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
        }
    }
    balance.values().all(|&n| n == 0)
}

#[test]
fn surfaces_of_real_masks_are_closed_and_keep_the_volume() {
    for (folder, masks) in FACES {
        let Some(folder) = real_data(folder) else { continue };
        for &(name, faces) in masks {
            let volume = read(&folder.join(format!("{name}.nii.gz"))).unwrap().volume;
            let grid = volume.grid().clone();
            let bits = MaskBits::from_fn(grid.dims(), |linear| volume.value(linear) > 0.5);
            let mask = Mask::new(name, grid, bits).unwrap();
            for kind in [SurfaceKind::VoxelFaces, SurfaceKind::Smoothed] {
                let surface = mesh(&mask, kind, &Progress::new()).unwrap();
                assert!(is_closed(&surface), "{name} {kind:?}");
                assert_eq!(surface.triangles().len(), 2 * faces, "{name}");
                let error = surface.volume_mm3() / (1000.0 * mask.volume_ml()) - 1.0;
                assert!(error.abs() < 1e-12, "{name} {kind:?}: {error}");
            }
        }
    }
}
