// Light of the cells: their projected visibility times the sky's, function by function. One thread per cell that a frame can look up.
#include lib/view
#include lib/light_grid
#include lib/sky

@group(0) @binding(37) var<storage, read_write> light_grid: array<vec2<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    light_grid[needed[number]] = light_of(number * sky.sets * sky.functions);
}
