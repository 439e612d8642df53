// Ambient occlusion of masks: rays from the surface over the hemisphere about its smoothed normal, weighted by the
// cosine, through the shown voxels by exact steps (Amanatides and Woo 1987), within a radius and within the lens.
//
// Directions are the points of one sequence (Roberts's R2), dealt out to the 16 pixels of a tile in turn. So n rays are
// always the first n, however many steps they are divided into.
#include lib/view
#include lib/march
#include lib/normal
#include lib/shown
#include lib/around
#include lib/lens_end
#include lib/linear
#include lib/index_space

struct Rays {
    first: u32,
    count: u32,
    unused: vec2<u32>,
}

struct Found {
    hidden: u32,         // rays that hit
    rays: u32,
    colors: vec2<u32>,   // sums of what they hit: red and green, 16 bits each; blue
}

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(7) var<storage, read_write> occlusion: array<u32>; // colour of what is hit, share of rays that hit
@group(0) @binding(40) var<storage, read> normals: array<u32>;
// This step. Values that loops depend on are read at index `zero`: see lib/zero.
@group(0) @binding(42) var<uniform> steps: array<Rays, 2>;
@group(0) @binding(43) var<storage, read_write> found: array<Found>;

// Rays whose start lies in a voxel, as in a narrow hollow, start half as high, or else this much before the hit on the line of
// sight, in the finest spacing.
const NEARER = 0.02;
// Standard error at which a pixel has enough rays, and how many pixels' rays the filter averages, at least.
const ENOUGH = 0.01;
const AVERAGED = 12.0;

// Point `k` of the sequence: 32-bit fractions, exact.
fn point(k: u32) -> vec2<f32> {
    return vec2<f32>((vec2<u32>(k) * vec2<u32>(3242174889u, 2447445414u) + 0x80000000u) >> vec2<u32>(8u)) / 16777216.0;
}

// The first shown voxel along a ray before `far`; x is below the margin if there is none. The smooth surface lies within
// voxels, too: there, those that a ray starts in don't count.
fn blocker(ray: Ray, far: f32) -> vec3<i32> {
    var cell = vec3<i32>(floor(ray.o));
    var t = 0.0;
    var starts_inside = (flags() & SMOOTH) != 0u;
    while t < far {
        let shown = shown_at(cell);
        if shown && !starts_inside {
            return cell;
        }
        starts_inside = starts_inside && shown;
        let next = crossing(ray, cell + ray.ahead);
        t = min(next.x, min(next.y, next.z));
        cell += select(vec3<i32>(0), ray.step, is_first(next));
    }
    return vec3<i32>(-MARGIN - 1);
}

// Whether a place in camera space, within a voxel of a surface, lies in a shown voxel.
fn is_shown_at(c: vec3<f32>) -> bool {
    return shown_at(vec3<i32>(floor(place_in_index_space(c))));
}

// Whether the rays so far are enough, by the standard error of as many independent ones. One ray more of each kind is
// assumed (Agresti and Coull): else few rays that all agree would pass.
fn is_enough(f: Found) -> bool {
    let n = f32(f.rays);
    let p = (f32(f.hidden) + 1.0) / (n + 2.0);
    return p * (1.0 - p) < ENOUGH * ENOUGH * AVERAGED * n;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    if depth >= FAR {
        occlusion[at] = 0u;
        return;
    }
    var sum = Found(0u, 0u, vec2<u32>(0u));
    let first = steps[zero].first;
    if first > 0u {
        sum = found[at];
        if is_enough(sum) {
            return;
        }
    }
    let n = unpacked_normal(normals[at]);
    let lift = lift_of(n);
    var c = point_at(id.xy, depth) + lift;
    // The smooth surface lies within voxels: see `blocker`.
    if (flags() & SMOOTH) == 0u && is_shown_at(c) {
        c -= 0.5 * lift;
        if is_shown_at(c) {
            c = point_at(id.xy, depth - NEARER * view.voxel_mm);
        }
    }
    let o = place_in_index_space(c);
    let basis = tangents_of(n);
    let margin = vec3<i32>(1);
    let end = vec3<i32>(view.dims) + margin;
    for (var i = 0u; i < steps[zero].count; i++) {
        let u = point((first + i) * 16u + tile_of(id.xy));
        let ring = sqrt(u.x);
        let turn = 6.2831853 * u.y;
        let w = ring * cos(turn) * basis[0] + ring * sin(turn) * basis[1] + sqrt(1.0 - u.x) * n;
        let ray = ray_from(o, in_index_space(w));
        let out = crossing(ray, select(-margin, end, ray.ahead == vec3<i32>(1)));
        let far = min(min(view.occlusion_radius_mm, leaves_lens(c, w)), min(out.x, min(out.y, out.z)));
        let cell = blocker(ray, far);
        if cell.x >= -MARGIN {
            let number = number_at(cell, brick_of(cell));
            let color = regions[number];
            sum.hidden += 1u;
            sum.colors += vec2<u32>((color & 0xffu) | ((color & 0xff00u) << 8u), (color >> 16u) & 0xffu);
        }
    }
    sum.rays += steps[zero].count;
    found[at] = sum;
    let hits = f32(max(sum.hidden, 1u)) * 255.0;
    let color = vec3<f32>(vec3<u32>(sum.colors.x & 0xffffu, sum.colors.x >> 16u, sum.colors.y)) / hits;
    occlusion[at] = pack4x8unorm(vec4<f32>(color, f32(sum.hidden) / f32(sum.rays)));
}
