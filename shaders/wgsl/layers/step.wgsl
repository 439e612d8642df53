// Light behind one layer: that behind the layer before, spread over a footprint, but for what the layer's surfaces hide.
//
// A surface hides light in the one layer in which it is met, not in all behind it: what a straight ray would meet
// depends on where it crosses the surface's depth.
#include lib/view
#include lib/layers

struct LayerStep {
    layer: u32,
    side: u32,                      // samples along a side of the footprint
    stride: i32,                    // cells between them
    center: f32,                    // weight of the cell itself
    share: f32,                     // weight of one sample
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
}

// This step, and whatever follows it in the buffer. Values that loops depend on are read at index `zero`.
@group(0) @binding(32) var<uniform> steps: array<LayerStep, 2>;
@group(0) @binding(45) var<storage, read_write> cover: array<u32>;
@group(0) @binding(46) var<storage, read_write> layer_light: array<f32>;

// Beyond the frame its edge cells extend.
fn before(at: vec2<i32>) -> f32 {
    let p = vec2<u32>(clamp(at, vec2<i32>(0), vec2<i32>(layers.cells) - 1));
    let layer = max(steps[zero].layer, 1u) - 1u;
    return select(layer_light[layer * cells_per_layer() + p.y * layers.cells.x + p.x], 1.0, steps[zero].layer == 0u);
}

// Pixels of the cell whose surfaces are met in the two layers before: so close, surfaces hide side by side, not one behind
// another. A round tube would let light through at its flanks.
fn covered_before(cell: u32) -> f32 {
    let layer = steps[zero].layer;
    let one = cover[max(layer, 1u) * cells_per_layer() - cells_per_layer() + cell];
    let two = cover[max(layer, 2u) * cells_per_layer() - 2u * cells_per_layer() + cell];
    return f32(select(0u, one, layer > 0u) + select(0u, two, layer > 1u));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= layers.cells) {
        return;
    }
    let here = vec2<i32>(id.xy);
    let first = here - (i32(steps[zero].side) - 1) * steps[zero].stride / 2;
    var sum = 0.0;
    for (var j = 0; j < i32(steps[zero].side); j++) {
        for (var i = 0; i < i32(steps[zero].side); i++) {
            sum += before(first + vec2<i32>(i, j) * steps[zero].stride);
        }
    }
    let spread = mix(sum * steps[zero].share, before(here), steps[zero].center);
    let cell = id.y * layers.cells.x + id.x;
    let at = steps[zero].layer * cells_per_layer() + cell;
    // Cells at the frame's edge have fewer pixels.
    let inside = min((id.xy + 1u) * layers.side, view.size) - id.xy * layers.side;
    let open = f32(inside.x * inside.y) - covered_before(cell);
    layer_light[at] = spread * (1.0 - min(f32(cover[at]) / max(open, 1.0), 1.0));
}
