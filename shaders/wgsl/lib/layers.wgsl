// Light among solids in layers of equal distance from the eye (with parallel rays: of equal depth), on a grid of cells of
// several pixels: see render/src/light/layers.

struct Layers {
    near: f32,                      // front of the first layer, as `range_of`
    slice_mm: f32,
    lag_mm: f32,                    // how far behind a surface its shadow begins
    count: u32,                     // layers; 0: none were computed
    cells: vec2<u32>,
    side: u32,                      // pixels along a cell's side
    flags: u32,
}

// Only tubes and arrows hide.
const TUBES_ONLY = 1u;

@group(0) @binding(44) var<uniform> layers: Layers;

fn cells_per_layer() -> u32 {
    return layers.cells.x * layers.cells.y;
}

// Distance from the eye along the pixel's ray, less that of the reference plane along the axis.
fn range_of(pixel: vec2<u32>, depth: f32) -> f32 {
    let t = from_middle(pixel) * view.mm_per_pixel_per_mm;
    let slant = sqrt(1.0 + dot(t, t));
    return depth * slant - view.nearest_mm * (dot(t, t) / (1.0 + slant));
}
