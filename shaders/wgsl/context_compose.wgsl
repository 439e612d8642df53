// The context view's picture: the tumour with occlusion and lines, the context image around and
// behind it, the lens ring (thesis 7.3.2).
#include lib/view.wgsl
#include lib/ring.wgsl
#include lib/lines.wgsl
#include lib/context.wgsl

@group(0) @binding(3) var<storage, read> regions: array<u32>;
@group(0) @binding(6) var<storage, read> marched: array<Marched>;
@group(0) @binding(8) var<storage, read> blurred: array<u32>;
@group(0) @binding(10) var picture: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= view.size) {
        return;
    }
    let here = vec2<i32>(id.xy);
    let at = linear_index(id.xy);
    var color = view.background.rgb;
    var front = FAR;
    let has_surface = (view.flags & HAS_SURFACE) != 0u;
    if has_surface {
        front = depths[at];
    }
    if front < FAR {
        color = unpack4x8unorm(regions[surfaces[at].x]).rgb;
        if (view.flags & HAS_OCCLUSION) != 0u {
            let o = unpack4x8unorm(blurred[at]);
            let dark = o.a * view.occlusion_strength;
            color = color * (1.0 - dark) + o.rgb * (dark * view.color_bleeding);
        }
    } else if (view.flags & HAS_CONTEXT) != 0u {
        color = image_over(marched[at], color);
    }
    if has_surface {
        let lines = lines_at(here, front);
        color = mix(color, INNER, view.inner_line_strength * lines.grey);
        color = mix(color, view.silhouette.rgb, lines.black);
    }
    color = with_ring(color, id.xy);
    textureStore(picture, here, vec4<f32>(color, 1.0));
}
