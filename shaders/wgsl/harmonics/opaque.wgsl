// Light of the sky on opaque geometry: rays past the masks' voxels in its directions, each by its share and its cosine to the normal,
// a part of them per dispatch. The last dispatch takes what the image lets through at the surface.
#include lib/view
#include lib/march
#include lib/normal
#include lib/depth_normal
#include lib/lens_end
#include lib/first_shown
#include lib/past_masks
#include lib/light_grid
#include lib/solid_light
#include lib/surface_normal

struct SkyRays {
    count: u32,
    begins: u32,                         // whether this is the first dispatch
    ends: u32,                           // whether it is the last one
    unused: u32,
    towards: array<vec4<f32>, 15>,       // camera space, unit length, and the share
}

@group(0) @binding(7) var<storage, read_write> lamp_light: array<f32>;
@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;
@group(0) @binding(39) var<uniform> rays: SkyRays;

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
    let surface = point_at(id.xy, depth);
    let n = normal_of(id.xy, surface);
    let c = surface + lift_of(n);
    var reached = select(lamp_light[at], 0.0, rays.begins != 0u);
    for (var i = 0u; i < varied(rays.count); i++) {
        let w = rays.towards[i].xyz;
        let facing = max(dot(n, w), 0.0) * rays.towards[i].w;
        var open = true;
        if past_masks {
            // Nothing is looked for where no light comes from.
            let end = select(-1.0, leaves_lens(c, w), facing > 0.0);
            open = is_lit_past_masks(c, w, end, (flags() & SMOOTH) != 0u);
        }
        reached += select(0.0, facing, open);
    }
    lamp_light[at] = reached;
    if varied(rays.ends) != 0u {
        var through = 1.0;
        if (flags() & HAS_CONTEXT) != 0u {
            let p = surface;
            through = grid_light(grid.corner + p.x * grid.right + p.y * grid.up + p.z * grid.forward).x;
        }
        blurred[at] = darker(min(reached, 1.0) * through);
    }
}
