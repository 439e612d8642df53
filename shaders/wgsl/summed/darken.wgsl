// Darkness of opaque geometry that lies behind the mean depth around it, from the summed-area table: depth darkening (Luft
// et al. 2006), whose Gaussian is a mean of boxes, or vicinity maps (Díaz et al. 2010), which compare each box by itself.
#include lib/view
#include lib/solid_light
#include lib/summed

@group(0) @binding(33) var<storage, read> table: array<vec2<u32>>;

// Whether boxes are compared one by one.
override one_by_one: bool = false;

// A step as high as half the radius makes its foot black.
const GAIN = 2.0;
// Steps between voxels and rounding of depths, in footprints.
const BIAS_PX = 0.75;

fn sum_up_to(x: i32, y: i32) -> vec2<u32> {
    let last = vec2<i32>(view.size) - 1;
    let at = clamp(vec2<i32>(x, y), vec2<i32>(0), last);
    let sum = table[linear_index(vec2<u32>(at))];
    return select(sum, vec2<u32>(0u), (x < 0) | (y < 0));
}

// Sum and number of the depths up to `k` pixels aside.
fn box_sum(p: vec2<i32>, k: i32) -> vec2<f32> {
    let low = p - k - 1;
    let high = p + k;
    let sum = sum_up_to(high.x, high.y) - sum_up_to(low.x, high.y) - sum_up_to(high.x, low.y) + sum_up_to(low.x, low.y);
    return vec2<f32>(sum);
}

// The same of a box of any side, of two whole ones by its area, per pixel of its area.
fn box_mean(p: vec2<i32>, half: f32) -> vec2<f32> {
    let area = 4.0 * half * half;
    let k = max(floor(half - 0.5), 0.0);
    let inner = (2.0 * k + 1.0) * (2.0 * k + 1.0);
    let share = clamp((area - inner) / (8.0 * k + 8.0), 0.0, 1.0);
    return mix(box_sum(p, i32(k)), box_sum(p, i32(k) + 1), share) / max(area, 1.0);
}

// How much a mean counts of which `covered` has depths. Where it has none, beyond a silhouette or the frame, a surface that slants
// would go on as far behind as it comes before: whether the rest is nearer for that or because it hides is not known. Without
// this the far edge of anything would be black, with nothing in front of it.
fn counted(covered: f32) -> f32 {
    let share = clamp(2.0 * covered - 1.0, 0.0, 1.0);
    return share * share;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    if depth >= FAR {
        blurred[at] = 0u;
        return;
    }
    let footprint = footprint_mm(depth);
    let radius = view.occlusion_radius_mm;
    let bias = BIAS_PX * footprint;
    var all = vec2<f32>(0.0);
    var dark = 0.0;
    for (var i = 0u; i < varied(summed.boxes); i++) {
        let half_mm = summed.halves[i].x * radius;
        let mean = box_mean(vec2<i32>(id.xy), min(half_mm / max(footprint, 1e-12), summed.widest_px));
        all += mean;
        let behind = depth - bias - summed.nearest - mean.x / (mean.y * summed.per_mm);
        dark += clamp(GAIN * behind * counted(mean.y) / half_mm, 0.0, 1.0);
    }
    let boxes = f32(summed.boxes);
    dark /= boxes;
    if !one_by_one {
        let behind = depth - bias - summed.nearest - all.x / (all.y * summed.per_mm);
        dark = clamp(GAIN * behind * counted(all.y / boxes) / radius, 0.0, 1.0);
    }
    blurred[at] = darker(1.0 - dark);
}
