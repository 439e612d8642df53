// Emission-absorption ray march of the context image (thesis 7.3.2), lit by a headlight or a lamp on its gradients.
// A ray that meets the masks' box starts behind it; rays end at opaque geometry.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/image_march

const WANTS_GRADIENT = true;

// Phong's shading, of a light at the eye or of a lamp far away; a surface's normal is towards the eye. Where the image is flat, a gradient is noise: shading fades out there. `inside_mm` is the distance
// from where the ray enters the image: a cut through tissue must be readable as an image, not as a relief of its
// noise.
fn appearance(
    color: vec3<f32>, gradient: vec3<f32>, ray: vec3<f32>, inside_mm: f32, at: vec3<f32>,
) -> vec3<f32> {
    let steepness = length(gradient);
    let relative = steepness / context.half_shaded;
    let strength = context.shading * clamp(inside_mm / context.cut_fade_mm, 0.0, 1.0)
        * (1.0 - 1.0 / (1.0 + relative * relative));
    let along = dot(gradient, ray) / max(steepness, 1e-20);
    var facing = abs(along);
    var half_facing = facing;
    if (varied(context.flags) & FROM_LAMP) != 0u {
        let normal = gradient * (select(1.0, -1.0, along > 0.0) / max(steepness, 1e-20));
        let half = context.lamp - ray;
        facing = max(dot(normal, context.lamp), 0.0);
        half_facing = select(0.0, max(dot(normal, half), 0.0) / max(length(half), 1e-6), facing > 0.0);
    }
    let light = context.ambient + (1.0 - context.ambient) * facing;
    let facing4 = half_facing * half_facing * half_facing * half_facing;
    let shine = context.specular * facing4 * facing4 * facing4 * facing4;
    return min(color * mix(1.0, light, strength) + strength * shine, vec3<f32>(1.0));
}

