// Light that reaches what is solid from a cone towards the eye: through the masks, and through the context
// image where there is one. Tubes are no medium: what they hide from each other is found in their vicinity.
#include lib/view.wgsl
#include lib/march.wgsl
#include lib/light.wgsl
#include lib/light_grid.wgsl
#include lib/solid_light.wgsl
#include lib/vicinity.wgsl
#include lib/tubes.wgsl

@group(0) @binding(37) var<storage, read> light_grid: array<f32>;

@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;

// Of a voxel, towards the eye: off the face that was hit.
const SLIP = 1e-3;

fn is_hidden(c: vec3<f32>) -> bool {
    return false;
}

// Outside a lens that cuts nothing is shown.
fn is_kept(c: vec3<f32>) -> bool {
    return (view.flags & (LENS_ON | LENS_ONLY_DRAWN)) != LENS_ON || distance(c, view.lens.xyz) <= view.lens.w;
}

fn near_extinction(p: vec3<f32>) -> f32 {
    let cell = vec3<i32>(floor(p));
    if any(cell < vec3<i32>(0)) || any(cell >= vec3<i32>(view.dims)) {
        return 0.0;
    }
    return select(0.0, light.dark, is_shown(number_at(cell, brick_of(cell))));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    if depth >= FAR {
        blurred[at] = 0u;
        return;
    }
    let s = depth - SLIP * light.voxel_mm;
    let c = vec3<f32>(from_middle(id.xy) * footprint_mm(s), s);
    var reached = light_from_cone(c);
    if (view.flags & HAS_CONTEXT) != 0u {
        reached *= grid_light(grid.corner + c.x * grid.right + c.y * grid.up + c.z * grid.forward);
    }
    if ((view.flags & HAS_TUBES) != 0u) & ((vicinity.flags & VICINITY) != 0u) {
        reached *= select(1.0, open(id.xy, depth), is_tube(surfaces[at].y));
    }
    blurred[at] = darker(reached);
}
