// One step, eye and occlusion in one pass. A tile (16x16 pixels) through which less than 1/255 comes,
// and whose neighbours are so too, is not sampled any more.

#include lib/dos.wgsl
#include lib/dos_texel.wgsl

// Bits of the most that comes through a tile, in thirds that take turns: one is read, one written, one
// cleared for the next step. So no thread waits for another: barriers cost Mesa's software driver more
// than all the rest of a step.
// Whether saturated tiles may stop at all.
override stopping: bool = false;

@group(0) @binding(9) var<storage, read_write> states: array<atomic<u32>>;

fn place_of(turn: u32, tile: vec2<u32>) -> u32 {
    return ((parts[0].states + turn) % 3u * dos.tiles.y + tile.y) * dos.tiles.x + tile.x;
}

fn is_saturated(tile: vec2<i32>) -> bool {
    if any(tile < vec2<i32>(0)) || any(tile >= vec2<i32>(dos.tiles)) {
        return true;
    }
    return bitcast<f32>(atomicLoad(&states[place_of(0u, vec2<u32>(tile))])) < 1.0 / 255.0;
}

@compute @workgroup_size(16, 16)
fn main(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    zero = id.x >> 31u;
    if stopping && local == 0u {
        atomicStore(&states[place_of(2u, group.xy)], 0u);
    }
    now = zero;
    let pixel = id.xy;
    if all(pixel < optical.size) {
        let at = pixel.y * optical.size.x + pixel.x;
        var stopped = stopping && parts[now].stops == 1u;
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
        } else if variant == MENDED {
            let light = lattice(pixel);
            if parts[now].is_empty == 1u {
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
            if parts[now].is_empty == 0u {
                optics = optics_at(place(from_middle(pixel), parts[0].depth + 0.5 * dos.slice_mm));
            }
            after[at] = disc(pixel, optics.w);
            // Nothing here leaves the eye as it is: its 32 bytes need not move.
            if optics.w > 0.0 {
                eye[at] = blend(eye[at], optics, before[at]);
            }
            through = eye[at].w;
        }
        if stopping {
            // Bits of what isn't negative are in the order of the numbers. Most threads find them there.
            let bits = bitcast<u32>(max(through, 0.0));
            let state = place_of(1u, group.xy);
            if atomicLoad(&states[state]) < bits {
                atomicMax(&states[state], bits);
            }
        }
    }
}
