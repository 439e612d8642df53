// The first voxel of a shown region along any ray, between two places on it.

// Where it is entered, FAR if there is none. `starts_inside`: the shown voxels that the ray starts in don't count.
fn first_shown(ray: Ray, begin: f32, end: f32, starts_inside: bool) -> f32 {
    let dims = vec3<i32>(view.dims);
    let enter = select(vec3<f32>(-FAR), (vec3<f32>((1 - ray.ahead) * dims) - ray.o) * ray.inv, ray.moves);
    let leave = crossing(ray, ray.ahead * dims);
    let misses = any(!ray.moves & ((ray.o < vec3<f32>(0.0)) | (ray.o >= vec3<f32>(dims))));
    let near = max(begin, max(enter.x, max(enter.y, enter.z)));
    let far = select(min(end, min(leave.x, min(leave.y, leave.z))), near, misses);
    if near >= far {
        return FAR;
    }
    let skipping = (flags() & NO_SKIPPING) == 0u;
    // Before its box a ray starts in no voxel.
    var inside = starts_inside & (near <= begin);
    var w = start_walk(ray, near, 3u);
    for (var n = most_steps(); n > 0u && w.t < far; n--) {
        let brick = brick_of(w.cell);
        let within = w.cell >> vec3<u32>(3u);
        let empty = skipping && (brick.x & view.selected) == 0u;
        while !empty && w.t < far && all((w.cell >> vec3<u32>(3u)) == within) {
            let shown = is_shown(number_at(w.cell, brick));
            if shown && !inside {
                return w.t;
            }
            inside = inside && shown;
            step_cell(ray, &w);
        }
        if empty {
            inside = false;
            step_brick(ray, &w);
        }
    }
    return FAR;
}
