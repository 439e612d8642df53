// A step of directional occlusion by slices (Schott et al. 2009) through the context image, with opaque
// surfaces in it (Schott et al. 2012). See render/src/light/slices.

struct Slices {
    slice_mm: f32,
    flags: u32,
    strength: f32,                  // darkness of unlit places, 0 to 1
    lag_px: f32,                    // behind an opaque surface, where it hides a lamp behind the scene
    decay: array<vec4<f32>, 257>,   // see lib/decay
}

// A rectangle of whole workgroups.
struct Area {
    origin: vec2<u32>,              // its first pixel
    first: u32,                     // its first workgroup among those of the dispatch
    per_row: f32,                   // 1 / workgroups across
}

struct Part {
    depth: f32,                     // front of the first slice
    slices: u32,
    side: u32,                      // samples along a side of the footprint
    stride: i32,                    // lattice: pixels between samples
    center: f32,                    // lattice: weight of the pixel itself
    radius: f32,                    // disc: pixels
    radius_mm: f32,
    share: f32,                     // weight of one sample
    turn: u32,                      // which half of `lights` is read
    is_last: u32,
    columns: u32,                   // workgroups across of the dispatch
    pad: u32,
    shift: vec2<f32>,               // ellipse: pixels, after a pixel's offset from the frame's middle grew
    scale: f32,                     // by this much
    pixel_mm: f32,
    along: vec2<f32>,               // its half axes, pixels
    across: vec2<f32>,
    areas: array<Area, 5>,          // in order; behind the last, one beyond the frame
}

const VOLUME_ON_VOLUME = 1u;

override variant: u32 = 2u;
// Whether the frame has opaque geometry. Then two lights are propagated: behind the image alone, which lights
// opaque geometry, and behind both, which lights the image.
override with_solid: bool = false;
// Whether both are stored although no light of this step has reached opaque geometry: then they are equal.
override two_lights: bool = false;
// Most steps have one slice. On Mesa's software driver a loop costs a third of the step's time.
override one_slice: bool = false;
// Whether opaque surfaces don't darken the image.
override solid_lets_through: bool = false;
// Whether opaque surfaces darken each other through the slices, as in the paper.
override solid_on_solid: bool = false;
// Whether light comes from a lamp: footprints are ellipses, and light doesn't pass slices along the line of sight.
override towards_lamp: bool = false;
// Whether that is behind the scene: steps are in order from back to front.
override from_behind: bool = false;
// Whether eye rays pass opaque geometry that covers its pixel in part: they then end at depths of their own,
// stored behind the others in `depths`.
override ends_apart: bool = false;
// Steps that contain nothing of the image.
override is_empty: bool = false;

const PAPER_EXACT = 0u;
const PAPER_APPROXIMATE = 1u;
const MENDED = 2u;

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(31) var<uniform> slices: Slices;
// This step, and whatever follows it in the buffer. Values that branches and loops depend on are read at index
// `zero`: see lib/zero.
@group(0) @binding(32) var<uniform> parts: array<Part, 2>;
@group(0) @binding(33) var<storage, read_write> lights: array<f32>;
@group(0) @binding(34) var<storage, read_write> eye: array<vec4<f32>>;    // radiance, transmittance
@group(0) @binding(35) var<storage, read_write> notes: array<vec2<f32>>;  // see slices/finish

// A thread's pixel: the dispatch has the workgroups of all areas, one after the other.
fn pixel_in_areas(workgroup: vec3<u32>, thread: vec3<u32>) -> vec2<u32> {
    let number = workgroup.y * parts[zero].columns + workgroup.x;
    var area = parts[zero].areas[0];
    for (var i = 1u; i < 5u; i++) {
        let next = parts[zero].areas[i];
        let is_in = number >= next.first;
        area.origin = select(area.origin, next.origin, is_in);
        area.first = select(area.first, next.first, is_in);
        area.per_row = select(area.per_row, next.per_row, is_in);
    }
    let at = number - area.first;
    let across = u32(round(1.0 / area.per_row));
    // Rounding is off by one row at most, in frames of millions of workgroups.
    let about = u32((f32(at) + 0.5) * area.per_row);
    let row = about + select(0u, 1u, (about + 1u) * across <= at) - select(0u, 1u, about * across > at);
    return area.origin + 8u * vec2<u32>(at - row * across, row) + thread.xy;
}

fn decay_entry(i: u32) -> vec4<f32> {
    return slices.decay[i];
}

#include lib/decay

fn light_place(at: u32, turn: u32) -> u32 {
    let pixels = view.size.x * view.size.y;
    return select(turn * pixels + at, 2u * (turn * pixels + at), two_lights);
}

// Index in `lights` of the depths between which a pixel shows the image: behind both halves.
fn range_place(at: u32) -> u32 {
    return light_place(0u, 2u) + 2u * at;
}

