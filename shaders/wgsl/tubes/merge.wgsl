// Merges the tubes into the first hits: where one is in front of the tumour, its depth and number replace the
// tumour's, and its shaded colour is stored beside them. A subtle headlight.
#include lib/view
#include lib/tubes

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec2<u32>>;
@group(0) @binding(28) var<storage, read> fibers: array<Fiber>;
@group(0) @binding(29) var tube_picture: texture_2d<u32>;
@group(0) @binding(30) var<storage, read_write> tube_shades: array<u32>; // shaded rgb, facing

const NUMBER = 0xffffffu;
const AMBIENT = 0.4;

// Without the highlight, which is added behind the darkening.
fn lit(color: vec3<f32>, facing: f32) -> vec3<f32> {
    return color * mix(AMBIENT, 1.0, facing);
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
    let found = textureLoad(tube_picture, vec2<i32>(id.xy), 0).xy;
    let depth = bitcast<f32>(found.y);
    var shade = 0u;
    if (found.x & NUMBER) != 0u && depth < front {
        let number = (found.x & NUMBER) - 1u;
        let facing = f32(found.x >> 24u) / 255.0;
        let color = unpack4x8unorm(fibers[number].color).rgb;
        depths[at] = depth;
        surfaces[at] = vec2<u32>(0u, TUBE | number);
        shade = pack4x8unorm(vec4<f32>(lit(color, facing), facing));
    } else if !has_surface {
        depths[at] = FAR;
        surfaces[at] = vec2<u32>(0u, NO_FACE);
    }
    tube_shades[at] = shade;
}
