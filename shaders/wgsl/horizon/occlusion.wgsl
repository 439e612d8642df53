// Ambient occlusion from depths and normals: in planes through the sight line, the highest horizon on both sides, and
// the cosine-weighted light between them in closed form (Jimenez et al. 2016, after Bavoil et al. 2008).
#include lib/view
#include lib/normal
#include lib/depth_normal
#include lib/around

@group(0) @binding(3) var<storage, read> regions: array<u32>;
@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read_write> occlusion: array<u32>; // bleeding rgb, occluded share
@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Whether normals are stored already; else they are found from depths, and stored.
override stored_normals: bool = false;
override planes: u32 = 2u;
override samples: u32 = 4u;   // on each side

const HALF_PI = 1.5707963;
const PI = 3.1415927;

// Light between the normal's plane angle and a horizon, both measured from the sight line.
fn arc(horizon: f32, angle: f32) -> f32 {
    return 0.25 * (cos(angle) + 2.0 * horizon * sin(angle) - cos(2.0 * horizon - angle));
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
    let here = vec2<i32>(id.xy);
    let sight = sight_of(id.xy);
    let to_eye = -sight;
    let surface = point_at(id.xy, depth);
    var n = to_eye;
    if stored_normals {
        n = unpacked_normal(normals[at]);
    } else {
        n = normal_from_depths(here, surface, sight);
        normals[at] = packed_normal(n);
    }
    let footprint = footprint_mm(depth);
    // Above what the pixel itself may hide: its own slant, and the steps between voxels.
    let c = surface + n * select(footprint, max(footprint, view.voxel_mm), stepped);
    let reach_px = view.occlusion_radius_mm / footprint;
    let tile = tile_of(id.xy);
    let turn = f32((tile * 7u + (tile >> 2u) * 5u) & 15u) / 16.0;
    let jitter = f32((tile * 5u + (tile >> 2u) * 3u) & 3u) / 4.0;
    var open = 0.0;
    var whole = 0.0;
    var bleeding = vec4<f32>(0.0);
    for (var k = 0u; k < planes; k++) {
        let azimuth = PI * (f32(k) + turn) / f32(planes);
        let across = vec3<f32>(cos(azimuth), sin(azimuth), 0.0);
        let sideways = normalize(across - dot(across, to_eye) * to_eye);
        let axis = cross(sideways, to_eye);
        let in_plane = n - axis * dot(n, axis);
        let share = max(length(in_plane), 1e-6);
        let angle = sign(dot(in_plane, sideways)) * acos(clamp(dot(in_plane, to_eye) / share, -1.0, 1.0));
        for (var side = 0; side < 2; side++) {
            let way = 2.0 * f32(side) - 1.0;
            // The surface's own horizon.
            let least = cos(clamp(angle + way * HALF_PI, -PI, PI));
            var highest = least;
            var highest_at = at;
            for (var s = 0u; s < samples; s++) {
                let q = (f32(s) + 0.25 + 0.5 * jitter) / f32(samples);
                // Pixels' y points down.
                let to = here + vec2<i32>(round(way * reach_px * q * q * vec2<f32>(across.x, -across.y)));
                let inside = all(to >= vec2<i32>(0)) && all(to < vec2<i32>(view.size)) && any(to != here);
                let p = vec2<u32>(clamp(to, vec2<i32>(0), vec2<i32>(view.size) - 1));
                let there = linear_index(p);
                let step = point_at(p, depths[there]) - c;
                let away = length(step);
                let height = dot(step, to_eye) / max(away, 1e-6);
                if inside && away < view.occlusion_radius_mm && height > highest {
                    highest = height;
                    highest_at = there;
                }
            }
            let horizon = way * acos(clamp(highest, -1.0, 1.0));
            let clamped_horizon = angle + clamp(horizon - angle, -HALF_PI, HALF_PI);
            let light = share * arc(clamped_horizon, angle);
            let unhidden = share * arc(angle + way * HALF_PI, angle);
            open += light;
            whole += unhidden;
            let lost = max(unhidden - light, 0.0);
            bleeding += lost * vec4<f32>(unpack4x8unorm(regions[surfaces[highest_at].x]).rgb, 1.0);
        }
    }
    let dark = clamp(1.0 - open / max(whole, 1e-6), 0.0, 1.0);
    occlusion[at] = pack4x8unorm(vec4<f32>(bleeding.rgb / max(bleeding.a, 1e-6), dark));
}
