// The context image: sampling, classification, and its interval along a pixel's ray.
// Coordinates are in voxel centres: the image's box is -0.5 to dims - 0.5.

struct Context {
    corner: vec3<f32>,           // of the image: index space, where the view axis meets the reference plane
    step_mm: f32,
    right: vec3<f32>,            // index space, one millimetre to the right
    table_scale: f32,            // from stored values to positions in `table`
    up: vec3<f32>,
    table_offset: f32,
    forward: vec3<f32>,
    factor_scale: f32,           // from gradients of stored values per mm to positions in `factors`, or to rows of `table`
    dims: vec3<u32>,
    factor_offset: f32,
    bricks: vec3<u32>,
    flags: u32,
    half_shaded: f32,            // gradient (stored values per mm) of half-strength shading
    ambient: f32,
    specular: f32,
    pad: u32,
    clips: array<vec4<f32>, 6>,  // camera space: dot(xyz, p) <= w is kept
    cut_fade_mm: f32,            // depth below a cut at which shading reaches full strength
    table_last: u32,             // index of the table's last entry
    factor_last: u32,
    shading: f32,                // how much of the headlight's shading is shown, 0 to 1
    lamp: vec3<f32>,             // camera space, towards the lamp, unit length
    unused: u32,
}

const JITTER = 1u;
const TWO_D = 2u;
const FROM_LAMP = 4u;           // gradients are shaded by the lamp instead of the light at the eye

// Whether the pipeline evaluates gradients at all: Mesa's software driver executes both sides of a branch.
override gradient_counts: bool = true;
// Whether colour and opacity are looked up by value and gradient magnitude together.
override joint: bool = false;

// Stored values are 0 to 1; one that isn't finite is stored far below, and so are interpolated values near it.
const NOT_FINITE = -0.5;
const TOO_STEEP = 1e9;
@group(0) @binding(11) var<uniform> context: Context;
@group(0) @binding(12) var<storage, read> values: array<f32>;
@group(0) @binding(13) var<storage, read> visible: array<u32>;       // a bit per brick
@group(0) @binding(14) var<storage, read> table: array<vec4<f32>>;   // rgb, opacity of 1 mm
@group(0) @binding(15) var<storage, read> factors: array<f32>;

#include lib/weighed

// Bilinear interpolation of four values.
fn across(v: vec4<f32>, w: vec2<f32>) -> f32 {
    return weighed(weighed(v.x, v.y, w.x), weighed(v.z, v.w, w.x), w.y);
}

struct Place {
    cell: vec3<u32>,     // lower corner, in voxel centres
    weight: vec3<f32>,
}

// `q` in voxel centres; beyond the outermost ones the edge voxels extend.
fn place_of(q: vec3<f32>) -> Place {
    let inside = clamp(q, vec3<f32>(0.0), vec3<f32>(context.dims - 1u));
    var p: Place;
    p.cell = min(vec3<u32>(inside), max(context.dims, vec3<u32>(2u)) - 2u);
    p.weight = inside - vec3<f32>(p.cell);
    return p;
}

fn is_visible(brick: vec3<u32>) -> bool {
    let at = (brick.z * context.bricks.y + brick.y) * context.bricks.x + brick.x;
    return ((visible[at >> 5u] >> (at & 31u)) & 1u) != 0u;
}

struct Corners {
    low: vec4<f32>,      // at the lower z: 00, 10, 01, 11 in x and y
    high: vec4<f32>,
}

fn corners_at(at: u32, step: vec3<u32>) -> Corners {
    var c: Corners;
    let above = at + step.z;
    c.low = vec4<f32>(values[at], values[at + step.x], values[at + step.y], values[at + step.x + step.y]);
    c.high = vec4<f32>(values[above], values[above + step.x], values[above + step.y], values[above + step.x + step.y]);
    return c;
}

fn four(at: u32, a: u32, b: u32) -> vec4<f32> {
    return vec4<f32>(values[at], values[at + a], values[at + b], values[at + a + b]);
}

