// Light that reaches cells of the context image through a cone towards the eye: one thread per cell that a
// frame can look up, a part of them per dispatch.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/cones
#include lib/image_cones
#include lib/light_grid
#include lib/light_cell

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

var<private> cell: u32;

fn begin_of(c: vec3<f32>, w: vec3<f32>) -> vec3<f32> {
    return middle_for(cell, w);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = part.first + id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    cell = needed[number];
    light_grid[cell] = light_from_cone(cell_middle(cell));
}
