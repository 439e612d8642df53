// Before a step whose footprint is wide: each row summed up to each of its distances from the pixel, all
// points of one weight.

#include lib/dos.wgsl
#include lib/dos_texel.wgsl

@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= optical.size) {
        return;
    }
    let at = vec2<i32>(id.xy);
    let pixels = optical.size.x * optical.size.y;
    let place = id.y * optical.size.x + id.x;
    var sum = 0.0;
    for (var h = 0u; h < rings; h++) {
        let row = parts[fixed].folded[h];
        let off = vec2<i32>(i32(row.x), 0);
        let near = texel(at + off) + texel(at - off);
        let far = texel(at + off + vec2<i32>(1, 0)) + texel(at - off - vec2<i32>(1, 0));
        sum += row.w * mix(near, far, row.y);
        rows[h * pixels + place] = sum;
    }
}
