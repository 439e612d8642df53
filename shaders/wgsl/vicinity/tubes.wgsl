// Light that reaches opaque geometry past tubes and arrows, where masks are traced: vicinity occlusion nearby, layers
// from afar. A factor in single precision.
#include lib/view
#include lib/vicinity
#include lib/layers
#include lib/layer_light
#include lib/tubes

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> tube_light: array<f32>;

fn counts(at: u32) -> bool {
    return is_tube(surfaces[at].y);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    var light = 1.0;
    if depth < FAR {
        light = open(id.xy, depth) * light_of_layers(id.xy, depth);
    }
    tube_light[at] = light;
}
