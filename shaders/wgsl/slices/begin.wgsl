// Initial state of the slice steps: full light, no radiance, full transmittance. And each pixel's depth interval
// in the image, which is too costly to find anew in each step. A frame of two runs keeps what the first one left, and mixes both.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/slices

// Whether what an earlier run left is kept.
override keeps: bool = false;
// Whether it is mixed with what the last run left, instead of a beginning.
override mixes: bool = false;

// Index in `lights` of what is kept of a pixel, behind the depths of all rays: radiance, transmittance, light on opaque geometry.
fn kept_place(at: u32) -> u32 {
    return range_place(view.size.x * view.size.y) + 5u * at;
}

fn keep(at: u32) {
    let place = kept_place(at);
    for (var c = 0u; c < 4u; c++) {
        lights[place + c] = eye[at][c];
    }
    lights[place + 4u] = notes[at].x;
}

fn mix_with_kept(at: u32) {
    let place = kept_place(at);
    let share = parts[zero].share;
    let kept = vec4<f32>(lights[place], lights[place + 1u], lights[place + 2u], lights[place + 3u]);
    eye[at] = mix(kept, eye[at], share);
    notes[at].x = mix(lights[place + 4u], notes[at].x, share);
}

// Depth where half of what lies behind is hidden, by the slices from front to back: steps from behind don't know it before
// the end.
fn half_hidden_at(at: u32, p: vec2<f32>, range: vec2<f32>) -> f32 {
    let line = image_line(p);
    let slant = length(vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0));
    var last = FAR;
    if with_solid {
        last = depths[at + select(0u, view.size.x * view.size.y, ends_apart)];
    }
    var through = 1.0;
    var found = FAR;
    for (var i = 0u; i < parts[zero].slices; i++) {
        let front = parts[zero].depth + f32(i) * slices.slice_mm;
        let span = vec2<f32>(max(front, range.x), min(front + slices.slice_mm, range.y));
        let place = place_of(line[0] + 0.5 * (span.x + span.y) * line[1]);
        if (span.x < min(span.y, last)) & shows_anything(place) {
            let behind = through * exp(-extinction_of(material_of(place)) * slant * (min(span.y, last) - span.x));
            found = select(found, front + 0.5 * slices.slice_mm, (through > 0.5) & (behind <= 0.5));
            through = behind;
        }
    }
    return found;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_id) thread: vec3<u32>) {
    zero = thread.x >> 31u;
    let id = pixel_in_areas(workgroup, thread);
    if any(id >= view.size) {
        return;
    }
    let at = linear_index(id);
    if mixes {
        mix_with_kept(at);
        return;
    }
    if keeps {
        keep(at);
    }
    eye[at] = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    notes[at] = vec2<f32>(1.0, FAR);
    for (var turn = 0u; turn < 2u; turn++) {
        let place = light_place(at, turn);
        lights[place] = 1.0;
        if two_lights {
            lights[place + 1u] = 1.0;
        }
    }
    let p = from_middle(id);
    let ray = image_ray(p, FAR);
    if from_behind {
        notes[at].y = half_hidden_at(at, p, vec2<f32>(ray.near, ray.far));
    }
    lights[range_place(at)] = ray.near;
    lights[range_place(at) + 1u] = ray.far;
}
