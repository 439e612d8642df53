// The light of a sky at cells whose visibility is projected: sums over functions.

struct Sky {
    functions: u32,
    sets: u32,                      // of projected visibility: past the image, and past image and masks
    bleeding: f32,                  // how much colour tissue gives to what it darkens, 0 to 1
    unused_b: u32,
    factors: array<vec4<f32>, 9>,
}

@group(0) @binding(30) var<storage, read> needed: array<u32>;
@group(0) @binding(34) var<storage, read> projected: array<f32>;
@group(0) @binding(36) var<uniform> sky: Sky;
fn raw_sum_from(start: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < varied(sky.functions); k++) {
        sum += projected[start + k] * sky.factors[k / 4u][k % 4u];
    }
    return sum;
}

// Functions that end at an order swing about what they sum to: light below none or above all of it is cut.
fn sum_from(start: u32) -> f32 {
    return clamp(raw_sum_from(start), 0.0, 1.0);
}

// Of a cell by its number among the needed ones.
fn light_of(start: u32) -> vec2<f32> {
    let image = sum_from(start);
    return vec2<f32>(image, min(image, sum_from(start + (sky.sets - 1u) * sky.functions)));
}
