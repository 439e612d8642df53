// Whether the paths so far are enough: one thread for a tile of 8x8 pixels, whose root mean square error is estimated
// from the difference of both halves.
#include lib/view
#include lib/path_state

// Standard error of linear light at which a tile has enough paths.
const ENOUGH = 0.01;
// Variance of a single path that is assumed for one pixel more: few paths that agree by chance are not enough.
const ASSUMED = 0.25;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    let first = 8u * id.xy;
    if any(first >= view.size) {
        return;
    }
    var sum = 0.0;
    var count = 1.0;
    var paths = 1.0;
    for (var n = 0u; n < 64u; n++) {
        let there = first + vec2<u32>(n & 7u, n >> 3u);
        if all(there < view.size) {
            let pixel = pixels[linear_index(there)];
            if weight_of(pixel) > 0.0 {
                sum += variance_of(pixel);
                count += 1.0;
                paths = max(paths, pixel.even.w + pixel.odd.w);
            }
        }
    }
    if sum + ASSUMED / paths >= ENOUGH * ENOUGH * count {
        return;
    }
    for (var n = 0u; n < 64u; n++) {
        let there = first + vec2<u32>(n & 7u, n >> 3u);
        if all(there < view.size) {
            pixels[linear_index(there)].place.z |= 0x80000000u;
        }
    }
}
