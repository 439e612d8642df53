// Fibre tracts as chains of capsules: one instance per point, which begins a segment (or is a ball, where
// its fibre has no other point). A rectangle around each is drawn, and its fragments are intersected with
// the capsule in closed form. Writes not a colour but the fibre's number with the facing ratio (cosine
// between normal and line of sight), and the depth; where fibres are coloured by values also which point the
// segment begins with, and how far along it the pixel is.
#include lib/view
#include lib/tubes

struct Tubes {
    right: vec3<f32>,    // world directions
    least_px: f32,       // a tube's least radius on the screen
    up: vec3<f32>,
    unused_a: f32,
    away: vec3<f32>,
    unused_b: f32,
    origin: vec3<f32>,   // of the points, camera space
    unused_c: f32,
}

struct TubePoint {
    place: vec3<f32>,    // world directions, millimetres from the origin
    what: u32,           // number of its fibre, LAST, ALONE
}

const NUMBER = 0xffffffu;
const LAST = 0x1000000u;     // no segment begins here
const ALONE = 0x2000000u;

@group(0) @binding(26) var<uniform> tubes: Tubes;
@group(0) @binding(27) var<storage, read> points: array<TubePoint>;
@group(0) @binding(28) var<storage, read> fibers: array<Fiber>;

override located: bool = false;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat) a: vec3<f32>,       // camera space
    @location(1) @interpolate(flat) b: vec3<f32>,
    @location(2) @interpolate(flat) radius: f32,
    @location(3) @interpolate(flat) number: u32,
    @location(4) @interpolate(flat) point: u32,
}

fn in_camera(p: vec3<f32>) -> vec3<f32> {
    return tubes.origin + vec3<f32>(dot(tubes.right, p), dot(tubes.up, p), dot(tubes.away, p));
}

// Distance in front of the eye, where rays spread from one.
fn from_eye(depth: f32) -> f32 {
    return footprint_mm(depth) / view.mm_per_pixel_per_mm;
}

// Extent of a ball's projection along a direction of the frame: pixels from the centre.
// The ball is in front of the eye, or rays are parallel.
fn reach_px(c: vec3<f32>, radius: f32, along: vec2<f32>) -> vec2<f32> {
    let x = dot(c.xy, along);
    if !spreads() {
        return vec2<f32>(x - radius, x + radius) / view.mm_per_pixel;
    }
    // Slopes of the two tangents through the eye.
    let w = from_eye(c.z);
    let squared = (w - radius) * (w + radius);
    let root = radius * sqrt(x * x + squared);
    return vec2<f32>(x * w - root, x * w + root) / (squared * view.mm_per_pixel_per_mm);
}

// Whether both balls are outside the same side of the view frustum.
fn is_aside(a: vec3<f32>, b: vec3<f32>, radius: f32) -> bool {
    let edge = 0.5 * vec2<f32>(view.size) * view.mm_per_pixel_per_mm;
    let margin = radius * sqrt(1.0 + edge * edge);
    let at_a = abs(a.xy) - edge * from_eye(a.z);
    let at_b = abs(b.xy) - edge * from_eye(b.z);
    return any((sign(a.xy) == sign(b.xy)) & (at_a > margin) & (at_b > margin));
}

@vertex
fn main(@builtin(vertex_index) corner: u32, @builtin(instance_index) at: u32) -> Corner {
    zero = corner >> 31u;
    let begin = points[at];
    let nowhere = Corner(vec4<f32>(2.0, 2.0, 0.0, 1.0), vec3<f32>(0.0), vec3<f32>(0.0), 0.0, 0u, 0u);
    if (begin.what & LAST) != 0u {
        return nowhere;
    }
    let number = begin.what & NUMBER;
    let a = in_camera(begin.place);
    var b = a;
    if (begin.what & ALONE) == 0u {
        b = in_camera(points[at + 1u].place);
    }
    let least = tubes.least_px * footprint_mm(0.5 * (a.z + b.z));
    let radius = max(fibers[number].radius_mm, least);
    // A rectangle along the segment around the projections of both its balls.
    var along = vec2<f32>(1.0, 0.0);
    var low = -0.5 * vec2<f32>(view.size);
    var high = -low;
    var around_eye = false;
    if spreads() {
        let w = vec2<f32>(from_eye(a.z), from_eye(b.z));
        if max(w.x, w.y) <= -radius {
            return nowhere;
        }
        around_eye = min(w.x, w.y) <= 1.01 * radius;
        if around_eye && is_aside(a, b, radius) {
            return nowhere;
        }
    }
    if !around_eye {
        let run = b.xy / footprint_mm(b.z) - a.xy / footprint_mm(a.z);
        let length_px = length(run);
        along = select(along, run / max(length_px, 1e-20), length_px > 1e-3);
        let across = vec2<f32>(-along.y, along.x);
        let a1 = reach_px(a, radius, along);
        let b1 = reach_px(b, radius, along);
        let a2 = reach_px(a, radius, across);
        let b2 = reach_px(b, radius, across);
        // So that rounding loses no pixel.
        low = vec2<f32>(min(a1.x, b1.x), min(a2.x, b2.x)) - 0.25;
        high = vec2<f32>(max(a1.y, b1.y), max(a2.y, b2.y)) + 0.25;
    }
    let place = vec2<f32>(select(low.x, high.x, (corner & 1u) != 0u), select(low.y, high.y, corner > 1u));
    let px = place.x * along + place.y * vec2<f32>(-along.y, along.x);
    return Corner(vec4<f32>(2.0 * px / vec2<f32>(view.size), 0.5, 1.0), a, b, radius, number, at);
}

