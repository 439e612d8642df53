// Light of one placed lamp on opaque geometry: the cosine to the normal, past the masks by one ray through their voxels.
// Tubes, arrows and ellipsoids are lit but cast no shadow: only their depths are known.
#include lib/view
#include lib/march
#include lib/normal
#include lib/depth_normal
#include lib/lens_end
#include lib/first_shown
#include lib/past_masks
#include lib/solid_light
#include lib/surface_normal

struct Lamp {
    light: vec3<f32>,    // direction that light travels in
    step_mm: f32,        // through the image
}

@group(0) @binding(7) var<storage, read_write> lamp_light: array<f32>;
@group(0) @binding(36) var<uniform> lamp: Lamp;

override past_masks: bool = false;

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
    let w = -lamp.light;
    let surface = point_at(id.xy, depth);
    let n = normal_of(id.xy, surface);
    var reached = max(dot(n, w), 0.0);
    if past_masks && reached > 0.0 {
        let c = surface + lift_of(n);
        reached = select(0.0, reached, is_lit_past_masks(c, w, leaves_lens(c, w), (flags() & SMOOTH) != 0u));
    }
    lamp_light[at] = reached;
    blurred[at] = darker(reached);
}
