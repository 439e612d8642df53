// Vicinity occlusion (Algorithm 5 of Schott et al. 2012), from depths alone.
//
// The including file provides `counts(at)`: whether the surface at pixel number `at` is an occluder.

struct Vicinity {
    radius_mm: f32,
    slope: f32,                     // mm nearer to the eye per mm sideways, beyond which a neighbour is in the cone
    count: u32,
    flags: u32,
    deepest_mm: f32,                // what is nearer to the eye by more is left to layers
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
    points: array<vec4<f32>, 118>,  // in the unit disc
}

const VICINITY = 1u;
const PARTIAL = 2u;
// Depth bias, in footprints. Samples fall on whole pixels, so surfaces steeper than this would occlude themselves.
const BIAS_PX = 1.0;

@group(0) @binding(36) var<uniform> vicinity: Vicinity;

// Share of the points around a pixel without a nearer occluder.
fn open(pixel: vec2<u32>, depth: f32) -> f32 {
    let footprint = footprint_mm(depth);
    let bias = BIAS_PX * footprint;
    let reach = vicinity.radius_mm / footprint;
    let middle = vec2<f32>(pixel) + 0.5;
    var hidden = 0.0;
    for (var i = 0u; i < varied(vicinity.count); i++) {
        let q = vicinity.points[i].xy;
        let to = floor(middle + reach * q);
        // Points outside the frame are not occluded.
        if all(to >= vec2<f32>(0.0)) && all(to < vec2<f32>(view.size)) {
            let nearest = depth - bias - vicinity.slope * vicinity.radius_mm * length(q);
            let there = linear_index(vec2<u32>(to));
            let near = depths[there] >= depth - vicinity.deepest_mm;
            hidden += select(0.0, 1.0, (depths[there] < nearest) & near & counts(there));
        }
    }
    return 1.0 - hidden / f32(vicinity.count);
}
