// Fibre tubes, or change arrows, among the first hits.

// Flag in the place of a face: the low bits are the fibre's or arrow's number.
const TUBE = 0x80000000u;

struct Fiber {
    color: u32,          // rgb in the low bytes
    radius_mm: f32,
}

fn is_tube(face: u32) -> bool {
    return (face & TUBE) != 0u && face != NO_FACE;
}
