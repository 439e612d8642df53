// The context image along each ray, emission and absorption, front to back (thesis 7.3.2). A ray
// that meets the box of the masks starts behind it, and ends at what is seen there: pixels that show
// tumour are done already.
//
// A ray's interval is cut into cells of one step's length, the first one shortened by the jitter and
// the last by the interval's end. Each is sampled in its middle, with the opacity of its own length:
// a homogeneous stretch has its closed form whatever the step and the jitter. Which samples a ray
// has does not depend on the bricks that are jumped over.
#include lib/view.wgsl
#include lib/march.wgsl
#include lib/context.wgsl

struct Context {
    corner: vec3<f32>,           // of the image: index space, where the view axis meets the reference plane
    step_mm: f32,
    right: vec3<f32>,            // index space, one millimetre to the right
    table_scale: f32,            // from stored values to places in the table
    up: vec3<f32>,
    table_offset: f32,
    forward: vec3<f32>,
    factor_scale: f32,           // from gradients of stored values per mm to places among the factors
    dims: vec3<u32>,
    factor_offset: f32,
    bricks: vec3<u32>,
    flags: u32,
    half_shaded: f32,            // gradient (stored values per mm) at which shading has half its strength
    ambient: f32,
    specular: f32,
    clip_count: u32,
    clips: array<vec4<f32>, 6>,  // camera space: what has dot(xyz, p) <= w is kept
    cut_fade_mm: f32,            // depth below a cut at which shading has all its strength
    table_last: u32,             // number of the table's last entry
    factor_last: u32,
    unused: u32,
}

const JITTER = 1u;
const TWO_D = 2u;

// Stored values are 0 to 1; what is not finite is far below, and so is every mean that it is part of.
const NOT_FINITE = -0.5;
const TOO_STEEP = 1e9;
// What is left of the light behind, at which a ray ends.
const DARK = 0.005;

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(6) var<storage, read_write> marched: array<Marched>;
@group(0) @binding(11) var<uniform> context: Context;
@group(0) @binding(12) var<storage, read> values: array<f32>;
@group(0) @binding(13) var<storage, read> visible: array<u32>;       // a bit a brick
@group(0) @binding(14) var<storage, read> table: array<vec4<f32>>;   // rgb, opacity of 1 mm
@group(0) @binding(15) var<storage, read> factors: array<f32>;

// In 0..1, the same for a pixel always.
fn hash(pixel: vec2<u32>) -> f32 {
    var h = pixel.x * 0x8da6b343u + pixel.y * 0xd8163841u;
    h = (h ^ (h >> 16u)) * 0x7feb352du;
    h = (h ^ (h >> 15u)) * 0x846ca68bu;
    return f32((h ^ (h >> 16u)) >> 8u) / 16777216.0;
}

// Exact at both ends, so that a value of weight 0 is none.
fn between(a: f32, b: f32, w: f32) -> f32 {
    return a * (1.0 - w) + b * w;
}

// Of four lines along the other two axes.
fn across(v: vec4<f32>, w: vec2<f32>) -> f32 {
    return between(between(v.x, v.y, w.x), between(v.z, v.w, w.x), w.y);
}

struct Place {
    cell: vec3<u32>,     // of voxel centres: its lower corner
    weight: vec3<f32>,
}

// `q` counts voxel centres; past the outermost ones the edge voxels go on.
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

// Gradient per mm in camera space: central differences of one voxel, of the interpolated image.
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
    // A gradient turns with the inverse transpose: these axes of the camera, in index space, are its rows.
    return vec3<f32>(
        dot(context.right, difference), dot(context.up, difference), dot(context.forward, difference));
}

fn looked_up(value: f32) -> vec4<f32> {
    let x = clamp(value * context.table_scale + context.table_offset, 0.0, f32(context.table_last));
    let i = min(u32(x), context.table_last - 1u);
    return mix(table[i], table[i + 1u], x - f32(i));
}

fn factor_of(gradient: f32) -> f32 {
    let x = clamp(gradient * context.factor_scale + context.factor_offset, 0.0, f32(context.factor_last));
    let i = min(u32(x), context.factor_last - 1u);
    return between(factors[i], factors[i + 1u], x - f32(i));
}

// Opacity of a length of material of which 1 mm has opacity `per_mm`.
fn opacity_over(per_mm: f32, length_mm: f32) -> f32 {
    return select(1.0 - exp2(length_mm * log2(max(1.0 - per_mm, 1e-30))), 1.0, per_mm >= 1.0);
}

