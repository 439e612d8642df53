// Averages occlusion over the 4x4 tile of rotations, not across depth steps (Mittring 2007). It darkens the
// encoded colour.
#include lib/view

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(7) var<storage, read> occlusion: array<u32>;
@group(0) @binding(8) var<storage, read_write> blurred: array<u32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    if depth >= FAR {
        blurred[at] = 0u;
        return;
    }
    let reach = 0.5 * view.occlusion_radius_mm;
    var sum = vec4<f32>(0.0);
    var weight = 0.0;
    let last = vec2<i32>(view.size) - 1;
    for (var y = -2; y < 2; y++) {
        for (var x = -2; x < 2; x++) {
            let to = clamp(vec2<i32>(id.xy) + vec2<i32>(x, y), vec2<i32>(0), last);
            let there = linear_index(vec2<u32>(to));
            if abs(depths[there] - depth) < reach {
                sum += unpack4x8unorm(occlusion[there]);
                weight += 1.0;
            }
        }
    }
    let mean = sum / max(weight, 1.0);
    blurred[at] = pack4x8unorm(vec4<f32>(mean.rgb, mean.a * view.occlusion_strength));
}
