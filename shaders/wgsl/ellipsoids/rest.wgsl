// Pixels whose list had no room: their fragments are found again, a batch at a time, and blended as in
// ellipsoids/compose. A pass of its own, as its many variables would slow down every other frame.
#include lib/view
#include lib/ellipsoid
#include lib/plane
#include lib/ring
#include lib/fragment

const BATCH = 16u;

// The nearest fragments of those behind `last` (of all fragments if `any`), sorted; a batch that is not full is
// padded with depth FAR. Few loop iterations: Mesa's software driver (llvmpipe) ends a shader's loops after
// 65,535 iterations of all of them together, and unrolls the inner ones.
fn gather(pixel: vec2<u32>, any: bool, last: vec2<u32>, batch: ptr<function, array<vec2<u32>, BATCH>>) {
    let p = from_middle(pixel);
    let tile = tile_of(pixel);
    for (var i = 0u; i < BATCH; i++) {
        (*batch)[i] = vec2<u32>(bitcast<u32>(FAR), NO_FACE);
    }
    for (var n = tiles[tile]; n < tiles[tile + 1u]; n++) {
        let number = tiles[n];
        let chord = chord_of(ellipsoids[number], p);
        for (var face = FRONT; face <= BACK; face++) {
            let s = chord.s[face];
            var node = vec2<u32>(bitcast<u32>(s), 2u * number + face);
            let wanted = chord.meets && s > view.nearest_mm && (any || is_behind(node, last));
            if wanted && is_behind((*batch)[BATCH - 1u], node) {
                for (var i = 0u; i < BATCH; i++) {
                    let other = (*batch)[i];
                    let sooner = is_behind(other, node);
                    (*batch)[i] = select(other, node, sooner);
                    node = select(node, other, sooner);
                }
            }
        }
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) || lists[linear_index(id.xy)].w == 0u {
        return;
    }
    var blend = start_blend(id.xy);
    var batch: array<vec2<u32>, BATCH>;
    var node = vec2<u32>(0u);
    for (var n = 0u; blend.through > 0.0; n++) {
        if n % BATCH == 0u {
            gather(id.xy, n == 0u, node, &batch);
        }
        node = batch[n % BATCH];
        if bitcast<f32>(node.x) >= FAR {
            break;
        }
        add_fragment(&blend, node, id.xy, n == 0u);
    }
    finish(&blend, id.xy);
}
