// As dynamic_ambient/light, with colours.
#include lib/view
#include lib/light_grid
#include lib/packed_tint

@group(0) @binding(30) var<storage, read> cluster_of: array<u32>;
@group(0) @binding(33) var<storage, read> of_cluster: array<vec4<f32>>;  // colours, share that nothing hides
@group(0) @binding(37) var<storage, read_write> light_grid: array<vec2<f32>>;
@group(0) @binding(39) var<storage, read_write> tints: array<vec2<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    zero = id.x >> 31u;
    let cell = id.x + id.y * groups.x * 64u;
    if cell >= grid.needed {
        return;
    }
    let light = of_cluster[cluster_of[cell]];
    light_grid[cell] = vec2<f32>(light.w);
    tints[cell] = packed_tint(light.rgb);
}
