// The ellipsoid diagram (thesis 7.6): each pixel's fragments lit and blended front to back, grey
// outside the ring, with outlines; the slice among them at its depth; the lens ring on top.
#include lib/view.wgsl
#include lib/ellipsoid.wgsl
#include lib/plane.wgsl
#include lib/ring.wgsl

struct Counters {
    nodes: u32,
    wraps: u32,
    last_nodes: u32,
    last_wraps: u32,
}

@group(0) @binding(6) var<storage, read> lists: array<vec4<u32>>;
@group(0) @binding(8) var<storage, read> blurred: array<u32>;
@group(0) @binding(10) var picture: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(11) var<storage, read> nodes: array<vec2<u32>>;
@group(0) @binding(12) var<storage, read_write> counters: Counters;

const AMBIENT = 0.42;           // of the colour, where the surface is seen edge on
const GLOSS = 0.28;             // of white, on front faces
const GLOSS_EXPONENT = 24.0;
const THICKEST = 2.5;           // a shell seen on edge is looked through so many times
const OUTLINE_PX = 1.3;         // for a picture 512 pixels high
const OUTLINE = 3.0;            // an outline's opacity to its surface's

// What a surface shows: premultiplied, with alpha.
fn fragment_at(node: vec2<u32>, pixel: vec2<u32>, nearest: bool, greyed: f32) -> vec4<f32> {
    let e = ellipsoids[node.y >> 1u];
    let face = node.y & 1u;
    let p = from_middle(pixel);
    let chord = chord_of(e, p);
    let unit = chord.nearest + select(chord.half, -chord.half, face == FRONT) * chord.along;
    let normal = vec3<f32>(dot(unit, e.unit_from_x), dot(unit, e.unit_from_y), dot(unit, e.unit_from_z));
    let ray = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    // The light is at the eye: light, viewer and half way between are one direction.
    let facing = min(abs(dot(normal, ray)) / max(length(normal) * length(ray), 1e-30), 1.0);

    var color = unpack4x8unorm(e.color).rgb;
    let grey = vec3<f32>(0.38 + 0.4 * dot(color, vec3<f32>(0.299, 0.587, 0.114)));
    color = mix(color, grey, greyed);
    color *= AMBIENT + (1.0 - AMBIENT) * facing;
    if face == FRONT {
        color += GLOSS * pow(max(2.0 * facing * facing - 1.0, 0.0), GLOSS_EXPONENT);
    }
    if nearest && (view.flags & HAS_OCCLUSION) != 0u {
        let o = unpack4x8unorm(blurred[linear_index(pixel)]);
        let dark = o.a * view.occlusion_strength;
        color = color * (1.0 - dark) + o.rgb * (dark * view.color_bleeding);
    }
    color = min(color, vec3<f32>(1.0));
    let shell = 1.0 - pow(1.0 - e.opacity, min(1.0 / max(facing, 1e-3), THICKEST));
    let inset = inset_px(e, chord);
    let outline = clamp(OUTLINE_PX * view.line_scale + 1.0 - inset, 0.0, 1.0);
    color = mix(color, view.silhouette.rgb, outline);
    let alpha = mix(shell, min(OUTLINE * e.opacity, 1.0), outline) * coverage_of(inset);
    return vec4<f32>(alpha * color, alpha);
}

// Pixels whose list had no room find their fragments again, so many at a time.
const BATCH = 16u;

// The nearest fragments of all that are behind `last` (of all, where there is no last one yet), sorted;
// at the end of a batch that is not full they lie at FAR. Few turns of loops: Mesa's software driver
// (llvmpipe) ends a shader's loops after 65,535 of all of them together, and unrolls the inner ones.
fn gather(pixel: vec2<u32>, any: bool, last: vec2<u32>, batch: ptr<function, array<vec2<u32>, BATCH>>) {
    let p = from_middle(pixel);
    let tile = tile_of(pixel);
    for (var i = 0u; i < BATCH; i++) {
        (*batch)[i] = vec2<u32>(bitcast<u32>(FAR), NO_FACE);
    }
    for (var n = tiles[tile]; n < tiles[tile + 1u]; n++) {
        let number = tiles[n];
        let chord = chord_of(ellipsoids[number], p);
        for (var face = FRONT; face <= BACK; face++) {
            let s = chord.s[face];
            var node = vec2<u32>(bitcast<u32>(s), 2u * number + face);
            let wanted = chord.meets && s > view.nearest_mm && (any || is_behind(node, last));
            if wanted && is_behind((*batch)[BATCH - 1u], node) {
                for (var i = 0u; i < BATCH; i++) {
                    let other = (*batch)[i];
                    let sooner = is_behind(other, node);
                    (*batch)[i] = select(other, node, sooner);
                    node = select(node, other, sooner);
                }
            }
        }
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if all(id == vec3<u32>(0u)) {
        // Lists made again alone, to be timed, start from zero.
        counters.last_nodes = counters.nodes;
        counters.last_wraps = counters.wraps;
        counters.nodes = 0u;
        counters.wraps = 0u;
    }
    if any(id.xy >= view.size) {
        return;
    }
    var color = vec3<f32>(0.0);
    var through = 1.0;
    let slice = plane_at(id.xy);
    var slice_waits = slice.depth < FAR;
    // Grey where the line of sight misses the lens. Enclosing ellipsoids are larger than a lens that
    // fits the tumour: judged by depth as well, all that faces the viewer would be grey.
    var greyed = 0.0;
    if (view.flags & LENS_ON) != 0u {
        greyed = clamp(0.5 + off_ring_px(id.xy), 0.0, 1.0);
    }
    if (view.flags & HAS_SURFACE) != 0u {
        let list = lists[linear_index(id.xy)];
        let listed = list.w == 0u;
        var batch: array<vec2<u32>, BATCH>;
        var node = vec2<u32>(0u);
        for (var n = 0u; through > 0.0; n++) {
            if listed {
                if n >= list.y {
                    break;
                }
                node = nodes[list.x + n];
            } else {
                if n % BATCH == 0u {
                    gather(id.xy, n == 0u, node, &batch);
                }
                node = batch[n % BATCH];
                if bitcast<f32>(node.x) >= FAR {
                    break;
                }
            }
            if slice_waits && slice.depth <= bitcast<f32>(node.x) {
                slice_waits = false;
                color += through * slice.color.rgb;
                through *= 1.0 - slice.color.a;
            }
            let fragment = fragment_at(node, id.xy, n == 0u, greyed);
            color += through * fragment.rgb;
            through *= 1.0 - fragment.a;
        }
    }
    if slice_waits {
        color += through * slice.color.rgb;
        through *= 1.0 - slice.color.a;
    }
    color = with_ring(color + through * view.background.rgb, id.xy);
    textureStore(picture, vec2<i32>(id.xy), vec4<f32>(color, 1.0));
}
