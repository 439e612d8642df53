// Light from the image: paths along a pixel's line of sight, one for each half of its samples. A path that collides with
// nothing is begun anew some times: what counts is the mean of those that collide, and how many would is known exactly.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/image_along
#include lib/paths

const ATTEMPTS = 4u;

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
    let p = from_middle(id.xy);
    let c = vec3<f32>(p * view.mm_per_pixel, 0.0);
    let slope = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    let w = slope / length(slope);
    let near = bitcast<f32>(pixel.place.x) * length(slope);
    let far = bitcast<f32>(pixel.place.y) * length(slope);
    let first = steps[zero].first;
    for (var half = 0u; half < 2u; half++) {
        random_state = hash_of_pixel(id.xy, 18u + 4u * first + half);
        var flight = Travel(FAR, 1.0, vec3<f32>(0.0));
        for (var n = 0u; n < ATTEMPTS && flight.along >= FAR; n++) {
            flight = travel(c, w, near, far, false);
        }
        if flight.along < FAR {
            let color = decoded(flight.color);
            let start = Vertex(c + flight.along * w, false, w, color);
            let count = u32(select(pixel.odd.w, pixel.even.w, half == 0u));
            let light = collected(start, first_point(id.xy, half, count));
            let found = vec4<f32>(mix(color, light, view.occlusion_strength), 1.0);
            if half == 0u {
                pixel.even += found;
            } else {
                pixel.odd += found;
            }
        }
    }
    pixels[at] = pixel;
}
