// Merges arrows into the opaque geometry for the lighting passes: the nearest of the surface and a pixel's
// arrow samples. A pixel that an arrow covers in part counts as the arrow.
#include lib/view
#include lib/change
#include lib/tubes

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(25) var arrow_picture: texture_2d<u32>;
@group(0) @binding(39) var<storage, read_write> solids: array<f32>;         // of all pixels, then where eye rays end
@group(0) @binding(40) var<storage, read_write> faces: array<vec2<u32>>;    // of solids: region number, face

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let has_surface = (flags() & HAS_SURFACE) != 0u;
    let front = select(FAR, depths[at], has_surface);
    var face = select(vec2<u32>(0u, NO_FACE), surfaces[at], has_surface);
    var solid = front;
    let is_lit = (varied(change.flags) & LIT_ARROWS) != 0u;
    for (var n = 0u; n < varied(change.samples * change.samples); n++) {
        let sample = id.xy * change.samples + vec2<u32>(n % change.samples, n / change.samples);
        let found = textureLoad(arrow_picture, vec2<i32>(sample), 0).xy;
        let depth = bitcast<f32>(found.y);
        let nearer = is_lit & ((found.x & ARROW_NUMBER) != 0u) & (depth < solid);
        solid = select(solid, depth, nearer);
        face = select(face, vec2<u32>(0u, TUBE | (found.x & ARROW_NUMBER)), nearer);
    }
    solids[at] = solid;
    // Beside an arrow that covers its pixel in part, the image is visible up to the surface.
    solids[at + view.size.x * view.size.y] = front;
    faces[at] = face;
    // The march reads it also without a surface, where the time points share nothing.
    depths[at] = front;
}
