// Light of the placed lamp on opaque geometry that the context image transmits.
#include lib/view
#include lib/march
#include lib/normal
#include lib/context
#include lib/image
#include lib/image_along
#include lib/solid_light

struct Lamp {
    light: vec3<f32>,    // direction that light travels in
    step_mm: f32,        // through the image
}

@group(0) @binding(7) var<storage, read> lamp_light: array<f32>;
@group(0) @binding(36) var<uniform> lamp: Lamp;

// Optical thickness beyond which no visible light is left.
const ENOUGH = 12.0;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    if depth >= FAR {
        return;
    }
    let reached = lamp_light[at];
    if reached <= 0.0 {
        return;
    }
    let c = point_at(id.xy, depth);
    let w = -lamp.light;
    let span = image_span(c, w);
    var thickness = 0.0;
    var t = max(span.x, 0.0);
    // The step is chosen so that no ray needs more: a guard against invalid numbers.
    for (var n = 0u; n < 20000u && t < span.y && thickness < ENOUGH; n++) {
        let end = min(t + lamp.step_mm, span.y);
        thickness += extinction_along(c + 0.5 * (t + end) * w) * (end - t);
        t = select(span.y, end, end > t);
    }
    blurred[at] = darker(reached * exp(-thickness));
}
