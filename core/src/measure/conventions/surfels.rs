//! Areas of the surface pieces in the 2×2×2 voxels around a corner, as in DeepMind's `surface-distance` 0.1.

/// A class of 2×2×2 neighbourhoods: a code, and the normals of the triangles in it, as long as their areas, in
/// eighths of a voxel face; signs are left out.
type Class = (u8, &'static [[u8; 3]]);

/// Bit `4·dx + 2·dy + dz` of a code is set where the voxel at `(dx, dy, dz)` is active. The other codes are turned or
/// mirrored ones of these: all 48 symmetries of the cube give 256. Figures: `_NEIGHBOUR_CODE_TO_NORMALS` of
/// surface-distance 0.1, from marching cubes with vertices in the middle of edges.
const CLASSES: [Class; 20] = [
    (1, &[[1, 1, 1]]),
    (3, &[[2, 2, 0], [2, 2, 0]]),
    (6, &[[1, 1, 1], [1, 1, 1]]),
    (7, &[[1, 1, 1], [2, 2, 2], [4, 0, 0]]),
    (15, &[[4, 0, 0], [4, 0, 0]]),
    (22, &[[1, 1, 1], [1, 1, 1], [1, 1, 1]]),
    (23, &[[1, 1, 1], [1, 1, 1], [2, 2, 2], [2, 2, 2]]),
    (24, &[[1, 1, 1], [1, 1, 1]]),
    (25, &[[0, 2, 2], [0, 2, 2], [1, 1, 1]]),
    (27, &[[0, 2, 2], [1, 1, 1], [2, 0, 2], [3, 3, 3]]),
    (30, &[[1, 1, 1], [1, 1, 1], [2, 2, 2], [4, 0, 0]]),
    (31, &[[1, 1, 1], [2, 2, 2], [4, 0, 0]]),
    (60, &[[2, 2, 0], [2, 2, 0], [2, 2, 0], [2, 2, 0]]),
    (61, &[[1, 1, 1], [2, 2, 0], [2, 2, 0]]),
    (63, &[[2, 2, 0], [2, 2, 0]]),
    (105, &[[1, 1, 1], [1, 1, 1], [1, 1, 1], [1, 1, 1]]),
    (107, &[[1, 1, 1], [1, 1, 1], [1, 1, 1]]),
    (111, &[[1, 1, 1], [1, 1, 1]]),
    (126, &[[1, 1, 1], [1, 1, 1]]),
    (127, &[[1, 1, 1]]),
];

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Surface in mm² around a corner by its code; 0 for codes 0 and 255, which have none.
pub(super) fn areas_mm2(spacing_mm: [f64; 3]) -> [f64; 256] {
    let [x, y, z] = spacing_mm;
    let face_mm2 = [y * z, x * z, x * y];
    let mut areas = [0.0; 256];
    for (code, normals) in CLASSES {
        for order in ORDERS {
            let area = |normal: &[u8; 3]| {
                let length = |a: usize| f64::from(normal[order[a]]) / 8.0 * face_mm2[a];
                (0..3).map(|a| length(a).powi(2)).sum::<f64>().sqrt()
            };
            let sum = normals.iter().map(area).sum();
            for mirrored in 0..8 {
                areas[usize::from(moved(code, order, mirrored))] = sum;
            }
        }
    }
    areas
}

/// `code` with its axis `order[a]` become axis `a`, mirrored along the axes whose bits are set in `mirrored`.
fn moved(code: u8, order: [usize; 3], mirrored: usize) -> u8 {
    let mut to = 0;
    for place in (0..8_usize).filter(|place| code >> place & 1 == 1) {
        let coordinate = |a: usize| place >> (2 - a) & 1;
        let new = |a: usize| (coordinate(order[a]) ^ (mirrored >> a & 1)) << (2 - a);
        to |= 1 << (new(0) | new(1) | new(2));
    }
    to
}
