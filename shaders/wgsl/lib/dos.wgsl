// Slices of directional occlusion shading (Schott et al. 2009); see render/src/dos.

#include lib/optics.wgsl

struct Dos {
    slice_mm: f32,
    pad: u32,
    tiles: vec2<u32>,
    decay: array<vec4<f32>, 257>,   // see lib/decay.wgsl
}

struct Step {
    depth: f32,                     // front of the first slice
    slices: u32,
    side: u32,                      // points along a side of the footprint
    stride: i32,                    // lattice: pixels between them
    center: f32,                    // lattice: weight of the pixel itself
    radius: f32,                    // disc: pixels
    radius_mm: f32,
    share: f32,                     // weight of one point
    is_empty: u32,
    states: u32,                    // which third of the tiles' states is read
    stops: u32,                     // 1: saturated tiles may stop
    together: u32,                  // steps of this dispatch, of the first; see dos_tiles.wgsl
    halo: i32,                      // how far all of them read, pixels; of the first
    margin: i32,                    // how far those behind this one read
    pad0: u32,
    pad1: u32,
    // Folded disc: of each ring its distance in mm and 3, 7 or 11 weights, then of all together. Rows: of each distance whole pixels,
    // the rest, how many distances a row at it has, and the weight of a pair; then the points' distance in mm.
    folded: array<vec4<f32>, 69>,
}

// Set when the pipeline is made: software drivers run both sides of a branch, so that one shader for
// all variants would sample the volume for each of them.
override variant: u32 = 0u;
// How far a folded disc reaches, pixels; DIRECT: point by point; ROWS: along rows (dos_rows.wgsl) and then across.
override reach: u32 = 4u;
override rings: u32 = 1u;           // of a folded disc; of ROWS the distances of rows

const PAPER_EXACT = 0u;
const PAPER_APPROXIMATE = 1u;
const MENDED = 2u;
const DIRECT = 4u;
const ROWS = 5u;

@group(0) @binding(4) var<uniform> dos: Dos;
// The step, and those behind it. What branches and loops depend on is read at `now`, which main sets: see
// lib/zero.wgsl. The rest is read at `fixed`, the same number: where there is one step it is a constant, which
// reads faster.
@group(0) @binding(5) var<uniform> parts: array<Step, 8>;
var<private> now: u32 = 0u;
var<private> fixed: u32 = 0u;
@group(0) @binding(6) var<storage, read> before: array<f32>;
@group(0) @binding(7) var<storage, read_write> after: array<f32>;
@group(0) @binding(8) var<storage, read_write> eye: array<vec4<f32>>; // radiance, transmittance

// Of each pixel, one picture after the other: its row summed up to each distance.
@group(0) @binding(10) var<storage, read_write> rows: array<f32>;

fn decay_entry(i: u32) -> vec4<f32> {
    return dos.decay[i];
}

#include lib/decay.wgsl

// Bilinear, from a pixel's corner on.
fn between(at: vec2<f32>) -> f32 {
    let low = floor(at - 0.5);
    let f = at - 0.5 - low;
    let i = vec2<i32>(low);
    let a = mix(texel(i), texel(i + vec2<i32>(1, 0)), f.x);
    let b = mix(texel(i + vec2<i32>(0, 1)), texel(i + vec2<i32>(1, 1)), f.x);
    return mix(a, b, f.y);
}

fn attenuation(extinction: f32, length: f32) -> f32 {
    return exp(-extinction * length);
}

// Sums of the texels that mirroring brings onto each other, on the axes, on the diagonals, between.
fn on_axes(at: vec2<i32>, a: i32) -> f32 {
    return texel(at + vec2<i32>(a, 0)) + texel(at - vec2<i32>(a, 0)) + texel(at + vec2<i32>(0, a))
        + texel(at - vec2<i32>(0, a));
}

fn off_axes(at: vec2<i32>, a: i32, b: i32) -> f32 {
    return texel(at + vec2<i32>(a, b)) + texel(at - vec2<i32>(a, b)) + texel(at + vec2<i32>(a, -b))
        + texel(at - vec2<i32>(a, -b));
}

// The same sum as `disc`'s, each texel read once: its bilinear weights are those of every pixel, and are
// added up beforehand, for each ring of points at one distance.
fn folded(pixel: vec2<u32>, extinction: f32) -> f32 {
    let at = vec2<i32>(pixel);
    var near = vec3<f32>(texel(at), 0.0, 0.0);
    var far = vec4<f32>(0.0);
    var farthest = vec3<f32>(0.0);
    if reach >= 1u {
        near = vec3<f32>(near.x, on_axes(at, 1), off_axes(at, 1, 1));
    }
    if reach >= 2u {
        far = vec4<f32>(on_axes(at, 2), off_axes(at, 2, 1) + off_axes(at, 1, 2), off_axes(at, 2, 2), 0.0);
    }
    if reach >= 3u {
        far.w = on_axes(at, 3);
        farthest = vec3<f32>(
            off_axes(at, 3, 1) + off_axes(at, 1, 3),
            off_axes(at, 3, 2) + off_axes(at, 2, 3),
            off_axes(at, 3, 3),
        );
    }
    let size = max(reach, 1u);
    var sum = 0.0;
    // Where nothing is, all rings weigh the same. A loop: software drivers run both sides of a branch.
    let apart = rings == 1u || extinction > 0.0;
    let last = select(rings + 1u, rings, apart);
    for (var i = select(rings, 0u, apart); i < last; i++) {
        let first = parts[fixed].folded[i * size];
        var light = dot(first.yzw, near);
        if reach >= 2u {
            light += dot(parts[fixed].folded[i * size + 1u], far);
        }
        if reach >= 3u {
            light += dot(parts[fixed].folded[i * size + 2u].xyz, farthest);
        }
        sum += light * attenuation(extinction, first.x);
    }
    return sum;
}

