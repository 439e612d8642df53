// Random numbers that are the same on every device: a path has its own stream (PCG of 32 bits, O'Neill 2014), seeded by
// hashes of its pixel and number; a path's first direction is a point of a sequence (Roberts's R2) with a shift for each
// pixel and half, so that the two halves of a pixel's samples are independent.

var<private> random_state: u32 = 0u;

fn hashed(value: u32) -> u32 {
    var h = (value ^ (value >> 16u)) * 0x7feb352du;
    h = (h ^ (h >> 15u)) * 0x846ca68bu;
    return h ^ (h >> 16u);
}

fn hash_of_pixel(pixel: vec2<u32>, salt: u32) -> u32 {
    return hashed(pixel.x * 0x8da6b343u + hashed(pixel.y * 0xd8163841u + hashed(salt)));
}

fn unit(bits: u32) -> f32 {
    return f32(bits >> 8u) / 16777216.0;
}

fn random() -> f32 {
    random_state = random_state * 747796405u + 2891336453u;
    let word = ((random_state >> ((random_state >> 28u) + 4u)) ^ random_state) * 277803737u;
    return unit((word >> 22u) ^ word);
}

// Point `k` of a pixel's sequence.
fn first_point(pixel: vec2<u32>, half: u32, k: u32) -> vec2<f32> {
    let x = k * 3242174889u + hash_of_pixel(pixel, 2u * half + 1u);
    let y = k * 2447445414u + hash_of_pixel(pixel, 2u * half + 5u);
    return vec2<f32>(unit(x), unit(y));
}
