// Half-angle slicing (Kniss et al. 2003): slabs perpendicular to a vector between the light's direction and the line of
// sight, in the light's order. For each slab the eye's buffer is continued with the light that reaches the slab, then the
// light's. See render/src/light/half_angle.
//
// Camera space as in lib/view. Texel (i, j) of the light's buffer covers [i, i+1) x [j, j+1).

struct Slab {
    normal: vec3<f32>,
    front: f32,                     // dot(normal, c) where the slab begins
    light: vec3<f32>,               // direction that light travels in
    slab_mm: f32,
    across: vec3<f32>,              // axes of the light's buffer
    per_mm: f32,                    // texels
    down: vec3<f32>,
    strength: f32,                  // darkness of unlit places, 0 to 1
    origin: vec2<f32>,              // the buffer's corner, texels
    texels: vec2<u32>,
    first: vec2<u32>,               // first pixel or texel of this dispatch
    layer: u32,                     // which half of `eye` and `lights`
    pad: u32,
}

struct Texel {
    light: f32,                     // left of it so far
    near: f32,                      // where its ray is in the image, millimetres along it from the plane through the origin
    far: f32,
    hit: f32,                       // dot(normal, c) where its ray meets the masks
}

@group(0) @binding(32) var<uniform> slab: Slab;
@group(0) @binding(33) var<storage, read_write> lights: array<Texel>;
@group(0) @binding(34) var<storage, read_write> eye: array<vec4<f32>>;    // radiance, transmittance
@group(0) @binding(35) var<storage, read_write> ranges: array<vec2<f32>>; // depths between which a pixel shows the image

// Where a texel's ray meets the plane through the origin that is perpendicular to it.
fn texel_start(id: vec2<u32>) -> vec3<f32> {
    let at = (vec2<f32>(id) + 0.5 + slab.origin) / slab.per_mm;
    return at.x * slab.across + at.y * slab.down;
}

fn eye_place(at: u32) -> u32 {
    return slab.layer * view.size.x * view.size.y + at;
}

fn light_place(id: vec2<u32>) -> u32 {
    return (slab.layer * slab.texels.y + id.y) * slab.texels.x + id.x;
}

// 1 - e^-x, accurate for small x too.
fn absorbed(x: f32) -> f32 {
    return select(1.0 - exp(-x), x * (1.0 - 0.5 * x * (1.0 - x / 3.0 * (1.0 - 0.25 * x))), x < 0.05);
}
