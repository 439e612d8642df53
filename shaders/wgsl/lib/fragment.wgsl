// Shading and blending of ellipsoid fragments, for every pass that finds them.
#include lib/surface_light

@group(0) @binding(6) var<storage, read> lists: array<vec4<u32>>;
@group(0) @binding(8) var<storage, read> blurred: array<u32>;
@group(0) @binding(10) var picture: texture_storage_2d<rgba8unorm, write>;

const AMBIENT = 0.42;           // share of the colour where the surface is seen edge-on
const GLOSS = 0.28;             // share of white in highlights, on front faces
const GLOSS_EXPONENT = 24.0;
const THICKEST = 2.5;           // longest path through a shell seen edge-on, in shell thicknesses
const OUTLINE_PX = 1.3;         // for a frame 512 pixels high
const OUTLINE = 3.0;            // opacity of an outline relative to its surface's

// Premultiplied colour and alpha. `greyed`: 0 inside the lens ring, 1 outside.
fn fragment_at(node: vec2<u32>, pixel: vec2<u32>, nearest: bool, greyed: f32) -> vec4<f32> {
    let e = ellipsoids[node.y >> 1u];
    let face = node.y & 1u;
    let p = from_middle(pixel);
    let chord = chord_of(e, p);
    let unit = chord.nearest + select(chord.half, -chord.half, face == FRONT) * chord.along;
    let normal = vec3<f32>(dot(unit, e.unit_from_x), dot(unit, e.unit_from_y), dot(unit, e.unit_from_z));
    let ray = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    // Headlight: light, view and half vector are one direction.
    let facing = min(abs(dot(normal, ray)) / max(length(normal) * length(ray), 1e-30), 1.0);

    var color = unpack4x8unorm(e.color).rgb;
    let grey = vec3<f32>(0.38 + 0.4 * dot(color, vec3<f32>(0.299, 0.587, 0.114)));
    color = mix(color, grey, greyed);
    color *= AMBIENT + (1.0 - AMBIENT) * facing;
    if face == FRONT {
        color += GLOSS * pow(max(2.0 * facing * facing - 1.0, 0.0), GLOSS_EXPONENT);
    }
    if nearest && (flags() & HAS_OCCLUSION) != 0u {
        let o = unpack4x8unorm(blurred[linear_index(pixel)]);
        color = in_light(color, o);
    }
    color = min(color, vec3<f32>(1.0));
    let shell = 1.0 - pow(1.0 - e.opacity, min(1.0 / max(facing, 1e-3), THICKEST));
    let inset = inset_px(e, chord);
    let outline = clamp(OUTLINE_PX * view.line_scale + 1.0 - inset, 0.0, 1.0);
    color = mix(color, view.silhouette.rgb, outline);
    let alpha = mix(shell, min(OUTLINE * e.opacity, 1.0), outline) * coverage_of(inset);
    return vec4<f32>(alpha * color, alpha);
}

// A pixel's state while fragments are blended, nearest first.
struct Blend {
    color: vec3<f32>,
    through: f32,
    slice: PlaneHit,
    slice_waits: bool,
    greyed: f32,
}

fn start_blend(pixel: vec2<u32>) -> Blend {
    let slice = plane_at(pixel);
    // Grey where the line of sight misses the lens. Enclosing ellipsoids are larger than a lens that
    // fits the tumour: with a depth test as well, every front face would be grey.
    let greyed = select(0.0, clamp(0.5 + off_ring_px(pixel), 0.0, 1.0), (flags() & LENS_ON) != 0u);
    return Blend(vec3<f32>(0.0), 1.0, slice, slice.depth < FAR, greyed);
}

fn add_slice(b: ptr<function, Blend>) {
    (*b).slice_waits = false;
    (*b).color += (*b).through * (*b).slice.color.rgb;
    (*b).through *= 1.0 - (*b).slice.color.a;
}

fn add_fragment(b: ptr<function, Blend>, node: vec2<u32>, pixel: vec2<u32>, nearest: bool) {
    if (*b).slice_waits && (*b).slice.depth <= bitcast<f32>(node.x) {
        add_slice(b);
    }
    let fragment = fragment_at(node, pixel, nearest, (*b).greyed);
    (*b).color += (*b).through * fragment.rgb;
    (*b).through *= 1.0 - fragment.a;
}

fn finish(b: ptr<function, Blend>, pixel: vec2<u32>) {
    if (*b).slice_waits {
        add_slice(b);
    }
    let color = with_ring((*b).color + (*b).through * view.background.rgb, pixel);
    textureStore(picture, vec2<i32>(pixel), vec4<f32>(color, 1.0));
}
