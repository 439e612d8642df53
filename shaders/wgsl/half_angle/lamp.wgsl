// Light of one placed lamp on opaque geometry: the cosine to the normal, past the masks by one ray through their voxels.
// Tubes, arrows and ellipsoids are lit but cast no shadow: only their depths are known.
#include lib/view
#include lib/march
#include lib/normal
#include lib/depth_normal
#include lib/lens_end
#include lib/first_shown
#include lib/solid_light
#include lib/lifted

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
        let c = lifted(surface, n);
        let o = view.corner + c.x * view.right + c.y * view.up + c.z * view.forward;
        let ray = ray_from(o, w.x * view.right + w.y * view.up + w.z * view.forward);
        // What is behind the eye's plane casts no shadow, as it isn't drawn.
        let to_eye = select(FAR, (view.nearest_mm - c.z) / select(-1.0, w.z, w.z < 0.0), w.z < 0.0);
        let end = min(leaves_lens(c, w), to_eye);
        reached = select(0.0, reached, first_shown(ray, 0.0, end, (flags() & SMOOTH) != 0u) >= FAR);
    }
    lamp_light[at] = reached;
    blurred[at] = darker(reached);
}
