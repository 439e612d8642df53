// A surface in the light that the light passes found.
#include lib/linear

// Whether they stored the light's own colour.
override tinted: bool = false;

// `color` is encoded, `o` what they stored: how much of it is lost, with the colour that bleeds onto the surface; or,
// if tinted, the colour of the light itself, encoded.
fn in_light(color: vec3<f32>, o: vec4<f32>) -> vec3<f32> {
    if tinted {
        return encoded(decoded(color) * decoded(o.rgb));
    }
    return color * (1.0 - o.a) + o.rgb * (o.a * view.color_bleeding);
}
