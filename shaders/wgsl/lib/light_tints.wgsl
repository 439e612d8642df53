// Light of a colour in the image's cells, where tissue gives of its colour to what it darkens.

// Three shares of 16 bits.
@group(0) @binding(39) var<storage, read> tints: array<vec2<u32>>;

fn tint_of(cell: u32) -> vec3<f32> {
    let tint = tints[cell];
    return vec3<f32>(unpack2x16unorm(tint.x), unpack2x16unorm(tint.y).x);
}

// At a point of the image's index space, as `grid_light` of lib/light_grid.
fn grid_tint(p: vec3<f32>) -> vec3<f32> {
    let here = cells_around(p);
    let f = here.share;
    let a = mix(tint_of(here.cells[0]), tint_of(here.cells[1]), f.x);
    let b = mix(tint_of(here.cells[2]), tint_of(here.cells[3]), f.x);
    let c = mix(tint_of(here.cells[4]), tint_of(here.cells[5]), f.x);
    let e = mix(tint_of(here.cells[6]), tint_of(here.cells[7]), f.x);
    return mix(mix(a, b, f.y), mix(c, e, f.y), f.z);
}
