// The image along rays that aren't the eye's: where it is, and how much light it transmits.

// Index space, voxel centres.
fn image_place(c: vec3<f32>) -> vec3<f32> {
    return context.corner + c.x * context.right + c.y * context.up + c.z * context.forward - 0.5;
}

// The interval in millimetres along direction `w` from `c` that lies in the image's box, behind the eye's plane, and
// that no clipping plane cuts away. No branches: `w` may be the same for all threads.
fn image_span(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    let o = image_place(c);
    let d = w.x * context.right + w.y * context.up + w.z * context.forward;
    let inside = image_box(o, d);
    var near = inside.x;
    var far = inside.y;
    for (var n = 0u; n < 7u; n++) {
        // The last plane is the eye's. Unused planes cut nothing.
        let plane = select(context.clips[min(n, 5u)], vec4<f32>(0.0, 0.0, -1.0, -view.nearest_mm), n == 6u);
        let room = plane.w - dot(plane.xyz, c);
        let rate = dot(plane.xyz, w);
        let is_parallel = abs(rate) <= 1e-12;
        let at = room / select(rate, 1.0, is_parallel);
        far = min(far, select(select(FAR, at, rate > 0.0), select(FAR, near, room < 0.0), is_parallel));
        near = max(near, select(-FAR, at, (rate < 0.0) & !is_parallel));
    }
    return vec2<f32>(near, far);
}

// Whether the image is drawn at `c`: it is left out inside the masks' box and in front of it.
fn is_drawn(c: vec3<f32>) -> bool {
    let span = box_interval(ray_through(c.xy / max(footprint_mm(c.z), 1e-12)));
    return !((span.near < span.far) & (c.z < span.far));
}

fn extinction_along(c: vec3<f32>) -> f32 {
    let place = place_of(image_place(c));
    var extinction = 0.0;
    if shows_anything(place) & is_drawn(c) {
        extinction = extinction_of(material_of(place));
    }
    return extinction;
}
