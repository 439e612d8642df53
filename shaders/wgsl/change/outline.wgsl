// Outline of the earlier date, whose first hits are bound here: against the background, or steps of far more than a voxel.
// Its coverage of each pixel is left for change/compose, where picks are stored later.
#include lib/view
#include lib/lines

@group(0) @binding(23) var<storage, read_write> tops: array<vec2<u32>>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let here = vec2<i32>(id.xy);
    let depth = depths[clamped(here)];
    let face = surfaces[clamped(here)].y;
    var line = 0.0;
    for (var n = 0u; n < 12u; n++) {
        let to = neighbour(n);
        let there = clamped(here + to);
        if surfaces[there].y == face {
            continue;
        }
        let q = depths[there];
        let steps = step_mm(depths[clamped(here - to)], depth, q, depths[clamped(here + 2 * to)]) / view.voxel_mm;
        let deep = select(smoothstep(3.0, 6.0, steps), 1.0, max(depth, q) >= FAR);
        let width = max(2.0 * width_at(min(depth, q)), 1.6);
        line = max(line, deep * coverage(width, length(vec2<f32>(to)) - 0.5));
    }
    tops[linear_index(id.xy)] = vec2<u32>(bitcast<u32>(line), 0u);
}
