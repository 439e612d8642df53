// Light on opaque surfaces: one path for each half of a pixel's samples.
#include lib/view
#include lib/march
#include lib/normal
#include lib/context
#include lib/image
#include lib/image_along
#include lib/paths
#include lib/index_space

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    var pixel = pixels[at];
    if weight_of(pixel) <= 0.0 {
        return;
    }
    let n = unpacked_normal(pixel.place.y);
    var c = point_at(id.xy, bitcast<f32>(pixel.place.x));
    if past_masks {
        c += lift_of(n);
    }
    let start = Vertex(c, true, n, vec3<f32>(1.0));
    let first = steps[zero].first;
    for (var half = 0u; half < 2u; half++) {
        random_state = hash_of_pixel(id.xy, 16u + 4u * first + half);
        let found = vec4<f32>(collected(start, first_point(id.xy, half, first)), 1.0);
        if half == 0u {
            pixel.even += found;
        } else {
            pixel.odd += found;
        }
    }
    pixels[at] = pixel;
}
