// Signed displacement of the surface at each pixel's voxel, and its certainty: 1, less within the
// uncertainty, with a mark where the tissue around moved too; below 0 where there is no surface, or none with a counterpart.
#include lib/view
#include lib/change

struct Length {
    key: u32,            // number of the voxel in the volume, from 1; 0 is an empty slot
    signed_mm: f32,
    sure: f32,
}

@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(17) var<storage, read> cells: array<u32>;
@group(0) @binding(18) var<storage, read> lengths: array<Length>;  // open addressing, at most half full
@group(0) @binding(19) var<storage, read_write> heights: array<vec2<f32>>;

// A voxel that is not in the table did not move.
fn looked_up(cell: u32) -> vec2<f32> {
    let key = cell + 1u;
    let last = varied((1u << change.log2_slots) - 1u);
    var slot = (key * 0x9e3779b1u) >> (32u - change.log2_slots);
    for (var n = 0u; n <= last; n++) {
        let entry = lengths[slot];
        if entry.key == key {
            return vec2<f32>(entry.signed_mm, entry.sure);
        }
        if entry.key == 0u {
            break;
        }
        slot = (slot + 1u) & last;
    }
    return vec2<f32>(0.0, 1.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let kind = kind_of(surfaces[at].x);
    var height = vec2<f32>(0.0, -1.0);
    if kind == (BEFORE | AFTER) {
        height.y = 1.0;
    } else if kind != 0u && (kind & ALONE) == 0u {
        height = looked_up(cells[at]);
    }
    heights[at] = height;
}
