// Ellipsoids as quadrics: rays are transformed to unit space, where the ellipsoid is the unit ball.

struct Ellipsoid {
    center: vec3<f32>,          // camera space
    opacity: f32,               // its own times that of the scene
    unit_from_x: vec3<f32>,     // unit space, one millimetre to the right
    color: u32,                 // rgb in the low bytes
    unit_from_y: vec3<f32>,     // up
    id: u32,
    unit_from_z: vec3<f32>,     // away from the viewer
    unused: u32,
}

@group(0) @binding(1) var<storage, read> ellipsoids: array<Ellipsoid>;
@group(0) @binding(2) var<storage, read> tiles: array<u32>; // start of each tile's list; the lists of ellipsoid numbers

// Ellipsoids are listed by tiles of this side, pixels.
const TILE = 16u;
// The faces of a fragment.
const FRONT = 0u;
const BACK = 1u;

// A fragment is its depth and twice its ellipsoid's number plus the face. Sorted by depth, then number
// (which follows the id), then front before back: the order of equal depths doesn't depend on the scene's.
fn is_behind(a: vec2<u32>, b: vec2<u32>) -> bool {
    let s = bitcast<f32>(a.x);
    let t = bitcast<f32>(b.x);
    return s > t || (s == t && a.y > b.y);
}

fn tile_of(pixel: vec2<u32>) -> u32 {
    return (pixel.y / TILE) * ((view.size.x + TILE - 1u) / TILE) + pixel.x / TILE;
}

struct Chord {
    meets: bool,
    s: vec2<f32>,               // depths of the front and the back face
    nearest: vec3<f32>,         // unit space: the ray's closest approach to the centre
    half: f32,                  // from there to either face, in depth
    along: vec3<f32>,           // unit space, per millimetre of depth
}

// Depths are relative to the plane through the centre, and the discriminant is the radius less the closest
// approach: no cancellation of large numbers, as in b^2 - 4ac.
fn chord_of(e: Ellipsoid, p: vec2<f32>) -> Chord {
    let across = p * footprint_mm(e.center.z) - e.center.xy;
    let start = across.x * e.unit_from_x + across.y * e.unit_from_y;
    let slant = p * view.mm_per_pixel_per_mm;
    var c: Chord;
    c.along = slant.x * e.unit_from_x + slant.y * e.unit_from_y + e.unit_from_z;
    let length2 = dot(c.along, c.along);
    let to = -dot(start, c.along) / length2;
    c.nearest = start + to * c.along;
    let off = length(c.nearest);
    let left = (1.0 - off) * (1.0 + off);
    c.meets = left > 0.0;
    c.half = sqrt(max(left, 0.0) / length2);
    let middle = e.center.z + to;
    c.s = vec2<f32>(middle - c.half, middle + c.half);
    return c;
}

// Distance of a ray inside the outline, pixels, to first order: only sideways motion of the ray changes the
// closest approach, which is a minimum along the ray.
fn inset_px(e: Ellipsoid, c: Chord) -> f32 {
    let off = length(c.nearest);
    let growth = vec2<f32>(dot(c.nearest, e.unit_from_x), dot(c.nearest, e.unit_from_y));
    let per_pixel = footprint_mm(0.5 * (c.s.x + c.s.y)) * length(growth) / max(off, 1e-6);
    return max(1.0 - off, 0.0) / max(per_pixel, 1e-9);
}

// Pixel coverage of an ellipsoid at this distance inside its outline.
fn coverage_of(inset: f32) -> f32 {
    return clamp(inset, 0.0, 1.0);
}
