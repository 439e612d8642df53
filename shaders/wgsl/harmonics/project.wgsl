// How visible the surroundings of a cell are from it, projected to spherical harmonics (thesis 3.3.3): sub-cones in directions all
// around, through prefiltered extinction. One thread per cell that a frame can look up; a part of the cells and of the directions
// per dispatch.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/cones
#include lib/image_cones
#include lib/first_shown
#include lib/light_grid
#include lib/light_cell

struct Part {
    first: u32,                     // index in `needed`
    direction: u32,                 // the first of this dispatch
    directions: u32,
    functions: u32,
}

@group(0) @binding(30) var<storage, read> needed: array<u32>;     // numbers of the cells
@group(0) @binding(33) var<storage, read> basis: array<f32>;      // of each direction, times its solid angle
@group(0) @binding(34) var<storage, read_write> projected: array<f32>;  // of each needed cell: past the image, then past masks too
@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;
@group(0) @binding(39) var<uniform> part: Part;

override with_masks: bool = false;

fn is_hidden(c: vec3<f32>) -> bool {
    return false;
}

// Whether the masks let light from direction `w` through.
fn is_open(c: vec3<f32>, w: vec3<f32>) -> bool {
    let o = view.corner + c.x * view.right + c.y * view.up + c.z * view.forward;
    let ray = ray_from(o, w.x * view.right + w.y * view.up + w.z * view.forward);
    let to_eye = select(FAR, (view.nearest_mm - c.z) / select(-1.0, w.z, w.z < 0.0), w.z < 0.0);
    return first_shown(ray, 0.0, to_eye, false) >= FAR;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = part.first + id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    let c = cell_middle(needed[number]);
    let sets = select(1u, 2u, with_masks);
    let start = number * sets * part.functions;
    // The first dispatch finds what an earlier projection left.
    let keeps = select(0.0, 1.0, part.direction > 0u);
    for (var k = 0u; k < varied(sets * part.functions); k++) {
        projected[start + k] *= keeps;
    }
    for (var i = 0u; i < varied(part.directions); i++) {
        let w = cones.axes[part.direction + i].xyz;
        let seen = sub_cone(c, w).x;
        let values = (part.direction + i) * part.functions;
        for (var k = 0u; k < varied(part.functions); k++) {
            projected[start + k] += seen * basis[values + k];
        }
        if with_masks {
            let past = select(0.0, seen, is_open(c, w));
            for (var k = 0u; k < varied(part.functions); k++) {
                projected[start + part.functions + k] += past * basis[values + k];
            }
        }
    }
}
