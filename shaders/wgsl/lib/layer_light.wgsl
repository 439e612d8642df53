// Looks up the light that layers carried to a surface. For files that include lib/layers.

@group(0) @binding(46) var<storage, read> layer_light: array<f32>;

// Light behind the first `planes` layers, between cells.
fn behind_layers(planes: u32, at: vec4<u32>, f: vec2<f32>) -> f32 {
    let first = max(planes, 1u) - 1u;
    let place = first * cells_per_layer() + at;
    let upper = mix(layer_light[place.x], layer_light[place.y], f.x);
    let lower = mix(layer_light[place.z], layer_light[place.w], f.x);
    return select(mix(upper, lower, f.y), 1.0, planes == 0u);
}

// Light that reaches a pixel's surface past all that is nearer to the eye by more than the lag.
fn light_of_layers(pixel: vec2<u32>, depth: f32) -> f32 {
    if varied(layers.count) == 0u {
        return 1.0;
    }
    let last = vec2<f32>(layers.cells) - 1.0;
    let cell = clamp((vec2<f32>(pixel) + 0.5) / f32(layers.side) - 0.5, vec2<f32>(0.0), last);
    let low = vec2<u32>(cell);
    let high = min(low + 1u, layers.cells - 1u);
    let row = vec2<u32>(low.y, high.y) * layers.cells.x;
    let at = vec4<u32>(row.x + low.x, row.x + high.x, row.y + low.x, row.y + high.x);
    let planes = clamp((range_of(pixel, depth) - layers.near) / layers.slice_mm, 0.0, f32(layers.count));
    let before = u32(planes);
    let f = cell - vec2<f32>(low);
    let after = behind_layers(min(before + 1u, layers.count), at, f);
    return mix(behind_layers(before, at, f), after, planes - f32(before));
}
