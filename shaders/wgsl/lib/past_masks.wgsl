// Whether the shown masks let light through. After lib/first_shown.
#include lib/index_space

// From a place towards a light, both in camera space, before `end`. `starts_inside`: the voxels that it starts in don't count.
fn is_lit_past_masks(c: vec3<f32>, w: vec3<f32>, end: f32, starts_inside: bool) -> bool {
    let ray = ray_from(place_in_index_space(c), in_index_space(w));
    // What is behind the eye's plane casts no shadow, as it isn't drawn.
    let to_eye = select(FAR, (view.nearest_mm - c.z) / select(-1.0, w.z, w.z < 0.0), w.z < 0.0);
    return first_shown(ray, 0.0, min(end, to_eye), starts_inside) >= FAR;
}
