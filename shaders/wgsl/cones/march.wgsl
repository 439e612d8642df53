// Ray march of the context image as in context/march, in linear light: each sample is lit by the light that
// reaches it through a cone towards the eye.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/image_march
#include lib/linear
#include lib/light_grid

@group(0) @binding(37) var<storage, read> light_grid: array<vec2<f32>>;

const WANTS_GRADIENT = false;

fn appearance(
    color: vec3<f32>, gradient: vec3<f32>, ray: vec3<f32>, inside_mm: f32, at: vec3<f32>,
) -> vec3<f32> {
    return decoded(color) * mix(1.0, grid_light(at + 0.5).y, grid.strength);
}
