// Between two values, exact at both ends, so that a value of weight 0 is none. Not `mix`: on graphics cards that takes
// the difference, and between the largest and the least numbers it overflows.

fn weighed(a: f32, b: f32, w: f32) -> f32 {
    return a * (1.0 - w) + b * w;
}
