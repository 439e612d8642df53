// The A-buffer (Carpenter 1984; thesis 7.6): each pixel's fragments, nearest first. One thread owns a
// pixel, so its list is contiguous: its fragments are counted, nodes are allocated from one counter, filled
// and sorted. Where too few nodes are left the list is marked, and only its nearest fragment is stored.
#include lib/view
#include lib/ellipsoid

struct Counters {
    nodes: atomic<u32>,         // requested in this frame
    wraps: atomic<u32>,         // times 2^32
    last_nodes: u32,
    last_wraps: u32,
}

@group(0) @binding(4) var<storage, read_write> depths: array<f32>;          // of the nearest fragment
@group(0) @binding(5) var<storage, read_write> surfaces: array<vec2<u32>>;  // its ellipsoid, its face
@group(0) @binding(6) var<storage, read_write> lists: array<vec4<u32>>; // first node, fragments, nodes requested, 1: no room
@group(0) @binding(11) var<storage, read_write> nodes: array<vec2<u32>>;    // depth, twice the ellipsoid plus the face
@group(0) @binding(12) var<storage, read_write> counters: Counters;

// Shellsort with Knuth's gaps: in place, short, about n^1.3 steps for hundreds of layers.
fn sort(first: u32, count: u32) {
    var gap = 1u;
    while gap < count / 3u {
        gap = 3u * gap + 1u;
    }
    while gap > 0u {
        for (var i = gap; i < count; i++) {
            let node = nodes[first + i];
            var to = i;
            while to >= gap {
                let before = nodes[first + to - gap];
                if !is_behind(before, node) {
                    break;
                }
                nodes[first + to] = before;
                to -= gap;
            }
            nodes[first + to] = node;
        }
        gap /= 3u;
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    zero = id.x >> 31u;
    if any(id.xy >= view.size) {
        return;
    }
    let at = linear_index(id.xy);
    let p = from_middle(id.xy);
    let tile = tile_of(id.xy);
    // Fragments behind an opaque one are invisible and not listed.
    let none = vec2<u32>(bitcast<u32>(FAR), NO_FACE);
    var cut = none;
    var nearest = none;
    let cutting = (flags() & NO_SKIPPING) == 0u;
    var first = 0u;
    var needed = 0u;
    var count = 0u;
    // Counting and filling are one loop, run twice, so both meet the same fragments. While counting, the cut
    // still moves nearer, so the count may be too large, never too small.
    for (var filling = 0u; filling < 2u; filling++) {
        for (var n = tiles[tile]; n < tiles[tile + 1u]; n++) {
            let number = tiles[n];
            let e = ellipsoids[number];
            let chord = chord_of(e, p);
            if !chord.meets {
                continue;
            }
            let opaque = cutting && e.opacity >= 1.0 && coverage_of(inset_px(e, chord)) >= 1.0;
            for (var face = FRONT; face <= BACK; face++) {
                let s = chord.s[face];
                let node = vec2<u32>(bitcast<u32>(s), 2u * number + face);
                if s <= view.nearest_mm || is_behind(node, cut) {
                    continue;
                }
                if filling == 0u {
                    needed += 1u;
                    if opaque {
                        cut = node;
                    }
                    if is_behind(nearest, node) {
                        nearest = node;
                    }
                } else if count < needed {
                    nodes[first + count] = node;
                    count += 1u;
                }
            }
        }
        if filling == 0u {
            first = atomicAdd(&counters.nodes, needed);
            let wrapped = first + needed < first;
            if wrapped {
                atomicAdd(&counters.wraps, 1u);
            }
            if needed == 0u || wrapped || first + needed > arrayLength(&nodes) {
                break;
            }
        }
    }
    lists[at] = vec4<u32>(first, count, needed, select(0u, 1u, count == 0u && needed > 0u));
    sort(first, count);
    depths[at] = bitcast<f32>(nearest.x);
    surfaces[at] = select(vec2<u32>(nearest.y >> 1u, nearest.y & 1u), vec2<u32>(0u, NO_FACE), needed == 0u);
}
