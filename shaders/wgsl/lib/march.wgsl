// Exact voxel traversal (Amanatides and Woo 1987). The depth of every cell boundary is computed from its
// integer index in closed form, never accumulated; boundaries at equal depth are crossed x before y before
// z. So the visited cells don't depend on which bricks were skipped.
//
// A brick of 8x8x8 voxels is (bit set of its region numbers modulo 32, start of its numbers).
// A brick with a single number stores none: its second word is UNIFORM | number.

@group(0) @binding(1) var<storage, read> bricks: array<vec2<u32>>;
@group(0) @binding(2) var<storage, read> voxels: array<u32>;
@group(0) @binding(3) var<storage, read> regions: array<u32>; // rgb in the low bytes, SHOWN

const UNIFORM = 0x80000000u;
const SHOWN = 0x80000000u;

struct Ray {
    o: vec3<f32>,        // index space at depth 0
    d: vec3<f32>,        // index space per millimetre of depth
    inv: vec3<f32>,
    moves: vec3<bool>,
    step: vec3<i32>,
    ahead: vec3<i32>,    // 1 where the next boundary is the cell's upper one
}

struct Interval {
    near: f32,
    far: f32,
    axis: u32,           // of the face of entry; 3: none
}

fn ray_of(pixel: vec2<u32>) -> Ray {
    return ray_through(from_middle(pixel));
}

// Ray through a point of the frame, in pixels from its centre.
fn ray_through(p: vec2<f32>) -> Ray {
    let across = p.x * view.right + p.y * view.up;
    return ray_from(
        view.corner + view.mm_per_pixel * across, view.forward + view.mm_per_pixel_per_mm * across);
}

// Ray from a point in a direction, index space.
fn ray_from(o: vec3<f32>, d: vec3<f32>) -> Ray {
    var ray: Ray;
    ray.o = o;
    ray.d = d;
    ray.moves = abs(ray.d) > vec3<f32>(1e-12);
    ray.inv = select(vec3<f32>(0.0), 1.0 / ray.d, ray.moves);
    ray.ahead = select(vec3<i32>(0), vec3<i32>(1), ray.d > vec3<f32>(0.0));
    ray.step = select(vec3<i32>(0), 2 * ray.ahead - 1, ray.moves);
    return ray;
}

// Depths where the ray crosses these boundaries.
fn crossing(ray: Ray, boundary: vec3<i32>) -> vec3<f32> {
    return select(vec3<f32>(FAR), (vec3<f32>(boundary) - ray.o) * ray.inv, ray.moves);
}

// The first axis whose depth is smallest.
fn first_axis(t: vec3<f32>) -> u32 {
    return select(select(2u, 1u, t.y <= t.z), 0u, t.x <= t.y && t.x <= t.z);
}

// Whether each axis is the first whose depth is smallest.
fn is_first(t: vec3<f32>) -> vec3<bool> {
    let x = (t.x <= t.y) & (t.x <= t.z);
    let y = (t.y <= t.z) & !x;
    return vec3<bool>(x, y, !(x | y));
}

// Interval in which the ray is inside the volume's box.
fn box_interval(ray: Ray) -> Interval {
    let dims = vec3<i32>(view.dims);
    let still_outside = !ray.moves & ((ray.o < vec3<f32>(0.0)) | (ray.o >= vec3<f32>(dims)));
    let in_ = select(vec3<f32>(-FAR), (vec3<f32>((1 - ray.ahead) * dims) - ray.o) * ray.inv, ray.moves);
    let out = crossing(ray, ray.ahead * dims);
    var i: Interval;
    i.near = max(in_.x, max(in_.y, in_.z));
    i.far = min(out.x, min(out.y, out.z));
    // Of boundaries at equal depth the last one crossed gives the face.
    i.axis = select(select(0u, 1u, in_.y == i.near), 2u, in_.z == i.near);
    if i.near < view.nearest_mm {
        i.near = view.nearest_mm;
        i.axis = 3u;
    }
    if any(still_outside) {
        i.far = i.near - 1.0;
    }
    return i;
}

