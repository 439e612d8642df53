// The colours of lib/cones' medium: prefiltered, in linear light. After lib/cones and lib/image.

// Colour times extinction, and extinction, of a cell.
fn cell_look(at: u32) -> vec4<f32> {
    let extinction = prefiltered[at];
    let of_color = cones.colors + 3u * at;
    let color = vec3<f32>(prefiltered[of_color], prefiltered[of_color + 1u], prefiltered[of_color + 2u]);
    return vec4<f32>(extinction * color, extinction);
}

// As `level_at`.
fn level_look(p: vec3<f32>, number: u32) -> vec4<f32> {
    let level = cones.levels[number];
    let at = clamp(p * level.scale - 0.5, vec3<f32>(0.0), vec3<f32>(level.dims) - 1.0);
    let low = min(vec3<u32>(at), max(level.dims, vec3<u32>(2u)) - 2u);
    let high = min(low + 1u, level.dims - 1u);
    let f = at - vec3<f32>(low);
    let sheet = level.dims.x * level.dims.y;
    let y0 = level.start + low.z * sheet + low.y * level.dims.x;
    let y1 = level.start + low.z * sheet + high.y * level.dims.x;
    let y2 = level.start + high.z * sheet + low.y * level.dims.x;
    let y3 = level.start + high.z * sheet + high.y * level.dims.x;
    let a = mix(cell_look(y0 + low.x), cell_look(y0 + high.x), f.x);
    let b = mix(cell_look(y1 + low.x), cell_look(y1 + high.x), f.x);
    let c = mix(cell_look(y2 + low.x), cell_look(y2 + high.x), f.x);
    let e = mix(cell_look(y3 + low.x), cell_look(y3 + high.x), f.x);
    return mix(mix(a, b, f.y), mix(c, e, f.y), f.z);
}

// As `extinction_at`.
fn colored_extinction_at(p: vec3<f32>, level: f32) -> vec4<f32> {
    let low = u32(floor(level));
    let f = level - floor(level);
    var a = vec4<f32>(0.0);
    if low == 0u {
        let material = material_at(p - 0.5);
        let extinction = min(extinction_of(material), cones.dark);
        a = vec4<f32>(decoded(material.rgb) * extinction, extinction);
    } else {
        a = level_look(p, low);
    }
    return mix(a, level_look(p, min(low + 1u, LAST_LEVEL)), f);
}
