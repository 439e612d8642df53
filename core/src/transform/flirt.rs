//! Matrices of FSL's FLIRT: four rows from the input (moving) image to the reference (fixed) one, in FSL's own mm:
//! voxel indices times spacing, x counted from the other end where the image is stored right-handed.
//!
//! Sources: `_fsl_aff_adapt` of nitransforms (fsl), `getFSLVoxelToWorldMatrix` of fslpy.

use glam::{DAffine3, DMat3, DVec3};

use super::{ImageGeometry, Refusal, inverse, matrix};

/// The matrix, from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn read(text: &str, fixed: &ImageGeometry, moving: &ImageGeometry) -> Result<DAffine3, Refusal> {
    let fixed_from_moving = matrix::bare(text)?;
    let world_from_fsl = moving.world_from_voxel * inverse(fsl_from_voxel(moving));
    let fsl_from_world = fsl_from_voxel(fixed) * fixed.voxel_from_world();
    Ok(world_from_fsl * inverse(fixed_from_moving) * fsl_from_world)
}

/// The text of a matrix from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn text(moving_from_fixed: DAffine3, fixed: &ImageGeometry, moving: &ImageGeometry) -> String {
    let fsl_from_world = fsl_from_voxel(moving) * moving.voxel_from_world();
    let world_from_fsl = fixed.world_from_voxel * inverse(fsl_from_voxel(fixed));
    matrix::bare_text(inverse(fsl_from_world * moving_from_fixed * world_from_fsl))
}

fn fsl_from_voxel(image: &ImageGeometry) -> DAffine3 {
    let mut scale = image.spacing_mm;
    let mut offset = DVec3::ZERO;
    if image.world_from_voxel.matrix3.determinant() > 0.0 {
        offset.x = (image.dims[0] - 1) as f64 * scale.x;
        scale.x = -scale.x;
    }
    DAffine3 { matrix3: DMat3::from_diagonal(scale), translation: offset }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Format, Given, Images, tests::*};

    /// By nitransforms 25.1.0, `Affine(truth, fixed).to_filename(…, fmt="fsl", moving=moving)`.
    pub(in super::super) const NITRANSFORMS: &str = "\
0.98985246 -0.01187559 -0.14160179 1.85179309
0.03556928 0.98548497 0.16599457 5.28722542
0.13757516 -0.16934680 0.97590714 1.65505497
-0.00000000 -0.00000000 0.00000000 1.00000000
";

    /// By fslpy 3.29.1, `toFlirt(inverse of truth, moving, fixed, "world", "world")`.
    const FSLPY: &str = "\
0.98985242368134507 -0.011875593417549131 -0.14160179229856404 1.8517930938700857
0.035569280609548219 0.98548497189898876 0.16599455798069659 5.2872252704922929
0.13757515065441298 -0.16934680525663892 0.97590710811876824 1.6550549469480274
0 0 0 1
";

    #[test]
    fn matrices_of_nitransforms_and_fslpy_need_both_images_in_their_roles() {
        let given = |images| Given { format: Some(Format::Flirt), images, ..Given::default() };
        let read = |text: &str, images| mapped(text, given(Some(images))).unwrap();
        assert!(difference(read(NITRANSFORMS, images()), truth()) < 3e-6, "it writes 8 digits");
        assert!(difference(read(FSLPY, images()), truth()) < 1e-12);
        let Images { fixed, moving } = images();
        assert!(difference(read(FSLPY, Images { fixed: moving, moving: fixed }), truth()) > 1.0);
        // The flip is that of each image by itself.
        let mut unflipped = images();
        unflipped.fixed.world_from_voxel.matrix3.x_axis *= -1.0;
        assert!(difference(read(FSLPY, unflipped), truth()) > 1.0);
        let error = mapped(FSLPY, given(None)).unwrap_err();
        assert!(error.contains("found FLIRT .mat, without its images"), "{error}");
        let mut flat = images();
        flat.fixed.spacing_mm.y = 0.0;
        assert!(mapped(FSLPY, given(Some(flat))).unwrap_err().contains("a grid of the fixed image without"));
        let mut empty = images();
        empty.moving.dims[0] = 0;
        assert!(
            mapped(FSLPY, given(Some(empty))).unwrap_err().contains("a grid of the moving image without")
        );
    }
}
