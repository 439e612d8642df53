// The first voxel of a shown region along any ray, between two places on it.

struct Met {
    along: f32,          // where the voxel is entered; FAR if there is none
    number: u32,         // of its region
    axis: u32,           // of the face of entry; 3: the ray started in the voxel
}

// `starts_inside`: the shown voxels that the ray starts in don't count.
fn first_met(ray: Ray, begin: f32, end: f32, starts_inside: bool) -> Met {
    let nothing = Met(FAR, 0u, 3u);
    let dims = vec3<i32>(view.dims);
    let enter = select(vec3<f32>(-FAR), (vec3<f32>((1 - ray.ahead) * dims) - ray.o) * ray.inv, ray.moves);
    let leave = crossing(ray, ray.ahead * dims);
    let misses = any(!ray.moves & ((ray.o < vec3<f32>(0.0)) | (ray.o >= vec3<f32>(dims))));
    let enters = max(enter.x, max(enter.y, enter.z));
    let near = max(begin, enters);
    let far = select(min(end, min(leave.x, min(leave.y, leave.z))), near, misses);
    if near >= far {
        return nothing;
    }
    let skipping = (flags() & NO_SKIPPING) == 0u;
    // Before its box a ray starts in no voxel.
    var inside = starts_inside & (near <= begin);
    var w = start_walk(ray, near, select(3u, select(select(2u, 1u, enter.y == enters), 0u, enter.x == enters), enters > begin));
    for (var n = most_steps(); n > 0u && w.t < far; n--) {
        let brick = brick_of(w.cell);
        let within = w.cell >> vec3<u32>(3u);
        let empty = skipping && (brick.x & view.selected) == 0u;
        while !empty && w.t < far && all((w.cell >> vec3<u32>(3u)) == within) {
            let number = number_at(w.cell, brick);
            let shown = is_shown(number);
            if shown && !inside {
                return Met(w.t, number, w.axis);
            }
            inside = inside && shown;
            step_cell(ray, &w);
        }
        if empty {
            inside = false;
            step_brick(ray, &w);
        }
    }
    return nothing;
}

// Where it is entered, FAR if there is none.
fn first_shown(ray: Ray, begin: f32, end: f32, starts_inside: bool) -> f32 {
    return first_met(ray, begin, end, starts_inside).along;
}
