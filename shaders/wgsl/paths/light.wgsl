// The paths' light on opaque surfaces as the composing pass reads it: its colour, and how much is lost.
#include lib/view
#include lib/linear
#include lib/path_state
#include lib/path_errors

@group(0) @binding(8) var<storage, read_write> blurred: array<u32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let pixel = pixels[at];
    var light = 0u;
    if abs(weight_of(pixel)) > 0.0 {
        let shown = clamp(mix(vec3<f32>(1.0), mean_of(pixel), view.occlusion_strength), vec3<f32>(0.0), vec3<f32>(1.0));
        let seen = dot(shown, vec3<f32>(0.2126, 0.7152, 0.0722));
        light = pack4x8unorm(vec4<f32>(encoded(shown), 1.0 - encoded(vec3<f32>(seen)).x));
    }
    blurred[at] = light;
    add_up_errors(id.xy, false, view.occlusion_strength);
}
