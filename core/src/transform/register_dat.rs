//! Registration files of FreeSurfer's tkregister: subject, in-plane spacing, spacing between slices, intensity, and a
//! matrix from the target (fixed) to the moving image, both in tkregister's RAS: axes along those of the voxels as if
//! every image were coronal, origin in the middle.
//!
//! Sources: FreeSurfer's `regio_read_register` (`utils/registerio`), `MRIxfmCRS2XYZtkreg` (`utils/mri`), and the
//! comment of `ltaReadRegisterDat` (`utils/transform`): "the registration matrix actually does from ref to mov".

use glam::{DAffine3, DMat3, DVec3};

use super::{ImageGeometry, Refusal, inverse, matrix};

const EXPECTED: &str = "subject, spacings, intensity and a 4x4 matrix, a line each";

/// Whether a text is a registration file.
pub(super) fn is_one(text: &str) -> bool {
    rows(text).is_some()
}

/// The matrix, from RAS mm of the fixed image to RAS mm of the moving one.
pub(super) fn read(text: &str, fixed: &ImageGeometry, moving: &ImageGeometry) -> Result<DAffine3, Refusal> {
    let rows = rows(text).ok_or_else(|| Refusal::new("another text", EXPECTED))?;
    let moving_from_fixed = matrix::affine(&rows)?;
    let world_from_tk = moving.world_from_voxel * inverse(tk_from_voxel(moving));
    let tk_from_world = tk_from_voxel(fixed) * fixed.voxel_from_world();
    Ok(world_from_tk * moving_from_fixed * tk_from_world)
}

/// The text of a matrix from RAS mm of the fixed image to RAS mm of the moving one. The subject, which FreeSurfer's programs
/// take from their own options, is unknown.
pub(super) fn text(moving_from_fixed: DAffine3, fixed: &ImageGeometry, moving: &ImageGeometry) -> String {
    let tk_from_world = tk_from_voxel(moving) * moving.voxel_from_world();
    let world_from_tk = fixed.world_from_voxel * inverse(tk_from_voxel(fixed));
    let stored = tk_from_world * moving_from_fixed * world_from_tk;
    let [in_plane_mm, _, between_mm] = moving.spacing_mm.to_array();
    format!("unknown\n{in_plane_mm}\n{between_mm}\n0.15\n{}round\n", matrix::bare_text(stored))
}

/// What follows the matrix only says how old versions round.
fn rows(text: &str) -> Option<[[f64; 4]; 4]> {
    let mut lines = text.lines().map(str::trim);
    let subject = lines.next()?;
    if subject.is_empty() {
        return None;
    }
    for _ in 0..3 {
        matrix::numbers::<1>(lines.next()?)?;
    }
    let mut row = || matrix::numbers::<4>(lines.next()?);
    Some([row()?, row()?, row()?, row()?])
}

fn tk_from_voxel(image: &ImageGeometry) -> DAffine3 {
    let [dx, dy, dz] = image.spacing_mm.to_array();
    let [nx, ny, nz] = image.dims.map(|n| n as f64);
    DAffine3 {
        matrix3: DMat3::from_cols(
            DVec3::new(-dx, 0.0, 0.0),
            DVec3::new(0.0, 0.0, -dy),
            DVec3::new(0.0, dz, 0.0),
        ),
        translation: DVec3::new(nx * dx, -nz * dz, ny * dy) / 2.0,
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::{Given, inverse, matrix, tests::*};

    /// As FreeSurfer writes it; the matrix by nibabel 5.4.2: `tkr(moving) inv(affine(moving)) truth affine(fixed)
    /// inv(tkr(fixed))`, where `tkr` is `MGHHeader.get_vox2ras_tkr`.
    pub(in super::super) const REGISTER_DAT: &str = "\
bert
2.5
2.0
0.15
-0.989852505892 -0.137575168085 0.035569290176 2.330174280468
-0.141601797353 0.975907191153 -0.165994573081 7.084392022473
0.011875588281 0.169346806235 0.985484987336 12.397542486939
0.000000000000 0.000000000000 0.000000000000 1.000000000000
round
";

    #[test]
    fn matrices_of_tkregister_need_both_images() {
        let given = |images| Given { images, ..Given::default() };
        let read = mapped(REGISTER_DAT, given(Some(images()))).unwrap();
        assert!(difference(read, truth()) < 1e-6, "the images' headers are in single precision");
        assert!(mapped(REGISTER_DAT, given(None)).unwrap_err().contains("without its images"));
    }

    #[test]
    fn tkregisters_space_is_that_of_freesurfers_own_library() {
        // By surfa 0.6.3 (FreeSurfer's), `Affine(inverse of truth, source=moving, target=fixed,
        // space="world").convert(space="surf").matrix`: from the moving to the fixed image.
        let surfa = rows([
            [-0.98985242, -0.14160179, 0.01187559, 3.16246309],
            [-0.13757515, 0.97590711, 0.16934681, -8.69261867],
            [0.03556928, -0.16599456, 0.98548497, -11.12450391],
        ]);
        let stored = matrix::affine(&super::rows(REGISTER_DAT).unwrap()).unwrap();
        assert!(difference(stored, inverse(surfa)) < 1e-6);
    }
}
