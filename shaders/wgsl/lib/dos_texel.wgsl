// Occlusion before the step, from the buffer. The edge of the picture goes on.
fn texel(at: vec2<i32>) -> f32 {
    let p = clamp(at, vec2<i32>(0), vec2<i32>(optical.size) - 1);
    return before[p.y * i32(optical.size.x) + p.x];
}
