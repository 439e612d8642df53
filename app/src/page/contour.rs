//! Outlines in a slice: level sets of a sampled field by marching squares, as closed SVG paths.

use std::{collections::BTreeMap, fmt::Write as _};

/// A field sampled at the centres of square pixels, line by line.
pub struct Field {
    /// Samples, `x` fastest.
    pub values: Vec<f64>,
    /// Number of samples along x and y.
    pub size: [usize; 2],
    /// Side of a pixel in millimetres.
    pub pixel_mm: f64,
}

/// What is inside.
const LEVEL: f64 = 0.5;

impl Field {
    /// Zero outside.
    fn at(&self, [x, y]: [isize; 2]) -> f64 {
        let index = |v: isize, n: usize| usize::try_from(v).ok().filter(|v| *v < n);
        let place = index(x, self.size[0]).zip(index(y, self.size[1]));
        place.and_then(|(x, y)| self.values.get(y * self.size[0] + x).copied()).unwrap_or(0.0)
    }

    /// Closed loops where the field passes one half, in millimetres from the upper left corner of the first pixel.
    pub fn loops_mm(&self) -> Vec<Vec<[f64; 2]>> {
        // A crossing lies on the edge from a sample to the next in x (0) or in y (1).
        type Crossing = ([isize; 2], u8);
        let mut next: BTreeMap<Crossing, Crossing> = BTreeMap::new();
        for y in -1..self.size[1] as isize {
            for x in -1..self.size[0] as isize {
                let corners = [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]];
                let values = corners.map(|c| self.at(c));
                let edges: [Crossing; 4] = [([x, y], 0), ([x + 1, y], 1), ([x, y + 1], 0), ([x, y], 1)];
                let is_in = values.map(|v| v >= LEVEL);
                let leaves = |n: usize| is_in[n] && !is_in[(n + 1) % 4];
                let enters = |n: usize| !is_in[n] && is_in[(n + 1) % 4];
                // Where two corners opposite each other are inside, the middle says whether they are one part.
                let turn = if values.iter().sum::<f64>() / 4.0 >= LEVEL { 1 } else { 3 };
                for from in (0..4).filter(|n| leaves(*n)) {
                    let to = (1..4).map(|k| (from + k * turn) % 4).find(|n| enters(*n));
                    if let Some(to) = to {
                        next.insert(edges[from], edges[to]);
                    }
                }
            }
        }
        let mut loops = Vec::new();
        while let Some((start, mut at)) = next.pop_first() {
            let mut points = vec![self.point_mm(start)];
            while at != start {
                points.push(self.point_mm(at));
                let Some(following) = next.remove(&at) else { break };
                at = following;
            }
            loops.push(points);
        }
        loops
    }

    fn point_mm(&self, ([x, y], along): ([isize; 2], u8)) -> [f64; 2] {
        let (a, b) = (self.at([x, y]), self.at([x + isize::from(along == 0), y + isize::from(along == 1)]));
        let t = if a == b { 0.5 } else { (LEVEL - a) / (b - a) };
        let shift = if along == 0 { [t, 0.0] } else { [0.0, t] };
        [(x as f64 + 0.5 + shift[0]) * self.pixel_mm, (y as f64 + 0.5 + shift[1]) * self.pixel_mm]
    }
}

/// Loops as an SVG path, hundredths of a millimetre; empty without loops.
pub fn path(loops: &[Vec<[f64; 2]>]) -> String {
    let mut out = String::new();
    for points in loops {
        for (n, [x, y]) in points.iter().enumerate() {
            // Writing into a string can't fail.
            let _ =
                write!(out, "{}{} {}", if n == 0 { "M" } else { "L" }, two_decimals(*x), two_decimals(*y));
        }
        out.push('Z');
    }
    out
}

/// Two decimals without trailing zeros.
fn two_decimals(mm: f64) -> String {
    let text = format!("{mm:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
