// The eye's buffer in front of or behind a slab, with the light that reaches it. Within a slab the medium is homogeneous
// along both ways, so that a homogeneous image has its closed form for any slab.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/linear
#include lib/half_angle

// Whether light and sight cross the slabs in the same order; else the eye's buffer is composed from the back.
override ahead: bool = true;

// A texel's light at dot(normal, c) of `along`.
fn texel(at: vec2<i32>, along: f32) -> f32 {
    let found = lights[light_place(vec2<u32>(clamp(at, vec2<i32>(0), vec2<i32>(slab.texels) - 1)))];
    return select(found.light, 0.0, found.hit < along);
}

fn light_at(c: vec3<f32>) -> f32 {
    let at = vec2<f32>(dot(c, slab.across), dot(c, slab.down)) * slab.per_mm - slab.origin - 0.5;
    let low = floor(at);
    let f = at - low;
    let i = vec2<i32>(low);
    let along = dot(c, slab.normal);
    let above = mix(texel(i, along), texel(i + vec2<i32>(1, 0), along), f.x);
    let below = mix(texel(i + vec2<i32>(0, 1), along), texel(i + vec2<i32>(1, 1), along), f.x);
    return mix(above, below, f.y);
}

// Share of the light at a slab's front that is scattered to the eye there: thickness along the line of sight, and along the
// light.
fn scattered(seen: f32, lit: f32) -> f32 {
    if ahead {
        return seen / max(seen + lit, 1e-30) * absorbed(seen + lit);
    }
    let off = seen - lit;
    let series = exp(-lit) * (1.0 - 0.5 * off * (1.0 - off / 3.0));
    let is_close = abs(off) < 0.02;
    return seen * select((exp(-lit) - exp(-seen)) / select(off, 1.0, is_close), series, is_close);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    zero = global.x >> 31u;
    let id = slab.first + global.xy;
    if any(id >= view.size) {
        return;
    }
    let at = linear_index(id);
    let p = from_middle(id);
    let start = vec3<f32>(p * view.mm_per_pixel, 0.0);
    let along = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    let rate = dot(slab.normal, along);
    let front = (slab.front - dot(slab.normal, start)) / rate;
    let back = front + slab.slab_mm / rate;
    let range = ranges[at];
    let near = max(min(front, back), range.x);
    let far = min(max(front, back), range.y);
    if near >= far {
        return;
    }
    let middle = 0.5 * (near + far);
    let line = image_line(p);
    let place = place_of(line[0] + middle * line[1]);
    if !shows_anything(place) {
        return;
    }
    let material = material_of(place);
    if material.a <= 0.0 {
        return;
    }
    let thickness = extinction_of(material) * (far - near);
    let seen = thickness * length(along);
    let lit = thickness * abs(rate) / dot(slab.normal, slab.light);
    let shown = mix(absorbed(seen), light_at(start + middle * along) * scattered(seen, lit), slab.strength);
    let color = decoded(material.rgb) * shown;
    let there = eye_place(at);
    let state = eye[there];
    if ahead {
        eye[there] = vec4<f32>(state.rgb + state.a * color, state.a * exp(-seen));
    } else {
        eye[there] = vec4<f32>(color + exp(-seen) * state.rgb, state.a * exp(-seen));
    }
}