// Beyond the frame its edge pixels extend.
fn texel(at: vec2<i32>) -> vec2<f32> {
    let p = clamp(at, vec2<i32>(0), vec2<i32>(view.size) - 1);
    let place = light_place(linear_index(vec2<u32>(p)), parts[zero].turn);
    if with_solid {
        return vec2<f32>(lights[place], lights[place + 1u]);
    }
    return vec2<f32>(lights[place + select(0u, 1u, two_lights)]);
}

// Bilinear; `at` is in pixels from the frame's corner.
fn smooth_texel(at: vec2<f32>) -> vec2<f32> {
    let low = floor(at - 0.5);
    let f = at - 0.5 - low;
    let i = vec2<i32>(low);
    let a = mix(texel(i), texel(i + vec2<i32>(1, 0)), f.x);
    let b = mix(texel(i + vec2<i32>(0, 1)), texel(i + vec2<i32>(1, 1)), f.x);
    return mix(a, b, f.y);
}

// The same, exact between equal values.
fn light_at(at: vec2<f32>) -> vec2<f32> {
    let low = floor(at - 0.5);
    let f = at - 0.5 - low;
    let i = vec2<i32>(low);
    let a = texel(i);
    let b = texel(i + vec2<i32>(0, 1));
    let top = a + (texel(i + vec2<i32>(1, 0)) - a) * f.x;
    let bottom = b + (texel(i + vec2<i32>(1, 1)) - b) * f.x;
    return top + (bottom - top) * f.y;
}

// A slice of the step by its number in the light's order: its front.
fn front_of(number: u32) -> f32 {
    return parts[zero].depth + f32(select(number, parts[zero].slices - 1u - number, from_behind)) * slices.slice_mm;
}

// Where the light of a lamp crosses the slice before, in pixels from the frame's corner.
fn towards(pixel: vec2<u32>) -> vec2<f32> {
    let middle = 0.5 * vec2<f32>(view.size);
    let off = vec2<f32>(pixel) + 0.5 - middle;
    return middle + off + (parts[zero].scale * off + parts[zero].shift);
}

// Light of a tilted cone: all points of the square.
fn ellipse(pixel: vec2<u32>) -> vec2<f32> {
    let center = towards(pixel);
    var sum = vec2<f32>(0.0);
    for (var j = 0u; j < parts[zero].side; j++) {
        for (var i = 0u; i < parts[zero].side; i++) {
            let p = (vec2<f32>(vec2<u32>(i, j)) + 0.5) / f32(parts[zero].side) * 2.0 - 1.0;
            sum += light_at(center + p.x * parts[zero].along + p.y * parts[zero].across);
        }
    }
    return sum * parts[zero].share;
}

// Algorithms 2 and 3 of the first paper: one extinction per light.
fn disc(pixel: vec2<u32>, extinction: vec2<f32>) -> vec2<f32> {
    let center = vec2<f32>(pixel) + 0.5;
    let d = slices.slice_mm;
    let approximate = exp(-extinction * d);
    var sum = vec2<f32>(0.0);
    for (var j = 0u; j < parts[zero].side; j++) {
        for (var i = 0u; i < parts[zero].side; i++) {
            let p = (vec2<f32>(vec2<u32>(i, j)) + 0.5) / f32(parts[zero].side) * 2.0 - 1.0;
            let off2 = dot(p, p);
            if off2 > 1.000001 {
                continue;
            }
            var through = approximate;
            var off = p * parts[zero].radius;
            if towards_lamp {
                off = towards(pixel) - center + p.x * parts[zero].along + p.y * parts[zero].across;
            }
            if variant == PAPER_EXACT && towards_lamp {
                through = exp(-extinction * length(vec3<f32>(off * parts[zero].pixel_mm, d)));
            } else if variant == PAPER_EXACT {
                through = exp(-extinction * sqrt(d * d + off2 * parts[zero].radius_mm * parts[zero].radius_mm));
            }
            sum += smooth_texel(center + off) * through;
        }
    }
    return sum * parts[zero].share;
}

fn lattice(pixel: vec2<u32>) -> vec2<f32> {
    let center = vec2<i32>(pixel);
    let own = texel(center);
    if parts[zero].side == 1u {
        return own;
    }
    let first = center - (i32(parts[zero].side) - 1) * parts[zero].stride / 2;
    var sum = vec2<f32>(0.0);
    for (var j = 0; j < i32(parts[zero].side); j++) {
        for (var i = 0; i < i32(parts[zero].side); i++) {
            sum += texel(first + vec2<i32>(i, j) * parts[zero].stride);
        }
    }
    return mix(sum * parts[zero].share, own, parts[zero].center);
}
