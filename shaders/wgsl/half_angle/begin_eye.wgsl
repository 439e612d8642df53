// Initial state of the eye's buffer: no radiance, full transmittance; and the depths between which a pixel shows the image.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/half_angle

@group(0) @binding(4) var<storage, read> depths: array<f32>;

// Whether eye rays pass opaque geometry that covers its pixel in part: they end at depths stored behind the others.
override ends_apart: bool = false;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    zero = global.x >> 31u;
    let id = slab.first + global.xy;
    if any(id >= view.size) {
        return;
    }
    let at = linear_index(id);
    eye[eye_place(at)] = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    var last = FAR;
    if (flags() & (HAS_SURFACE | HAS_TUBES)) != 0u {
        if ends_apart {
            last = depths[at + view.size.x * view.size.y];
        } else {
            last = depths[at];
        }
    }
    let ray = image_ray(from_middle(id), last);
    ranges[at] = vec2<f32>(ray.near, ray.far);
}
