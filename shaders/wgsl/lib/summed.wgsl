// A summed-area table of the depths of opaque geometry (Crow 1984; Díaz et al. 2010), in whole numbers modulo 2^32: the sum
// over any rectangle is exact as long as that sum itself is below 2^32, however large the sums in the table are.

struct Summed {
    nearest: f32,               // depth that counts as 0
    per_mm: f32,                // whole numbers per millimetre
    most: f32,                  // the largest
    boxes: u32,
    widest_px: f32,             // largest half side of a box
    unused_a: u32,
    unused_b: u32,
    unused_c: u32,
    halves: array<vec4<f32>, 8>,  // x: half the side of each box in radii
}

@group(0) @binding(36) var<uniform> summed: Summed;
