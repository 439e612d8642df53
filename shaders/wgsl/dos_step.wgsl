// One step, eye and occlusion in one pass. A tile (16x16 pixels) through which less than 1/255 comes,
// and whose neighbours are so too, is not sampled any more.

#include lib/dos.wgsl

@group(0) @binding(9) var<storage, read_write> states: array<u32>; // 1: saturated; two halves

var<workgroup> most: atomic<u32>;

fn is_saturated(tile: vec2<i32>) -> bool {
    let tiles = vec2<i32>(dos.tiles);
    if any(tile < vec2<i32>(0)) || any(tile >= tiles) {
        return true;
    }
    return states[part.states * dos.tiles.x * dos.tiles.y + u32(tile.y * tiles.x + tile.x)] == 1u;
}

@compute @workgroup_size(16, 16)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    if local == 0u {
        atomicStore(&most, 0u);
    }
    workgroupBarrier();
    let pixel = id.xy;
    if all(pixel < optical.size) {
        let at = pixel.y * optical.size.x + pixel.x;
        var stopped = part.stops == 1u;
        if stopped {
            for (var j = -1; j <= 1; j++) {
                for (var i = -1; i <= 1; i++) {
                    stopped = stopped && is_saturated(vec2<i32>(group.xy) + vec2<i32>(i, j));
                }
            }
        }
        var through = 0.0;
        if stopped {
            after[at] = before[at];
        } else if dos.variant == MENDED {
            let light = lattice(pixel);
            if part.is_empty == 1u {
                after[at] = light;
                through = eye[at].w;
            } else {
                let next = advance(eye[at], light, from_middle(pixel));
                eye[at] = next.eye;
                after[at] = next.light;
                through = next.eye.w;
            }
        } else {
            var optics = vec4<f32>(0.0);
            if part.is_empty == 0u {
                optics = optics_at(place(from_middle(pixel), part.depth + 0.5 * dos.slice_mm));
            }
            let next = blend(eye[at], optics, before[at]);
            eye[at] = next;
            after[at] = disc(pixel, optics.w);
            through = next.w;
        }
        // Bits of what isn't negative are in the order of the numbers.
        atomicMax(&most, bitcast<u32>(max(through, 0.0)));
    }
    workgroupBarrier();
    if local == 0u {
        let saturated = bitcast<f32>(atomicLoad(&most)) < 1.0 / 255.0;
        let other = (1u - part.states) * dos.tiles.x * dos.tiles.y;
        states[other + group.y * dos.tiles.x + group.x] = select(0u, 1u, saturated);
    }
}
