// Averages ambient occlusion over the 4x4 pixels that sample different directions: along the surface, not across its
// edges and silhouettes, nor across what the rays of two pixels tell apart. Stored as composing passes read it: the share by which the encoded colour is darkened, but for
// ambient light.
#include lib/view
#include lib/normal
#include lib/linear

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(7) var<storage, read> occlusion: array<u32>;
@group(0) @binding(8) var<storage, read_write> blurred: array<u32>;
@group(0) @binding(40) var<storage, read> normals: array<u32>;

// Pixels on one surface: normals within 60 degrees, and this close to the other's plane, in radii.
const LEAST_COSINE = 0.85;
const OFF_PLANE = 0.06;
// Standard errors by which the shares of two pixels may differ, and how many rays tell that: of fewer all are averaged.
const TOLD_APART = 4.0;
const TELLING_RAYS = 32.0;

// How far another pixel's share of rays may be from this one. One ray more of each kind is assumed, as in traced/rays.
fn reach_of(share: f32) -> f32 {
    let n = view.occlusion_rays;
    let p = (share * n + 1.0) / (n + 2.0);
    return select(2.0, TOLD_APART * sqrt(p * (1.0 - p) / max(n, 1.0)), n >= TELLING_RAYS);
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
        blurred[at] = 0u;
        return;
    }
    let n = unpacked_normal(normals[at]);
    let c = point_at(id.xy, depth);
    let reach = max(OFF_PLANE * view.occlusion_radius_mm, 2.0 * footprint_mm(depth));
    let here = unpack4x8unorm(occlusion[at]).a;
    let most = reach_of(here);
    var sum = vec4<f32>(0.0);
    var weight = 0.0;
    let last = vec2<i32>(view.size) - 1;
    for (var y = -2; y < 2; y++) {
        for (var x = -2; x < 2; x++) {
            let to = vec2<u32>(clamp(vec2<i32>(id.xy) + vec2<i32>(x, y), vec2<i32>(0), last));
            let there = linear_index(to);
            let off = abs(dot(point_at(to, depths[there]) - c, n));
            let o = unpack4x8unorm(occlusion[there]);
            let along = off < reach && dot(unpacked_normal(normals[there]), n) > LEAST_COSINE && abs(o.a - here) < most;
            // Colours count as much as light is lost to them.
            sum += select(vec4<f32>(0.0), vec4<f32>(o.rgb * o.a, o.a), along);
            weight += select(0.0, 1.0, along);
        }
    }
    let dark = view.occlusion_strength * sum.a / max(weight, 1.0);
    blurred[at] = pack4x8unorm(vec4<f32>(sum.rgb / max(sum.a, 1e-6), 1.0 - encoded(vec3<f32>(1.0 - dark)).x));
}
