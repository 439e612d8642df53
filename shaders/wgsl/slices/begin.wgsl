// Initial state of the slice steps: full light, no radiance, full transmittance. And each pixel's depth interval
// in the image, which is too costly to find anew in each step.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/slices

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) thread: vec3<u32>) {
    zero = thread.x >> 31u;
    let id = pixel_in_areas(workgroup, thread);
    if any(id >= view.size) {
        return;
    }
    let at = linear_index(id);
    eye[at] = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    notes[at] = vec2<f32>(1.0, FAR);
    for (var turn = 0u; turn < 2u; turn++) {
        let place = light_place(at, turn);
        lights[place] = 1.0;
        if two_lights {
            lights[place + 1u] = 1.0;
        }
    }
    let ray = image_ray(from_middle(id), FAR);
    lights[range_place(at)] = ray.near;
    lights[range_place(at) + 1u] = ray.far;
}
