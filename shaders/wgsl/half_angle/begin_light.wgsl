// Initial state of the light's buffer: all of it, where each texel's ray is in the image, and where it meets the masks.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/image_along
#include lib/first_shown
#include lib/half_angle

override with_masks: bool = false;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    zero = global.x >> 31u;
    let id = slab.first + global.xy;
    if any(id >= slab.texels) {
        return;
    }
    let c = texel_start(id);
    let span = image_span(c, slab.light);
    var hit = FAR;
    if with_masks {
        let w = slab.light;
        let o = view.corner + c.x * view.right + c.y * view.up + c.z * view.forward;
        let ray = ray_from(o, w.x * view.right + w.y * view.up + w.z * view.forward);
        // What is behind the eye's plane casts no shadow, as it isn't drawn.
        let to_eye = (view.nearest_mm - c.z) / select(1.0, w.z, abs(w.z) > 1e-12);
        let begin = select(-FAR, to_eye, w.z > 1e-12);
        let end = select(FAR, to_eye, w.z < -1e-12);
        let along = first_shown(ray, begin, end, false);
        hit = select(FAR, dot(slab.normal, c) + along * dot(slab.normal, slab.light), along < FAR);
    }
    lights[light_place(id)] = Texel(1.0, span.x, span.y, hit);
}
