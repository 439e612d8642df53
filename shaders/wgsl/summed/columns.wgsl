// Running sums of the rows' sums down the columns: each thread has a column.
#include lib/view

@group(0) @binding(33) var<storage, read_write> table: array<vec2<u32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if id.x >= view.size.x {
        return;
    }
    var sum = vec2<u32>(0u);
    for (var y = 0u; y < varied(view.size.y); y++) {
        let at = y * view.size.x + id.x;
        sum += table[at];
        table[at] = sum;
    }
}
