// What the passes of the change view share (thesis 7.3.4).

struct Change {
    right: vec3<f32>,           // camera axes in world directions: rotate the arrows
    full_mm: f32,               // change length drawn opaque
    up: vec3<f32>,
    smooth_mm: f32,             // standard deviation of the filter, in the view plane
    away: vec3<f32>,
    gap_mm: f32,                // depth step that the filter does not cross
    origin: vec3<f32>,          // camera space: origin of the arrows' coordinates
    radius_mm: f32,             // of an arrow's shaft
    base: vec3<f32>,            // colour of a surface that did not change
    head_radius_mm: f32,
    grow: vec3<f32>,
    head_length_mm: f32,
    shrink: vec3<f32>,
    log2_slots: u32,            // of the hash table of lengths
    clip_offset: f32,           // clip depth of depth 0
    clip_scale: f32,            // clip depth per millimetre
    samples: u32,               // of the arrows along each side of a pixel
    flags: u32,
    kinds: array<vec4<u32>, 2>, // of region numbers 0 to 7
    outline: vec4<f32>,         // colour of the earlier date's outline
    displaced: vec4<f32>,       // colour of a surface that moved with the tissue around it
}

const STYLE_HEIGHT = 1u;
const STYLE_ARROWS = 2u;
const HAS_HEIGHTS = 4u;
const HAS_ARROWS = 8u;
const HAS_HULL = 16u;
const LIT_ARROWS = 32u;          // a pixel's light is that of its nearest arrow, if any
const HAS_EARLIER = 64u;

// Bits of an arrow's `what` that hold its number, from 1.
const ARROW_NUMBER = 0x7fffffu;

// Added to the certainty of a length, at most 1, of which the tissue around it moved too.
const DISPLACED = 4.0;

fn is_displaced(certainty: f32) -> bool {
    return certainty >= 0.5 * DISPLACED;
}

// The certainty without that mark.
fn certainty_of(marked: f32) -> f32 {
    return marked - select(0.0, DISPLACED, is_displaced(marked));
}

// Index bits of the regions: active before, after, in a component without a counterpart.
const BEFORE = 1u;
const AFTER = 2u;
const ALONE = 4u;

@group(0) @binding(16) var<uniform> change: Change;

fn kind_of(number: u32) -> u32 {
    return change.kinds[(number >> 2u) & 1u][number & 3u];
}
