// Composes the context view's frame: the tumour with occlusion and lines, fibre tubes beside it, the context
// image around and behind, the lens ring (thesis 7.3.2).
#include lib/view
#include lib/ring
#include lib/lines
#include lib/context
#include lib/surface_light
#include lib/tubes
#include lib/tube_lines

@group(0) @binding(3) var<storage, read> regions: array<u32>;
@group(0) @binding(6) var<storage, read> marched: array<Marched>;
@group(0) @binding(8) var<storage, read> blurred: array<u32>;
@group(0) @binding(10) var picture: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(28) var<storage, read> fibers: array<Fiber>;
@group(0) @binding(30) var<storage, read> tube_shades: array<u32>;
@group(0) @binding(33) var<storage, read> projected: array<u32>;

const SPECULAR = 0.12;

fn highlight(facing: f32) -> f32 {
    let facing4 = facing * facing * facing * facing;
    return SPECULAR * facing4 * facing4 * facing4 * facing4;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let here = vec2<i32>(id.xy);
    let at = linear_index(id.xy);
    var color = view.background.rgb;
    var front = FAR;
    var shine = 0.0;
    let has_surface = (flags() & HAS_SURFACE) != 0u;
    let has_tubes = (flags() & HAS_TUBES) != 0u;
    if has_surface || has_tubes {
        front = depths[at];
    }
    if front < FAR {
        let surface = surfaces[at];
        if has_tubes && is_tube(surface.y) {
            let edge = tube_edge(here, front, surface.y, fibers[surface.y & ~TUBE].radius_mm);
            let shade = unpack4x8unorm(tube_shades[at]);
            color = shade.rgb * edge;
            shine = edge * highlight(shade.a);
        } else {
            color = unpack4x8unorm(regions[surface.x]).rgb;
        }
        if (flags() & HAS_OCCLUSION) != 0u {
            let o = unpack4x8unorm(blurred[at]);
            color = in_light(color, o);
        }
        // Occlusion darkens ambient and diffuse light, not the highlight (Algorithm 6 of Schott et al. 2012).
        color = min(color + shine, vec3<f32>(1.0));
    }
    // Nothing of the image is in front of the tumour.
    if (flags() & HAS_CONTEXT) != 0u {
        color = image_over(marched[at], color);
    }
    if has_surface {
        var lines = Lines(0.0, 0.0, front);
        if has_tubes {
            lines = lines_among_tubes(here, front);
        } else {
            lines = lines_at(here, front);
        }
        color = mix(color, INNER, view.inner_line_strength * lines.grey);
        color = mix(color, view.silhouette.rgb, lines.black);
    }
    if (flags() & HAS_PROJECTION) != 0u {
        let over = unpack4x8unorm(projected[at]);
        color = mix(color, over.rgb, over.a);
    }
    color = with_ring(color, id.xy);
    textureStore(picture, here, vec4<f32>(color, 1.0));
}
