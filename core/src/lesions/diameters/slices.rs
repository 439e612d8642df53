//! The pieces of a component's slices: pixels connected over edges and corners.

use std::collections::BTreeMap;

use super::super::sets::Sets;
use crate::components::Run;

/// Pixels of each piece, by slice. Indices within the plane are those of the grid's other two axes, in their order.
pub(super) fn pieces(runs: &[Run], axis: usize) -> BTreeMap<usize, Vec<Vec<[i32; 2]>>> {
    let mut lines: BTreeMap<usize, Vec<[i32; 3]>> = BTreeMap::new();
    for run in runs {
        let [first, last, y, z] = [run.first, run.last, run.y, run.z].map(|n| n as i32);
        match axis {
            0 => (first..=last).for_each(|x| lines.entry(x as usize).or_default().push([z, y, y])),
            1 => lines.entry(y as usize).or_default().push([z, first, last]),
            _ => lines.entry(z as usize).or_default().push([y, first, last]),
        }
    }
    lines.into_iter().map(|(slice, lines)| (slice, connected(lines))).collect()
}

/// Lines `[v, first u, last u]` in any order, joined into pieces.
fn connected(mut lines: Vec<[i32; 3]>) -> Vec<Vec<[i32; 2]>> {
    lines.sort_unstable();
    let mut sets = Sets::new(lines.len());
    // Start of the line before, and how far it may be passed.
    let mut from = 0;
    for at in 0..lines.len() {
        let [v, first, last] = lines[at];
        // Lines that end before this one begins, or lie more than one below, meet none that follow in this order.
        while from < at && (lines[from][0] < v - 1 || lines[from][0] == v - 1 && lines[from][2] + 1 < first) {
            from += 1;
        }
        let mut other = from;
        while other < at && lines[other][0] == v - 1 && lines[other][1] <= last + 1 {
            sets.join(at, other);
            other += 1;
        }
        // Along x a line may be given in parts.
        if at > 0 && lines[at - 1][0] == v && lines[at - 1][2] + 1 >= first {
            sets.join(at, at - 1);
        }
    }
    let mut number: BTreeMap<usize, usize> = BTreeMap::new();
    let mut pieces: Vec<Vec<[i32; 2]>> = Vec::new();
    for (at, [v, first, last]) in lines.iter().enumerate() {
        let piece = *number.entry(sets.root(at)).or_insert_with(|| {
            pieces.push(Vec::new());
            pieces.len() - 1
        });
        if let Some(pixels) = pieces.get_mut(piece) {
            pixels.extend((*first..=*last).map(|u| [u, *v]));
        }
    }
    pieces
}
