// Light that reaches opaque geometry: vicinity occlusion (Algorithm 5 of Schott et al. 2012) from depths
// alone, times the light past farther surfaces, times the light that the slices transmit to it (Algorithm 6).
#include lib/view
#include lib/solid_light
#include lib/vicinity
#include lib/layers
#include lib/layer_light

@group(0) @binding(35) var<storage, read> notes: array<vec2<f32>>;

fn counts(at: u32) -> bool {
    return true;
}

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
    var light = 1.0;
    if (varied(vicinity.flags) & VICINITY) != 0u {
        light = open(id.xy, depth) * light_of_layers(id.xy, depth);
    }
    if (varied(vicinity.flags) & PARTIAL) != 0u {
        light *= notes[at].x;
    }
    blurred[at] = darker(light);
}
