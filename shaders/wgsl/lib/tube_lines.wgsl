// Lines of frames with fibre tubes: the tumour's lines are not drawn on tubes, and tubes have edges of their
// own. For passes that include lib/lines and lib/tubes.

// As lines_at. Between a tube and the tumour, or the background, there is a line only where the tumour is in
// front of the tube: the tumour's silhouette, as wide as everywhere.
fn lines_among_tubes(here: vec2<i32>, front: f32) -> Lines {
    let face = surfaces[linear_index(vec2<u32>(here))].y;
    let on_tube = is_tube(face);
    var others = 0u;
    for (var n = 0u; n < line_reach(); n++) {
        let there = clamped(here + neighbour(n));
        let other = surfaces[there].y;
        var differs = other != face;
        if on_tube {
            differs = !is_tube(other) && depths[there] < front;
        } else if is_tube(other) {
            differs = depths[there] > front;
        }
        others |= select(0u, 1u << n, differs);
    }
    var lines = lines_towards(here, front, others);
    lines.grey = select(lines.grey, 0.0, on_tube);
    return lines;
}

// Brightness of a tube's edge that hides something, and of a tube beside a nearer one.
const TUBE_EDGE = 0.55;
const TUBE_BEHIND = 0.6;

// Factor of a tube's colour: darker along its edge, where the tube is wide enough to have one, and beside a
// tube that passes in front, so that tubes of a bundle can be followed.
fn tube_edge(here: vec2<i32>, depth: f32, face: u32, radius_mm: f32) -> f32 {
    let width_px = 2.0 * radius_mm / footprint_mm(depth);
    let own = mix(1.0, TUBE_EDGE, smoothstep(2.0, 6.0, width_px));
    var light = 1.0;
    for (var n = 0u; n < 4u; n++) {
        let there = clamped(here + neighbour(n));
        let other = surfaces[there].y;
        let behind = depths[there] - depth;
        if other != face && behind > radius_mm {
            light = min(light, own);
        }
        if other != face && is_tube(other) && behind < -2.0 * radius_mm {
            light = min(light, TUBE_BEHIND);
        }
    }
    return light;
}
