// Screen-space ambient occlusion from depth alone (Mittring 2007; thesis 7.3.1). Sample points come in
// pairs about the surface point, so on a plane at any slant exactly half are hidden: that half counts
// as unoccluded, the excess as occlusion. Occluders further in front than three radii count less; otherwise
// every foreground would cast a hard halo on surfaces far behind.
#include lib/view
#include lib/around

@group(0) @binding(3) var<storage, read> regions: array<u32>;
@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> occlusion: array<u32>; // bleeding rgb, occlusion
@group(0) @binding(9) var<uniform> kernel: array<vec4<f32>, 32>;      // one point of each pair

// Without it, the occlusion of a place enclosed on all sides but the viewer's would be one half.
const GAIN = 2.0;

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
    let radius_mm = view.occlusion_radius_mm;
    let footprint = footprint_mm(depth);
    let radius_px = radius_mm / footprint;
    let bias = 0.75 * footprint;
    // A 4x4 tile of rotations, averaged out by the 4x4 blur.
    let tile = tile_of(id.xy);
    let turn = f32((tile * 7u + (tile >> 2u) * 5u) & 15u) * (6.2831853 / 16.0);
    let c = cos(turn);
    let s = sin(turn);
    let last = vec2<f32>(view.size) - 1.0;
    let here = vec2<f32>(id.xy);
    var hidden = 0.0;
    var bleeding = vec4<f32>(0.0);
    for (var n = 0u; n < varied(view.occlusion_samples); n++) {
        let k = kernel[n];
        let offset = vec2<f32>(c * k.x - s * k.y, s * k.x + c * k.y) * radius_px;
        // The bleeding colour is that of the pair's nearer occluder.
        var nearest = FAR;
        var nearest_at = at;
        var weight = 0.0;
        for (var side = 0; side < 2; side++) {
            let sign = 1.0 - 2.0 * f32(side);
            let to = clamp(here + sign * offset, vec2<f32>(0.0), last);
            let there = linear_index(vec2<u32>(to + 0.5));
            let occluder = depths[there];
            // An occluder far in front is weak evidence: then half, as on a plane.
            let sure = min(3.0 * radius_mm / max(depth - occluder, 1e-6), 1.0);
            let inside = occluder < depth + sign * k.z * radius_mm - bias;
            hidden += select(select(0.0, 0.5 - 0.5 * sure, occluder < depth), 0.5 + 0.5 * sure, inside);
            if inside && occluder < nearest {
                nearest = occluder;
                nearest_at = there;
                weight = sure;
            }
        }
        bleeding += weight * vec4<f32>(unpack4x8unorm(regions[surfaces[nearest_at].x]).rgb, 1.0);
    }
    let dark = clamp(GAIN * (hidden / f32(view.occlusion_samples) - 1.0), 0.0, 1.0);
    occlusion[at] = pack4x8unorm(vec4<f32>(bleeding.rgb / max(bleeding.a, 1e-6), dark));
}
