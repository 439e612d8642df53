// A surface in the light that the light passes found.
#include lib/linear

// `color` is encoded, `o` what they stored: how much of it is lost, with the colour that bleeds onto the surface; or,
// TINTED, the colour of the light itself, encoded.
fn in_light(color: vec3<f32>, o: vec4<f32>) -> vec3<f32> {
    if (flags() & TINTED) != 0u {
        return encoded(decoded(color) * decoded(o.rgb));
    }
    return color * (1.0 - o.a) + o.rgb * (o.a * view.color_bleeding);
}
