// Initial state of the layers: nothing covers any cell.
#include lib/view
#include lib/layers

@group(0) @binding(45) var<storage, read_write> cover: array<u32>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= layers.cells) {
        return;
    }
    let cell = id.y * layers.cells.x + id.x;
    for (var layer = 0u; layer < varied(layers.count); layer++) {
        cover[layer * cells_per_layer() + cell] = 0u;
    }
}
