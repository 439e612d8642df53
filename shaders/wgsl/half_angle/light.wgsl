// The light's buffer behind a slab.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/image_along
#include lib/half_angle

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    zero = global.x >> 31u;
    let id = slab.first + global.xy;
    if any(id >= slab.texels) {
        return;
    }
    let at = light_place(id);
    let texel = lights[at];
    let c = texel_start(id);
    let rate = dot(slab.normal, slab.light);
    let front = (slab.front - dot(slab.normal, c)) / rate;
    let begin = max(front, texel.near);
    let end = min(front + slab.slab_mm / rate, texel.far);
    if begin < end && texel.light > 0.0 {
        let extinction = extinction_along(c + 0.5 * (begin + end) * slab.light);
        lights[at].light = texel.light * exp(-extinction * (end - begin));
    }
}
