// Attenuation of visibility through a slice; see through_slice of core/src/optics/cone.rs. The including
// file provides decay_entry(i), for i of 0 to 256 and t = DECAY_END (i/256)^2, which is densest where the
// curves bend most:
// - x: the decay rate at visibility i/256;
// - y, z: minus the logarithms of a slab's visibility, and of the light scattered from there on, at optical
//   thickness t;
// - w: the optical thickness at which minus the logarithm of visibility is t.

const DECAY_END = 16.0;
const THIN = 0.03;

// 1 - e^-x, accurate for small x too.
fn absorbed(x: f32) -> f32 {
    return select(1.0 - exp(-x), x * (1.0 - 0.5 * x * (1.0 - x / 3.0 * (1.0 - 0.25 * x))), x < 0.05);
}

fn rate_at(visibility: f32) -> f32 {
    let x = clamp(visibility, 0.0, 1.0) * 256.0;
    let low = min(u32(x), 255u);
    return mix(decay_entry(low).x, decay_entry(low + 1u).x, x - f32(low));
}

fn decay_at(at: f32) -> vec4<f32> {
    let share = clamp(at / DECAY_END, 0.0, 1.0);
    let low = min(u32(256.0 * sqrt(share)), 255u);
    let i = f32(low);
    let f = clamp((65536.0 * share - i * i) / (2.0 * i + 1.0), 0.0, 1.0);
    return mix(decay_entry(low), decay_entry(low + 1u), f);
}

// Light scattered to the eye, and visibility behind the slice.
fn through_slice(visibility: f32, thickness: f32) -> vec2<f32> {
    // Thin slice: the rate at its middle holds throughout, so that no table error adds up over thousands.
    let half_way = visibility * exp(-0.5 * thickness * rate_at(visibility));
    let rate = rate_at(half_way);
    let thin = vec2<f32>(
        visibility * absorbed((1.0 + rate) * thickness) / (1.0 + rate), visibility * exp(-rate * thickness));
    // Thick slice: as if a slab had attenuated the light before.
    let before = decay_at(-log(max(visibility, 1e-30))).w;
    let here = decay_at(before);
    let behind = decay_at(before + thickness);
    // Beyond the end of the table nothing is left.
    let left = select(exp(-behind.y), 0.0, before + thickness >= DECAY_END);
    let later = select(exp(-thickness - behind.z), 0.0, before + thickness >= DECAY_END);
    let thick = vec2<f32>(exp(-here.z) - later, left);
    return select(thick, thin, thickness < THIN) * select(0.0, 1.0, visibility > 1e-7);
}
