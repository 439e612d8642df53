// Light that reaches opaque geometry through a cone towards the eye: past the masks, and through the context
// image where there is one. Tubes and arrows are no medium: their light was found before, see vicinity/tubes.
#include lib/view
#include lib/march
#include lib/cones
#include lib/light_grid
#include lib/solid_light

@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;

@group(0) @binding(7) var<storage, read> tube_light: array<f32>;

// Whether tubes or arrows take light away.
override past_tubes: bool = false;

// Offset from the hit face towards the eye, in voxels.
const SLIP = 1e-3;

fn is_hidden(c: vec3<f32>) -> bool {
    return false;
}

fn kept_span(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    return vec2<f32>(0.0, FAR);
}

// Outside a cutting lens nothing is shown.
fn is_kept(c: vec3<f32>) -> bool {
    return (flags() & (LENS_ON | LENS_ONLY_DRAWN)) != LENS_ON || distance(c, view.lens.xyz) <= view.lens.w;
}

fn near_extinction(p: vec3<f32>) -> f32 {
    let cell = vec3<i32>(floor(p));
    if any(cell < vec3<i32>(0)) || any(cell >= vec3<i32>(view.dims)) {
        return 0.0;
    }
    return select(0.0, cones.dark, is_shown(number_at(cell, brick_of(cell))));
}

fn colored_extinction_at(p: vec3<f32>, level: f32) -> vec4<f32> {
    return vec4<f32>(0.0);
}

// Voxel traversal up to the first shown voxel.
fn exact_ray(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    let ray = ray_from(index_of(c), w.x * cones.right + w.y * cones.up + w.z * cones.forward);
    let dims = vec3<i32>(view.dims);
    let enter = select(vec3<f32>(-FAR), (vec3<f32>((1 - ray.ahead) * dims) - ray.o) * ray.inv, ray.moves);
    let leave = crossing(ray, ray.ahead * dims);
    let near = max(max(enter.x, max(enter.y, enter.z)), 0.0);
    let to_eye = select(FAR, (view.nearest_mm - c.z) / select(-1.0, w.z, w.z < 0.0), w.z < 0.0);
    let outside = any(!ray.moves & ((ray.o < vec3<f32>(0.0)) | (ray.o >= vec3<f32>(dims))));
    let far = select(min(min(leave.x, min(leave.y, leave.z)), to_eye), -1.0, outside);
    var open = 1.0;
    var walk = start_walk(ray, near, 3u);
    for (var n = most_steps(); (n > 0u) & (walk.t < far) & (open > 0.0); n--) {
        let begin = walk.t;
        let cell = walk.cell;
        let shown = is_shown(number_at(cell, brick_of(cell)));
        step_cell(ray, &walk);
        let kept = is_kept(c + 0.5 * (begin + min(walk.t, far)) * w);
        open = select(open, 0.0, shown & kept);
    }
    return vec2<f32>(open);
}

fn begin_of(c: vec3<f32>, w: vec3<f32>) -> vec3<f32> {
    return c;
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
    let s = depth - SLIP * cones.voxel_mm;
    let c = vec3<f32>(from_middle(id.xy) * footprint_mm(s), s);
    var reached = light_from_cone(c).x;
    if (flags() & HAS_CONTEXT) != 0u {
        reached *= grid_light(grid.corner + c.x * grid.right + c.y * grid.up + c.z * grid.forward).x;
    }
    if past_tubes {
        reached *= tube_light[at];
    }
    blurred[at] = darker(reached);
}