fn row_sum(at: vec2<i32>, first: u32) -> f32 {
    let size = vec2<i32>(optical.size);
    return rows[first + u32(clamp(at.y, 0, size.y - 1) * size.x + at.x)];
}

// Across the rows that dos_rows.wgsl summed up: the sum of all points.
fn across_rows(pixel: vec2<u32>) -> f32 {
    let at = vec2<i32>(pixel);
    var sum = 0.0;
    for (var h = 0u; h < rings; h++) {
        let row = parts[fixed].folded[h];
        let first = (u32(row.z) - 1u) * optical.size.x * optical.size.y;
        let off = vec2<i32>(0, i32(row.x));
        let near = row_sum(at + off, first) + row_sum(at - off, first);
        let far = row_sum(at + off + vec2<i32>(0, 1), first) + row_sum(at - off - vec2<i32>(0, 1), first);
        sum += row.w * mix(near, far, row.y);
    }
    return sum;
}

// Algorithms 2 and 3 of the paper.
fn disc(pixel: vec2<u32>, extinction: f32) -> f32 {
    let d = dos.slice_mm;
    let approximate = attenuation(extinction, d);
    var side = parts[now].side;
    var sum = 0.0;
    if reach == ROWS {
        // Where nothing is, all points weigh the same also in the exact variant; those of 2x2 do everywhere.
        let apart = variant == PAPER_EXACT && side > 2u && extinction > 0.0;
        side = select(0u, side, apart);
        sum = select(across_rows(pixel) * attenuation(extinction, parts[fixed].folded[rings].x), 0.0, apart);
    } else if reach != DIRECT {
        return folded(pixel, extinction);
    }
    let center = vec2<f32>(pixel) + 0.5;
    for (var j = 0u; j < side; j++) {
        for (var i = 0u; i < side; i++) {
            let p = (vec2<f32>(vec2<u32>(i, j)) + 0.5) / f32(side) * 2.0 - 1.0;
            let off2 = dot(p, p);
            if off2 > 1.000001 {
                continue;
            }
            var through = approximate;
            if variant == PAPER_EXACT {
                through = attenuation(extinction, sqrt(d * d + off2 * parts[fixed].radius_mm * parts[fixed].radius_mm));
            }
            sum += between(center + p * parts[fixed].radius) * through;
        }
    }
    return sum * parts[fixed].share;
}

fn lattice(pixel: vec2<u32>) -> f32 {
    let center = vec2<i32>(pixel);
    let own = texel(center);
    if parts[now].side == 1u {
        return own;
    }
    let stride = parts[fixed].stride;
    let first = center - (i32(parts[now].side) - 1) * stride / 2;
    var sum = 0.0;
    for (var j = 0; j < i32(parts[now].side); j++) {
        for (var i = 0; i < i32(parts[now].side); i++) {
            sum += texel(first + vec2<i32>(i, j) * stride);
        }
    }
    return mix(sum * parts[fixed].share, own, parts[fixed].center);
}

// The paper's blending of one slice into the eye buffer.
fn blend(state: vec4<f32>, optics: vec4<f32>, occlusion: f32) -> vec4<f32> {
    let alpha = absorbed(optics.w * dos.slice_mm);
    return vec4<f32>(state.rgb + optics.rgb * (occlusion * alpha * state.w), state.w * (1.0 - alpha));
}

struct Advanced {
    eye: vec4<f32>,
    light: f32,
}

// The mended variant through the slices of a step.
fn advance(state: vec4<f32>, occlusion: f32, middle: vec2<f32>) -> Advanced {
    var seen = state;
    var light = occlusion;
    let length = dos.slice_mm * slant_of(middle);
    for (var i = 0u; i < parts[now].slices; i++) {
        let optics = optics_at(place(middle, parts[fixed].depth + (f32(i) + 0.5) * dos.slice_mm));
        if optics.w <= 0.0 {
            continue;
        }
        if optics.w >= OPAQUE_FROM {
            seen = vec4<f32>(seen.rgb + optics.rgb * (light * seen.w), 0.0);
            light = 0.0;
            continue;
        }
        let thickness = optics.w * length;
        let slice = through_slice(light, thickness);
        seen = vec4<f32>(seen.rgb + optics.rgb * (slice.x * seen.w), seen.w * exp(-thickness));
        light = slice.y;
    }
    return Advanced(seen, light);
}
