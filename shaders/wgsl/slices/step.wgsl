// One step of slices through the context image: eye, occlusion and partial occlusion at once
// (Algorithms 1 to 4 of Schott et al. 2012 in one pass). Continues from slices/begin or the previous step.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/linear
#include lib/slices

// Extinction that represents opaque geometry, per millimetre.
const SOLID = 1e20;

struct Pixel {
    at: u32,
    line: array<vec3<f32>, 2>,
    range: vec2<f32>,            // depths between which the image is visible
    slant: f32,
    solid: f32,
    last: f32,                   // where the eye's ray ends
}

var<private> state: vec4<f32>;
var<private> note: vec2<f32>;
var<private> light: vec2<f32>;

// Depth interval of the slice in the image.
fn span_of(pixel: Pixel, front: f32) -> vec2<f32> {
    return vec2<f32>(max(front, pixel.range.x), min(front + slices.slice_mm, pixel.range.y));
}

// The middle of that interval in the image.
fn place_in(pixel: Pixel, span: vec2<f32>) -> Place {
    return place_of(pixel.line[0] + 0.5 * (span.x + span.y) * pixel.line[1]);
}

fn shades() -> bool {
    return (slices.flags & VOLUME_ON_VOLUME) != 0u;
}

// Whether a pixel's opaque surface lies in the slice.
fn meets_solid(pixel: Pixel, front: f32) -> bool {
    return with_solid && (pixel.solid >= front) & (pixel.solid < front + slices.slice_mm);
}

// Light to the eye from a slice that light crosses towards the eye, `seen` being its optical thickness along the eye's ray:
// both fade exponentially.
fn scattered_onwards(before: f32, after: f32, seen: f32) -> f32 {
    let faded = log(max(before, 1e-30) / max(after, 1e-30));
    let differ = abs(seen - faded);
    return before * seen * exp(-min(seen, faded)) * select(1.0, absorbed(differ) / differ, differ > 1e-6);
}

// As `mended`, from back to front. A surface hides light from the image where it is met, and from surfaces all that is
// behind it: so those that face away from the lamp are dark.
fn mended_from_behind(pixel: Pixel, front: f32, span: vec2<f32>, material: vec4<f32>) {
    let extinction = extinction_of(material);
    let end = max(span.y, span.x);
    let until = clamp(pixel.solid, span.x, end);
    var ends = until;
    if ends_apart {
        ends = clamp(pixel.last, until, end);
    }
    let whole = extinction * (end - span.x);
    let seen = extinction * pixel.slant * (ends - span.x);
    let through = select(light, vec2<f32>(through_slice(light.x, whole).y, through_slice(light.y, whole).y), whole > 0.0);
    let meets = meets_solid(pixel, front);
    let of_image = select(light.y, 0.0, meets && !solid_lets_through);
    let gathered = scattered_onwards(of_image, select(of_image, min(through.y, of_image), shades()), seen);
    let kept = exp(-seen);
    state = vec4<f32>(
        state.rgb * kept + decoded(material.rgb) * mix(absorbed(seen), gathered, slices.strength), state.a * kept);
    if with_solid {
        let share = select(1.0, extinction * (end - until) / whole, whole > 0.0);
        let at_solid = light.x * pow(max(through.x, 1e-30) / max(light.x, 1e-30), share);
        note.x = select(select(note.x, at_solid, meets), through.x, pixel.solid < front);
    }
    light = vec2<f32>(through.x, select(light.y, through.y, shades()));
}

// What opaque surfaces take from the light that comes from behind, in a slice.
fn behind_solid(pixel: Pixel, front: f32) {
    if with_solid && !solid_lets_through {
        light.y = select(light.y, 0.0, meets_solid(pixel, front));
    }
    if with_solid && solid_on_solid {
        light.x = select(light.x, 0.0, front > pixel.solid + slices.lag_px * footprint_mm(pixel.solid));
    }
}

fn mended(pixel: Pixel, front: f32, span: vec2<f32>, material: vec4<f32>) {
    // A lamp's light crosses slices on ways of its own, which its decay knows.
    let extinction = extinction_of(material) * select(pixel.slant, 1.0, towards_lamp);
    let hides = with_solid && pixel.solid < front + slices.slice_mm;
    let meets = hides && pixel.solid >= front;
    let end = max(span.y, span.x);
    // Optical thickness up to opaque geometry, up to the end of the eye ray, and of the whole slice.
    let until = clamp(pixel.solid, span.x, end);
    var ends = until;
    if ends_apart {
        ends = clamp(pixel.last, until, end);
    }
    let to_solid = extinction * (until - span.x);
    let to_end = extinction * (ends - span.x);
    let whole = extinction * (end - span.x);
    let slice = through_slice(light.y, to_end);
    var seen = to_end;
    var gathered = slice.x;
    if towards_lamp {
        seen = to_end * pixel.slant;
        gathered *= select(pixel.slant, absorbed(seen) / absorbed(to_end), to_end > 1e-6);
    }
    let lit = mix(absorbed(seen), gathered, slices.strength);
    state = vec4<f32>(state.rgb + decoded(material.rgb) * (lit * state.a), state.a * exp(-seen));
    if with_solid {
        let after = select(light.x, through_slice(light.x, whole).y, whole > 0.0);
        // At opaque geometry: between in front of and behind the slice (Algorithm 4), as light attenuates.
        let share = select(1.0, to_solid / whole, whole > 0.0);
        let at_solid = light.x * pow(max(after, 1e-30) / max(light.x, 1e-30), share);
        note.x = select(note.x, select(after, at_solid, meets), !hides | meets);
        light.x = after;
        if solid_lets_through {
            light.y = select(light.y, through_slice(light.y, whole).y, shades() & (whole > 0.0));
        } else {
            light.y = select(select(light.y, slice.y, shades() & (to_end > 0.0)), 0.0, hides);
        }
    } else {
        light.y = select(light.y, slice.y, shades() & (to_end > 0.0));
        light.x = light.y;
    }
}

