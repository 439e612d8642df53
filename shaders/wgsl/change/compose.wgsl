// Composes the change view's frame: the surface with the height map over it, or the part that both time points
// share with arrows around it and the rest as a veil; the context image around and behind.
#include lib/view
#include lib/lines
#include lib/context
#include lib/change
#include lib/surface_light

@group(0) @binding(6) var<storage, read> marched: array<Marched>;
@group(0) @binding(8) var<storage, read> blurred: array<u32>;
@group(0) @binding(10) var picture: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(19) var<storage, read> heights: array<vec2<f32>>;
@group(0) @binding(21) var<storage, read> hull_depths: array<f32>;
@group(0) @binding(22) var<storage, read> hull_surfaces: array<vec2<u32>>;
@group(0) @binding(23) var<storage, read_write> tops: array<vec2<u32>>;    // see change/outline; then arrow number from 1, depth
@group(0) @binding(25) var arrow_picture: texture_2d<u32>;


const GROWS = 0x1000000u;
const FAINT = 0x2000000u;
const TISSUE_MOVED = 0x800000u;
// Opacity of the veil where it is at least three voxels thick.
const VEIL = 0.14;
// Brightness along an arrow's edge.
const EDGE = 0.45;

fn tone_of(grows: bool) -> vec3<f32> {
    return select(change.shrink, change.grow, grows);
}

fn stripe_at(along: u32) -> f32 {
    let place = f32(along) / (8.0 * view.line_scale);
    return smoothstep(0.15, 0.3, abs(fract(place) - 0.5));
}

// Stripes where no change length is defined: a connected component appeared or disappeared.
fn hatched(color: vec3<f32>, kind: u32, pixel: vec2<u32>) -> vec3<f32> {
    return mix(color, tone_of((kind & AFTER) != 0u), mix(0.15, 0.75, stripe_at(pixel.x + pixel.y)));
}

// The colour of a change: where the tissue moved too, in stripes across the others with that of displacement.
fn change_tone(height: vec2<f32>, pixel: vec2<u32>) -> vec3<f32> {
    let tone = tone_of(height.x > 0.0);
    if !is_displaced(height.y) {
        return tone;
    }
    return mix(tone, change.displaced.rgb, stripe_at(pixel.x + view.size.y - pixel.y));
}

struct ArrowSample {
    what: u32,
    depth: f32,          // FAR where there is no arrow
    color: vec3<f32>,
}

// A sample of the arrows: darker along edges in front of another arrow or of no arrow.
fn arrow_at(pixel: vec2<u32>, n: u32) -> ArrowSample {
    let sample = vec2<i32>(pixel * change.samples + vec2<u32>(n % change.samples, n / change.samples));
    let found = textureLoad(arrow_picture, sample, 0).xy;
    if found.x == 0u {
        return ArrowSample(0u, FAR, vec3<f32>(0.0));
    }
    let depth = bitcast<f32>(found.y);
    let last = vec2<i32>(view.size * change.samples) - 1;
    // Arrows of few pixels would be all edge.
    let size_px = change.head_radius_mm / footprint_mm(depth);
    let dark = mix(1.0, EDGE, smoothstep(0.7, 3.5, size_px));
    var edge = 1.0;
    for (var k = 0u; k < 4u; k++) {
        let there = textureLoad(arrow_picture, clamp(sample + neighbour(k), vec2<i32>(0), last), 0).xy;
        let hides = there.x == 0u || bitcast<f32>(there.y) > depth;
        edge = select(edge, dark, ((there.x ^ found.x) & ARROW_NUMBER) != 0u && hides);
    }
    let tone = select(tone_of((found.x & GROWS) != 0u), change.displaced.rgb, (found.x & TISSUE_MOVED) != 0u);
    let pale = mix(tone, change.base, select(0.0, 0.6, (found.x & FAINT) != 0u));
    return ArrowSample(found.x, depth, pale * (edge * f32(found.x >> 26u) / 63.0));
}

