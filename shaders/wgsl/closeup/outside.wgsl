// The outer level (thesis 7.3.3): all regions outside the lens, faint, composited front to back
// where the region changes, and the first hit stored separately for the outer contour lines. Where
// the lens shows tissue the composite isn't used, so only the first hit is searched.
#include lib/view
#include lib/march

struct Outside {
    depth: f32,          // of the first hit
    number: u32,         // of the first hit
    face: u32,
    color: u32,          // rgb with alpha, premultiplied
}

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(6) var<storage, read_write> outsides: array<Outside>;

const MOST_OPAQUE = 0.97;    // nothing behind changes 8-bit colours by much

struct Level {
    first: Outside,
    color: vec3<f32>,
    through: f32,
    number: u32,
}

fn composite(ray: Ray, near: f32, far: f32, axis: u32, only_first: bool, level: ptr<function, Level>) {
    if near >= far {
        return;
    }
    let skipping = (flags() & NO_SKIPPING) == 0u;
    var w = start_walk(ray, near, axis);
    for (var n = 2u * most_steps(); n > 0u && w.t < far; n--) {
        let brick = brick_of(w.cell);
        let within = w.cell >> vec3<u32>(3u);
        let uniform_brick = skipping && (brick.y & UNIFORM) != 0u;
        var number = number_at(w.cell, brick);
        // Advances to the next region boundary, or out of the brick.
        while number == (*level).number && !uniform_brick {
            step_cell(ray, &w);
            if w.t >= far || any((w.cell >> vec3<u32>(3u)) != within) {
                break;
            }
            number = number_at(w.cell, brick);
        }
        if number != (*level).number {
            (*level).number = number;
            if number != 0u {
                if (*level).first.number == 0u {
                    (*level).first.depth = w.t;
                    (*level).first.number = number;
                    (*level).first.face = face_of(ray, w);
                    if only_first {
                        return;
                    }
                }
                (*level).color += (*level).through * view.outside_opacity * color_of(number);
                (*level).through *= 1.0 - view.outside_opacity;
                if (*level).through < 1.0 - MOST_OPAQUE {
                    return;
                }
            }
        }
        if uniform_brick {
            step_brick(ray, &w);
        }
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    var level = Level(Outside(FAR, 0u, NO_FACE, 0u), vec3<f32>(0.0), 1.0, 0u);
    let ray = ray_of(id.xy);
    let span = box_interval(ray);
    // Lens off: the selection applies everywhere and nothing is outside.
    if span.near < span.far && (flags() & LENS_ON) != 0u {
        let hidden = (flags() & HAS_SURFACE) != 0u && depths[at] < FAR;
        let lens = lens_interval(id.xy);
        let meets = lens.x < lens.y;
        // In front of the lens, then behind it: one loop, as masked vector lanes would pay for two.
        var from_to = vec2<f32>(span.near, select(span.far, min(span.far, lens.x), meets));
        var axis = span.axis;
        for (var behind = false; ; behind = true) {
            composite(ray, from_to.x, from_to.y, axis, hidden, &level);
            if behind || !meets || hidden {
                break;
            }
            let cut = lens.y > span.near;
            level.number = select(level.number, 0u, cut);
            axis = select(span.axis, 3u, cut);
            from_to = vec2<f32>(max(span.near, lens.y), span.far);
        }
    }
    level.first.color = pack4x8unorm(vec4<f32>(level.color, 1.0 - level.through));
    outsides[at] = level.first;
}
