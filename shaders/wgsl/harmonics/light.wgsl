// Light of the cells: their projected visibility times the sky's, function by function. One thread per cell that a frame can look up.
#include lib/view
#include lib/light_grid

struct Sky {
    functions: u32,
    sets: u32,                      // of projected visibility: past the image, and past image and masks
    unused_a: u32,
    unused_b: u32,
    factors: array<vec4<f32>, 9>,
}

@group(0) @binding(30) var<storage, read> needed: array<u32>;
@group(0) @binding(34) var<storage, read> projected: array<f32>;
@group(0) @binding(36) var<uniform> sky: Sky;
@group(0) @binding(37) var<storage, read_write> light_grid: array<vec2<f32>>;

// Functions that end at an order swing about what they sum to: light below none or above all of it is cut.
fn sum_from(start: u32) -> f32 {
    var sum = 0.0;
    for (var k = 0u; k < varied(sky.functions); k++) {
        sum += projected[start + k] * sky.factors[k / 4u][k % 4u];
    }
    return clamp(sum, 0.0, 1.0);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    let start = number * sky.sets * sky.functions;
    let image = sum_from(start);
    light_grid[needed[number]] = vec2<f32>(image, min(image, sum_from(start + (sky.sets - 1u) * sky.functions)));
}
