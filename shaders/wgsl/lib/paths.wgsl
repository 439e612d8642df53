// Paths of light through the image and among the masks, backwards from what is seen (Kajiya 1986): free flights by delta
// tracking, transmittance by ratio tracking (Woodcock et al. 1965, Novák et al. 2014), with an upper bound of the
// extinction for each brick. Light comes from a white sky and a lamp far away. See render/src/light/paths.
//
// After lib/view, lib/march, lib/context, lib/image, lib/image_along. Camera space as there; lengths in millimetres.
#include lib/random
#include lib/around
#include lib/lens_end
#include lib/first_shown
#include lib/linear
#include lib/path_state

// This dispatch. Values that branches and loops depend on are read at index `zero`: see lib/zero.
@group(0) @binding(42) var<uniform> steps: array<Step, 2>;
@group(0) @binding(43) var<storage, read> majorants: array<f32>;

// Whether there is an image at all, and masks that paths meet.
override through_image: bool = false;
override past_masks: bool = false;

// Mesa's software driver silently ends a thread's loops after 65,535 rounds in total.
const MOST_ROUNDS = 40000u;
var<private> rounds: u32 = MOST_ROUNDS;
// Transmittance at which ratio tracking ends.
const DARKNESS = 1e-4;
// Paths start this far above the voxel's face that they met, in voxels.
const OFF_FACE = 0.01;

struct Travel {
    along: f32,          // where it collided; FAR if it didn't
    left: f32,           // ratio tracking: estimate of the transmittance
    color: vec3<f32>,    // of what it collided with, encoded
}

// Along direction `w` from `c` between two places, which lie in the image.
fn travel(c: vec3<f32>, w: vec3<f32>, begin: f32, end: f32, by_ratio: bool) -> Travel {
    var out = Travel(FAR, 1.0, vec3<f32>(0.0));
    if !through_image || begin >= end {
        return out;
    }
    let o = image_place(c);
    let d = w.x * context.right + w.y * context.up + w.z * context.forward;
    let moves = abs(d) > vec3<f32>(1e-12);
    let inv = select(vec3<f32>(0.0), 1.0 / select(vec3<f32>(1.0), d, moves), moves);
    let ahead = select(vec3<i32>(0), vec3<i32>(1), d > vec3<f32>(0.0));
    let counts = vec3<i32>(context.bricks);
    // The outermost bricks reach to the image's faces.
    let outermost = ahead * (counts - 1);
    var brick = vec3<i32>(place_of(o + begin * d).cell >> vec3<u32>(3u));
    var t = begin;
    var thickness = 0.0;     // until the next tentative collision
    var is_drawn_already = false;
    while t < end && rounds > 0u {
        rounds -= 1u;
        let majorant = majorants[(brick.z * counts.y + brick.y) * counts.x + brick.x];
        let bound = vec3<f32>((brick + ahead) << vec3<u32>(3u));
        let next = select(vec3<f32>(FAR), (bound - o) * inv, moves & (brick != outermost));
        let past = clamp(min(next.x, min(next.y, next.z)), t, end);
        if majorant > 0.0 {
            if !is_drawn_already {
                thickness = -log(1.0 - random());
                is_drawn_already = true;
            }
            let there = t + thickness / majorant;
            if there < past {
                t = there;
                is_drawn_already = false;
                let material = material_of(place_of(o + t * d));
                let shown = is_drawn(c + t * w);
                let share = select(0.0, min(extinction_of(material) / majorant, 1.0), shown);
                if by_ratio {
                    out.left *= 1.0 - share;
                    if out.left < DARKNESS {
                        out.left = 0.0;
                        return out;
                    }
                } else if random() < share {
                    out.along = t;
                    out.color = material.rgb;
                    return out;
                }
                continue;
            }
            thickness = max(thickness - (past - t) * majorant, 0.0);
        }
        t = past;
        let axis = first_axis(next);
        brick += select(vec3<i32>(0), 2 * ahead - 1, vec3<u32>(axis) == vec3<u32>(0u, 1u, 2u));
    }
    return out;
}

// Where a ray meets the masks.
fn met_from(c: vec3<f32>, w: vec3<f32>, starts_inside: bool) -> Met {
    if !past_masks {
        return Met(FAR, 0u, 3u);
    }
    let o = view.corner + c.x * view.right + c.y * view.up + c.z * view.forward;
    let ray = ray_from(o, w.x * view.right + w.y * view.up + w.z * view.forward);
    // What is behind the eye's plane is not drawn.
    let to_eye = select(FAR, (view.nearest_mm - c.z) / select(-1.0, w.z, w.z < 0.0), w.z < 0.0);
    return first_met(ray, 0.0, min(leaves_lens(c, w), to_eye), starts_inside);
}

