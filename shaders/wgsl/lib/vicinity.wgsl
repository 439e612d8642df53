// Vicinity occlusion (Algorithm 5 of Schott et al. 2012), from depths alone.
//
// The including file gives `counts(at)`: whether what pixel number `at` shows hides anything.

struct Vicinity {
    radius_mm: f32,
    slope: f32,                     // mm nearer to the eye a mm aside, from which on a neighbour is in the cone
    count: u32,
    flags: u32,
    points: array<vec4<f32>, 118>,  // in the unit disc
}

const VICINITY = 1u;
const PARTIAL = 2u;
// A surface that falls this much a pixel hides itself: points fall in whole pixels.
const BIAS_PX = 1.0;

@group(0) @binding(36) var<uniform> vicinity: Vicinity;

// Share of the points about a pixel that nothing nearer hides.
fn open(pixel: vec2<u32>, depth: f32) -> f32 {
    let footprint = footprint_mm(depth);
    let bias = BIAS_PX * footprint;
    let reach = vicinity.radius_mm / footprint;
    let middle = vec2<f32>(pixel) + 0.5;
    var hidden = 0.0;
    for (var i = 0u; i < varied(vicinity.count); i++) {
        let q = vicinity.points[i].xy;
        let to = floor(middle + reach * q);
        // What is off the picture hides nothing.
        if all(to >= vec2<f32>(0.0)) && all(to < vec2<f32>(view.size)) {
            let nearest = depth - bias - vicinity.slope * vicinity.radius_mm * length(q);
            let there = linear_index(vec2<u32>(to));
            hidden += select(0.0, 1.0, (depths[there] < nearest) & counts(there));
        }
    }
    return 1.0 - hidden / f32(vicinity.count);
}
