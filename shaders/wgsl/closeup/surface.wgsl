// First voxel of a shown region along each ray (thesis 7.3.3, the inner level).
#include lib/view
#include lib/march
#include lib/first_hit

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec2<u32>>; // region number, face

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let hit = first_hit(id.xy);
    depths[at] = hit.depth;
    surfaces[at] = vec2<u32>(hit.number, hit.face);
}
