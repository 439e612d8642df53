// Moves each pixel's surface to the level set of the smoothed voxels where half of the weights are shown: for the eye
// only. The first voxel of the ray decides whether there is a surface. Where the ray passes over the corner of a body it
// goes on to what is behind; what has no level set beside it (a single voxel, a sheet of one) stays as it is.
#include lib/view
#include lib/march
#include lib/shown
#include lib/smoothed

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec2<u32>>; // region number, face

// The level set is sought from this far before where the ray enters the first voxel, in steps; this near to it, it is that
// voxel's own. Voxels.
const BEFORE = 2.0;
const BESIDE = 1.5;
const STEP = 0.4;
const MOST_STEPS = 200;
const HALVINGS = 6;
// Pixels of one smooth surface have faces alike while their depths are: whole parts of this many voxels.
const FACE_VOXELS = 4.0;

fn share_at(ray: Ray, t: f32) -> f32 {
    return smoothed_at(ray.o + t * ray.d).share;
}

// Offsets of a voxel and its 26 neighbours.
fn around(n: i32) -> vec3<i32> {
    return vec3<i32>(n % 3, (n / 3) % 3, n / 9) - 1;
}

// The shown voxel nearest to a place, of those around it; x is below the margin where there is none.
fn nearest_shown(place: vec3<f32>) -> vec3<i32> {
    let middle = vec3<i32>(floor(place));
    var nearest = vec3<i32>(-MARGIN - 1);
    var least = 1e9;
    for (var n = 0; n < 27; n++) {
        let cell = middle + around(n);
        let off = place - vec3<f32>(cell) - 0.5;
        let far = dot(off, off);
        let in_grid = all(cell >= vec3<i32>(0)) && all(cell < vec3<i32>(view.dims));
        if far < least && in_grid && shown_at(cell) {
            least = far;
            nearest = cell;
        }
    }
    return nearest;
}

// Whether a voxel is no part of a body that has a level set.
fn is_thin(cell: vec3<i32>) -> bool {
    for (var n = 0; n < 27; n++) {
        let beside = cell + around(n);
        if smoothed_at(vec3<f32>(beside) + 0.5).share >= 0.5 {
            return false;
        }
    }
    return true;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let first = depths[at];
    if first >= FAR {
        return;
    }
    let ray = ray_of(id.xy);
    var near = view.nearest_mm;
    var far = box_interval(ray).far;
    if (flags() & (LENS_ON | LENS_ONLY_DRAWN)) == LENS_ON {
        let lens = lens_interval(id.xy);
        near = max(near, lens.x);
        far = min(far, lens.y);
    }
    let voxel = 1.0 / max(max(abs(ray.d.x), abs(ray.d.y)), abs(ray.d.z));
    var t = max(near, first - BEFORE * voxel);
    if share_at(ray, t) >= 0.5 {
        // Cut by the lens, or by the eye.
        return;
    }
    var before = t;
    var found = false;
    var thin = false;
    for (var n = 0; n < MOST_STEPS && !found && !thin && t < far; n++) {
        let was_beside = t < first + BESIDE * voxel;
        before = t;
        t = min(t + STEP * voxel, far);
        found = share_at(ray, t) >= 0.5;
        // Asked once, when the ray leaves the first voxel's surroundings.
        if !found && was_beside && (t >= far || t >= first + BESIDE * voxel) {
            thin = is_thin(nearest_shown(ray.o + (first + 0.01 * voxel) * ray.d));
        }
    }
    if thin || (!found && t < far) {
        return;
    }
    if !found {
        depths[at] = FAR;
        surfaces[at] = vec2<u32>(0u, NO_FACE);
        return;
    }
    for (var n = 0; n < HALVINGS; n++) {
        let middle = 0.5 * (before + t);
        let inside = share_at(ray, middle) >= 0.5;
        before = select(middle, before, inside);
        t = select(t, middle, inside);
    }
    let cell = nearest_shown(ray.o + t * ray.d);
    let face = u32(i32(floor(t / (FACE_VOXELS * view.voxel_mm)))) << 2u;
    depths[at] = t;
    if cell.x > -MARGIN {
        surfaces[at] = vec2<u32>(number_at(cell, brick_of(cell)), face);
    } else {
        surfaces[at].y = face;
    }
}