struct Shade {
    @location(0) what: vec4<u32>,    // the target has two of them unless pixels are located
    @builtin(frag_depth) depth: f32,
}

// Maps depths of any size to 0 to 1 in order, with a resolution of 1e-5 mm near the reference plane and 2e-3 mm
// a metre away. So one distant point doesn't cost the others precision.
fn order_of(depth: f32) -> f32 {
    return min(0.5 + 0.5 * depth / (200.0 + abs(depth)), 0.9999999);
}

struct Met {
    t: f32,              // along the ray; FAR where it misses
    normal: vec3<f32>,
}

// First hit of a ball; `o` is the ray's origin from the ball's centre.
fn ball(o: vec3<f32>, d: vec3<f32>, radius: f32) -> Met {
    let dd = dot(d, d);
    let nearest = -dot(o, d) / dd;
    let off = o + nearest * d;
    let half2 = radius * radius - dot(off, off);
    let t = nearest - sqrt(max(half2, 0.0) / dd);
    return Met(select(FAR, t, half2 >= 0.0), o + t * d);
}

// Where the ray o + t d enters the capsule around the segment from -h to h. Within the infinite cylinder the
// capsule ends in its balls; the ray meets first the one on the side it comes from.
fn capsule(o: vec3<f32>, d: vec3<f32>, h: vec3<f32>, radius: f32) -> Met {
    let dd = dot(d, d);
    let hh = dot(h, h);
    let dh = dot(d, h);
    let oh = dot(o, h);
    if hh <= 1e-12 * dd {
        return ball(o, d, radius);
    }
    // Without the components along the axis.
    let a = dd - dh * dh / hh;
    let b = dot(o, d) - oh * dh / hh;
    let c = dot(o, o) - oh * oh / hh - radius * radius;
    let end = select(1.0, -1.0, dh > 0.0);
    if a <= 1e-6 * dd {
        return ball(o - end * h, d, radius);
    }
    let root2 = b * b - a * c;
    if root2 < 0.0 {
        return Met(FAR, vec3<f32>(0.0));
    }
    let root = sqrt(root2);
    // The root in the form without cancellation.
    let t = select(c / max(root - b, 1e-30), (-b - root) / a, b > 0.0);
    let y = (oh + t * dh) / hh;
    if abs(y) <= 1.0 {
        return Met(t, o + t * d - y * h);
    }
    return ball(o - sign(y) * h, d, radius);
}

@fragment
fn shade(corner: Corner) -> Shade {
    let p = from_middle(vec2<u32>(corner.clip.xy));
    // Relative to the segment's middle, which keeps precision.
    let middle = 0.5 * (corner.a + corner.b);
    let d = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    let o = vec3<f32>(p * footprint_mm(middle.z) - middle.xy, 0.0);
    let met = capsule(o, d, 0.5 * (corner.b - corner.a), corner.radius);
    let depth = middle.z + met.t;
    // Also a capsule that contains the eye.
    if met.t >= FAR || !(depth > view.nearest_mm) {
        discard;
    }
    let facing = -dot(met.normal, d) / (corner.radius * length(d));
    let light = u32(255.0 * clamp(facing, 0.0, 1.0) + 0.5);
    var what = vec4<u32>((corner.number + 1u) | (light << 24u), bitcast<u32>(depth), 0u, 0u);
    if located {
        let h = 0.5 * (corner.b - corner.a);
        let y = dot(o + met.t * d, h) / max(dot(h, h), 1e-20);
        what.z = corner.point;
        what.w = bitcast<u32>(0.5 + 0.5 * clamp(y, -1.0, 1.0));
    }
    return Shade(what, order_of(depth));
}
