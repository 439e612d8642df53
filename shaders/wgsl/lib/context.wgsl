// The context image's ray march: its result for one pixel.

#include lib/linear

struct Marched {
    red_green: u32,      // premultiplied, 16 bits each
    blue_opacity: u32,
    depth: f32,          // where transmittance falls to one half; FAR where it never does
    unused: u32,
}

// The march's result over the colour behind it.
fn image_over(m: Marched, behind: vec3<f32>) -> vec3<f32> {
    let blue_opacity = unpack2x16unorm(m.blue_opacity);
    let color = vec3<f32>(unpack2x16unorm(m.red_green), blue_opacity.x);
    let left = 1.0 - blue_opacity.y;
    if (flags() & LINEAR_LIGHT) != 0u {
        // Decoding and encoding again is not exact.
        return select(encoded(color + left * decoded(behind)), behind, blue_opacity.y <= 0.0);
    }
    return color + left * behind;
}
