// How visible the surroundings of a cell are from it, projected to spherical harmonics (thesis 3.3.3): sub-cones in directions all
// around, through prefiltered extinction; on request the colours of what takes light away, too. One thread per cell that a frame can look up; a part of the cells and of the directions
// per dispatch.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/cones
#include lib/image_cones
#include lib/linear
#include lib/cone_colors
#include lib/light_grid
#include lib/light_cell

struct ProjectPart {
    first: u32,                     // index in `needed`
    direction: u32,                 // the first of this dispatch
    directions: u32,
    functions: u32,
}

struct Basis {
    values: array<vec4<f32>, 1152>, // of each direction, times its solid angle
}

@group(0) @binding(30) var<storage, read> needed: array<u32>;     // numbers of the cells
@group(0) @binding(33) var<storage, read> open: array<u32>;       // bits of directions past the masks, see harmonics/open
@group(0) @binding(34) var<storage, read_write> projected: array<f32>;  // of each needed cell: past the image, then past masks too
@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;
@group(0) @binding(36) var<uniform> basis: Basis;
@group(0) @binding(39) var<uniform> part: ProjectPart;

override with_masks: bool = false;

fn is_hidden(c: vec3<f32>) -> bool {
    return false;
}

fn begin_of(c: vec3<f32>, w: vec3<f32>) -> vec3<f32> {
    return c;
}

fn basis_at(number: u32) -> f32 {
    return basis.values[number / 4u][number % 4u];
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = part.first + id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    let colors = select(1u, 2u, with_masks);
    let sets = colors + select(0u, 3u, gathers_color);
    let start = number * sets * part.functions;
    // The first dispatch finds what an earlier projection left.
    let keeps = select(0.0, 1.0, part.direction > 0u);
    for (var k = 0u; k < varied(sets * part.functions); k++) {
        projected[start + k] *= keeps;
    }
    for (var i = 0u; i < varied(part.directions); i++) {
        let w = cones.axes[part.direction + i].xyz;
        let seen = sub_cone(middle_for(needed[number], w), w).x;
        let values = (part.direction + i) * part.functions;
        for (var k = 0u; k < varied(part.functions); k++) {
            projected[start + k] += seen * basis_at(values + k);
        }
        var color = gathered;
        if with_masks {
            let direction = part.direction + i;
            let word = open[number * 4u + direction / 32u];
            let is_open = ((word >> (direction % 32u)) & 1u) != 0u;
            let past = select(0.0, seen, is_open);
            color = select(vec3<f32>(0.0), color, is_open);
            for (var k = 0u; k < varied(part.functions); k++) {
                projected[start + part.functions + k] += past * basis_at(values + k);
            }
        }
        if gathers_color {
            for (var k = 0u; k < varied(part.functions); k++) {
                let of_color = color * basis_at(values + k);
                let at = start + colors * part.functions + k;
                projected[at] += of_color.r;
                projected[at + part.functions] += of_color.g;
                projected[at + 2u * part.functions] += of_color.b;
            }
        }
    }
}
