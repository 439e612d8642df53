// The slices' result in the form of the ray march's: colours in linear light.
#include lib/view
#include lib/context

@group(0) @binding(6) var<storage, read_write> marched: array<Marched>;
@group(0) @binding(34) var<storage, read> eye: array<vec4<f32>>;    // radiance, transmittance
// Light on opaque geometry behind the image; depth where transmittance falls to one half.
@group(0) @binding(35) var<storage, read> notes: array<vec2<f32>>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let state = eye[at];
    marched[at] = Marched(pack2x16unorm(state.rg), pack2x16unorm(vec2<f32>(state.b, 1.0 - state.a)), notes[at].y, 0u);
}
