// One step of slices through the context image: eye, occlusion and partial occlusion at once
// (Algorithms 1 to 4 of Schott et al. 2012 in one pass).
#include lib/view.wgsl
#include lib/march.wgsl
#include lib/context.wgsl
#include lib/image.wgsl
#include lib/linear.wgsl
#include lib/slices.wgsl

// Extinction that stands for something solid, per millimetre.
const SOLID = 1e20;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= view.size) {
        return;
    }
    zero = id.x >> 31u;
    let at = linear_index(id.xy);
    let p = from_middle(id.xy);
    let sight = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    let slant = length(sight);
    var ray: ImageRay;
    if !is_empty {
        ray = image_ray(p, FAR);
    }
    var solid = FAR;
    if with_solid {
        solid = depths[at];
    }
    var last = solid;
    if ends_apart {
        last = depths[at + view.size.x * view.size.y];
    }
    var state = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    var note = vec2<f32>(1.0, FAR);
    var light = vec2<f32>(1.0);
    if !is_first {
        state = eye[at];
        note = notes[at];
        if variant == MENDED {
            light = lattice(id.xy);
        } else {
            light = texel(vec2<i32>(id.xy));
        }
    }
    let before = state.a;
    let casts = !solid_lets_through;
    let shades = (slices.flags & VOLUME_ON_VOLUME) != 0u;
    for (var i = 0u; i < parts[zero].slices; i++) {
        let front = parts[0].depth + f32(i) * slices.slice_mm;
        let back = front + slices.slice_mm;
        var begin = front;
        var end = front;
        var material = vec4<f32>(0.0);
        if !is_empty {
            begin = max(front, ray.near);
            end = min(back, ray.far);
            if begin < end {
                material = material_at(ray.o + 0.5 * (begin + end) * ray.d);
            }
        }
        let extinction = extinction_of(material);
        let hides = with_solid && solid < back;
        let meets = hides && solid >= front;
        if variant == MENDED {
            // Up to what is solid; up to where the eye's ray ends; all of the slice.
            let until = clamp(solid, begin, max(end, begin));
            var ends = until;
            if ends_apart {
                ends = clamp(last, until, max(end, until));
            }
            let seen = extinction * slant * max(until - begin, 0.0);
            let shown = extinction * slant * max(ends - begin, 0.0);
            let whole = extinction * slant * max(end - begin, 0.0);
            let slice = through_slice(light.y, shown);
            let lit = mix(absorbed(shown), slice.x, slices.strength);
            state = vec4<f32>(state.rgb + decoded(material.rgb) * (lit * state.a), state.a * exp(-shown));
            if with_solid {
                let after = select(light.x, through_slice(light.x, whole).y, whole > 0.0);
                // At what is solid: between before and behind the slice (Algorithm 4), as light falls.
                let share = select(1.0, seen / whole, whole > 0.0);
                let at_solid = light.x * pow(max(after, 1e-30) / max(light.x, 1e-30), share);
                note.x = select(note.x, select(after, at_solid, meets), !hides | meets);
                light.x = after;
                if solid_lets_through {
                    light.y = select(light.y, through_slice(light.y, whole).y, shades & (whole > 0.0));
                } else {
                    light.y = select(select(light.y, slice.y, shades & (shown > 0.0)), 0.0, hides);
                }
            } else {
                light.y = select(light.y, slice.y, shades & (shown > 0.0));
                light.x = light.y;
            }
        } else {
            // As the paper has it: a slice is a sheet in its middle, its opacity that of the distance to
            // what is solid where that is nearer.
            let sampled = min(end - begin, last - front);
            let alpha = select(absorbed(extinction * sampled), 0.0, sampled <= 0.0);
            state = vec4<f32>(state.rgb + decoded(material.rgb) * (mix(1.0, light.y, slices.strength) * alpha * state.a), state.a * (1.0 - alpha));
            let of_solid = select(extinction, SOLID, hides && casts);
            let of_both = select(select(0.0, SOLID, hides && casts), of_solid, shades);
            var after = vec2<f32>(exp(-vec2<f32>(extinction, of_both) * slices.slice_mm));
            if !is_first {
                after = disc(id.xy, vec2<f32>(extinction, of_both));
            }
            if !hides {
                note.x = after.x;
            } else if meets {
                note.x = mix(light.x, after.x, (solid - front) / slices.slice_mm);
            }
            light = after;
        }
    }
    if before > 0.5 && state.a <= 0.5 {
        note.y = parts[0].depth + 0.5 * f32(parts[zero].slices) * slices.slice_mm;
    }
    eye[at] = state;
    notes[at] = note;
    let place = light_place(at, 1u - parts[0].turn);
    if with_solid {
        lights[place] = light.x;
        lights[place + 1u] = light.y;
    } else {
        lights[place] = light.y;
    }
}
