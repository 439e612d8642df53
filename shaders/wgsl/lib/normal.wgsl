// Normals of the visible surface, one per pixel: unit vectors in camera space, octahedral (Cigolle et al. 2014), 16 bits
// each.

fn packed_normal(n: vec3<f32>) -> u32 {
    let p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    let folded = (1.0 - abs(p.yx)) * select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return pack2x16snorm(select(p, folded, n.z < 0.0));
}

fn unpacked_normal(packed: u32) -> vec3<f32> {
    let p = unpack2x16snorm(packed);
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (1.0 - abs(p.yx)) * select(vec2<f32>(-1.0), vec2<f32>(1.0), p >= vec2<f32>(0.0));
    return normalize(vec3<f32>(select(p, folded, z < 0.0), z));
}

// Direction of a pixel's ray, camera space, unit length.
fn sight_of(pixel: vec2<u32>) -> vec3<f32> {
    return normalize(vec3<f32>(from_middle(pixel) * view.mm_per_pixel_per_mm, 1.0));
}

// The point that a pixel shows at a depth, camera space.
fn point_at(pixel: vec2<u32>, depth: f32) -> vec3<f32> {
    return vec3<f32>(from_middle(pixel) * footprint_mm(depth), depth);
}
