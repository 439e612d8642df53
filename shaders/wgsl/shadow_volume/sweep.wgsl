// Light of a lamp far away, carried through the cells of the context image from slice to slice (Ropinski et al. 2010): what was
// left where its way crosses the slice before, less what the image takes on the way from there.
#include lib/view
#include lib/march
#include lib/context
#include lib/image
#include lib/image_along
#include lib/light_grid
#include lib/light_cell

struct Slice {
    light: vec3<f32>,               // direction that light travels in, camera space
    segment_mm: f32,                // from slice to slice along it
    shift: vec2<f32>,               // cells within the slice, from a cell back to where its light crosses the slice before
    size: vec2<u32>,                // cells
    strides: vec2<u32>,             // from cell to cell
    start: u32,                     // number of the first cell
    before: u32,                    // of the slice before; NONE at the first slice
    samples: u32,                   // of the image on the way
    own: u32,                       // number of the first cell of the slice whose light this one has
    unused_b: u32,
    unused_c: u32,
}

const NONE = 0xffffffffu;

@group(0) @binding(32) var<uniform> slice: Slice;
@group(0) @binding(33) var<storage, read_write> carried: array<f32>;           // so far
@group(0) @binding(34) var<storage, read> open: array<f32>;                    // past the masks
@group(0) @binding(37) var<storage, read_write> light_grid: array<vec2<f32>>;  // past the image; past image and masks

override with_masks: bool = false;

// Outside the cells nothing has taken light.
fn carried_at(at: vec2<i32>) -> f32 {
    let size = vec2<i32>(slice.size);
    let inside = all(at >= vec2<i32>(0)) & all(at < size) & (slice.before != NONE);
    let place = dot(vec2<u32>(clamp(at, vec2<i32>(0), size - 1)), slice.strides);
    return select(1.0, carried[select(slice.start, slice.before, slice.before != NONE) + place], inside);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= slice.size) {
        return;
    }
    // A cell beside a face that light leaves the image through has the light of the cell inside, as `middle_for` has it.
    let ring = vec2<u32>(u32(grid.ring));
    // So has the last slice, by `slice.own`.
    let low_side = select(ring, vec2<u32>(0u), slice.shift < vec2<f32>(-1e-3));
    let high_side = slice.size - 1u - select(ring, vec2<u32>(0u), slice.shift > vec2<f32>(1e-3));
    let own = clamp(id.xy, low_side, high_side);
    let at = vec2<f32>(own) + slice.shift;
    let low = floor(at);
    let f = at - low;
    let i = vec2<i32>(low);
    let upper = weighed(carried_at(i), carried_at(i + vec2<i32>(1, 0)), f.x);
    let lower = weighed(carried_at(i + vec2<i32>(0, 1)), carried_at(i + vec2<i32>(1, 1)), f.x);
    let arrives = weighed(upper, lower, f.y);

    let cell = slice.start + dot(id.xy, slice.strides);
    let c = cell_middle(slice.own + dot(own, slice.strides));
    let span = image_span(c, -slice.light);
    let begin = max(span.x, 0.0);
    let each = max(min(span.y, slice.segment_mm) - begin, 0.0) / f32(slice.samples);
    var extinction = 0.0;
    for (var n = 0u; n < varied(slice.samples); n++) {
        extinction += extinction_along(c - (begin + (f32(n) + 0.5) * each) * slice.light);
    }
    let left = arrives * exp(-extinction * each);
    carried[cell] = left;
    if with_masks {
        light_grid[cell] = left * vec2<f32>(1.0, open[cell]);
    } else {
        light_grid[cell] = vec2<f32>(left);
    }
}
