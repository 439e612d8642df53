// Light of one placed lamp on opaque geometry: the cosine to the normal, past the masks by one ray through their voxels.
// Tubes, arrows and ellipsoids are lit but cast no shadow: only their depths are known.
#include lib/view
#include lib/march
#include lib/normal
#include lib/depth_normal
#include lib/lens_end
#include lib/first_shown
#include lib/solid_light

struct Lamp {
    light: vec3<f32>,    // direction that light travels in
    step_mm: f32,        // through the image
}

@group(0) @binding(7) var<storage, read_write> lamp_light: array<f32>;
@group(0) @binding(36) var<uniform> lamp: Lamp;
@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Whether normals are stored already; else they are found from depths, and stored.
override stored_normals: bool = false;
override past_masks: bool = false;

// Rays start this far above the surface, along the axis of voxels that the normal is closest to: above the steps between
// voxels, which would hide a part of every slanted plane from itself.
const LIFT = 1.0;

// From depths; of voxels the mean of nine, as far apart as voxels are, or the faces between them would be lit instead of
// the surface.
fn normal_among(here: vec2<i32>, c: vec3<f32>) -> vec3<f32> {
    var sum = normal_from_depths(here, c, sight_of(vec2<u32>(here)));
    if stepped {
        let apart = clamp(i32(round(view.voxel_mm / footprint_mm(c.z))), 1, 8);
        for (var k = 0; k < 9; k++) {
            let there = here + apart * vec2<i32>(k % 3 - 1, k / 3 - 1);
            let inside = all(there >= vec2<i32>(0)) && all(there < vec2<i32>(view.size));
            let q = point_of(there);
            if inside && k != 4 && abs(q.z - c.z) < 3.0 * view.voxel_mm {
                sum += normal_from_depths(there, q, sight_of(vec2<u32>(there)));
            }
        }
    }
    return sum / max(length(sum), 1e-12);
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
    let w = -lamp.light;
    let surface = point_at(id.xy, depth);
    var n = vec3<f32>(0.0);
    if stored_normals {
        n = unpacked_normal(normals[at]);
    } else {
        n = normal_among(vec2<i32>(id.xy), surface);
        normals[at] = packed_normal(n);
    }
    var reached = max(dot(n, w), 0.0);
    if past_masks && reached > 0.0 {
        let steep = n.x * view.right + n.y * view.up + n.z * view.forward;
        let c = surface + n * (LIFT / max(max(abs(steep.x), abs(steep.y)), abs(steep.z)));
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
