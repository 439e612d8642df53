// What ambient occlusion in sampled directions shares: tiles of pixels and bases.

// Number of a pixel in its 4x4 tile. Pixels of a tile sample different directions, which filters average.
fn tile_of(pixel: vec2<u32>) -> u32 {
    return (pixel.x & 3u) + 4u * (pixel.y & 3u);
}

// Two vectors that complete a unit vector to an orthonormal basis (Duff et al. 2017).
fn tangents_of(n: vec3<f32>) -> array<vec3<f32>, 2> {
    let side = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    return array<vec3<f32>, 2>(
        vec3<f32>(1.0 + side * n.x * n.x * a, side * b, -side * n.x), vec3<f32>(b, side + n.y * n.y * a, -n.y));
}