// The ray's cell after crossing every boundary before `t`, and those at `t` of the axes in `ties`.
// `near` is any nearby cell.
fn settle(ray: Ray, near: vec3<i32>, t: f32, ties: vec3<bool>) -> vec3<i32> {
    var cell = near;
    for (var n = 0; n < 8; n++) {
        let next = crossing(ray, cell + ray.ahead);
        let go = (next < vec3<f32>(t)) | ((next == vec3<f32>(t)) & ties);
        if !any(go) {
            break;
        }
        cell += select(vec3<i32>(0), ray.step, go);
    }
    for (var n = 0; n < 8; n++) {
        let last = crossing(ray, cell + 1 - ray.ahead);
        let undo = ray.moves & !((last < vec3<f32>(t)) | ((last == vec3<f32>(t)) & ties));
        if !any(undo) {
            break;
        }
        cell -= select(vec3<i32>(0), ray.step, undo);
    }
    return cell;
}

struct Walk {
    cell: vec3<i32>,
    t: f32,              // depth where the cell was entered
    axis: u32,           // of the face of entry; 3: the ray started in the cell
}

fn start_walk(ray: Ray, t: f32, axis: u32) -> Walk {
    var w: Walk;
    let guess = vec3<i32>(floor(ray.o + t * ray.d));
    let cell = settle(ray, guess, t, vec3<bool>(true));
    w.cell = clamp(cell, vec3<i32>(0), vec3<i32>(view.dims) - 1);
    w.t = t;
    w.axis = axis;
    return w;
}

// Advances by one cell.
fn step_cell(ray: Ray, w: ptr<function, Walk>) {
    let next = crossing(ray, (*w).cell + ray.ahead);
    let on = is_first(next);
    (*w).t = min(next.x, min(next.y, next.z));
    (*w).cell += select(vec3<i32>(0), ray.step, on);
    (*w).axis = select(select(2u, 1u, on.y), 0u, on.x);
}

// Advances to the first cell past this brick: the same cell that single steps would reach.
fn step_brick(ray: Ray, w: ptr<function, Walk>) {
    let boundary = (((*w).cell >> vec3<u32>(3u)) + ray.ahead) << vec3<u32>(3u);
    let next = crossing(ray, boundary);
    let axis = first_axis(next);
    let on = vec3<u32>(axis) == vec3<u32>(0u, 1u, 2u);
    let t = min(next.x, min(next.y, next.z));
    // Along the crossing axis the cell adjoins the boundary; of the other axes, those of lower number that
    // cross at exactly the same depth have been crossed before.
    let ties = vec3<u32>(0u, 1u, 2u) <= vec3<u32>(axis);
    let low = ((*w).cell >> vec3<u32>(3u)) << vec3<u32>(3u);
    let guess = clamp(vec3<i32>(floor(ray.o + t * ray.d)), low, low + 7);
    (*w).cell = settle(ray, select(guess, boundary + ray.ahead - 1, on), t, ties);
    (*w).t = t;
    (*w).axis = axis;
}

fn brick_of(cell: vec3<i32>) -> vec2<u32> {
    let b = vec3<u32>(cell) >> vec3<u32>(3u);
    return bricks[(b.z * view.bricks.y + b.y) * view.bricks.x + b.x];
}

// Region number of a cell of this brick.
fn number_at(cell: vec3<i32>, brick: vec2<u32>) -> u32 {
    if (brick.y & UNIFORM) != 0u {
        return brick.y & ~UNIFORM;
    }
    let c = vec3<u32>(cell) & vec3<u32>(7u);
    let at = c.z * 64u + c.y * 8u + c.x;
    let shift = view.log2_ids_per_word;
    let bits = 32u >> shift;
    let word = voxels[brick.y + (at >> shift)];
    let low = (at & ((1u << shift) - 1u)) * bits;
    return extractBits(word, low, bits);
}

fn is_shown(number: u32) -> bool {
    if (flags() & MANY_REGIONS) == 0u {
        return number != 0u && ((view.selected >> (number & 31u)) & 1u) != 0u;
    }
    return number != 0u && (regions[number] & SHOWN) != 0u;
}

// The face of entry as one number, equal for neighbours on one plane.
fn face_of(ray: Ray, w: Walk) -> u32 {
    if w.axis == 3u {
        return 3u;
    }
    let plane = w.cell + 1 - ray.ahead;
    let along = select(select(plane.z, plane.y, w.axis == 1u), plane.x, w.axis == 0u);
    return (u32(along) << 2u) | w.axis;
}

// No ray crosses more boundaries than this.
fn most_steps() -> u32 {
    return varied(view.dims.x + view.dims.y + view.dims.z + 8u);
}

fn color_of(number: u32) -> vec3<f32> {
    return unpack4x8unorm(regions[number]).rgb;
}
