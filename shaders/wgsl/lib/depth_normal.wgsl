// Normals from depths, where a view stores none. After lib/normal; the including file provides `depths`.

// Whether the surface is one of voxels: normals are then found over about one and a half of them, and the steps between
// them hide nothing.
override stepped: bool = false;

fn point_of(at: vec2<i32>) -> vec3<f32> {
    let p = vec2<u32>(clamp(at, vec2<i32>(0), vec2<i32>(view.size) - 1));
    return point_at(p, depths[linear_index(p)]);
}

// Of the steps to both neighbours, that which is shorter in depth.
fn tangent(here: vec2<i32>, to: vec2<i32>, c: vec3<f32>) -> vec3<f32> {
    let last = vec2<i32>(view.size) - 1;
    let after = point_of(here + to) - c;
    let before = c - point_of(here - to);
    let has_before = all(here - to >= vec2<i32>(0));
    let has_after = all(here + to <= last);
    return select(after, before, has_before && (!has_after || abs(before.z) < abs(after.z)));
}

fn normal_from_depths(here: vec2<i32>, c: vec3<f32>, sight: vec3<f32>) -> vec3<f32> {
    var reach = 1;
    if stepped {
        reach = clamp(i32(1.5 * view.voxel_mm / footprint_mm(c.z)), 1, 12);
    }
    let n = cross(tangent(here, vec2<i32>(reach, 0), c), tangent(here, vec2<i32>(0, reach), c));
    let size = length(n);
    let unit = select(-sight, n / max(size, 1e-30), size > 1e-20 && size < 1e20);
    let facing = select(-unit, unit, dot(unit, sight) < 0.0);
    return normalize(facing - sight * max(0.02 + dot(facing, sight), 0.0));
}

// From depths; of voxels the mean of nine, as far apart as voxels are, or the faces between them would be lit instead of
// the surface.
fn normal_among(here: vec2<i32>, c: vec3<f32>) -> vec3<f32> {
    var sum = normal_from_depths(here, c, sight_of(vec2<u32>(here)));
    if stepped {
        let apart = clamp(i32(round(view.voxel_mm / footprint_mm(c.z))), 1, 8);
        for (var k = 0; k < 9; k++) {
            let there = here + apart * vec2<i32>(k % 3 - 1, k / 3 - 1);
            let inside = all(there >= vec2<i32>(0)) && all(there < vec2<i32>(view.size));
            let q = point_of(there);
            if inside && k != 4 && abs(q.z - c.z) < 3.0 * view.voxel_mm {
                sum += normal_from_depths(there, q, sight_of(vec2<u32>(there)));
            }
        }
    }
    return sum / max(length(sum), 1e-12);
}