// Gradient per mm in camera space, by central differences of the interpolated image, one voxel to each side.
fn gradient_at(p: Place, at: u32, step: vec3<u32>, c: Corners) -> vec3<f32> {
    let stride = vec3<u32>(1u, context.dims.x, context.dims.x * context.dims.y);
    let before = at - select(vec3<u32>(0u), stride, p.cell > vec3<u32>(0u));
    let behind = at + step + select(vec3<u32>(0u), stride, p.cell + 2u < context.dims);
    let w = p.weight;
    let x0 = across(vec4<f32>(c.low.x, c.low.z, c.high.x, c.high.z), w.yz);
    let x1 = across(vec4<f32>(c.low.y, c.low.w, c.high.y, c.high.w), w.yz);
    let y0 = across(vec4<f32>(c.low.xy, c.high.xy), w.xz);
    let y1 = across(vec4<f32>(c.low.zw, c.high.zw), w.xz);
    let z0 = across(c.low, w.xy);
    let z1 = across(c.high, w.xy);
    let first = vec3<f32>(
        across(four(before.x, step.y, step.z), w.yz),
        across(four(before.y, step.x, step.z), w.xz),
        across(four(before.z, step.x, step.y), w.xy));
    let last = vec3<f32>(
        across(four(behind.x, step.y, step.z), w.yz),
        across(four(behind.y, step.x, step.z), w.xz),
        across(four(behind.z, step.x, step.y), w.xy));
    let lower = vec3<f32>(x0, y0, z0);
    let upper = vec3<f32>(x1, y1, z1);
    let difference = 0.5 * ((upper - first) * (1.0 - w) + (last - lower) * w);
    // Gradients transform by the inverse transpose, whose rows are the camera axes in index space.
    return vec3<f32>(
        dot(context.right, difference), dot(context.up, difference), dot(context.forward, difference));
}

fn looked_up(value: f32) -> vec4<f32> {
    let x = clamp(value * context.table_scale + context.table_offset, 0.0, f32(context.table_last));
    let i = min(u32(x), context.table_last - 1u);
    return mix(table[i], table[i + 1u], x - f32(i));
}

// The table's rows belong to gradient magnitudes then, and its colours are multiplied by the opacity.
fn looked_up_jointly(value: f32, gradient: f32) -> vec4<f32> {
    let last = vec2<u32>(context.table_last, context.factor_last);
    let place = vec2<f32>(
        value * context.table_scale + context.table_offset, gradient * context.factor_scale + context.factor_offset);
    let x = clamp(place, vec2<f32>(0.0), vec2<f32>(last));
    let i = min(vec2<u32>(x), last - 1u);
    let w = x - vec2<f32>(i);
    let lower = i.y * (last.x + 1u) + i.x;
    let upper = lower + last.x + 1u;
    let found = mix(mix(table[lower], table[lower + 1u], w.x), mix(table[upper], table[upper + 1u], w.x), w.y);
    return vec4<f32>(found.rgb / max(found.a, 1e-20), found.a);
}

fn factor_of(gradient: f32) -> f32 {
    let x = clamp(gradient * context.factor_scale + context.factor_offset, 0.0, f32(context.factor_last));
    let i = min(u32(x), context.factor_last - 1u);
    return weighed(factors[i], factors[i + 1u], x - f32(i));
}

// Opacity of `length_mm` of a material of which 1 mm has opacity `per_mm`.
fn opacity_over(per_mm: f32, length_mm: f32) -> f32 {
    return select(1.0 - exp2(length_mm * log2(max(1.0 - per_mm, 1e-30))), 1.0, per_mm >= 1.0);
}

fn shows_anything(place: Place) -> bool {
    return ((flags() & NO_SKIPPING) != 0u) | is_visible(place.cell >> vec3<u32>(3u));
}

