// What a pixel's paths have found so far, in two halves, from whose difference the error is estimated.

struct Pixel {
    even: vec4<f32>,     // sum of the light found; number of paths that count
    odd: vec4<f32>,
    // Bits of single numbers. z: how much of the pixel it is, 0 to 1; negative where the paths are enough.
    // Surfaces: x depth, y normal (lib/normal). Image: x and y depths between which it is shown, w where half is hidden.
    place: vec4<u32>,
}

struct Step {
    first: u32,          // number of the path of each half in this dispatch
    bounces: u32,        // most scatterings of a path
    sky: f32,            // radiance from everywhere
    anisotropy: f32,     // mean cosine of the image's phase function (Henyey and Greenstein 1941)
    lamp: vec3<f32>,     // direction towards the middle of the lamp
    lamp_cap: f32,       // 1 - cosine of its angular radius
    lamp_light: f32,     // radiance of a white surface that faces it
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
}

@group(0) @binding(44) var<storage, read_write> pixels: array<Pixel>;

fn weight_of(pixel: Pixel) -> f32 {
    return bitcast<f32>(pixel.place.z);
}

// Mean light of both halves. One without paths doesn't count.
fn mean_of(pixel: Pixel) -> vec3<f32> {
    let even = pixel.even.rgb / max(pixel.even.w, 1.0);
    let odd = pixel.odd.rgb / max(pixel.odd.w, 1.0);
    let both = pixel.even.w > 0.0 && pixel.odd.w > 0.0;
    return select(even + odd, 0.5 * (even + odd), both);
}

// Estimate of the variance of the pixel's light, mean of its channels.
fn variance_of(pixel: Pixel) -> f32 {
    let both = pixel.even.w > 0.0 && pixel.odd.w > 0.0;
    let off = pixel.even.rgb / max(pixel.even.w, 1.0) - pixel.odd.rgb / max(pixel.odd.w, 1.0);
    let weight = weight_of(pixel);
    return weight * weight * select(1.0, dot(off, off) / 12.0, both);
}
