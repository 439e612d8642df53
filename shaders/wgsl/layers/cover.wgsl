// Counts the pixels of each cell whose surface is met in each layer.
#include lib/view
#include lib/layers
#include lib/tubes

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(45) var<storage, read_write> cover: array<atomic<u32>>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    // Light behind a layer lacks what the layer's surfaces hide: in the mean half a layer too late, so half a layer less.
    let behind = range_of(id.xy, depths[at]) + layers.lag_mm - layers.near;
    let layer = floor(behind / layers.slice_mm - 0.5);
    let counts = (varied(layers.flags) & TUBES_ONLY) == 0u || is_tube(surfaces[at].y);
    // Behind the last layer nothing is darkened any more.
    if counts && layer < f32(layers.count) {
        let cell = id.xy / layers.side;
        let there = cell.y * layers.cells.x + cell.x;
        atomicAdd(&cover[u32(max(layer, 0.0)) * cells_per_layer() + there], 1u);
    }
}
