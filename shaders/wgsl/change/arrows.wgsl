// Arrows of the surface change: a shaft and a cone, six-sided, one instance per arrow. Writes not a colour but
// what compose shades. Thin arrows have a minimum width in pixels, so that none disappears.
#include lib/view
#include lib/change

struct Arrow {
    start: vec3<f32>,    // world directions, millimetres from the common origin
    what: u32,           // its number from 1, GROWS, FAINT, TISSUE_MOVED
    along: vec3<f32>,    // from its start to its tip
    unused: u32,
}

@group(0) @binding(24) var<storage, read> arrows: array<Arrow>;

const SIDES = 6u;
const AMBIENT = 0.45;

struct Corner {
    @builtin(position) clip: vec4<f32>,
    @location(0) place: vec3<f32>,                      // camera space
    @location(1) @interpolate(flat) what: u32,
}

fn in_camera(p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(change.right, p), dot(change.up, p), dot(change.away, p));
}

// Corners 0 to 5: the shaft's start; 6 to 11: its end; 12 to 17: the head's rim; 18: the tip.
@vertex
fn main(@builtin(vertex_index) corner: u32, @builtin(instance_index) number: u32) -> Corner {
    zero = corner >> 31u;
    let arrow = arrows[number];
    let start = change.origin + in_camera(arrow.start);
    let along = in_camera(arrow.along);
    let length_mm = length(along);
    let axis = along / length_mm;
    let pixel_mm = max(footprint_mm(start.z + 0.5 * along.z), 0.0) * view.line_scale;
    let radius = max(change.radius_mm, 0.5 * pixel_mm);
    let head_radius = max(change.head_radius_mm, 1.7 * pixel_mm);
    let head_length = min(max(change.head_length_mm, 3.4 * pixel_mm), 0.6 * length_mm);
    // The coordinate axis least parallel to the arrow.
    let a = abs(axis);
    let least = select(
        select(vec3<f32>(0.0, 0.0, 1.0), vec3<f32>(0.0, 1.0, 0.0), a.y <= a.z),
        vec3<f32>(1.0, 0.0, 0.0), a.x <= a.y && a.x <= a.z);
    let u = normalize(cross(axis, least));
    let v = cross(axis, u);
    let ring = corner / SIDES;
    let turn = f32(corner % SIDES) * (6.2831853 / f32(SIDES));
    let out = cos(turn) * u + sin(turn) * v;
    var place = start + along;
    switch ring {
        case 0u: { place = start + radius * out; }
        case 1u: { place = start + (length_mm - head_length) * axis + radius * out; }
        case 2u: { place = start + (length_mm - head_length) * axis + head_radius * out; }
        default: {}
    }
    let across = 2.0 * place.xy / vec2<f32>(view.size);
    let clip = vec4<f32>(across, change.clip_offset + change.clip_scale * place.z, footprint_mm(place.z));
    return Corner(clip, place, arrow.what);
}

// The arrow's `what`, with 6 bits of brightness on top, and its depth.
@fragment
fn shade(corner: Corner) -> @location(0) vec2<u32> {
    let normal = cross(dpdx(corner.place), dpdy(corner.place));
    // Line of sight from the eye, which is at the depth of footprint 0; the same for all pixels when
    // orthographic.
    let sight = vec3<f32>(corner.place.xy * view.mm_per_pixel_per_mm / footprint_mm(corner.place.z), 1.0);
    let facing = abs(dot(normal, sight)) / max(length(normal) * length(sight), 1e-30);
    let light = AMBIENT + (1.0 - AMBIENT) * min(facing, 1.0);
    return vec2<u32>(corner.what | (u32(63.0 * light + 0.5) << 26u), bitcast<u32>(corner.place.z));
}
