// The height filter along the frame's rows.
#include lib/view
#include lib/change
#include lib/change_filter

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if all(id.xy < view.size) {
        filter_along(id.xy, vec2<i32>(1, 0));
    }
}
