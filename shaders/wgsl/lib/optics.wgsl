// A sampled volume as a participating medium, and where pixels are at view depths. Shared by every
// occlusion backend; see render/src/occlusion.
//
// Index space: voxel (i, j, k) fills [i, i+1) x [j, j+1) x [k, k+1). Depths are millimetres of view
// depth from a plane at the volume's front.

#include lib/zero.wgsl
#include lib/weighed.wgsl

struct Optical {
    corner: vec3<f32>,              // index space, where the view axis meets the plane of depth 0
    pixel_mm: f32,                  // on that plane
    right: vec3<f32>,               // index space, one millimetre to the right
    pixel_mm_per_mm: f32,           // growth with depth; 0 for the orthographic camera
    up: vec3<f32>,
    table_scale: f32,               // value * scale + offset is its place in the table
    forward: vec3<f32>,
    table_offset: f32,
    plane: vec4<f32>,               // index space; kept where dot(xyz, place) <= w
    dims: vec3<u32>,
    table_last: u32,
    bricks: vec3<u32>,
    nearest: u32,                   // 1: labels, 0: trilinear
    size: vec2<u32>,
    skipping: u32,                  // 1: empty bricks are not sampled
    pad: u32,
}

@group(0) @binding(0) var<uniform> optical: Optical;
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read> table: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> occupied: array<u32>;

// Set when the pipeline is made, where that pays: software drivers run both sides of a branch, and the
// side not taken cost as much as the rest of a sample.
override filtering: u32 = 2u;       // 0: trilinear, 1: labels, 2: what optical.nearest says
override by_bricks: u32 = 2u;       // 0: bricks count for nothing, 1: empty ones are skipped, 2: what optical.skipping says

// From here on an extinction is infinite.
const OPAQUE_FROM = 1e20;

// Pixel centre in pixels from the middle of the picture, y up.
fn from_middle(pixel: vec2<u32>) -> vec2<f32> {
    let at = vec2<f32>(pixel) + 0.5 - 0.5 * vec2<f32>(optical.size);
    return vec2<f32>(at.x, -at.y);
}

fn place(middle: vec2<f32>, depth: f32) -> vec3<f32> {
    let mm = middle * (optical.pixel_mm + optical.pixel_mm_per_mm * depth);
    return optical.corner + mm.x * optical.right + mm.y * optical.up + depth * optical.forward;
}

// Millimetres of the line of sight a millimetre of view depth.
fn slant_of(middle: vec2<f32>) -> f32 {
    let off = middle * optical.pixel_mm_per_mm;
    return sqrt(1.0 + dot(off, off));
}

fn index_of(cell: vec3<u32>) -> u32 {
    return (cell.z * optical.dims.y + cell.y) * optical.dims.x + cell.x;
}

fn value_at(cell: vec3<u32>) -> f32 {
    return values[index_of(cell)];
}

fn classify(value: f32) -> vec4<f32> {
    let last = f32(optical.table_last);
    let x = clamp(value * optical.table_scale + optical.table_offset, 0.0, last);
    let low = min(floor(x), last - 1.0);
    return mix(table[u32(low)], table[u32(low) + 1u], x - low);
}

// Colour, and extinction per millimetre, at a place of index space.
fn optics_at(p: vec3<f32>) -> vec4<f32> {
    let size = vec3<f32>(optical.dims);
    let outside = any(p < vec3<f32>(0.0)) || any(p > size);
    if outside || dot(optical.plane.xyz, p) > optical.plane.w {
        return vec4<f32>(0.0);
    }
    if by_bricks == 1u || by_bricks == 2u && varied(optical.skipping) == 1u {
        let brick = min(vec3<u32>(p), optical.dims - 1u) / 8u;
        let i = (brick.z * optical.bricks.y + brick.y) * optical.bricks.x + brick.x;
        if (occupied[i / 32u] >> (i % 32u) & 1u) == 0u {
            return vec4<f32>(0.0);
        }
    }
    if filtering == 1u || filtering == 2u && varied(optical.nearest) == 1u {
        return classify(value_at(min(vec3<u32>(p), optical.dims - 1u)));
    }
    let at = clamp(p - 0.5, vec3<f32>(0.0), size - 1.0);
    let low = min(vec3<u32>(at), max(optical.dims, vec3<u32>(2u)) - 2u);
    let f = at - vec3<f32>(low);
    // To the next voxel along each axis; where there is none f is 0.
    let all = vec3<u32>(1u, optical.dims.x, optical.dims.x * optical.dims.y);
    let on = select(vec3<u32>(0u), all, optical.dims > vec3<u32>(1u));
    let i = index_of(low);
    let j = i + on.z;
    let a = weighed(values[i], values[i + on.x], f.x);
    let b = weighed(values[i + on.y], values[i + on.y + on.x], f.x);
    let c = weighed(values[j], values[j + on.x], f.x);
    let d = weighed(values[j + on.y], values[j + on.y + on.x], f.x);
    return classify(weighed(weighed(a, b, f.y), weighed(c, d, f.y), f.z));
}
