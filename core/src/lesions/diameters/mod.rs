//! The two diameters of a component in one slice, as RANO and RECIST measure them.
//!
//! A chord is a straight line inside the component: from face to face of pixels, not from centre to centre, never across
//! a gap or a hole. The longest and the longest at right angles are exact for the component's voxels.

mod piece;
mod slices;
#[cfg(test)]
mod tests;

use crate::{Grid, components::Run, glam::DVec3};
use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use piece::{Metric, Piece, PlaneChord, SAME_LENGTH};

/// Least of both diameters of a measurable lesion (RANO 2010 and 2.0).
pub const MEASURABLE_MM: f64 = 10.0;

/// Slices thicker than this ask for diameters of [`MEASURABLE_SLICES`] thicknesses (RANO 2010).
pub const THICK_SLICE_MM: f64 = 5.0;

/// Least number of slices of a measurable lesion (RANO 2010 and 2.0).
pub const MEASURABLE_SLICES: usize = 2;

/// Which pair of perpendicular chords is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum DiameterMode {
    /// The longest chord of all slices, and the longest at right angles to it in the same piece of its slice. Of equally
    /// long chords, that with the longer one across.
    #[default]
    LongestThenPerpendicular,
    /// The two chords at right angles, in one piece of a slice, whose product is largest.
    LargestProduct,
}

/// A straight line inside a component.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chord {
    /// One end, RAS+ millimetres.
    pub from_mm: DVec3,
    /// The other end, RAS+ millimetres.
    pub to_mm: DVec3,
    /// Its length.
    pub length_mm: f64,
}

/// The diameters of a component.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diameters {
    /// Which chords these are.
    pub mode: DiameterMode,
    /// Axis of the grid along which the slices follow each other.
    pub axis: usize,
    /// Index along this axis of the slice that the chords lie in.
    pub slice: usize,
    /// The longer chord.
    pub d1: Chord,
    /// The chord at right angles.
    pub d2: Chord,
    /// Product of both lengths.
    pub product_mm2: f64,
    /// Whether the chords have a point in common: not always where the component is bent.
    pub crosses: bool,
    /// Number of slices with a voxel of the component.
    pub slices: usize,
    /// Distance between the planes of neighbouring slices.
    pub slice_thickness_mm: f64,
}

impl Diameters {
    /// Least length of both diameters of a measurable lesion: 10 mm, and twice the slices' thickness where that is more
    /// than 5 mm.
    pub fn least_mm(&self) -> f64 {
        if self.slice_thickness_mm > THICK_SLICE_MM {
            MEASURABLE_MM.max(MEASURABLE_SLICES as f64 * self.slice_thickness_mm)
        } else {
            MEASURABLE_MM
        }
    }

    /// Whether the component is measurable by RANO.
    pub fn measurable(&self) -> bool {
        let least_mm = self.least_mm();
        self.d1.length_mm >= least_mm && self.d2.length_mm >= least_mm && self.slices >= MEASURABLE_SLICES
    }
}

/// The axis of `grid` nearest to the patient's inferior–superior direction: its slices are the axial ones, or the
/// nearest to them.
pub fn axial_axis(grid: &Grid) -> usize {
    grid.axis_codes().iter().position(|code| matches!(code, 'S' | 'I')).unwrap_or(2)
}

/// The diameters of the voxels of `runs` on `grid`, in slices perpendicular to `axis` in index space (in parallel planes
/// of pixels, however the grid is sheared). `None` without a voxel, and for an axis above 2.
///
/// Exact: of all chords inside the closed pixels, whose ends need not be corners. Where a slice has several pieces that
/// touch at no corner, both chords lie in one.
pub fn diameters(grid: &Grid, runs: &[Run], axis: usize, mode: DiameterMode) -> Option<Diameters> {
    let [u, v] = *[[1, 2], [0, 2], [0, 1]].get(axis)?;
    let m = grid.world_from_voxel().matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    let (cu, cv) = (columns[u], columns[v]);
    let metric = Metric { uu: cu.length_squared(), uv: cu.dot(cv), vv: cv.length_squared() };
    let pixel_mm2 = cu.cross(cv).length();
    let by_slice = slices::pieces(runs, axis);
    let pieces: Vec<(usize, Piece)> = by_slice
        .iter()
        .flat_map(|(slice, pieces)| pieces.iter().map(|pixels| (*slice, Piece::new(pixels))))
        .collect();
    let pair = match mode {
        DiameterMode::LongestThenPerpendicular => longest_then_perpendicular(&pieces, &metric),
        DiameterMode::LargestProduct => largest_product(&pieces, &metric, pixel_mm2),
    }?;
    let (d1, d2) =
        if pair.d1.length_mm >= pair.d2.length_mm { (pair.d1, pair.d2) } else { (pair.d2, pair.d1) };
    let place_mm = |at: [f64; 2]| {
        let mut index = DVec3::ZERO;
        index[axis] = pair.slice as f64;
        // Corners lie half a voxel before centres.
        index[u] = at[0] - 0.5;
        index[v] = at[1] - 0.5;
        grid.world_from_voxel().transform_point3(index)
    };
    let chord =
        |c: &PlaneChord| Chord { from_mm: place_mm(c.from), to_mm: place_mm(c.to), length_mm: c.length_mm };
    Some(Diameters {
        mode,
        axis,
        slice: pair.slice,
        d1: chord(&d1),
        d2: chord(&d2),
        product_mm2: d1.length_mm * d2.length_mm,
        crosses: d1.crosses(&d2),
        slices: by_slice.len(),
        slice_thickness_mm: grid.voxel_volume_mm3() / pixel_mm2,
    })
}

