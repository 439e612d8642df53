// Light that reaches cells of the context image through a cone towards the eye: one thread per cell that a
// frame can look up, a part of them per dispatch.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/cones
#include lib/image_cones
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

fn colored_extinction_at(p: vec3<f32>, level: f32) -> vec4<f32> {
    return vec4<f32>(0.0);
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
