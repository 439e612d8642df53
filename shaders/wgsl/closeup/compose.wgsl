// Composes the frame: region colours, light at the eye, occlusion, the cut of the lens, contour lines, the faint outside, the slice, the lens ring.
#include lib/view
#include lib/plane
#include lib/ring
#include lib/lines
#include lib/normal
#include lib/surface_light

struct Outside {
    depth: f32,
    number: u32,
    face: u32,
    color: u32,
}

@group(0) @binding(3) var<storage, read> regions: array<u32>;
@group(0) @binding(6) var<storage, read> outsides: array<Outside>;
@group(0) @binding(8) var<storage, read> blurred: array<u32>;
@group(0) @binding(40) var<storage, read> normals: array<u32>;
@group(0) @binding(10) var picture: texture_storage_2d<rgba8unorm, write>;

// Whether anything is drawn outside the lens, and whether a slice is: else nothing of it is read.
override has_outside: bool = true;
override has_slice: bool = false;

// Light at the rim of a surface, where it faces the eye it is 1; linear.
const RIM_LIGHT = 0.45;
// Share of light that edges between voxels lack: darker than both faces, whatever their colour.
const EDGE_DARKER = 0.5;
// Light on the cut of the lens and on its hatching: a section, not a surface.
const CUT_LIGHT = 0.86;
const HATCH_LIGHT = 0.62;

// Light at the eye that a surface reflects. The cut of the lens is hatched instead: lines from the lower left, one point
// wide.
fn light_at(pixel: vec2<u32>, surface: vec2<u32>, at: u32) -> f32 {
    let facing = clamp(-dot(unpacked_normal(normals[at]), sight_of(pixel)), 0.0, 1.0);
    let along = f32(pixel.x + pixel.y) / (7.0 * view.line_scale);
    let off_px = abs(fract(along) - 0.5) * 7.0 * view.line_scale;
    let line = clamp(0.7 * view.line_scale + 0.5 - off_px, 0.0, 1.0);
    let is_cut = surface.y == 3u && (flags() & LENS_ON) != 0u;
    let light = select(mix(RIM_LIGHT, 1.0, facing * facing), mix(CUT_LIGHT, HATCH_LIGHT, line), is_cut);
    return mix(1.0, light, view.relief);
}

// Silhouettes and large depth steps of the outer level, where it is in front of what the lens shows.
fn outer_line_at(here: vec2<i32>, front: f32) -> f32 {
    let at = linear_index(vec2<u32>(here));
    let depth = outsides[at].depth;
    let face = outsides[at].face;
    var others = 0u;
    for (var n = 0u; n < 8u; n++) {
        others |= select(0u, 1u << n, outsides[clamped(here + neighbour(n))].face != face);
    }
    others = select(0u, others, depth < front);
    var line = 0.0;
    while others != 0u {
        let to = neighbour(firstTrailingBit(others));
        others &= others - 1u;
        let q = outsides[clamped(here + to)].depth;
        let steps =
            step_mm(outsides[clamped(here - to)].depth, depth, q, outsides[clamped(here + 2 * to)].depth) / view.voxel_mm;
        let away = length(vec2<f32>(to)) - 0.5;
        let drawn = smoothstep(2.0, 5.0, steps) * coverage(1.3 * width_at(depth), away);
        line = max(line, select(0.0, drawn, q >= depth));
    }
    return line;
}

fn slice_at(pixel: vec2<u32>) -> PlaneHit {
    if has_slice {
        return plane_at(pixel);
    }
    return PlaneHit(FAR, vec4<f32>(0.0));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let here = vec2<i32>(id.xy);
    let at = linear_index(id.xy);
    var color = view.background.rgb;
    var front = FAR;
    let slice = slice_at(id.xy);
    var slice_pending = slice.depth < FAR;
    let has_surface = (flags() & HAS_SURFACE) != 0u;
    if has_surface {
        front = depths[at];
    }
    // Surfaces in front of the slice hide it or are drawn over it.
    slice_pending = slice_pending && slice.depth < front;
    if front < FAR {
        let surface = surfaces[at];
        let albedo = decoded(unpack4x8unorm(regions[surface.x]).rgb);
        color = encoded(albedo * light_at(id.xy, surface, at));
        if (flags() & HAS_OCCLUSION) != 0u {
            let o = unpack4x8unorm(blurred[at]);
            color = in_light(color, o);
        }
    } else if has_outside {
        if slice_pending && slice.depth >= outsides[at].depth {
            color = with_plane(color, slice);
            slice_pending = false;
        }
        let outer = unpack4x8unorm(outsides[at].color);
        color = outer.rgb + (1.0 - outer.a) * color;
    }
    if has_surface {
        let lines = lines_at(here, front);
        if slice_pending && slice.depth >= lines.depth {
            color = with_plane(color, slice);
            slice_pending = false;
        }
        color *= 1.0 - EDGE_DARKER * view.inner_line_strength * lines.grey;
        color = mix(color, view.silhouette.rgb, lines.black);
    }
    if has_outside {
        if slice_pending && slice.depth >= outsides[at].depth {
            color = with_plane(color, slice);
            slice_pending = false;
        }
        color = mix(color, view.silhouette.rgb, view.outer_line_strength * outer_line_at(here, front));
    }
    if slice_pending {
        color = with_plane(color, slice);
    }
    color = with_ring(color, id.xy);
    textureStore(picture, here, vec4<f32>(color, 1.0));
}
