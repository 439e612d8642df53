// The image's light on a coarse grid, interpolated between cells.

struct LightGrid {
    cells: vec3<u32>,
    needed: u32,                    // number of cells that are computed
    scale: vec3<f32>,               // cells per voxel
    strength: f32,                  // darkness of unlit places, 0 to 1
    corner: vec3<f32>,              // index space, where the view axis meets the reference plane
    ring: f32,                      // cells outside each face of the image
    right: vec3<f32>,               // index space, one millimetre
    pad2: u32,
    up: vec3<f32>,
    pad3: u32,
    forward: vec3<f32>,
    pad4: u32,
    right_from_index: vec4<f32>,    // camera space of an index-space point: dot(xyz, p) + w
    up_from_index: vec4<f32>,
    depth_from_index: vec4<f32>,
}

@group(0) @binding(38) var<uniform> grid: LightGrid;

// Linear interpolation, exact between equal values.
fn towards(a: vec2<f32>, b: vec2<f32>, share: f32) -> vec2<f32> {
    return a + (b - a) * share;
}

// The cells about a point of the image's index space, x fastest, and its place between them.
struct Around {
    cells: array<u32, 8>,
    share: vec3<f32>,
}

// Voxel (i, j, k) fills [i, i+1) and so on.
fn cells_around(p: vec3<f32>) -> Around {
    let at = clamp(p * grid.scale - 0.5 + grid.ring, vec3<f32>(0.0), vec3<f32>(grid.cells) - 1.0);
    let low = min(vec3<u32>(at), max(grid.cells, vec3<u32>(2u)) - 2u);
    let high = min(low + 1u, grid.cells - 1u);
    let f = at - vec3<f32>(low);
    let sheet = grid.cells.x * grid.cells.y;
    let y0 = low.z * sheet + low.y * grid.cells.x;
    let y1 = low.z * sheet + high.y * grid.cells.x;
    let y2 = high.z * sheet + low.y * grid.cells.x;
    let y3 = high.z * sheet + high.y * grid.cells.x;
    return Around(
        array<u32, 8>(
            y0 + low.x, y0 + high.x, y1 + low.x, y1 + high.x, y2 + low.x, y2 + high.x, y3 + low.x, y3 + high.x),
        f);
}

// The including file binds the cells' values as `light_grid`. Transmittance at a point of the image's index
// space: of the image alone, and of the image and opaque surfaces.
fn grid_light(p: vec3<f32>) -> vec2<f32> {
    let here = cells_around(p);
    let f = here.share;
    let a = towards(light_grid[here.cells[0]], light_grid[here.cells[1]], f.x);
    let b = towards(light_grid[here.cells[2]], light_grid[here.cells[3]], f.x);
    let c = towards(light_grid[here.cells[4]], light_grid[here.cells[5]], f.x);
    let e = towards(light_grid[here.cells[6]], light_grid[here.cells[7]], f.x);
    return towards(towards(a, b, f.y), towards(c, e, f.y), f.z);
}
