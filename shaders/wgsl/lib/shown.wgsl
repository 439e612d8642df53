// One bit per voxel: whether it belongs to a shown region. A word holds 8x4 voxels of one layer, and begins every four voxels
// along x, so that two words hold what lies around a voxel in its layer. Around the volume lies an empty margin, so that nothing
// near it needs a test. See render/src/solid/shown.rs.

@group(0) @binding(41) var<storage, read> shown: array<u32>;

const MARGIN = 3;

// Words along x and y.
fn shown_words() -> vec2<u32> {
    return (view.dims.xy + u32(2 * MARGIN + 3)) >> vec2<u32>(2u);
}

// The word that begins at a multiple of four voxels at or before a voxel, both counted from the margin's corner.
fn shown_word(p: vec3<u32>) -> u32 {
    let words = shown_words();
    return (p.z * words.y + (p.y >> 2u)) * words.x + (p.x >> 2u);
}

fn shown_at(cell: vec3<i32>) -> bool {
    let p = vec3<u32>(cell + MARGIN);
    return ((shown[shown_word(p)] >> ((p.y & 3u) * 8u + (p.x & 3u))) & 1u) != 0u;
}

// The bits of five by five voxels of one layer from the lowest on: of the first four rows a byte each, and of the last; of a
// byte the low five.
fn shown_rows(lowest: vec3<i32>) -> vec2<u32> {
    let p = vec3<u32>(lowest + MARGIN);
    let word = shown_word(p);
    let upper = shown[word];
    let lower = shown[word + shown_words().x];
    let down = (p.y & 3u) * 8u;
    return vec2<u32>((upper >> down) | ((lower << 1u) << (31u - down)), lower >> down) >> vec2<u32>(p.x & 3u);
}