// As in the paper: a slice is a plane at its middle, with the opacity of the distance to opaque geometry where
// that is nearer. Opaque geometry blocks the light of both, which then are the paper's one.
fn as_the_paper(id: vec2<u32>, pixel: Pixel, front: f32, span: vec2<f32>, material: vec4<f32>) {
    let extinction = extinction_of(material);
    let casts = !solid_lets_through;
    let meets = meets_solid(pixel, front);
    let hides = with_solid && select(pixel.solid < front + slices.slice_mm, meets, from_behind);
    let sampled = min(span.y - span.x, pixel.last - front);
    let alpha = select(absorbed(extinction * sampled), 0.0, sampled <= 0.0);
    let own = decoded(material.rgb) * (mix(1.0, light.y, slices.strength) * alpha);
    state = vec4<f32>(
        select(state.rgb + own * state.a, state.rgb * (1.0 - alpha) + own, from_behind), state.a * (1.0 - alpha));
    let of_solid = select(extinction, SOLID, hides && casts);
    let of_both = select(select(0.0, SOLID, hides && casts), of_solid, shades());
    let after = disc(id, vec2<f32>(extinction, of_both));
    let share = (pixel.solid - front) / slices.slice_mm;
    if meets {
        note.x = mix(light.x, after.x, select(share, 1.0 - share, from_behind));
    } else if select(!hides, pixel.solid < front, from_behind) {
        note.x = after.x;
    }
    light = vec2<f32>(select(after.x, 0.0, hides && solid_on_solid && !from_behind), after.y);
}

fn load(at: u32) {
    state = eye[at];
    note = notes[at];
}

fn store(at: u32, before: f32) {
    if !from_behind && before > 0.5 && state.a <= 0.5 {
        note.y = parts[zero].depth + 0.5 * f32(parts[zero].slices) * slices.slice_mm;
    }
    eye[at] = state;
    notes[at] = note;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) thread: vec3<u32>) {
    zero = thread.x >> 31u;
    let id = pixel_in_areas(workgroup, thread);
    if any(id >= view.size) {
        return;
    }
    let at = linear_index(id);
    let p = from_middle(id);
    let slant = length(vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0));
    var range = vec2<f32>(FAR, -FAR);
    if !is_empty {
        range = vec2<f32>(lights[range_place(at)], lights[range_place(at) + 1u]);
    }
    var solid = FAR;
    if with_solid {
        solid = depths[at];
    }
    var last = solid;
    if ends_apart {
        last = depths[at + view.size.x * view.size.y];
    }
    let pixel = Pixel(at, image_line(p), range, slant, solid, last);
    if variant == MENDED && towards_lamp {
        light = ellipse(id);
    } else if variant == MENDED {
        light = lattice(id);
    } else {
        light = texel(vec2<i32>(id));
    }
    if variant == MENDED && one_slice {
        let front = parts[zero].depth;
        let span = span_of(pixel, front);
        let place = place_in(pixel, span);
        let shows = (span.x < span.y) & shows_anything(place);
        let back = front + slices.slice_mm;
        // Where the slice is empty, eye and notes don't change and needn't be read or written.
        if shows | (with_solid & (((solid >= front) & (solid < back)) | (parts[zero].is_last == 1u))) {
            load(at);
            let before = state.a;
            let material = select(vec4<f32>(0.0), material_of(place), shows);
            if from_behind {
                mended_from_behind(pixel, front, span, material);
            } else {
                mended(pixel, front, span, material);
            }
            store(at, before);
        } else if with_solid && !solid_lets_through && !from_behind {
            light.y = select(light.y, 0.0, solid < back);
        }
        if from_behind {
            behind_solid(pixel, front);
        }
    } else {
        load(at);
        let before = state.a;
        for (var i = 0u; i < parts[zero].slices; i++) {
            let front = front_of(i);
            let span = span_of(pixel, front);
            let place = place_in(pixel, span);
            var material = vec4<f32>(0.0);
            if (span.x < span.y) & shows_anything(place) {
                material = material_of(place);
            }
            if variant == MENDED && from_behind {
                mended_from_behind(pixel, front, span, material);
            } else if variant == MENDED {
                mended(pixel, front, span, material);
            } else {
                as_the_paper(id, pixel, front, span, material);
            }
            if from_behind {
                behind_solid(pixel, front);
            }
        }
        store(at, before);
    }
    let there = light_place(at, 1u - parts[zero].turn);
    if two_lights {
        lights[there] = light.x;
        lights[there + 1u] = light.y;
    } else {
        lights[there] = light.y;
    }
}
