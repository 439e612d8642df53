// Whether the masks let light of a lamp far away through to a cell: a ray from its middle, one thread per cell, a part of the
// cells per dispatch.
#include lib/view
#include lib/march
#include lib/first_shown
#include lib/past_masks
#include lib/light_grid
#include lib/light_cell

struct LightPart {
    first: u32,                     // number of a cell
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
}

struct Lamp {
    light: vec3<f32>,               // direction that light travels in
    step_mm: f32,
}

@group(0) @binding(34) var<storage, read_write> open: array<f32>;
@group(0) @binding(36) var<uniform> lamp: Lamp;
@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;
@group(0) @binding(39) var<uniform> part: LightPart;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let cell = part.first + id.x + id.y * groups.x * 64u;
    if cell >= grid.needed {
        return;
    }
    let c = cell_middle(cell);
    open[cell] = select(0.0, 1.0, is_lit_past_masks(c, -lamp.light, FAR, false));
}
