// Shared by all passes of a 3D view: camera, volume shape, appearance.
//
// Camera space: x right, y up, s = view depth in millimetres from a reference plane near the data, so that
// neither a distant camera nor a volume 1e6 mm from the origin costs precision.
// Index space: voxel (i, j, k) of the cropped volume fills [i, i+1) x [j, j+1) x [k, k+1).

#include lib/zero

struct View {
    corner: vec3<f32>,              // index space, where the view axis meets the reference plane
    mm_per_pixel: f32,              // on the reference plane
    right: vec3<f32>,               // index space, one millimetre to the right
    mm_per_pixel_per_mm: f32,       // growth with depth; 0 for the orthographic camera
    up: vec3<f32>,
    nearest_mm: f32,                // depth where rays start
    forward: vec3<f32>,
    voxel_mm: f32,                  // finest spacing
    dims: vec3<u32>,
    log2_ids_per_word: u32,
    bricks: vec3<u32>,
    selected: u32,                  // bit set of the shown region numbers modulo 32
    lens: vec4<f32>,                // camera space centre and radius
    background: vec4<f32>,
    silhouette: vec4<f32>,
    size: vec2<u32>,
    flags: u32,
    occlusion_samples: u32,
    occlusion_radius_mm: f32,
    occlusion_strength: f32,        // share of the light that can be hidden; the rest is ambient
    color_bleeding: f32,
    line_scale: f32,                // widths of lines, 1 for a frame 512 pixels high
    depth_span_mm: f32,             // half the diagonal of the volume's box
    outside_opacity: f32,           // of each region boundary outside the lens
    inner_line_strength: f32,
    outer_line_strength: f32,
    relief: f32,                    // of the light at the eye: 0 none, 1 full
    occlusion_rays: f32,            // at most, of each pixel's stored occlusion; 0 where it isn't by rays
    unused_b: f32,
    unused_c: f32,
}

const LENS_ON = 1u;
const HAS_SURFACE = 2u;
const HAS_OUTSIDE = 4u;
const HAS_OCCLUSION = 8u;
const NO_SKIPPING = 16u;
const MANY_REGIONS = 32u;
const LENS_ONLY_DRAWN = 64u;     // the lens is only a ring, it cuts nothing
const HAS_CONTEXT = 128u;
const HAS_PLANE = 256u;
const HAS_TUBES = 512u;          // tubes or arrows are among depths and surfaces
const LINEAR_LIGHT = 1024u;        // the march's colours are in linear light
const HAS_PROJECTION = 4096u;        // a second image is projected over the picture
const SMOOTH = 2048u;              // surfaces are a level set, without edges of voxels

// Depth of a pixel without a hit.
const FAR = 1e30;
// Its face.
const NO_FACE = 0xffffffffu;

@group(0) @binding(0) var<uniform> view: View;

fn flags() -> u32 {
    return varied(view.flags);
}

// Whether rays spread from an eye (perspective); else they are parallel.
fn spreads() -> bool {
    return view.mm_per_pixel_per_mm + f32(zero) > 0.0;
}

// Pixel centre in pixels from the centre of the frame, y up.
fn from_middle(pixel: vec2<u32>) -> vec2<f32> {
    let at = vec2<f32>(pixel) + 0.5 - 0.5 * vec2<f32>(view.size);
    return vec2<f32>(at.x, -at.y);
}

// Footprint of a pixel at a depth, millimetres.
fn footprint_mm(depth: f32) -> f32 {
    return view.mm_per_pixel + depth * view.mm_per_pixel_per_mm;
}

fn linear_index(pixel: vec2<u32>) -> u32 {
    return pixel.y * view.size.x + pixel.x;
}

// Depths where the pixel's ray enters and leaves the lens; x > y when it misses.
fn lens_interval(pixel: vec2<u32>) -> vec2<f32> {
    let p = from_middle(pixel);
    let direction = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    let start = vec3<f32>(p * view.mm_per_pixel, 0.0) - view.lens.xyz;
    let a = dot(direction, direction);
    let nearest = -dot(start, direction) / a;
    let off = start + nearest * direction;
    let b = length(off);
    let half2 = (view.lens.w - b) * (view.lens.w + b) / a;
    if half2 <= 0.0 {
        return vec2<f32>(1.0, 0.0);
    }
    let half = sqrt(half2);
    return vec2<f32>(nearest - half, nearest + half);
}
