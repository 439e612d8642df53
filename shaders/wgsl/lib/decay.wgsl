// How visibility falls through a slice; see through_slice of render/src/occlusion/cone.rs. The
// including file gives rate_entry, the 257 decay rates of visibilities 0 to 1.

fn rate_at(visibility: f32) -> f32 {
    let x = clamp(visibility, 0.0, 1.0) * 256.0;
    let low = min(u32(x), 255u);
    return mix(rate_entry(low), rate_entry(low + 1u), x - f32(low));
}

// Light scattered to the eye, and visibility behind the slice.
fn through_slice(visibility: f32, whole: f32) -> vec2<f32> {
    let thickness = min(whole, 12.0);
    let steps = max(ceil(6.0 * thickness), 1.0);
    let size = thickness / steps;
    var light = visibility;
    var through = 1.0;
    var gathered = 0.0;
    for (var i = 0u; i < u32(steps); i++) {
        let half_way = light * exp(-0.5 * size * rate_at(light));
        let rate = rate_at(half_way);
        gathered += through * light * absorbed((1.0 + rate) * size) / (1.0 + rate);
        through *= exp(-size);
        light *= exp(-rate * size);
    }
    return vec2<f32>(gathered, light);
}
