// Light that reaches an opaque surface, as the composing pass reads it: the share by which the encoded
// colour is darkened. The rest of the light is ambient and reaches it anyway.
#include lib/linear

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(8) var<storage, read_write> blurred: array<u32>;

fn darker(light: f32) -> u32 {
    return pack4x8unorm(vec4<f32>(0.0, 0.0, 0.0, 1.0 - encoded(vec3<f32>(mix(1.0, light, view.occlusion_strength))).x));
}
