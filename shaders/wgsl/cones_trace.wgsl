// Cone-traced occlusion in a ray caster; see render/src/cones. Distances are millimetres along rays.

#include lib/optics.wgsl

struct Level {
    dims: vec3<u32>,
    start: u32,                     // of its cells among all
    scale: vec3<f32>,               // cells a voxel
    pad: u32,
}

struct Cones {
    tangent: f32,                   // of a sub-cone's half opening
    ray_step: f32,                  // mm
    cone_step: f32,                 // cells
    coarsest: f32,                  // level
    voxel_mm: f32,
    count: u32,                     // sub-cones
    dark: f32,                      // no finest cell counts for more than this extinction when mixed
    pad: u32,
    levels: array<Level, 16>,
    decay: array<vec4<f32>, 257>,   // see lib/decay.wgsl
}

// What one dispatch does: pieces of the ray that begin in a stretch, with some of the sub-cones. Work is
// cut up because Mesa's software driver ends all loops of an invocation after 65535 rounds in all.
struct Share {
    begin: f32,
    end: f32,
    first_axis: u32,
    end_axis: u32,
    advances: u32,                  // 1: the last of the sub-cones; transmittance moves on
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(4) var<uniform> cones: Cones;
@group(0) @binding(8) var<uniform> share: Share;
@group(0) @binding(5) var<storage, read> cells: array<f32>;
@group(0) @binding(6) var<storage, read> axes: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> eye: array<vec4<f32>>; // radiance, transmittance

fn decay_entry(i: u32) -> vec4<f32> {
    return cones.decay[i];
}

#include lib/decay.wgsl

// Past this optical thickness nothing is left that a pixel could show.
const ENOUGH = 12.0;
// Steps thicker than this take their light from their front.
const THICK = 1.0;
const SLIP_VOXELS = 1e-4;
const NEVER = 1e30;

// Stretch of a ray in the volume's box and before the plane; empty when the second is not larger.
fn stretch(o: vec3<f32>, d: vec3<f32>) -> vec2<f32> {
    let size = vec3<f32>(optical.dims);
    let moves = abs(d) > vec3<f32>(1e-12);
    let still_outside = !moves & ((o < vec3<f32>(0.0)) | (o > size));
    if any(still_outside) {
        return vec2<f32>(0.0, -1.0);
    }
    let safe = select(vec3<f32>(1.0), d, moves);
    let a = select(vec3<f32>(-NEVER), -o / safe, moves);
    let b = select(vec3<f32>(NEVER), (size - o) / safe, moves);
    let first = min(a, b);
    let last = max(a, b);
    var near = max(max(first.x, first.y), max(first.z, 0.0));
    var far = min(min(last.x, last.y), last.z);
    let at = dot(optical.plane.xyz, o) - optical.plane.w;
    let along = dot(optical.plane.xyz, d);
    if abs(along) < 1e-12 {
        if at > 0.0 {
            return vec2<f32>(0.0, -1.0);
        }
    } else if along > 0.0 {
        far = min(far, -at / along);
    } else {
        near = max(near, -at / along);
    }
    return vec2<f32>(near, far);
}

// Where a ray leaves a cell, along each axis.
fn ends_of(o: vec3<f32>, d: vec3<f32>, cell: vec3<i32>) -> vec3<f32> {
    let moves = abs(d) > vec3<f32>(1e-12);
    let ahead = select(vec3<i32>(0), vec3<i32>(1), d > vec3<f32>(0.0));
    return select(vec3<f32>(NEVER), (vec3<f32>(cell + ahead) - o) / select(vec3<f32>(1.0), d, moves), moves);
}

fn first_axis(t: vec3<f32>) -> u32 {
    return select(select(2u, 1u, t.y <= t.z), 0u, t.x <= t.y && t.x <= t.z);
}

// Optical thickness through labels, voxel by voxel.
fn exact_thickness(o: vec3<f32>, d: vec3<f32>) -> f32 {
    let s = stretch(o, d);
    if s.y <= s.x {
        return 0.0;
    }
    let dims = vec3<i32>(optical.dims);
    var cell = clamp(vec3<i32>(floor(o + d * s.x)), vec3<i32>(0), dims - 1);
    var begin = s.x;
    var thickness = 0.0;
    let most = i32(varied(u32(dims.x + dims.y + dims.z + 3)));
    for (var i = 0; i < most; i++) {
        let ends = ends_of(o, d, cell);
        let axis = first_axis(ends);
        let to = min(ends[axis], s.y);
        if to > begin {
            thickness += classify(value_at(vec3<u32>(cell))).w * (to - begin);
            begin = to;
        }
        cell[axis] += select(-1, 1, d[axis] > 0.0);
        if thickness > ENOUGH || ends[axis] >= s.y || cell[axis] < 0 || cell[axis] >= dims[axis] {
            break;
        }
    }
    return thickness;
}

fn level_at(p: vec3<f32>, number: u32) -> f32 {
    let level = cones.levels[number];
    let at = clamp(p * level.scale - 0.5, vec3<f32>(0.0), vec3<f32>(level.dims) - 1.0);
    let low = min(vec3<u32>(at), max(level.dims, vec3<u32>(2u)) - 2u);
    let high = min(low + 1u, level.dims - 1u);
    let f = at - vec3<f32>(low);
    let line = level.dims.x;
    let sheet = level.dims.x * level.dims.y;
    let y0 = level.start + low.z * sheet + low.y * line;
    let y1 = level.start + low.z * sheet + high.y * line;
    let y2 = level.start + high.z * sheet + low.y * line;
    let y3 = level.start + high.z * sheet + high.y * line;
    let a = mix(cells[y0 + low.x], cells[y0 + high.x], f.x);
    let b = mix(cells[y1 + low.x], cells[y1 + high.x], f.x);
    let c = mix(cells[y2 + low.x], cells[y2 + high.x], f.x);
    let e = mix(cells[y3 + low.x], cells[y3 + high.x], f.x);
    return mix(mix(a, b, f.y), mix(c, e, f.y), f.z);
}

fn extinction_at(p: vec3<f32>, level: f32) -> f32 {
    if level <= 0.0 {
        return optics_at(p).w;
    }
    let low = u32(floor(level));
    let f = level - floor(level);
    var a = 0.0;
    if low == 0u {
        a = min(optics_at(p).w, cones.dark);
    } else {
        a = level_at(p, low);
    }
    if f <= 0.0 {
        return a;
    }
    return a + (level_at(p, low + 1u) - a) * f;
}

// Share of one sub-cone's light that reaches a place.
fn sub_cone(o: vec3<f32>, d: vec3<f32>) -> f32 {
    if cones.coarsest + f32(zero) == 0.0 && varied(optical.nearest) == 1u {
        return exp(-exact_thickness(o, d));
    }
    let size = vec3<f32>(optical.dims);
    let moves = abs(d) > vec3<f32>(1e-12);
    let safe = select(vec3<f32>(1.0), d, moves);
    let ends = select(vec3<f32>(NEVER), max(-o / safe, (size - o) / safe), moves);
    let far = min(min(ends.x, ends.y), ends.z);
    let widest = cones.voxel_mm * exp2(cones.coarsest);
    var t = 0.0;
    var thickness = 0.0;
    while t < far && thickness < ENOUGH {
        let width = clamp(2.0 * t * cones.tangent, cones.voxel_mm, widest);
        let step = min(cones.cone_step * width, far - t);
        if !(t + step > t) {
            break;
        }
        let middle = t + 0.5 * step;
        let p = o + d * middle;
        if dot(optical.plane.xyz, p) <= optical.plane.w {
            let here = clamp(2.0 * middle * cones.tangent, cones.voxel_mm, widest);
            thickness += extinction_at(p, log2(here / cones.voxel_mm)) * step;
        }
        t += step;
    }
    return exp(-thickness);
}

// Unit directions in camera space: right and up in the picture at right angles to the ray, and back.
struct Frame {
    u: vec3<f32>,
    v: vec3<f32>,
    axis: vec3<f32>,
}

fn light_at(o: vec3<f32>, frame: Frame) -> f32 {
    var sum = 0.0;
    for (var i = varied(share.first_axis); i < varied(share.end_axis); i++) {
        let a = axes[i];
        let w = frame.u * a.x + frame.v * a.y + frame.axis * a.z;
        sum += sub_cone(o, w.x * optical.right + w.y * optical.up - w.z * optical.forward);
    }
    return sum / f32(cones.count);
}

fn piece(now: vec4<f32>, o: vec3<f32>, d: vec3<f32>, begin: f32, to: f32, optics: vec4<f32>, frame: Frame) -> vec4<f32> {
    if optics.w <= 0.0 {
        return now;
    }
    if optics.w >= OPAQUE_FROM {
        let light = light_at(o + d * (begin - SLIP_VOXELS * cones.voxel_mm), frame);
        return vec4<f32>(now.rgb + optics.rgb * (light * now.w), 0.0);
    }
    let thickness = optics.w * (to - begin);
    var gathered = 0.0;
    if thickness < THICK {
        gathered = light_at(o + d * (0.5 * (begin + to)), frame) * absorbed(thickness);
    } else {
        let light = light_at(o + d * (begin - SLIP_VOXELS * cones.voxel_mm), frame);
        gathered = light * through_slice(1.0, thickness).x;
    }
    return vec4<f32>(now.rgb + optics.rgb * (gathered * now.w), now.w * exp(-thickness));
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    let pixel = id.xy;
    if any(pixel >= optical.size) {
        return;
    }
    let middle = from_middle(pixel);
    let slant = slant_of(middle);
    let off = middle * optical.pixel_mm_per_mm;
    let o = place(middle, 0.0);
    let d = (optical.forward + off.x * optical.right + off.y * optical.up) / slant;
    var frame: Frame;
    frame.axis = vec3<f32>(-off, 1.0) / slant;
    frame.u = normalize(vec3<f32>(1.0, 0.0, 0.0) - frame.axis * frame.axis.x);
    frame.v = cross(frame.axis, frame.u);
    let s = stretch(o, d);
    let index = pixel.y * optical.size.x + pixel.x;
    let before = eye[index];
    var now = before;
    let least = exp(-ENOUGH);
    if s.y > s.x && varied(optical.nearest) == 0u {
        let steps = clamp(ceil((s.y - s.x) / cones.ray_step), 1.0, 1e6);
        let step = (s.y - s.x) / steps;
        let first = u32(max(floor((share.begin - s.x) / step) - 1.0, 0.0));
        for (var i = first; i < u32(steps) && now.w > least; i++) {
            let begin = s.x + f32(i) * step;
            if begin >= share.end {
                break;
            }
            if begin >= share.begin {
                let optics = optics_at(o + d * (begin + 0.5 * step));
                now = piece(now, o, d, begin, begin + step, optics, frame);
            }
        }
    } else if s.y > s.x {
        let dims = vec3<i32>(optical.dims);
        // A little before, so that no cell that begins in this stretch is missed.
        let start = max(s.x, share.begin - 0.5 * cones.voxel_mm);
        var cell = clamp(vec3<i32>(floor(o + d * start)), vec3<i32>(0), dims - 1);
        let behind = select(vec3<i32>(0), vec3<i32>(1), d <= vec3<f32>(0.0));
        let entries = ends_of(o, d, cell - 1 + 2 * behind);
        let moves = abs(d) > vec3<f32>(1e-12);
        let entered = select(vec3<f32>(-NEVER), entries, moves);
        var begin = max(s.x, max(entered.x, max(entered.y, entered.z)));
        let most = i32(varied(u32(dims.x + dims.y + dims.z + 3)));
        for (var i = 0; i < most && now.w > least && begin < share.end; i++) {
            let ends = ends_of(o, d, cell);
            let axis = first_axis(ends);
            let to = min(ends[axis], s.y);
            if to > begin {
                let optics = classify(value_at(vec3<u32>(cell)));
                let count = max(ceil((to - begin) / cones.ray_step), 1.0);
                let part = (to - begin) / count;
                for (var k = 0u; k < u32(count) && optics.w > 0.0 && now.w > least && begin >= share.begin; k++) {
                    now = piece(now, o, d, begin + f32(k) * part, begin + f32(k + 1u) * part, optics, frame);
                }
                begin = to;
            }
            cell[axis] += select(-1, 1, d[axis] > 0.0);
            if ends[axis] >= s.y || cell[axis] < 0 || cell[axis] >= dims[axis] {
                break;
            }
        }
    }
    eye[index] = vec4<f32>(now.rgb, select(before.w, now.w, share.advances == 1u));
}
