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
    let c = cells_about(p, number);
    let f = c.fraction;
    let a = mix(cell_look(c.rows.x + c.low), cell_look(c.rows.x + c.high), f.x);
    let b = mix(cell_look(c.rows.y + c.low), cell_look(c.rows.y + c.high), f.x);
    let d = mix(cell_look(c.rows.z + c.low), cell_look(c.rows.z + c.high), f.x);
    let e = mix(cell_look(c.rows.w + c.low), cell_look(c.rows.w + c.high), f.x);
    return mix(mix(a, b, f.y), mix(d, e, f.y), f.z);
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