// Colour, and opacity of 1 mm, in a visible brick.
fn material_of(place: Place) -> vec4<f32> {
    let stride = vec3<u32>(1u, context.dims.x, context.dims.x * context.dims.y);
    let to_next = select(vec3<u32>(0u), stride, context.dims > vec3<u32>(1u));
    let here = dot(place.cell, stride);
    let corners = corners_at(here, to_next);
    let value = weighed(across(corners.low, place.weight.xy), across(corners.high, place.weight.xy), place.weight.z);
    if joint {
        let steepness = length(gradient_at(place, here, to_next, corners));
        let known = (value > NOT_FINITE) & (steepness < TOO_STEEP);
        return select(vec4<f32>(0.0), looked_up_jointly(value, steepness), known);
    }
    var material = select(vec4<f32>(0.0), looked_up(value), value > NOT_FINITE);
    if gradient_counts && (varied(context.flags) & TWO_D) != 0u && material.a > 0.0 {
        let steepness = length(gradient_at(place, here, to_next, corners));
        material.a *= select(0.0, factor_of(steepness), steepness < TOO_STEEP);
    }
    return material;
}

// Material at a point in voxel centres; transparent in invisible bricks.
fn material_at(q: vec3<f32>) -> vec4<f32> {
    let place = place_of(q);
    let material = material_of(place);
    return select(vec4<f32>(0.0), material, shows_anything(place));
}

// Extinction per millimetre, capped where nothing is transmitted.
fn extinction_of(material: vec4<f32>) -> f32 {
    return -log(max(1.0 - material.a, 1e-30));
}

struct ImageRay {
    o: vec3<f32>,        // voxel centres, at depth 0
    d: vec3<f32>,        // per millimetre of depth
    along: vec3<f32>,    // camera space, per millimetre of depth
    near: f32,           // depths between which the image is visible
    far: f32,
}

// A pixel's ray in voxel centres: its point at depth 0, and its direction per millimetre of depth; `p` in pixels
// from the frame's centre.
fn image_line(p: vec2<f32>) -> array<vec3<f32>, 2> {
    let aside = p.x * context.right + p.y * context.up;
    return array<vec3<f32>, 2>(
        context.corner + view.mm_per_pixel * aside - 0.5, context.forward + view.mm_per_pixel_per_mm * aside);
}

// The interval of a line in the image's box, `o` and `d` in voxel centres; empty where the line misses it. No branches: lines may
// be the same for all threads.
fn image_box(o: vec3<f32>, d: vec3<f32>) -> vec2<f32> {
    let moves = abs(d) > vec3<f32>(1e-12);
    let inv = select(vec3<f32>(0.0), 1.0 / select(vec3<f32>(1.0), d, moves), moves);
    let lower = vec3<f32>(-0.5);
    let upper = vec3<f32>(context.dims) - 0.5;
    let a = select(vec3<f32>(-FAR), (lower - o) * inv, moves);
    let b = select(vec3<f32>(FAR), (upper - o) * inv, moves);
    let enter = min(a, b);
    let leave = max(a, b);
    let near = max(enter.x, max(enter.y, enter.z));
    let misses = any(!moves & ((o < lower) | (o >= upper)));
    return vec2<f32>(near, select(min(leave.x, min(leave.y, leave.z)), near, misses));
}

// The interval of a pixel's ray where the image is visible: in its box, nearer than depth `ahead`, not
// clipped, neither inside the masks' box nor in front of it.
fn image_ray(p: vec2<f32>, ahead: f32) -> ImageRay {
    let line = image_line(p);
    let o = line[0];
    let d = line[1];
    let inside = image_box(o, d);
    var near = max(view.nearest_mm, inside.x);
    var far = min(ahead, inside.y);

    // Clipping planes.
    let start = vec3<f32>(p * view.mm_per_pixel, 0.0);
    let along = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    // Unused planes cut nothing: a loop of fixed length is not recompiled for another number.
    for (var n = 0u; n < 6u; n++) {
        let plane = context.clips[n];
        let to_plane = plane.w - dot(plane.xyz, start);
        let rate = dot(plane.xyz, along);
        if rate > 0.0 {
            far = min(far, to_plane / rate);
        } else if rate < 0.0 {
            near = max(near, to_plane / rate);
        } else if to_plane < 0.0 {
            far = near;
        }
    }

    // The image is left out in front of the masks' box and inside it. A box without voxels is never entered.
    let span = box_interval(ray_through(p));
    near = select(near, max(near, span.far), span.near < span.far);
    return ImageRay(o, d, along, near, far);
}
