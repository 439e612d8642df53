// Normal of the surface at each pixel, for shading and ambient occlusion: the gradient of the shown voxels smoothed by
// about a voxel, at the point that is hit. On the cut of the lens, the lens's own.
#include lib/view
#include lib/normal
#include lib/shown

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>;
@group(0) @binding(40) var<storage, read_write> normals: array<u32>;

// Half the width of the smoothing kernel, (1 - t²/W²)², in voxels: its standard deviation is W/√7 = 0.94.
const WIDTH = 2.5;
// Visible surfaces face the eye at least by this cosine; a smoothed normal needn't.
const LEAST_FACING = 0.02;

// Gradient of the smoothed shown voxels at a place, index space, not scaled; it points inwards.
fn gradient_at(place: vec3<f32>) -> vec3<f32> {
    let cell = clamp(vec3<i32>(floor(place)), vec3<i32>(0), vec3<i32>(view.dims));
    var whole = vec3<f32>(0.0);
    var whole_slope = vec3<f32>(0.0);
    var w: array<vec3<f32>, 5>;
    var d: array<vec3<f32>, 5>;
    for (var k = 0; k < 5; k++) {
        let t = (place - vec3<f32>(cell + k - 2) - 0.5) / WIDTH;
        let inside = max(1.0 - t * t, vec3<f32>(0.0));
        w[k] = inside * inside;
        d[k] = -t * inside;
        whole += w[k];
        whole_slope += d[k];
    }
    var sum = vec3<f32>(0.0);
    var value = 0.0;
    for (var z = 0; z < 5; z++) {
        for (var y = 0; y < 5; y++) {
            let bits = shown_from(shown_line(cell.y + y - 2, cell.z + z - 2), cell.x - 2);
            let on = vec4<f32>((vec4<u32>(bits) >> vec4<u32>(0u, 1u, 2u, 3u)) & vec4<u32>(1u));
            let last = f32((bits >> 4u) & 1u);
            let across = dot(on, vec4<f32>(w[0].x, w[1].x, w[2].x, w[3].x)) + last * w[4].x;
            let along = dot(on, vec4<f32>(d[0].x, d[1].x, d[2].x, d[3].x)) + last * d[4].x;
            value += across * w[y].y * w[z].z;
            sum += vec3<f32>(along * w[y].y * w[z].z, across * d[y].y * w[z].z, across * w[y].y * d[z].z);
        }
    }
    // Of the weighted mean: where all voxels are alike it is flat.
    return sum - value * whole_slope / whole;
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let depth = depths[at];
    if depth >= FAR {
        normals[at] = 0u;
        return;
    }
    let sight = sight_of(id.xy);
    let c = point_at(id.xy, depth);
    var n = -sight;
    if surfaces[at].y == 3u {
        // The ray began in the voxel: on the lens, or at the eye.
        let out = c - view.lens.xyz;
        let on_lens = (flags() & LENS_ON) != 0u && abs(length(out) - view.lens.w) < 1e-3 * view.lens.w;
        n = select(n, out / max(view.lens.w, 1e-6), on_lens);
    } else {
        let inwards = gradient_at(view.corner + c.x * view.right + c.y * view.up + c.z * view.forward);
        let out = -vec3<f32>(dot(inwards, view.right), dot(inwards, view.up), dot(inwards, view.forward));
        let size = length(out);
        n = select(n, out / max(size, 1e-30), size > 1e-6);
    }
    n = normalize(n - sight * max(LEAST_FACING + dot(n, sight), 0.0));
    normals[at] = packed_normal(n);
}
