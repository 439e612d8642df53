// Ray march through the image, front to back. The including file provides `WANTS_GRADIENT` (whether
// `appearance` uses the gradient) and
// `appearance(color, gradient, sight, inside_mm, at) -> vec3<f32>`: the shaded colour of a sample.
//
// A ray's interval is divided into segments of one step, the first one shortened by the jitter and the
// last by the interval's end. Each is sampled at its middle, with the opacity of its own length: a
// homogeneous medium gives its closed form for any step and jitter. Skipped bricks don't change the
// positions of the samples.

// Transmittance at which a ray ends.
const DARK = 0.005;

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(6) var<storage, read_write> marched: array<Marched>;

// A number in 0..1, always the same for a pixel.
fn hash(pixel: vec2<u32>) -> f32 {
    var h = pixel.x * 0x8da6b343u + pixel.y * 0xd8163841u;
    h = (h ^ (h >> 16u)) * 0x7feb352du;
    h = (h ^ (h >> 15u)) * 0x846ca68bu;
    return f32((h ^ (h >> 16u)) >> 8u) / 16777216.0;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    var out = Marched(0u, 0u, FAR, 0u);
    var solid = FAR;
    if (flags() & (HAS_SURFACE | HAS_TUBES)) != 0u {
        solid = depths[at];
    }
    let ray = image_ray(from_middle(id.xy), solid);
    let near = ray.near;
    let far = ray.far;
    let o = ray.o;
    let d = ray.d;
    if near < far {
        let mm_per_depth = length(ray.along);
        let sight = ray.along / mm_per_depth;
        let step = context.step_mm / mm_per_depth;
        let jittered = (varied(context.flags) & JITTER) != 0u;
        let first = near + select(1.0, hash(id.xy), jittered) * step;
        // The step is chosen so that no ray needs more: a guard against invalid numbers.
        let count = min(u32(max((far - first) / step, 0.0)) + 2u, 40000u);
        let two_d = (varied(context.flags) & TWO_D) != 0u;
        let skipping = (flags() & NO_SKIPPING) == 0u;
        let stride = vec3<u32>(1u, context.dims.x, context.dims.x * context.dims.y);
        let to_next = select(vec3<u32>(0u), stride, context.dims > vec3<u32>(1u));
        let moves = abs(d) > vec3<f32>(1e-12);
        let inv = select(vec3<f32>(0.0), 1.0 / d, moves);
        let ahead = select(vec3<u32>(0u), vec3<u32>(1u), d > vec3<f32>(0.0));
        var color = vec3<f32>(0.0);
        var transmittance = 1.0;
        var k = 0u;
        while k < count {
            var place: Place;
            var begin: f32;
            var end: f32;
            // Advances to the next sample in a visible brick.
            while k < count {
                begin = select(first + (f32(k) - 1.0) * step, near, k == 0u);
                end = min(first + f32(k) * step, far);
                place = place_of(o + 0.5 * (begin + end) * d);
                let brick = place.cell >> vec3<u32>(3u);
                if !skipping || is_visible(brick) {
                    break;
                }
                let boundary = vec3<f32>((brick + ahead) << vec3<u32>(3u));
                let crossing = select(vec3<f32>(FAR), (boundary - o) * inv, moves);
                let past = min(crossing.x, min(crossing.y, crossing.z));
                // The first sample behind the brick, or the one before where rounding makes that uncertain.
                let next = ceil((past - first) / step + 0.5 - 0.02);
                k = max(k + 1u, u32(clamp(next, 0.0, f32(count))));
            }
            if k >= count || begin >= far {
                break;
            }
            let here = dot(place.cell, stride);
            let corners = corners_at(here, to_next);
            let value = weighed(across(corners.low, place.weight.xy), across(corners.high, place.weight.xy), place.weight.z);
            var gradient = vec3<f32>(0.0);
            var material: vec4<f32>;
            if joint {
                gradient = gradient_at(place, here, to_next, corners);
                let steepness = length(gradient);
                material = select(vec4<f32>(0.0), looked_up_jointly(value, steepness), steepness < TOO_STEEP);
            } else {
                material = looked_up(value);
            }
            // Jitter may leave the first segment without length.
            if value > NOT_FINITE && material.a > 0.0 && begin < end {
                if !joint && (WANTS_GRADIENT || gradient_counts && two_d) {
                    gradient = gradient_at(place, here, to_next, corners);
                    let steepness = length(gradient);
                    let unknown = !(steepness < TOO_STEEP);
                    if unknown {
                        gradient = vec3<f32>(0.0);
                    }
                    if gradient_counts && two_d {
                        material.a *= select(factor_of(steepness), 0.0, unknown);
                    }
                }
                let length_mm = (end - begin) * mm_per_depth;
                let inside_mm = (0.5 * (begin + end) - near) * mm_per_depth;
                let whole = k > 0u && end < far;
                let opacity = opacity_over(material.a, select(length_mm, context.step_mm, whole));
                let at = o + 0.5 * (begin + end) * d;
                color += transmittance * opacity * appearance(material.rgb, gradient, sight, inside_mm, at);
                let remaining = transmittance * (1.0 - opacity);
                if transmittance > 0.5 && remaining <= 0.5 {
                    out.depth = 0.5 * (begin + end);
                }
                transmittance = remaining;
                if transmittance < DARK {
                    color /= 1.0 - transmittance;
                    transmittance = 0.0;
                    break;
                }
            }
            k += 1u;
        }
        out.red_green = pack2x16unorm(color.rg);
        out.blue_opacity = pack2x16unorm(vec2<f32>(color.b, 1.0 - transmittance));
    }
    marched[at] = out;
}
