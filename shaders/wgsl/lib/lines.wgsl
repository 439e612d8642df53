// Silhouettes and contour lines of the surface that the surface pass found, for the composing passes.

@group(0) @binding(4) var<storage, read> depths: array<f32>;
@group(0) @binding(5) var<storage, read> surfaces: array<vec2<u32>>; // region number, face

const INNER = vec3<f32>(0.72, 0.72, 0.72);

fn clamped(at: vec2<i32>) -> u32 {
    return linear_index(vec2<u32>(clamp(at, vec2<i32>(0), vec2<i32>(view.size) - 1)));
}

// Depth step between p and q that no slanted surface explains: the least of their difference and of those to
// both sides' linear extrapolations from the pixels beyond (pp, p | q, qq).
fn step_mm(pp: f32, p: f32, q: f32, qq: f32) -> f32 {
    return min(abs(q - p), min(abs(q - 2.0 * p + pp), abs(p - 2.0 * q + qq)));
}

// Pixel coverage of a line that is `width` pixels wide, at a distance of `away` pixels.
fn coverage(width: f32, away: f32) -> f32 {
    return clamp(0.5 * width + 0.5 - away, 0.0, min(width, 1.0));
}

// Line width: wider nearer the viewer (thesis 7.3.1: depth-based line thickness).
fn width_at(depth: f32) -> f32 {
    return view.line_scale * mix(1.35, 0.65, clamp(0.5 + 0.5 * depth / view.depth_span_mm, 0.0, 1.0));
}

// Offsets of the neighbours searched for lines: 1, 1.4 and 2 pixels away.
fn neighbour(n: u32) -> vec2<i32> {
    let side = select(1, -1, (n & 1u) == 1u);
    switch n >> 1u {
        case 0u: { return vec2<i32>(side, 0); }
        case 1u: { return vec2<i32>(0, side); }
        case 2u: { return vec2<i32>(side, side); }
        case 3u: { return vec2<i32>(side, -side); }
        case 4u: { return vec2<i32>(2 * side, 0); }
        default: { return vec2<i32>(0, 2 * side); }
    }
}

struct Lines {
    black: f32,          // silhouettes: against the background, or steps of far more than a voxel
    grey: f32,           // steps of a voxel and more; edges between faces, fainter
    depth: f32,          // of the outlined surface, where nearer than this pixel's
}

// Two pixels on one plane have the same face (and so have two of the background): no line lies between
// them. Such neighbours are discarded first, then the few others examined.
fn lines_at(here: vec2<i32>, front: f32) -> Lines {
    let face = surfaces[linear_index(vec2<u32>(here))].y;
    var others = 0u;
    for (var n = 0u; n < line_reach(); n++) {
        others |= select(0u, 1u << n, surfaces[clamped(here + neighbour(n))].y != face);
    }
    return lines_towards(here, front, others);
}

// Number of neighbours that are searched.
fn line_reach() -> u32 {
    return varied(select(8u, 12u, view.line_scale > 1.2));
}

// The lines between here and the neighbours whose bits are set.
fn lines_towards(here: vec2<i32>, front: f32, neighbours: u32) -> Lines {
    var lines = Lines(0.0, 0.0, front);
    var others = neighbours;
    while others != 0u {
        let to = neighbour(firstTrailingBit(others));
        others &= others - 1u;
        let q = depths[clamped(here + to)];
        let nearer = min(front, q);
        let width = width_at(nearer);
        let away = length(vec2<f32>(to)) - 0.5;
        lines.depth = min(lines.depth, q);
        let steps = step_mm(depths[clamped(here - to)], front, q, depths[clamped(here + 2 * to)]) / view.voxel_mm;
        let border = max(front, q) >= FAR;
        let deep = select(smoothstep(3.0, 6.0, steps), 1.0, border);
        lines.black = max(lines.black, deep * coverage(max(1.5 * width, 1.3), away));
        // Voxels smaller than a few pixels would turn grey all over.
        let voxel_px = view.voxel_mm / footprint_mm(nearer);
        let raised = smoothstep(0.3, 0.9, steps) * smoothstep(1.0, 3.5, voxel_px);
        let edge = 0.45 * smoothstep(2.0, 7.0, voxel_px);
        let none = border || (flags() & SMOOTH) != 0u;
        lines.grey = max(lines.grey, select(max(raised, edge), 0.0, none) * coverage(0.9 * width, away));
    }
    return lines;
}
