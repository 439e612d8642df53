// Ray march of the context image as in cones/march, each sample lit by light of a colour.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/image_march
#include lib/linear
#include lib/light_grid
#include lib/light_tints

@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;

const WANTS_GRADIENT = false;

fn appearance(
    color: vec3<f32>, gradient: vec3<f32>, ray: vec3<f32>, inside_mm: f32, at: vec3<f32>,
) -> vec3<f32> {
    return decoded(color) * mix(vec3<f32>(1.0), grid_tint(at + 0.5), grid.strength);
}
