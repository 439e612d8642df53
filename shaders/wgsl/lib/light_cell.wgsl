// Middles of the cells of lib/light_grid.

// Camera space. The last cells may reach past the image.
fn cell_middle(cell: u32) -> vec3<f32> {
    let sheet = grid.cells.x * grid.cells.y;
    let ijk = vec3<u32>(cell % grid.cells.x, cell % sheet / grid.cells.x, cell / sheet);
    let p = (vec3<f32>(ijk) + 0.5) / grid.scale;
    return vec3<f32>(
        dot(grid.right_from_index.xyz, p) + grid.right_from_index.w,
        dot(grid.up_from_index.xyz, p) + grid.up_from_index.w,
        dot(grid.depth_from_index.xyz, p) + grid.depth_from_index.w);
}
