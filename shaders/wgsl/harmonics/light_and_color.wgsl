// As harmonics/light, with the colours of what takes light away.
#include lib/view
#include lib/light_grid
#include lib/sky
#include lib/packed_tint

@group(0) @binding(37) var<storage, read_write> light_grid: array<vec2<f32>>;
@group(0) @binding(39) var<storage, read_write> tints: array<vec2<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let number = id.x + id.y * groups.x * 64u;
    if number >= grid.needed {
        return;
    }
    let start = number * (sky.sets + 3u) * sky.functions;
    light_grid[needed[number]] = light_of(start);
    // Past masks if there are any, then red, green and blue.
    let at = start + sky.sets * sky.functions;
    let colors = vec3<f32>(raw_sum_from(at), raw_sum_from(at + sky.functions), raw_sum_from(at + 2u * sky.functions));
    let light = raw_sum_from(at - sky.functions) + sky.bleeding * max(colors, vec3<f32>(0.0));
    tints[needed[number]] = packed_tint(clamp(light, vec3<f32>(0.0), vec3<f32>(1.0)));
}
