// Linear interpolation, exact at both ends, so that a value of weight 0 doesn't count. Not `mix`: GPUs compute that
// from the difference, which overflows between the largest and the smallest numbers.

fn weighed(a: f32, b: f32, w: f32) -> f32 {
    return a * (1.0 - w) + b * w;
}
