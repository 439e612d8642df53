// Maximum-intensity projection of a second image: the largest value along each pixel's ray, whatever is in front of it. Samples lie at the
// middles of equal steps from where the ray enters the image's box; bricks without a value above the largest one so far are skipped,
// which doesn't change the positions of samples.
#include lib/view
#include lib/march
#include lib/image

struct Projection {
    step_mm: f32,
    scale: f32,          // from stored values to shares of the window
    offset: f32,
    threshold: f32,      // stored; values at or below it are transparent
    opacity: f32,
    unused_a: f32,
    unused_b: f32,
    unused_c: f32,
}

@group(0) @binding(34) var<uniform> projection: Projection;
@group(0) @binding(35) var<storage, read> most: array<f32>;      // the largest value of each brick
@group(0) @binding(36) var<storage, read> ramp: array<u32>;      // 256 colours
@group(0) @binding(37) var<storage, read_write> projected: array<u32>;

fn value_in(place: Place) -> f32 {
    let stride = vec3<u32>(1u, context.dims.x, context.dims.x * context.dims.y);
    let to_next = select(vec3<u32>(0u), stride, context.dims > vec3<u32>(1u));
    let corners = corners_at(dot(place.cell, stride), to_next);
    return weighed(across(corners.low, place.weight.xy), across(corners.high, place.weight.xy), place.weight.z);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let p = from_middle(id.xy);
    let line = image_line(p);
    let o = line[0];
    let d = line[1];
    let moves = abs(d) > vec3<f32>(1e-12);
    let inv = select(vec3<f32>(0.0), 1.0 / d, moves);
    let inside = image_box(o, d);
    let near = max(view.nearest_mm, inside.x);
    let far = inside.y;
    let step = projection.step_mm / length(vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0));
    let ahead = select(vec3<u32>(0u), vec3<u32>(1u), d > vec3<f32>(0.0));
    // A guard against invalid numbers: the step is chosen so that no ray needs more.
    let count = min(u32(max((far - near) / step, 0.0) + 0.5), 40000u);
    let skipping = (flags() & NO_SKIPPING) == 0u;
    var best = projection.threshold;
    var k = 0u;
    while k < count {
        let place = place_of(o + (near + (f32(k) + 0.5) * step) * d);
        let brick = place.cell >> vec3<u32>(3u);
        let above = most[(brick.z * context.bricks.y + brick.y) * context.bricks.x + brick.x] > best;
        if above || !skipping {
            best = max(best, value_in(place));
            k += 1u;
        } else {
            let boundary = vec3<f32>((brick + ahead) << vec3<u32>(3u));
            let crossing = select(vec3<f32>(FAR), (boundary - o) * inv, moves);
            let past = min(crossing.x, min(crossing.y, crossing.z));
            // The first sample behind the brick, or the one before where rounding makes that uncertain.
            let next = ceil((past - near) / step - 0.5 - 0.02);
            k = max(k + 1u, u32(clamp(next, 0.0, f32(count))));
        }
    }
    let share = clamp(best * projection.scale + projection.offset, 0.0, 1.0);
    let color = unpack4x8unorm(ramp[u32(share * 255.0 + 0.5)]).rgb;
    let opacity = select(0.0, projection.opacity, best > projection.threshold);
    projected[linear_index(id.xy)] = pack4x8unorm(vec4<f32>(color, opacity));
}
