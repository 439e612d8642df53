//! Large inputs: cubes of 512³ voxels, and many components.

use super::{all, index_of, random, unit_grid};
use crate::{
    Connectivity, MaskBits,
    components::Components,
    ellipsoid::{Of, Options, enclose, hull_corners},
};

#[test]
fn a_full_cube_of_512() {
    let found = all(&index_of(&unit_grid([512; 3]), &[MaskBits::full([512; 3])]));
    assert_eq!(found.len(), 2);
    for c in found {
        assert_eq!(c.voxels, 512 * 512 * 512);
        assert!((c.enclosing.semi_axes_mm / (256.0 * 3_f64.sqrt())).distance(glam::DVec3::ONE) < 1e-9);
    }
}

#[test]
fn a_cube_of_512_missing_one_voxel_uses_the_solver() {
    let mut bits = MaskBits::full([512; 3]);
    bits.words_mut()[(200 * 512 + 100) * 8] &= !(1 << 7);
    let components = Components::of_mask(&bits, Connectivity::default()).unwrap();
    let component = &components.list()[0];
    let found =
        enclose(&hull_corners(components.runs(component), component.start), &Options::default()).unwrap();
    let expected = glam::DVec3::splat(256.0 * 3_f64.sqrt());
    let found_axes = glam::DVec3::new(found.shape.x_axis.x, found.shape.y_axis.y, found.shape.z_axis.z);
    assert!((found_axes / expected).distance(glam::DVec3::ONE) < 1e-7);
}

#[test]
fn thirty_one_thousand_small_components() {
    // 2 % of 128³ at random: about 31,800 components of one or a few voxels.
    let mut state = 9;
    let bits = MaskBits::from_fn([128; 3], |_| random(&mut state).is_multiple_of(50));
    let found = all(&index_of(&unit_grid([128; 3]), &[bits]));
    let masks = found.iter().filter(|c| c.of == Of::Mask(0)).count();
    assert!(masks > 28_000 && found.len() == 2 * masks, "{masks}");
    assert!(found.iter().all(|c| c.volume_bound <= 1.0 + 1e-7));
}
