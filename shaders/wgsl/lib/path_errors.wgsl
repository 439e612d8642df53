// Sums over tiles of 8x8 pixels, from which the frame's standard error is: of estimated variances, and of pixels.
@group(0) @binding(45) var<storage, read_write> errors: array<vec2<f32>>;

// By one thread of a tile. Errors of the image's light are stored behind those of surfaces.
fn add_up_errors(id: vec2<u32>, of_image: bool, scale: f32) {
    if any((id & vec2<u32>(7u)) != vec2<u32>(0u)) {
        return;
    }
    var sum = vec2<f32>(0.0);
    for (var n = 0u; n < 64u; n++) {
        let there = id + vec2<u32>(n & 7u, n >> 3u);
        if all(there < view.size) {
            let pixel = pixels[linear_index(there)];
            if abs(weight_of(pixel)) > 0.0 {
                sum += vec2<f32>(scale * scale * variance_of(pixel), 1.0);
            }
        }
    }
    let tiles = (view.size + 7u) >> vec2<u32>(3u);
    let tile = (id.y >> 3u) * tiles.x + (id.x >> 3u);
    errors[tile + select(0u, tiles.x * tiles.y, of_image)] = sum;
}
