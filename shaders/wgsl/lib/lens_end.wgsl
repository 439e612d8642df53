// Depth where a ray from `c` leaves the lens, if that cuts; 0 where `c` is outside.
fn leaves_lens(c: vec3<f32>, w: vec3<f32>) -> f32 {
    let off = c - view.lens.xyz;
    let b = dot(off, w);
    let inside = view.lens.w * view.lens.w - dot(off, off);
    let cut = (flags() & (LENS_ON | LENS_ONLY_DRAWN)) == LENS_ON;
    return select(FAR, select(0.0, sqrt(b * b + max(inside, 0.0)) - b, inside > 0.0), cut);
}
