// The first voxel of a shown region along a pixel's ray: inside the lens, or anywhere when the lens
// is off or only drawn. A voxel that the lens cuts is hit on the lens.

struct Hit {
    depth: f32,          // FAR where there is none
    number: u32,         // of its region
    face: u32,
    cell: vec3<i32>,
}

fn first_hit(pixel: vec2<u32>) -> Hit {
    var hit = Hit(FAR, 0u, NO_FACE, vec3<i32>(0));
    let ray = ray_of(pixel);
    var span = box_interval(ray);
    if (flags() & (LENS_ON | LENS_ONLY_DRAWN)) == LENS_ON {
        let lens = lens_interval(pixel);
        if lens.x > span.near {
            span.near = lens.x;
            span.axis = 3u;
        }
        span.far = min(span.far, lens.y);
    }
    if span.near >= span.far {
        return hit;
    }
    let skipping = (flags() & NO_SKIPPING) == 0u;
    var w = start_walk(ray, span.near, span.axis);
    // Outer loop over bricks, inner over cells: skipping is then tested once per brick, not once per cell.
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
            return Hit(w.t, number, face_of(ray, w), w.cell);
        }
        if empty {
            step_brick(ray, &w);
        }
    }
    return hit;
}
