// Light that reaches cells of the context image through a cone towards the eye: one thread per cell that a
// frame can look up, a part of them per dispatch.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/cones
#include lib/light_grid

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(37) var<storage, read_write> light_grid: array<vec2<f32>>;
@group(0) @binding(30) var<storage, read> needed: array<u32>;   // numbers of the cells

struct LightPart {
    first: u32,                     // index in `needed`
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
}

@group(0) @binding(39) var<uniform> part: LightPart;

fn middle_of(c: vec3<f32>) -> vec2<f32> {
    return c.xy / max(footprint_mm(c.z), 1e-12);
}

// Everything behind a pixel's opaque surface counts as opaque: the depths hold no more of it.
fn is_hidden(c: vec3<f32>) -> bool {
    let m = middle_of(c);
    let size = vec2<f32>(view.size);
    let at = floor(vec2<f32>(m.x, -m.y) + 0.5 * size);
    // Not `&&`: with a load on its right side, Mesa 22.3's software driver crashes when it compiles this.
    let inside = all(at >= vec2<f32>(0.0)) & all(at < size) & ((flags() & (HAS_SURFACE | HAS_TUBES)) != 0u);
    let there = linear_index(vec2<u32>(clamp(at, vec2<f32>(0.0), size - 1.0)));
    return inside & (depths[there] < c.z - cones.voxel_mm);
}

// Interval that the clipping planes leave.
fn kept_span(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    var span = vec2<f32>(0.0, FAR);
    for (var n = 0u; n < 6u; n++) {
        let plane = context.clips[n];
        let to_plane = plane.w - dot(plane.xyz, c);
        let rate = dot(plane.xyz, w);
        let at = to_plane / select(1.0, rate, abs(rate) > 1e-12);
        let parallel_end = select(FAR, -1.0, to_plane < 0.0);
        span.y = min(span.y, select(select(FAR, at, rate > 1e-12), parallel_end, abs(rate) <= 1e-12));
        span.x = max(span.x, select(0.0, at, rate < -1e-12));
    }
    return span;
}

// Neither inside the masks' box nor in front of it.
fn is_kept(c: vec3<f32>) -> bool {
    let span = box_interval(ray_through(middle_of(c)));
    return !((view.dims.x > 0u) & (span.near < span.far) & (c.z < span.far));
}

fn near_extinction(p: vec3<f32>) -> f32 {
    return extinction_of(material_at(p - 0.5));
}

// Images are interpolated: there is no exact traversal.
fn exact_ray(c: vec3<f32>, w: vec3<f32>) -> vec2<f32> {
    return sub_cone(c, w);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = part.first + id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    let cell = needed[number];
    let sheet = grid.cells.x * grid.cells.y;
    let ijk = vec3<u32>(cell % grid.cells.x, cell % sheet / grid.cells.x, cell / sheet);
    // The last cells may reach past the image.
    let p = min((vec3<f32>(ijk) + 0.5) / grid.scale, vec3<f32>(context.dims));
    let c = vec3<f32>(
        dot(grid.right_from_index.xyz, p) + grid.right_from_index.w,
        dot(grid.up_from_index.xyz, p) + grid.up_from_index.w,
        dot(grid.depth_from_index.xyz, p) + grid.depth_from_index.w);
    light_grid[cell] = light_from_cone(c);
}
