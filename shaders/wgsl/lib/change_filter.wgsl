// One direction of the separable Gaussian filter over the heights. It runs from each pixel to both sides
// and stops where the surface ends: at the background, at a depth step (a silhouette), at a surface
// without a height. A mark of what was displaced stays that of the pixel.

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(19) var<storage, read> unfiltered: array<vec2<f32>>;
@group(0) @binding(20) var<storage, read_write> filtered: array<vec2<f32>>;

// Largest filter radius, pixels.
const MOST_REACH = 96.0;

fn filter_along(pixel: vec2<u32>, direction: vec2<i32>) {
    let at = linear_index(pixel);
    let own = unfiltered[at];
    if own.y < 0.0 {
        filtered[at] = own;
        return;
    }
    let depth = depths[at];
    let sigma_px = change.smooth_mm / footprint_mm(depth);
    let reach = i32(min(ceil(3.0 * sigma_px), MOST_REACH));
    let fall = -0.5 / (sigma_px * sigma_px);
    var sum = vec2<f32>(own.x, certainty_of(own.y));
    var weight = 1.0;
    for (var side = -1; side <= 1; side += 2) {
        var last = depth;
        for (var k = 1; k <= reach; k++) {
            let to = vec2<i32>(pixel) + side * k * direction;
            if any(to < vec2<i32>(0)) || any(to >= vec2<i32>(view.size)) {
                break;
            }
            let there = linear_index(vec2<u32>(to));
            let height = unfiltered[there];
            let next = depths[there];
            if height.y < 0.0 || abs(next - last) > change.gap_mm {
                break;
            }
            last = next;
            let w = exp(fall * f32(k * k));
            sum += w * vec2<f32>(height.x, certainty_of(height.y));
            weight += w;
        }
    }
    filtered[at] = sum / weight + vec2<f32>(0.0, select(0.0, DISPLACED, is_displaced(own.y)));
}
