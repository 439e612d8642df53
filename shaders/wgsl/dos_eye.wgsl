// The first of the paper's two passes a slice (Algorithm 1): the slice is blended into the eye buffer.

#include lib/dos.wgsl
#include lib/dos_texel.wgsl

@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    now = zero;
    let pixel = id.xy;
    if any(pixel >= optical.size) {
        return;
    }
    let at = pixel.y * optical.size.x + pixel.x;
    var optics = vec4<f32>(0.0);
    if parts[now].is_empty == 0u {
        optics = optics_at(place(from_middle(pixel), parts[0].depth + 0.5 * dos.slice_mm));
    }
    // As in dos_step.wgsl.
    if optics.w > 0.0 {
        eye[at] = blend(eye[at], optics, before[at]);
    }
}
