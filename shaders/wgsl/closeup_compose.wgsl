// The picture: flat region colours, occlusion, contour lines, the faint outside, the lens ring.
#include lib/view.wgsl

struct Outside {
    depth: f32,
    number: u32,
    face: u32,
    color: u32,
}

@group(0) @binding(3) var<storage, read> regions: array<u32>;
@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(6) var<storage, read> outsides: array<Outside>;
@group(0) @binding(8) var<storage, read> blurred: array<u32>;
@group(0) @binding(10) var picture: texture_storage_2d<rgba8unorm, write>;

const RING = vec3<f32>(0.86, 0.08, 0.08);
const INNER = vec3<f32>(0.80, 0.80, 0.80);

fn clamped(at: vec2<i32>) -> u32 {
    return linear_index(vec2<u32>(clamp(at, vec2<i32>(0), vec2<i32>(view.size) - 1)));
}

// Step in depth between p and q that no slant explains: both sides are also carried on in a
// straight line from the pixels beyond (pp, p | q, qq), and the best explanation is taken.
fn step_mm(pp: f32, p: f32, q: f32, qq: f32) -> f32 {
    return min(abs(q - p), min(abs(q - 2.0 * p + pp), abs(p - 2.0 * q + qq)));
}

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
    } else if (view.flags & HAS_OUTSIDE) != 0u {
        let outer = unpack4x8unorm(outsides[at].color);
        color = outer.rgb + (1.0 - outer.a) * color;
    }
    if has_surface {
        var black = 0.0;
        var grey = 0.0;
        for (var n = 0; n < 4; n++) {
            let to = vec2<i32>(select(0, 1 - (n & 2), (n & 1) == 0), select(0, 1 - (n & 2), (n & 1) == 1));
            let p = front;
            let q = depths[clamped(here + to)];
            if p >= FAR && q >= FAR {
                continue;
            }
            let jump = step_mm(depths[clamped(here - to)], p, q, depths[clamped(here + 2 * to)]);
            black = max(black, smoothstep(3.0, 6.0, jump / view.voxel_mm));
            if p < q {
                grey = max(grey, smoothstep(0.3, 1.0, jump / view.voxel_mm));
            }
        }
        color = mix(color, INNER, 0.6 * grey);
        color = mix(color, view.silhouette.rgb, black);
    }
    if (view.flags & HAS_OUTSIDE) != 0u {
        let p = outsides[at].depth;
        if p < front {
            var line = 0.0;
            for (var n = 0; n < 4; n++) {
                let to = vec2<i32>(select(0, 1 - (n & 2), (n & 1) == 0), select(0, 1 - (n & 2), (n & 1) == 1));
                let q = outsides[clamped(here + to)].depth;
                let jump = step_mm(
                    outsides[clamped(here - to)].depth, p, q, outsides[clamped(here + 2 * to)].depth);
                line = max(line, select(0.0, smoothstep(2.0, 5.0, jump / view.voxel_mm), p < q));
            }
            color = mix(color, view.silhouette.rgb, 0.35 * line);
        }
    }
    if (view.flags & LENS_ON) != 0u {
        let p = from_middle(id.xy);
        let direction = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
        let start = vec3<f32>(p * view.mm_per_pixel, 0.0) - view.lens.xyz;
        let nearest = -dot(start, direction) / dot(direction, direction);
        let off_px = (length(start + nearest * direction) - view.lens.w) / footprint_mm(nearest);
        if nearest > view.nearest_mm {
            color = mix(color, RING, clamp(0.5 + view.line_scale - abs(off_px), 0.0, 1.0));
        }
    }
    textureStore(picture, here, vec4<f32>(color, 1.0));
}
