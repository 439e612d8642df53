// Whether the masks let light through to a cell, in directions all around: a bit for each. One thread per cell that a frame can look
// up; a part of the cells and half a word of directions per dispatch.
#include lib/view
#include lib/march
#include lib/first_shown
#include lib/past_masks
#include lib/light_grid
#include lib/light_cell

struct ProjectPart {
    first: u32,                     // index in `needed`
    direction: u32,                 // the first of this dispatch, a multiple of 16
    directions: u32,                // at most 16
    functions: u32,
}

struct Directions {
    axes: array<vec4<f32>, 128>,    // camera space, unit length
}

@group(0) @binding(30) var<storage, read> needed: array<u32>;         // numbers of the cells
@group(0) @binding(34) var<storage, read_write> open: array<u32>;     // four words for each of them
@group(0) @binding(36) var<uniform> spread: Directions;
@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;
@group(0) @binding(39) var<uniform> part: ProjectPart;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = part.first + id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    let c = cell_middle(needed[number]);
    var bits = 0u;
    // Of all 16, as Mesa 22.3's software driver crashes when it compiles this loop with an end that isn't constant. Bits of
    // directions that there aren't mean nothing, and aren't read.
    for (var i = 0u; i < 16u; i++) {
        let w = spread.axes[part.direction + i].xyz;
        bits |= select(0u, 1u << i, is_lit_past_masks(c, w, FAR, false));
    }
    let place = number * 4u + part.direction / 32u;
    let shift = part.direction % 32u;
    open[place] = (open[place] & ~(0xffffu << shift)) | (bits << shift);
}
