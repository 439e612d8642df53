// Where the image lies along each line of sight, and how much of it is seen: by quadrature, brick by brick.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/path_state

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(43) var<storage, read> majorants: array<f32>;

// Whether eye rays pass opaque geometry that covers its pixel in part: they end at depths stored behind the others.
override ends_apart: bool = false;

// Optical thickness beyond which nothing is seen.
const ENOUGH = 12.0;
const HALF = 0.693147;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    var last = FAR;
    if (flags() & (HAS_SURFACE | HAS_TUBES)) != 0u {
        if ends_apart {
            last = depths[at + view.size.x * view.size.y];
        } else {
            last = depths[at];
        }
    }
    let ray = image_ray(from_middle(id.xy), last);
    let slant = length(ray.along);
    let moves = abs(ray.d) > vec3<f32>(1e-12);
    let inv = select(vec3<f32>(0.0), 1.0 / select(vec3<f32>(1.0), ray.d, moves), moves);
    let ahead = select(vec3<i32>(0), vec3<i32>(1), ray.d > vec3<f32>(0.0));
    let counts = vec3<i32>(context.bricks);
    // The outermost bricks reach to the image's faces.
    let outermost = ahead * (counts - 1);
    var brick = vec3<i32>(place_of(ray.o + ray.near * ray.d).cell >> vec3<u32>(3u));
    var t = ray.near;
    var thickness = 0.0;
    var half = FAR;
    // No ray needs more rounds: a guard against invalid numbers.
    for (var n = 0u; n < 60000u && t < ray.far && thickness < ENOUGH; n++) {
        let majorant = majorants[(brick.z * counts.y + brick.y) * counts.x + brick.x];
        let bound = vec3<f32>((brick + ahead) << vec3<u32>(3u));
        let next = select(vec3<f32>(FAR), (bound - ray.o) * inv, moves & (brick != outermost));
        let past = clamp(min(next.x, min(next.y, next.z)), t, ray.far);
        var end = past;
        if majorant > 0.0 {
            end = min(past, t + context.step_mm / slant);
            let extinction = extinction_of(material_of(place_of(ray.o + 0.5 * (t + end) * ray.d))) * slant;
            let here = extinction * (end - t);
            if thickness < HALF && thickness + here >= HALF {
                half = t + (HALF - thickness) / extinction;
            }
            thickness += here;
        }
        // Steps too short for single precision end the brick.
        let is_past = end >= past || end <= t;
        t = select(end, past, is_past);
        let axis = first_axis(next);
        brick += select(vec3<i32>(0), 2 * ahead - 1, vec3<bool>(is_past) & (vec3<u32>(axis) == vec3<u32>(0u, 1u, 2u)));
    }
    let opacity = select(1.0 - exp(-thickness), 1.0, thickness >= ENOUGH);
    let place = vec4<u32>(bitcast<u32>(ray.near), bitcast<u32>(ray.far), bitcast<u32>(opacity), bitcast<u32>(half));
    pixels[at] = Pixel(vec4<f32>(0.0), vec4<f32>(0.0), place);
}
