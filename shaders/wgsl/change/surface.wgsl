// As closeup/surface, and the number of the voxel, by which its change length is looked up (thesis 7.3.4).
#include lib/view
#include lib/march
#include lib/first_hit

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec2<u32>>; // region number, face
@group(0) @binding(17) var<storage, read_write> cells: array<u32>;         // the voxel's number in the volume

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let hit = first_hit(id.xy);
    let cell = vec3<u32>(hit.cell);
    depths[at] = hit.depth;
    surfaces[at] = vec2<u32>(hit.number, hit.face);
    cells[at] = (cell.z * view.dims.y + cell.y) * view.dims.x + cell.x;
}
