// The context image as the medium of lib/cones.

fn middle_of(c: vec3<f32>) -> vec2<f32> {
    return c.xy / max(footprint_mm(c.z), 1e-12);
}

// Interval that the clipping planes leave.
fn kept_span(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    var span = vec2<f32>(0.0, FAR);
    for (var n = 0u; n < 6u; n++) {
        let plane = context.clips[n];
        let to_plane = plane.w - dot(plane.xyz, c);
        let rate = dot(plane.xyz, w);
        let at = to_plane / select(1.0, rate, abs(rate) > 1e-12);
        let parallel_end = select(FAR, -1.0, to_plane < 0.0);
        span.y = min(span.y, select(select(FAR, at, rate > 1e-12), parallel_end, abs(rate) <= 1e-12));
        span.x = max(span.x, select(0.0, at, rate < -1e-12));
    }
    return span;
}

// Neither inside the masks' box nor in front of it.
fn is_kept(c: vec3<f32>) -> bool {
    let span = box_interval(ray_through(middle_of(c)));
    return !((view.dims.x > 0u) & (span.near < span.far) & (c.z < span.far));
}

fn near_extinction(p: vec3<f32>) -> f32 {
    return extinction_of(material_at(p - 0.5));
}

// Images are interpolated: there is no exact traversal.
fn exact_ray(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    return sub_cone(c, w);
}