// Normal of a voxel's face that a ray along `w` met.
fn normal_of_face(axis: u32, w: vec3<f32>) -> vec3<f32> {
    let x = vec3<f32>(view.right.x, view.up.x, view.forward.x);
    let y = vec3<f32>(view.right.y, view.up.y, view.forward.y);
    let z = vec3<f32>(view.right.z, view.up.z, view.forward.z);
    let n = select(select(select(-w, z, axis == 2u), y, axis == 1u), x, axis == 0u);
    return n * select(1.0, -1.0, dot(n, w) > 0.0) / max(length(n), 1e-30);
}

// A place where light is scattered.
struct Vertex {
    c: vec3<f32>,
    on_surface: bool,
    axis: vec3<f32>,         // the surface's normal; in the image the direction that the path came along
    throughput: vec3<f32>,
}

// A direction at an angle of this cosine to an axis.
fn about(axis: vec3<f32>, cosine: f32, turn: f32) -> vec3<f32> {
    let basis = tangents_of(axis);
    let sine = sqrt(max((1.0 - cosine) * (1.0 + cosine), 0.0));
    let angle = 6.2831853 * turn;
    return sine * cos(angle) * basis[0] + sine * sin(angle) * basis[1] + cosine * axis;
}

// Share of the light from direction `w` that goes on along the path, 1 for a white surface that faces it.
fn scattered_from(v: Vertex, w: vec3<f32>) -> f32 {
    let cosine = dot(v.axis, w);
    let g = steps[zero].anisotropy;
    let spread = 1.0 + g * g - 2.0 * g * cosine;
    return select(0.25 * (1.0 - g * g) / (spread * sqrt(spread)), max(cosine, 0.0), v.on_surface);
}

// A direction that light comes from: by the cosine to a surface's normal, or by the phase function.
fn scattered_to(v: Vertex, u: vec2<f32>) -> vec3<f32> {
    let g = steps[zero].anisotropy;
    let is_even = abs(g) < 1e-3;
    let part = (1.0 - g * g) / (1.0 - g + 2.0 * g * u.x);
    let peaked = (1.0 + g * g - part * part) / (2.0 * select(g, 1.0, is_even));
    let in_image = clamp(select(peaked, 1.0 - 2.0 * u.x, is_even), -1.0, 1.0);
    return about(v.axis, select(in_image, sqrt(1.0 - u.x), v.on_surface), u.y);
}

// Light that a path collects from its first vertex on; `u` decides its first direction.
fn collected(start: Vertex, u: vec2<f32>) -> vec3<f32> {
    var v = start;
    var turn = u;
    var sum = vec3<f32>(0.0);
    // The smooth surface lies within voxels, too.
    var inside = start.on_surface && (flags() & SMOOTH) != 0u;
    for (var n = 1u; n <= steps[zero].bounces; n++) {
        if steps[zero].lamp_light > 0.0 {
            let cosine = 1.0 - random() * steps[zero].lamp_cap;
            let l = about(steps[zero].lamp, cosine, random());
            let share = scattered_from(v, l);
            if share > 0.0 && met_from(v.c, l, inside).along >= FAR {
                let span = image_span(v.c, l);
                let lit = travel(v.c, l, max(span.x, 0.0), span.y, true);
                sum += v.throughput * (steps[zero].lamp_light * share * lit.left);
            }
        }
        let w = scattered_to(v, turn);
        let met = met_from(v.c, w, inside);
        let span = image_span(v.c, w);
        let is_last = n == steps[zero].bounces;
        let flight = travel(v.c, w, max(span.x, 0.0), min(span.y, met.along), is_last);
        if flight.along >= FAR && met.along >= FAR {
            sum += v.throughput * (steps[zero].sky * flight.left);
            break;
        }
        if flight.along < FAR {
            v = Vertex(v.c + flight.along * w, false, w, v.throughput * decoded(flight.color));
        } else {
            let normal = normal_of_face(met.axis, w);
            let steep = normal.x * view.right + normal.y * view.up + normal.z * view.forward;
            let off = OFF_FACE / max(max(abs(steep.x), abs(steep.y)), abs(steep.z));
            let c = v.c + met.along * w + off * normal;
            v = Vertex(c, true, normal, v.throughput * decoded(color_of(met.number)));
        }
        turn = vec2<f32>(random(), random());
        inside = false;
    }
    return sum;
}
