// As lib/light_tints reads it.
fn packed_tint(tint: vec3<f32>) -> vec2<u32> {
    return vec2<u32>(pack2x16unorm(tint.xy), pack2x16unorm(vec2<f32>(tint.z, 0.0)));
}
