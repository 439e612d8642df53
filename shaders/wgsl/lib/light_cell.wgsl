// Places of the cells of lib/light_grid.

fn cell_number(cell: u32) -> vec3<u32> {
    let sheet = grid.cells.x * grid.cells.y;
    return vec3<u32>(cell % grid.cells.x, cell % sheet / grid.cells.x, cell / sheet);
}

// A point of the image's index space in camera space.
fn from_index(p: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        dot(grid.right_from_index.xyz, p) + grid.right_from_index.w,
        dot(grid.up_from_index.xyz, p) + grid.up_from_index.w,
        dot(grid.depth_from_index.xyz, p) + grid.depth_from_index.w);
}

// Camera space. The last cells may reach past the image.
fn cell_middle(cell: u32) -> vec3<f32> {
    return from_index((vec3<f32>(cell_number(cell)) + 0.5) / grid.scale);
}

// Where a cell's light is found, camera space: in its middle, that of the outermost cells on the image's faces. Light is constant
// from their middles outwards, so that tissue which the image ends in would be as dark on its face as half a cell below it.
fn cell_place(cell: u32) -> vec3<f32> {
    let ijk = cell_number(cell);
    let last = grid.cells - 1u;
    let middle = (vec3<f32>(ijk) + 0.5) / grid.scale;
    let first_face = select(middle, vec3<f32>(0.0), ijk == vec3<u32>(0u));
    let face = select(first_face, vec3<f32>(grid.voxels_x, grid.voxels_y, grid.voxels_z), ijk == last);
    return from_index(select(face, middle, last == vec3<u32>(0u)));
}
