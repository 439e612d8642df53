// First voxel of a shown region along each ray: inside the lens, or anywhere when the lens is off
// (thesis 7.3.3, the inner level). A face that the lens cuts open is hit at the lens.
#include lib/view.wgsl
#include lib/march.wgsl

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec2<u32>>; // region number, face

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    depths[at] = FAR;
    surfaces[at] = vec2<u32>(0u, NO_FACE);
    let ray = ray_of(id.xy);
    var span = box_interval(ray);
    if (view.flags & (LENS_ON | LENS_ONLY_DRAWN)) == LENS_ON {
        let lens = lens_interval(id.xy);
        if lens.x > span.near {
            span.near = lens.x;
            span.axis = 3u;
        }
        span.far = min(span.far, lens.y);
    }
    if span.near >= span.far {
        return;
    }
    let skipping = (view.flags & NO_SKIPPING) == 0u;
    var w = start_walk(ray, span.near, span.axis);
    // Bricks outside, cells inside: the work of a jump is then done once a brick, not once a cell.
    for (var n = most_steps(); n > 0u && w.t < span.far; n--) {
        let brick = brick_of(w.cell);
        let within = w.cell >> vec3<u32>(3u);
        let empty = skipping && (brick.x & view.selected) == 0u;
        var number = 0u;
        while !empty && w.t < span.far && all((w.cell >> vec3<u32>(3u)) == within) {
            number = number_at(w.cell, brick);
            if is_shown(number) {
                break;
            }
            number = 0u;
            step_cell(ray, &w);
        }
        if number != 0u {
            depths[at] = w.t;
            surfaces[at] = vec2<u32>(number, face_of(ray, w));
            return;
        }
        if empty {
            step_brick(ray, &w);
        }
    }
}
