// The ellipsoid diagram (thesis 7.6): each pixel's fragments lit and blended front to back, grey
// outside the lens ring, with outlines; the slice blended at its depth; the lens ring on top.
#include lib/view
#include lib/ellipsoid
#include lib/plane
#include lib/ring
#include lib/fragment

struct Counters {
    nodes: u32,
    wraps: u32,
    last_nodes: u32,
    last_wraps: u32,
}

@group(0) @binding(11) var<storage, read> nodes: array<vec2<u32>>;
@group(0) @binding(12) var<storage, read_write> counters: Counters;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if all(id == vec3<u32>(0u)) {
        // So that the lists pass starts from zero when it is run again alone to be timed.
        counters.last_nodes = counters.nodes;
        counters.last_wraps = counters.wraps;
        counters.nodes = 0u;
        counters.wraps = 0u;
    }
    if any(id.xy >= view.size) {
        return;
    }
    var blend = start_blend(id.xy);
    if (flags() & HAS_SURFACE) != 0u {
        let list = lists[linear_index(id.xy)];
        if list.w != 0u {
            return; // no room: the next pass draws it
        }
        for (var n = 0u; n < list.y && blend.through > 0.0; n++) {
            add_fragment(&blend, nodes[list.x + n], id.xy, n == 0u);
        }
    }
    finish(&blend, id.xy);
}
