// Ellipsoids as quadrics: a ray is taken to the space where the ellipsoid is the unit ball.

struct Ellipsoid {
    center: vec3<f32>,          // camera space
    opacity: f32,               // its own times that of the scene
    unit_from_x: vec3<f32>,     // where one millimetre to the right goes
    color: u32,                 // rgb in the low bytes
    unit_from_y: vec3<f32>,     // up
    id: u32,
    unit_from_z: vec3<f32>,     // away from the viewer
    unused: u32,
}

@group(0) @binding(1) var<storage, read> ellipsoids: array<Ellipsoid>;

// Ellipsoids are listed by tiles of so many pixels along each side.
const TILE = 16u;
// The faces of a fragment.
const FRONT = 0u;
const BACK = 1u;

struct Chord {
    meets: bool,
    s: vec2<f32>,               // depths of the front and the back face
    nearest: vec3<f32>,         // unit space: the ray's closest approach to the centre
    half: f32,                  // from there to either face, in depth
    along: vec3<f32>,           // unit space, per millimetre of depth
    inset_px: f32,              // from the outline inwards, to first order
}

// Depths count from the plane through the centre, and the discriminant is what the closest approach
// leaves of the radius: no large numbers are subtracted from each other (not b^2 - 4ac).
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
    // Of the approach's length only the sideways motion of the ray counts: it is least along the ray.
    let growth = vec2<f32>(dot(c.nearest, e.unit_from_x), dot(c.nearest, e.unit_from_y));
    let per_pixel = footprint_mm(middle) * length(growth) / max(off, 1e-6);
    c.inset_px = max(1.0 - off, 0.0) / max(per_pixel, 1e-9);
    return c;
}

// How much of a pixel an ellipsoid covers that begins so far out.
fn coverage_of(inset_px: f32) -> f32 {
    return clamp(inset_px, 0.0, 1.0);
}
