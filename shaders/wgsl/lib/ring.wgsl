// The lens's ring, the same in every 3D view (thesis 7.3.3): white with dark edges, so that it is seen on every ground
// and its colour means nothing else.

const RING = vec3<f32>(1.0);
const RING_EDGE = vec3<f32>(0.04, 0.05, 0.06);
const RING_EDGE_PX = 1.4;       // width of each edge, for a frame 512 pixels high

// Distance of a pixel outside the lens's outline, in pixels: its ray's closest approach to the centre, less
// the radius. FAR where the lens is behind the eye.
fn off_ring_px(pixel: vec2<u32>) -> f32 {
    let p = from_middle(pixel);
    let direction = vec3<f32>(p * view.mm_per_pixel_per_mm, 1.0);
    let start = vec3<f32>(p * view.mm_per_pixel, 0.0) - view.lens.xyz;
    let nearest = -dot(start, direction) / dot(direction, direction);
    let off_px = (length(start + nearest * direction) - view.lens.w) / footprint_mm(nearest);
    return select(FAR, off_px, nearest > view.nearest_mm);
}

fn with_ring(color: vec3<f32>, pixel: vec2<u32>) -> vec3<f32> {
    if (flags() & LENS_ON) == 0u {
        return color;
    }
    let off_px = abs(off_ring_px(pixel));
    let core_px = 0.8 * view.line_scale;
    let edged = mix(color, RING_EDGE, clamp(0.5 + core_px + RING_EDGE_PX * view.line_scale - off_px, 0.0, 1.0));
    return mix(edged, RING, clamp(0.5 + core_px - off_px, 0.0, 1.0));
}
