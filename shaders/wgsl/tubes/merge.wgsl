// Merges the tubes into the first hits: where one is in front of the tumour, its depth and number replace the
// tumour's, and its shaded colour is stored beside them. A subtle headlight. Colours by values are interpolated between
// the two points of the segment that the pixel is on.
#include lib/view
#include lib/tubes

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec2<u32>>;
@group(0) @binding(28) var<storage, read> fibers: array<Fiber>;
@group(0) @binding(29) var tube_picture: texture_2d<u32>;
@group(0) @binding(30) var<storage, read_write> tube_shades: array<u32>; // shaded rgb, facing
@group(0) @binding(31) var<storage, read> values: array<u32>;            // of each point: a direction's rgb, or a scalar
@group(0) @binding(32) var<storage, read> scales: array<u32>;            // low end, colours per unit, 256 colours

override located: bool = false;

const BY_DIRECTION = 1u;
const BY_SCALAR = 2u;
const SCALE_WORDS = 258u;
// Scalars that are missing are beyond this.
const MISSING = 1e38;
const NO_VALUE = vec3<f32>(0.5);

const NUMBER = 0xffffffu;
const AMBIENT = 0.4;

// Without the highlight, which is added behind the darkening.
fn lit(color: vec3<f32>, facing: f32) -> vec3<f32> {
    return color * mix(AMBIENT, 1.0, facing);
}

// Colour of a fibre at the share of a segment from a point to the next.
fn tint(color: u32, point: u32, share: f32) -> vec3<f32> {
    let kind = color >> 24u;
    let a = values[point];
    // Nothing follows a point without another.
    let b = select(a, values[point + 1u], share > 0.0);
    if kind == BY_DIRECTION {
        let from_a = unpack4x8unorm(a);
        let from_b = unpack4x8unorm(b);
        return select(NO_VALUE, mix(from_a.rgb, from_b.rgb, share), min(from_a.a, from_b.a) > 0.5);
    }
    if kind == BY_SCALAR {
        let scale = (color & 0xffffffu) * SCALE_WORDS;
        let from_a = bitcast<f32>(a);
        let from_b = bitcast<f32>(b);
        let value = mix(from_a, from_b, share) - bitcast<f32>(scales[scale]);
        let step = u32(255.0 * clamp(value * bitcast<f32>(scales[scale + 1u]), 0.0, 1.0) + 0.5);
        let found = unpack4x8unorm(scales[scale + 2u + step]).rgb;
        return select(found, NO_VALUE, max(from_a, from_b) > MISSING);
    }
    return unpack4x8unorm(color).rgb;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let has_surface = (flags() & HAS_SURFACE) != 0u;
    var front = FAR;
    if has_surface {
        front = depths[at];
    }
    let found = textureLoad(tube_picture, vec2<i32>(id.xy), 0);
    let depth = bitcast<f32>(found.y);
    var shade = 0u;
    if (found.x & NUMBER) != 0u && depth < front {
        let number = (found.x & NUMBER) - 1u;
        let facing = f32(found.x >> 24u) / 255.0;
        var color = unpack4x8unorm(fibers[number].color).rgb;
        if located {
            color = tint(fibers[number].color, found.z, bitcast<f32>(found.w));
        }
        depths[at] = depth;
        surfaces[at] = vec2<u32>(0u, TUBE | number);
        shade = pack4x8unorm(vec4<f32>(lit(color, facing), facing));
    } else if !has_surface {
        depths[at] = FAR;
        surfaces[at] = vec2<u32>(0u, NO_FACE);
    }
    tube_shades[at] = shade;
}