/// Two chords at right angles.
struct Pair {
    slice: usize,
    d1: PlaneChord,
    d2: PlaneChord,
}

/// Pieces by a number that no piece's result exceeds, largest first; the pieces' order decides ties.
fn by_bound(pieces: &[(usize, Piece)], bound: impl Fn(&Piece) -> f64) -> Vec<(f64, &(usize, Piece))> {
    let mut order: Vec<_> = pieces.iter().map(|piece| (bound(&piece.1), piece)).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0));
    order
}

fn longest_then_perpendicular(pieces: &[(usize, Piece)], metric: &Metric) -> Option<Pair> {
    let mut best_mm = 0.0;
    let mut longest: Vec<(&(usize, Piece), PlaneChord)> = Vec::new();
    for (bound_mm, piece) in by_bound(pieces, |piece| piece.hull_diameter_mm(metric)) {
        if bound_mm < best_mm * (1.0 - SAME_LENGTH) {
            break;
        }
        let found = piece.1.longest(metric, best_mm * (1.0 - SAME_LENGTH));
        best_mm = found.iter().map(|chord| chord.length_mm).fold(best_mm, f64::max);
        longest.extend(found.into_iter().map(|chord| (piece, chord)));
    }
    let mut best: Option<Pair> = None;
    for (piece, d1) in longest {
        if d1.length_mm < best_mm * (1.0 - SAME_LENGTH) {
            continue;
        }
        let least_mm = best.as_ref().map_or(0.0, |best| best.d2.length_mm * (1.0 + SAME_LENGTH));
        if let Some(d2) = piece.1.longest_across(d1.direction(), metric, least_mm) {
            best = Some(Pair { slice: piece.0, d1, d2 });
        }
    }
    best
}

/// Two chords at right angles span at least half their product of the hull's area, whether they cross or not.
///
/// One of the two passes two corners, for the reason of [`Piece::critical_chords`]: logarithms of sums of reciprocal
/// cosines are convex, and so are sums of those.
fn largest_product(pieces: &[(usize, Piece)], metric: &Metric, pixel_mm2: f64) -> Option<Pair> {
    let mut best_mm2 = 0.0;
    let mut best: Option<Pair> = None;
    let bound_mm2 =
        |piece: &Piece| (2.0 * piece.hull_area() * pixel_mm2).min(piece.hull_diameter_mm(metric).powi(2));
    for (bound_mm2, (slice, piece)) in by_bound(pieces, bound_mm2) {
        if bound_mm2 <= best_mm2 {
            break;
        }
        let mut consider = |d1: PlaneChord, best_mm2: &mut f64| {
            let least_mm = *best_mm2 * (1.0 + SAME_LENGTH) / d1.length_mm;
            if let Some(d2) = piece.longest_across(d1.direction(), metric, least_mm) {
                *best_mm2 = d1.length_mm * d2.length_mm;
                best = Some(Pair { slice: *slice, d1, d2 });
            }
        };
        // Neither chord is longer than the hull's diameter.
        let longest = piece.longest(metric, best_mm2 / piece.hull_diameter_mm(metric));
        let Some(longest_mm) = longest.first().map(|chord| chord.length_mm) else { continue };
        longest.into_iter().for_each(|d1| consider(d1, &mut best_mm2));
        // The other chord is at most the longest.
        let least_mm = best_mm2 / longest_mm;
        let mut critical = Vec::new();
        piece.critical_chords(metric, least_mm, |chord| {
            critical.push(chord);
            least_mm
        });
        critical.sort_by(|a, b| b.length_mm.total_cmp(&a.length_mm));
        for d1 in critical {
            let across_mm = piece.extent_across_mm(d1.direction(), metric).min(longest_mm);
            if d1.length_mm * across_mm > best_mm2 * (1.0 + SAME_LENGTH) {
                consider(d1, &mut best_mm2);
            }
        }
    }
    best
}