// Outlines of the veil, against farther surfaces and the background.
fn veil_line_at(here: vec2<i32>, depth: f32, face: u32) -> f32 {
    var line = 0.0;
    for (var n = 0u; n < 8u; n++) {
        let to = neighbour(n);
        let there = clamped(here + to);
        if hull_surfaces[there].y == face {
            continue;
        }
        let q = hull_depths[there];
        let steps =
            step_mm(hull_depths[clamped(here - to)], depth, q, hull_depths[clamped(here + 2 * to)]) / view.voxel_mm;
        let drawn = smoothstep(2.0, 5.0, steps) * coverage(1.3 * width_at(depth), length(vec2<f32>(to)) - 0.5);
        line = max(line, select(0.0, drawn, q >= depth));
    }
    return line;
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
    // One light per pixel, that of its nearest surface. Where that is an arrow, the tumour surface beside it in the
    // pixel gets the arrow's light: both are in one pixel only along the arrow's edge.
    var o = vec4<f32>(0.0);
    if (flags() & HAS_OCCLUSION) != 0u {
        o = unpack4x8unorm(blurred[at]);
    }
    var front = FAR;
    let has_surface = (flags() & HAS_SURFACE) != 0u;
    if has_surface {
        front = depths[at];
    }
    if front < FAR {
        color = change.base;
        let kind = kind_of(surfaces[at].x);
        if (kind & ALONE) != 0u {
            color = hatched(color, kind, id.xy);
        } else if (varied(change.flags) & HAS_HEIGHTS) != 0u {
            let height = heights[at];
            let opacity = clamp(abs(height.x) / change.full_mm, 0.0, 1.0) * clamp(certainty_of(height.y), 0.0, 1.0);
            color = mix(color, change_tone(height, id.xy), opacity);
        }
        color = in_light(color, o);
    } else if (flags() & HAS_CONTEXT) != 0u {
        color = image_over(marched[at], color);
    }
    var lines = Lines(0.0, 0.0, FAR);
    if has_surface {
        lines = lines_at(here, front);
    }
    var top = ArrowSample(0u, FAR, vec3<f32>(0.0));
    var plain = color;
    plain = mix(plain, INNER, view.inner_line_strength * lines.grey);
    plain = mix(plain, view.silhouette.rgb, lines.black);
    if (varied(change.flags) & HAS_ARROWS) != 0u {
        // Arrows in front of the surface hide its lines; arrows behind the outlined edge are under them.
        var sum = vec3<f32>(0.0);
        let count = varied(change.samples * change.samples);
        for (var n = 0u; n < count; n++) {
            let arrow = arrow_at(id.xy, n);
            var one = plain;
            if arrow.depth < front {
                one = select(arrow.color, in_light(arrow.color, o), (varied(change.flags) & LIT_ARROWS) != 0u);
                if arrow.depth >= lines.depth {
                    one = mix(one, INNER, view.inner_line_strength * lines.grey);
                    one = mix(one, view.silhouette.rgb, lines.black);
                }
                if arrow.depth < top.depth {
                    top = arrow;
                }
            }
            sum += one;
        }
        plain = sum / f32(count);
    }
    color = plain;
    if (varied(change.flags) & HAS_HULL) != 0u {
        let hull = hull_depths[at];
        let kind = kind_of(hull_surfaces[at].x);
        if hull < front && (kind & ALONE) == 0u && kind != (BEFORE | AFTER) {
            let thickness = clamp((front - hull) / (3.0 * view.voxel_mm), 0.0, 1.0);
            color = mix(color, tone_of(kind == AFTER), VEIL * thickness);
            let line = veil_line_at(here, hull, hull_surfaces[at].y);
            color = mix(color, view.silhouette.rgb, view.outer_line_strength * line);
        }
    }
    if (varied(change.flags) & HAS_EARLIER) != 0u {
        color = mix(color, change.outline.rgb, bitcast<f32>(tops[at].x));
    }
    tops[at] = vec2<u32>(top.what & ARROW_NUMBER, bitcast<u32>(top.depth));
    textureStore(picture, here, vec4<f32>(color, 1.0));
}
