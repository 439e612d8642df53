// Several steps in one dispatch: a tile's occlusion stays in workgroup memory, and so does that of a halo
// around it, which shrinks by each step's reach; the eye stays in registers.

#include lib/dos.wgsl

// Cells along a side of the memory, halo included; the first workgroup's side holds it twice.
const SIDE = 32;
const CELLS = 1024u;

// Before and behind a step, in turns.
var<workgroup> light: array<f32, 2048>;
var<private> first: u32;            // of the half that is read
var<private> origin: vec2<i32>;     // pixel of cell (0, 0)

// The edge of the picture goes on. A pixel of the picture stands in its middle or nearer, so that what the
// tile's middle reads is in the memory; what else is read here counts for nothing.
fn texel(at: vec2<i32>) -> f32 {
    let p = clamp(at, vec2<i32>(0), vec2<i32>(optical.size) - 1) - origin;
    let q = vec2<u32>(clamp(p, vec2<i32>(0), vec2<i32>(SIDE - 1)));
    return light[first + q.y * u32(SIDE) + q.x];
}

fn cell_of(q: u32, local: vec2<u32>) -> vec2<i32> {
    return vec2<i32>(local + 16u * vec2<u32>(q % 2u, q / 2u));
}

@compute @workgroup_size(16, 16)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    zero = group.x >> 31u;
    let together = parts[zero].together;
    let halo = parts[zero].halo;
    let size = vec2<i32>(optical.size);
    origin = vec2<i32>(group.xy) * (SIDE - 2 * halo) - halo;
    var eyes: array<vec4<f32>, 4>;
    for (var q = 0u; q < 4u; q++) {
        let cell = cell_of(q, local.xy);
        let p = clamp(origin + cell, vec2<i32>(0), size - 1);
        let at = u32(p.y) * optical.size.x + u32(p.x);
        light[u32(cell.y) * u32(SIDE) + u32(cell.x)] = before[at];
        eyes[q] = eye[at];
    }
    first = 0u;
    workgroupBarrier();
    for (var k = 0u; k < together; k++) {
        now = zero + k;
        fixed = now;
        let edge = halo - parts[now].margin;
        for (var q = 0u; q < 4u; q++) {
            let cell = cell_of(q, local.xy);
            let pixel = origin + cell;
            let wanted = all(cell >= vec2<i32>(edge)) & all(cell < vec2<i32>(SIDE - edge))
                & all(pixel >= vec2<i32>(0)) & all(pixel < size);
            // A loop, because software drivers run what a branch leaves out.
            for (var once = 0u; once < select(0u, 1u, wanted); once++) {
                let at = vec2<u32>(pixel);
                var behind = 0.0;
                if variant == MENDED {
                    let next = advance(eyes[q], lattice(at), from_middle(at));
                    eyes[q] = next.eye;
                    behind = next.light;
                } else {
                    var optics = vec4<f32>(0.0);
                    if parts[now].is_empty == 0u {
                        optics = optics_at(place(from_middle(at), parts[fixed].depth + 0.5 * dos.slice_mm));
                    }
                    behind = disc(at, optics.w);
                    eyes[q] = blend(eyes[q], optics, texel(pixel));
                }
                light[CELLS - first + u32(cell.y) * u32(SIDE) + u32(cell.x)] = behind;
            }
        }
        first = CELLS - first;
        workgroupBarrier();
    }
    for (var q = 0u; q < 4u; q++) {
        let cell = cell_of(q, local.xy);
        let pixel = origin + cell;
        let inner = all(cell >= vec2<i32>(halo)) & all(cell < vec2<i32>(SIDE - halo)) & all(pixel < size);
        if inner {
            let at = u32(pixel.y) * optical.size.x + u32(pixel.x);
            after[at] = light[first + u32(cell.y) * u32(SIDE) + u32(cell.x)];
            eye[at] = eyes[q];
        }
    }
}
