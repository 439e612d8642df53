// Middles of the cells of lib/light_grid.

fn cell_ijk(cell: u32) -> vec3<f32> {
    let sheet = grid.cells.x * grid.cells.y;
    return vec3<f32>(vec3<u32>(cell % grid.cells.x, cell % sheet / grid.cells.x, cell / sheet));
}

// Camera space.
fn middle_at(ijk: vec3<f32>) -> vec3<f32> {
    let p = (ijk + 0.5 - grid.ring) / grid.scale;
    return vec3<f32>(
        dot(grid.right_from_index.xyz, p) + grid.right_from_index.w,
        dot(grid.up_from_index.xyz, p) + grid.up_from_index.w,
        dot(grid.depth_from_index.xyz, p) + grid.depth_from_index.w);
}

fn cell_middle(cell: u32) -> vec3<f32> {
    return middle_at(cell_ijk(cell));
}

// Where a cell's light from direction `w` is looked for. A cell outside a face that this light leaves the image through has that of
// the cell inside: what passes beside the image doesn't meet the face.
fn middle_for(cell: u32, w: vec3<f32>) -> vec3<f32> {
    let d = w.x * grid.right + w.y * grid.up + w.z * grid.forward;
    let least = 1e-3 * max(max(abs(d.x), abs(d.y)), abs(d.z));
    let low = select(vec3<f32>(grid.ring), vec3<f32>(0.0), d < vec3<f32>(-least));
    let high = vec3<f32>(grid.cells) - 1.0 - select(vec3<f32>(grid.ring), vec3<f32>(0.0), d > vec3<f32>(least));
    return middle_at(clamp(cell_ijk(cell), low, high));
}
