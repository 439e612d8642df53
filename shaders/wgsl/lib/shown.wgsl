// One bit per voxel: whether it belongs to a shown region. Lines along x start at a word; around the volume lies an
// empty margin, so that nothing near it needs a test. See render/src/solid/shown.rs.

@group(0) @binding(41) var<storage, read> shown: array<u32>;

const MARGIN = 3;

// Where the bits of a line of voxels begin.
fn shown_line(y: i32, z: i32) -> u32 {
    let across = vec3<i32>(view.dims) + 2 * MARGIN;
    return u32(((z + MARGIN) * across.y + y + MARGIN) * ((across.x + 31) >> 5u));
}

fn shown_at(cell: vec3<i32>) -> bool {
    let x = u32(cell.x + MARGIN);
    return ((shown[shown_line(cell.y, cell.z) + (x >> 5u)] >> (x & 31u)) & 1u) != 0u;
}

// The bits of voxels from x on, in the low bits; at least as many as the margin is wide twice.
fn shown_from(line: u32, x: i32) -> u32 {
    let bit = u32(x + MARGIN);
    let word = line + (bit >> 5u);
    let low = bit & 31u;
    return (shown[word] >> low) | ((shown[word + 1u] << 1u) << (31u - low));
}
