// The paths' light from the image in the form of the ray march's: colours in linear light.
#include lib/view
#include lib/context
#include lib/path_state
#include lib/path_errors

@group(0) @binding(6) var<storage, read_write> marched: array<Marched>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let pixel = pixels[at];
    let opacity = abs(weight_of(pixel));
    let color = opacity * mean_of(pixel);
    marched[at] = Marched(
        pack2x16unorm(color.rg), pack2x16unorm(vec2<f32>(color.b, opacity)), bitcast<f32>(pixel.place.w), 0u);
    add_up_errors(id.xy, true, 1.0);
}
