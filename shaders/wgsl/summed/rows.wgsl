// Running sums along the rows of the frame: depths of opaque geometry as whole numbers, and how many there are. A workgroup
// has a row, each thread a stretch of it.
#include lib/view
#include lib/summed

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(33) var<storage, read_write> table: array<vec2<u32>>;

const THREADS = 64u;
var<workgroup> sums: array<vec2<u32>, 64>;

fn entry(at: u32) -> vec2<u32> {
    let depth = depths[at];
    let number = u32(clamp(round((depth - summed.nearest) * summed.per_mm), 0.0, summed.most));
    return select(vec2<u32>(number, 1u), vec2<u32>(0u), depth >= FAR);
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) thread: vec3<u32>) {
    zero = thread.x >> 31u;
    let stretch = (view.size.x + THREADS - 1u) / THREADS;
    let first = min(thread.x * stretch, view.size.x);
    let end = min(first + stretch, view.size.x);
    let row = group.x * view.size.x;
    var sum = vec2<u32>(0u);
    for (var x = first; x < end; x++) {
        sum += entry(row + x);
    }
    sums[thread.x] = sum;
    workgroupBarrier();
    sum = vec2<u32>(0u);
    for (var i = 0u; i < THREADS; i++) {
        sum += select(vec2<u32>(0u), sums[i], i < thread.x);
    }
    for (var x = first; x < end; x++) {
        sum += entry(row + x);
        table[row + x] = sum;
    }
}
