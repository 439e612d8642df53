// The slabs' result in the form of the ray march's: colours in linear light, and the depth at which half is hidden. Slabs
// from the back can't know that depth: rays of pixels that hide more than half look for it.
#include lib/view
#include lib/march
#include lib/context
#include lib/image

struct Finish {
    weight: f32,         // of the second half of `eye`
    step_mm: f32,
    unused_a: u32,
    unused_b: u32,
}

override two_cases: bool = false;

@group(0) @binding(6) var<storage, read_write> marched: array<Marched>;
@group(0) @binding(34) var<storage, read> eye: array<vec4<f32>>;
@group(0) @binding(35) var<storage, read> ranges: array<vec2<f32>>;
@group(0) @binding(36) var<uniform> finish: Finish;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    var state = eye[at];
    if two_cases {
        state = mix(state, eye[at + view.size.x * view.size.y], finish.weight);
    }
    var depth = FAR;
    if state.a < 0.5 {
        let p = from_middle(id.xy);
        let line = image_line(p);
        let slant = length(vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0));
        let range = ranges[at];
        var thickness = 0.0;
        var t = range.x;
        // The slabs are chosen so that no ray needs more: a guard against invalid numbers.
        for (var n = 0u; n < 20000u && t < range.y && depth >= FAR; n++) {
            let end = min(t + finish.step_mm / slant, range.y);
            let middle = 0.5 * (t + end);
            thickness += extinction_of(material_at(line[0] + middle * line[1])) * (end - t) * slant;
            depth = select(depth, middle, thickness > 0.693147);
            t = select(range.y, end, end > t);
        }
        // The march and the slabs may differ about the half.
        depth = select(depth, range.y, depth >= FAR);
    }
    marched[at] = Marched(pack2x16unorm(state.rg), pack2x16unorm(vec2<f32>(state.b, 1.0 - state.a)), depth, 0u);
}
