//! Real files against nibabel 5.4.2 with NumPy 2.4.6 (22 Nov 2026): dimensions, the sum of all scaled values of the
//! last frame, the same sum weighted by `index * 7919 % 1009` (which detects a wrong voxel order), and the affine
//! where the header sets one. Only these numbers are stored here.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a failed unwrap here is a failed test"
)]

use crate::common::real_data;
use glioscope_core::files::{ReadOptions, Source, read};
use glioscope_core::{Progress, Sides};

struct NibabelResult {
    file: &'static str,
    dims: [usize; 3],
    frames: usize,
    sum: f64,
    weighted: f64,
    affine: Option<[[f64; 4]; 3]>,
}

#[rustfmt::skip]
const NIBABEL_RESULTS: &[NibabelResult] = &[
    NibabelResult { file: "nifti-types/27/float32.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/float64.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/int16.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/int32.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/int64.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/int8.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/uint16.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/uint32.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/uint64.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/27/uint8.nii", dims: [3, 3, 3], frames: 1, sum: 351.0, weighted: 177981.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/5D_small.nii", dims: [1, 2, 3], frames: 3, sum: 1.9867660377640277, weighted: 884.3950844893698, affine: Some([[-6.920585349234898e-08, -0.0016480153426527977, 0.9999986290931702, -87.89346313476562], [-0.9917474985122681, 0.12820644676685333, 0.0002112178481183946, 147.39846801757812], [0.12820661067962646, 0.9917461276054382, 0.0016344239702448249, -120.61727905273438]]) },
    NibabelResult { file: "nifti-types/air.hdr.gz", dims: [79, 67, 64], frames: 1, sum: 11398461.247137904, weighted: 5743403447.880084, affine: Some([[0.0, -0.0, 2.3852322101593018, -75.76253509521484], [2.389753818511963, -0.0, 0.0, -110.76253509521484], [0.0, -2.3664863109588623, 0.0, 84.4255599975586]]) },
    NibabelResult { file: "nifti-types/avg152T1_LR_nifti.nii.gz", dims: [91, 109, 91], frames: 1, sum: 74825382.0, weighted: 37705167729.0, affine: Some([[-2.0, 0.0, 0.0, 90.0], [0.0, 2.0, 0.0, -126.0], [0.0, 0.0, 2.0, -72.0]]) },
    NibabelResult { file: "nifti-types/avg152T1_LR_nifti2.nii.gz", dims: [91, 109, 91], frames: 1, sum: 74825382.0, weighted: 37705167729.0, affine: Some([[-2.0, 0.0, 0.0, 90.0], [0.0, 2.0, 0.0, -126.0], [0.0, 0.0, 2.0, -72.0]]) },
    NibabelResult { file: "nifti-types/big.nii.gz", dims: [64, 64, 21], frames: 1, sum: 11648.372022011292, weighted: 5835908.485953538, affine: Some([[-4.0, 0.0, 0.0, 0.0], [0.0, 4.0, 0.0, 0.0], [0.0, 0.0, 6.0, 0.0]]) },
    NibabelResult { file: "nifti-types/f32.nii.gz", dims: [11, 11, 11], frames: 1, sum: 166.00000071525574, weighted: 79707.80039954185, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/little.nii.gz", dims: [64, 64, 21], frames: 1, sum: 11648.372022011292, weighted: 5835908.485953538, affine: Some([[-4.0, 0.0, 0.0, 0.0], [0.0, 4.0, 0.0, 0.0], [0.0, 0.0, 6.0, 0.0]]) },
    NibabelResult { file: "nifti-types/minimal.hdr", dims: [64, 64, 10], frames: 1, sum: 1290240.0, weighted: 650238104.0, affine: None },
    NibabelResult { file: "nifti-types/minimal.hdr.gz", dims: [64, 64, 10], frames: 1, sum: 1290240.0, weighted: 650238104.0, affine: None },
    NibabelResult { file: "nifti-types/minimal.nii", dims: [64, 64, 10], frames: 1, sum: 1290240.0, weighted: 650238104.0, affine: None },
    NibabelResult { file: "nifti-types/minimal.nii.gz", dims: [64, 64, 10], frames: 1, sum: 1290240.0, weighted: 650238104.0, affine: None },
    NibabelResult { file: "nifti-types/minimal_extended_hdr.nii", dims: [8, 8, 1], frames: 1, sum: 0.0, weighted: 0.0, affine: Some([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "nifti-types/multi-member-gzip.nii.gz", dims: [64, 64, 10], frames: 1, sum: 1290240.0, weighted: 650238104.0, affine: None },
    NibabelResult { file: "nifti-types/with_extension.nii.gz", dims: [161, 191, 151], frames: 1, sum: 1472871.0, weighted: 742407681.0, affine: Some([[-1.0, 0.0, -0.0, 80.0], [0.0, -1.0, -0.0, 80.0], [0.0, 0.0, -1.0, 85.0]]) },
    NibabelResult { file: "nifti-types/zstat1.nii.gz", dims: [64, 64, 21], frames: 1, sum: 11648.372022011292, weighted: 5835908.485953538, affine: Some([[-4.0, 0.0, 0.0, 0.0], [0.0, 4.0, 0.0, 0.0], [0.0, 0.0, 6.0, 0.0]]) },
    NibabelResult { file: "sarcoma-ct-mr-pet/CT_image.nii.gz", dims: [154, 158, 51], frames: 1, sum: -270207471.0, weighted: -136199933118.0, affine: Some([[-0.9765620231628418, 0.0, 0.0, 129.88287353515625], [0.0, -0.9765620231628418, 0.0, 3.9063758850097656], [0.0, 0.0, 3.2699999809265137, -849.3200073242188]]) },
    NibabelResult { file: "sarcoma-ct-mr-pet/CT_mask.nii.gz", dims: [154, 158, 51], frames: 1, sum: 25693.0, weighted: 12953487.0, affine: Some([[-0.9765620231628418, 0.0, 0.0, 129.88287353515625], [0.0, -0.9765620231628418, 0.0, 3.9063758850097656], [0.0, 0.0, 3.2699999809265137, -849.3200073242188]]) },
    NibabelResult { file: "sarcoma-ct-mr-pet/MR_T1_image.nii.gz", dims: [121, 138, 47], frames: 1, sum: 362958960.0, weighted: 182952248360.0, affine: Some([[-0.9765620231628418, 0.0, 0.0, 111.32818603515625], [0.0, -0.9765620231628418, 0.0, -15.6248779296875], [0.0, 0.0, 3.2699549198150635, -839.5046997070312]]) },
    NibabelResult { file: "sarcoma-ct-mr-pet/MR_T1_mask.nii.gz", dims: [121, 138, 47], frames: 1, sum: 25693.0, weighted: 12957686.0, affine: Some([[-0.9765620231628418, 0.0, 0.0, 111.32818603515625], [0.0, -0.9765620231628418, 0.0, -15.6248779296875], [0.0, 0.0, 3.2699549198150635, -839.5046997070312]]) },
    NibabelResult { file: "sarcoma-ct-mr-pet/PET_image.nii.gz", dims: [29, 30, 51], frames: 1, sum: 27702.46773372242, weighted: 13973933.782724028, affine: Some([[-5.46875, 0.0, 0.0, 133.984375], [0.0, -5.46875, 0.0, 8.203120231628418], [0.0, 0.0, 3.2699999809265137, -849.2999877929688]]) },
    NibabelResult { file: "sarcoma-ct-mr-pet/PET_mask.nii.gz", dims: [29, 30, 51], frames: 1, sum: 817.0, weighted: 413255.0, affine: Some([[-5.46875, 0.0, 0.0, 133.984375], [0.0, -5.46875, 0.0, 8.203120231628418], [0.0, 0.0, 3.2699999809265137, -849.2999877929688]]) },
    NibabelResult { file: "glioma-5-algorithms/consensus.nii.gz", dims: [240, 240, 155], frames: 1, sum: 71561.0, weighted: 36115710.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/fla.nii.gz", dims: [240, 240, 155], frames: 1, sum: 298943405.0, weighted: 150678633942.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/hnfnetv1-20.nii.gz", dims: [240, 240, 155], frames: 1, sum: 69178.0, weighted: 34914755.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/isen-20.nii.gz", dims: [240, 240, 155], frames: 1, sum: 84665.0, weighted: 42664056.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/sanet0-20.nii.gz", dims: [240, 240, 155], frames: 1, sum: 70107.0, weighted: 35386971.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/scan-20.nii.gz", dims: [240, 240, 155], frames: 1, sum: 60419.0, weighted: 30432795.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/t1.nii.gz", dims: [240, 240, 155], frames: 1, sum: 407113260.0, weighted: 205177594514.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/t1c.nii.gz", dims: [240, 240, 155], frames: 1, sum: 503779755.0, weighted: 253916526552.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/t2.nii.gz", dims: [240, 240, 155], frames: 1, sum: 582957038.0, weighted: 293816559809.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "glioma-5-algorithms/yixinmpl-20.nii.gz", dims: [240, 240, 155], frames: 1, sum: 81128.0, weighted: 40917714.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, 239.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "masks-degenerate/disconnected_mask.nii.gz", dims: [8, 8, 8], frames: 1, sum: 3.0, weighted: 1318.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, -0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "masks-degenerate/empty_mask.nii.gz", dims: [8, 8, 8], frames: 1, sum: 0.0, weighted: 0.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, -0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "masks-degenerate/full_mask.nii.gz", dims: [8, 8, 8], frames: 1, sum: 512.0, weighted: 257980.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, -0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "masks-degenerate/one_voxel_mask.nii.gz", dims: [8, 8, 8], frames: 1, sum: 1.0, weighted: 799.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, -0.0], [0.0, 0.0, 1.0, 0.0]]) },
    NibabelResult { file: "masks-degenerate/uninformative.nii.gz", dims: [8, 8, 8], frames: 1, sum: 512.0, weighted: 257980.0, affine: Some([[-1.0, 0.0, 0.0, -0.0], [0.0, -1.0, 0.0, -0.0], [0.0, 0.0, 1.0, 0.0]]) },
];

#[test]
fn dimensions_values_and_affines_match_nibabel() {
    let Some(root) = real_data("") else { return };
    for expected in NIBABEL_RESULTS {
        let options = ReadOptions { frame: expected.frames - 1, ..ReadOptions::default() };
        let loaded = read(&Source::File(root.join(expected.file)), &options, &Progress::new()).unwrap();
        let volume = &loaded.volume;
        assert_eq!(
            (volume.grid().dims(), loaded.frames),
            (expected.dims, expected.frames),
            "{}",
            expected.file
        );
        let (mut sum, mut weighted, mut magnitude) = (0.0, 0.0, 0.0);
        for i in 0..volume.samples().len() {
            let value = volume.value(i);
            let weight = (i * 7919 % 1009) as f64;
            sum += value;
            weighted += value * weight;
            magnitude += value.abs() * weight.max(1.0);
        }
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-11 * magnitude;
        assert!(near(sum, expected.sum), "{}: sum {sum}, nibabel {}", expected.file, expected.sum);
        assert!(
            near(weighted, expected.weighted),
            "{}: {weighted}, nibabel {}",
            expected.file,
            expected.weighted
        );
        let Some(rows) = expected.affine else {
            assert_eq!(volume.grid().sides(), Sides::Unknown, "{}", expected.file);
            assert!(crate::common::codes(&loaded).contains(&"side-unknown"));
            continue;
        };
        assert_eq!(volume.grid().sides(), Sides::Known, "{}", expected.file);
        let matrix = volume.grid().world_from_voxel();
        for (r, row) in rows.iter().enumerate() {
            for (c, &expected_entry) in row.iter().enumerate() {
                let ours = if c < 3 { matrix.matrix3.col(c)[r] } else { matrix.translation[r] };
                assert!(
                    (ours - expected_entry).abs() < 1e-6,
                    "{}: row {r}, column {c}: {ours}, {expected_entry}",
                    expected.file
                );
            }
        }
    }
}
