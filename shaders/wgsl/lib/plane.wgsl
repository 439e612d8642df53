// A textured rectangle in space, for example a slice of an image.

struct Plane {
    corner: vec3<f32>,          // camera space, top left
    opacity: f32,
    to_u: vec3<f32>,            // camera space to 0..1 across the rectangle, from its corner
    width: u32,                 // texels
    to_v: vec3<f32>,            // down
    height: u32,
    normal: vec3<f32>,          // unit length
    unused: u32,
}

@group(0) @binding(13) var<uniform> plane: Plane;
@group(0) @binding(14) var<storage, read> texels: array<u32>; // rgba, row after row, not premultiplied

struct PlaneHit {
    depth: f32,                 // FAR where the ray misses it
    color: vec4<f32>,           // premultiplied
}

fn texel(x: i32, y: i32) -> vec4<f32> {
    let last = vec2<i32>(i32(plane.width), i32(plane.height)) - 1;
    let at = clamp(vec2<i32>(x, y), vec2<i32>(0), last);
    let c = unpack4x8unorm(texels[u32(at.y) * plane.width + u32(at.x)]);
    return vec4<f32>(c.rgb * c.a, c.a);
}

// Texel centres lie at halves; bilinear between them.
fn plane_at(pixel: vec2<u32>) -> PlaneHit {
    var hit = PlaneHit(FAR, vec4<f32>(0.0));
    if (flags() & HAS_PLANE) == 0u {
        return hit;
    }
    let p = from_middle(pixel);
    let direction = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    // Relative to the depth of the corner.
    let start = vec3<f32>(p * footprint_mm(plane.corner.z) - plane.corner.xy, 0.0);
    let facing = dot(direction, plane.normal);
    if abs(facing) < 1e-6 {
        return hit;
    }
    let to = -dot(start, plane.normal) / facing;
    let depth = plane.corner.z + to;
    let on = start + to * direction;
    let uv = vec2<f32>(dot(on, plane.to_u), dot(on, plane.to_v));
    if depth <= view.nearest_mm || any(uv < vec2<f32>(0.0)) || any(uv > vec2<f32>(1.0)) {
        return hit;
    }
    let at = uv * vec2<f32>(f32(plane.width), f32(plane.height)) - 0.5;
    let low = floor(at);
    let part = at - low;
    let x = i32(low.x);
    let y = i32(low.y);
    let upper = mix(texel(x, y), texel(x + 1, y), part.x);
    let lower = mix(texel(x, y + 1), texel(x + 1, y + 1), part.x);
    hit.depth = depth;
    hit.color = plane.opacity * mix(upper, lower, part.y);
    return hit;
}

fn with_plane(color: vec3<f32>, hit: PlaneHit) -> vec3<f32> {
    return hit.color.rgb + (1.0 - hit.color.a) * color;
}