// Headlight. Where the image is flat, a gradient is noise: shading fades out there. `inside` is how
// far from where the ray was let in: on a cut through tissue one wants to read the image, not a relief
// of its noise.
fn shaded(color: vec3<f32>, gradient: vec3<f32>, ray: vec3<f32>, inside_mm: f32) -> vec3<f32> {
    let steepness = length(gradient);
    let relative = steepness / context.half_shaded;
    let strength = clamp(inside_mm / context.cut_fade_mm, 0.0, 1.0) * (1.0 - 1.0 / (1.0 + relative * relative));
    let facing = abs(dot(gradient, ray)) / max(steepness, 1e-20);
    let light = context.ambient + (1.0 - context.ambient) * facing;
    let facing4 = facing * facing * facing * facing;
    let shine = context.specular * facing4 * facing4 * facing4 * facing4;
    return min(color * mix(1.0, light, strength) + strength * shine, vec3<f32>(1.0));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    var out = Marched(0u, 0u, FAR, 0u);
    var near = view.nearest_mm;
    var far = FAR;
    if (view.flags & (HAS_SURFACE | HAS_TUBES)) != 0u {
        far = depths[at];
    }

    // The image's box. Cells are counted by voxel centres here: the box is -0.5 to dims - 0.5.
    let p = from_middle(id.xy);
    let aside = p.x * context.right + p.y * context.up;
    let o = context.corner + view.mm_per_pixel * aside - 0.5;
    let d = context.forward + view.mm_per_pixel_per_mm * aside;
    let moves = abs(d) > vec3<f32>(1e-12);
    let inv = select(vec3<f32>(0.0), 1.0 / d, moves);
    let lower = vec3<f32>(-0.5);
    let upper = vec3<f32>(context.dims) - 0.5;
    let a = select(vec3<f32>(-FAR), (lower - o) * inv, moves);
    let b = select(vec3<f32>(FAR), (upper - o) * inv, moves);
    let enter = min(a, b);
    let leave = max(a, b);
    near = max(near, max(enter.x, max(enter.y, enter.z)));
    far = min(far, min(leave.x, min(leave.y, leave.z)));
    if any(!moves & ((o < lower) | (o >= upper))) {
        far = near;
    }

    // Clipping planes.
    let start = vec3<f32>(p * view.mm_per_pixel, 0.0);
    let along = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    for (var n = 0u; n < context.clip_count; n++) {
        let plane = context.clips[n];
        let room = plane.w - dot(plane.xyz, start);
        let rate = dot(plane.xyz, along);
        if rate > 0.0 {
            far = min(far, room / rate);
        } else if rate < 0.0 {
            near = max(near, room / rate);
        } else if room < 0.0 {
            far = near;
        }
    }

    // What lies before the masks' box is dropped, and nothing of the image is inside it.
    if view.dims.x > 0u {
        let span = box_interval(ray_of(id.xy));
        if span.near < span.far {
            near = max(near, span.far);
        }
    }

    if near < far {
        let mm_per_depth = length(along);
        let sight = along / mm_per_depth;
        let step = context.step_mm / mm_per_depth;
        let jittered = (context.flags & JITTER) != 0u;
        let first = near + select(1.0, hash(id.xy), jittered) * step;
        // No ray needs more: the step is chosen so. A guard against numbers gone wrong.
        let count = min(u32(max((far - first) / step, 0.0)) + 2u, 40000u);
        let two_d = (context.flags & TWO_D) != 0u;
        let skipping = (view.flags & NO_SKIPPING) == 0u;
        let stride = vec3<u32>(1u, context.dims.x, context.dims.x * context.dims.y);
        let to_next = select(vec3<u32>(0u), stride, context.dims > vec3<u32>(1u));
        let ahead = select(vec3<u32>(0u), vec3<u32>(1u), d > vec3<f32>(0.0));
        var color = vec3<f32>(0.0);
        var through = 1.0;
        var k = 0u;
        while k < count {
            var place: Place;
            var begin: f32;
            var end: f32;
            // To the next sample in a brick where anything shows.
            while k < count {
                begin = select(first + (f32(k) - 1.0) * step, near, k == 0u);
                end = min(first + f32(k) * step, far);
                place = place_of(o + 0.5 * (begin + end) * d);
                let brick = place.cell >> vec3<u32>(3u);
                if !skipping || is_visible(brick) {
                    break;
                }
                let boundary = vec3<f32>((brick + ahead) << vec3<u32>(3u));
                let crossing = select(vec3<f32>(FAR), (boundary - o) * inv, moves);
                let past = min(crossing.x, min(crossing.y, crossing.z));
                // The first sample behind the brick, or the one before where rounding leaves a doubt.
                let next = ceil((past - first) / step + 0.5 - 0.02);
                k = max(k + 1u, u32(clamp(next, 0.0, f32(count))));
            }
            if k >= count || begin >= far {
                break;
            }
            let here = dot(place.cell, stride);
            let corners = corners_at(here, to_next);
            let value = between(across(corners.low, place.weight.xy), across(corners.high, place.weight.xy), place.weight.z);
            var material = looked_up(value);
            // The jitter may leave the first cell no length.
            if value > NOT_FINITE && material.a > 0.0 && begin < end {
                var gradient = gradient_at(place, here, to_next, corners);
                let steepness = length(gradient);
                let unknown = !(steepness < TOO_STEEP);
                if unknown {
                    gradient = vec3<f32>(0.0);
                }
                if two_d {
                    material.a *= select(factor_of(steepness), 0.0, unknown);
                }
                let length_mm = (end - begin) * mm_per_depth;
                let inside_mm = (0.5 * (begin + end) - near) * mm_per_depth;
                let whole = k > 0u && end < far;
                let opacity = opacity_over(material.a, select(length_mm, context.step_mm, whole));
                color += through * opacity * shaded(material.rgb, gradient, sight, inside_mm);
                let left = through * (1.0 - opacity);
                if through > 0.5 && left <= 0.5 {
                    out.depth = 0.5 * (begin + end);
                }
                through = left;
                if through < DARK {
                    color /= 1.0 - through;
                    through = 0.0;
                    break;
                }
            }
            k += 1u;
        }
        out.red_green = pack2x16unorm(color.rg);
        out.blue_opacity = pack2x16unorm(vec2<f32>(color.b, 1.0 - through));
    }
    marched[at] = out;
}
