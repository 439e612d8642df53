// The shown voxels smoothed by about a voxel: mean of what is shown, weighted by (1 - t²/WIDTH²)² along each axis.

// Half the width of the smoothing kernel in voxels: its standard deviation is WIDTH/√7 = 0.94.
const WIDTH = 2.5;

struct Smoothed {
    share: f32,          // of the weights that lie on shown voxels, 0 to 1
    inwards: vec3<f32>,  // its gradient in index space, not scaled
}

fn smoothed_at(place: vec3<f32>) -> Smoothed {
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
        let rows = shown_rows(cell + vec3<i32>(-2, -2, z - 2));
        // Of the layer: its weights along x and y, and their slopes along either.
        var layer = vec3<f32>(0.0);
        for (var y = 0; y < 5; y++) {
            let bits = select(rows.x >> (8u * (u32(y) & 3u)), rows.y, y == 4);
            let on = vec4<f32>((vec4<u32>(bits) >> vec4<u32>(0u, 1u, 2u, 3u)) & vec4<u32>(1u));
            let last = f32((bits >> 4u) & 1u);
            let across = dot(on, vec4<f32>(w[0].x, w[1].x, w[2].x, w[3].x)) + last * w[4].x;
            let along = dot(on, vec4<f32>(d[0].x, d[1].x, d[2].x, d[3].x)) + last * d[4].x;
            layer += vec3<f32>(along * w[y].y, across * d[y].y, across * w[y].y);
        }
        value += layer.z * w[z].z;
        sum += vec3<f32>(layer.xy * w[z].z, layer.z * d[z].z);
    }
    // Of the weighted mean: where all voxels are alike it is flat.
    return Smoothed(value / (whole.x * whole.y * whole.z), sum - value * whole_slope / whole);
}
