//! The phantom's true volumes.

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;

use super::marks::{Ellipsoid, MARK_IDS, Mark, TIMES, mark};

/// Spacing of the lines along which overlaps are measured.
pub(super) const STEP_MM: f64 = 0.0625;

/// True volume of one mask's shape.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MaskTruth {
    /// The mask's id.
    pub id: &'static str,
    /// Volume of the union of its parts.
    pub volume_ml: f64,
    /// Its parts; the first is the main body.
    pub parts: Vec<Ellipsoid>,
    /// Volume of each part alone: 4/3 π a b c, exact.
    pub part_volumes_ml: Vec<f64>,
}

/// True volume of one region.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegionTruth {
    /// The masks that are active in it.
    pub masks: Vec<&'static str>,
    /// Its volume.
    pub volume_ml: f64,
}

/// One date.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeTruth {
    /// The date.
    pub time: &'static str,
    /// Every mask.
    pub masks: Vec<MaskTruth>,
    /// Every region, fewest masks first.
    pub regions: Vec<RegionTruth>,
}

/// How far one mask's main body moved its outermost points between the dates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Growth {
    /// The mask's id.
    pub id: &'static str,
    /// Outward movement of the left, posterior and inferior faces; negative where they receded.
    pub left_posterior_inferior_mm: DVec3,
    /// Outward movement of the right, anterior and superior faces; negative where they receded.
    pub right_anterior_superior_mm: DVec3,
}

/// What is known of the phantom's shapes, before rasterisation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Truth {
    /// How it was computed.
    pub how: String,
    /// The dates.
    pub time_points: Vec<TimeTruth>,
    /// Growth from the first date to the second.
    pub growth: Vec<Growth>,
}

/// Interval of the line along R at (`y`, `z`) inside an ellipsoid.
fn chord(e: &Ellipsoid, y: f64, z: f64) -> Option<(f64, f64)> {
    let v = (y - e.center_mm.y) / e.semi_axes_mm.y;
    let w = (z - e.center_mm.z) / e.semi_axes_mm.z;
    let half = (1.0 - v * v - w * w).max(0.0).sqrt() * e.semi_axes_mm.x;
    (half > 0.0).then_some((e.center_mm.x - half, e.center_mm.x + half))
}

/// Volume of each combination of marks: exact lengths along lines in R, `step_mm` apart in A and S,
/// each representing its square cell (midpoint rule). `[bits]` in ml; `[0]` is 0.
///
/// Error: that of the midpoint rule on the chord length, which falls to 0 like a square root at the
/// border; a test compares it with 4/3 π a b c.
pub(super) fn measured_ml(marks: &[Mark], step_mm: f64) -> Vec<f64> {
    let boxes = marks.iter().flat_map(|m| &m.parts);
    let (lo, hi) = boxes.fold((DVec3::MAX, DVec3::MIN), |(lo, hi), e| {
        (lo.min(e.center_mm - e.semi_axes_mm), hi.max(e.center_mm + e.semi_axes_mm))
    });
    let [ny, nz] = [hi.y - lo.y, hi.z - lo.z].map(|length| (length / step_mm).ceil() as usize);
    let zeros = || vec![0.0; 1 << marks.len()];
    let slice = |k: usize| {
        let z = lo.z + (k as f64 + 0.5) * step_mm;
        let mut lengths = zeros();
        for j in 0..ny {
            let y = lo.y + (j as f64 + 0.5) * step_mm;
            let mut ends: Vec<f64> = Vec::new();
            let mut inside: Vec<(usize, f64, f64)> = Vec::new();
            for (mark, m) in marks.iter().enumerate() {
                for (from, to) in m.parts.iter().filter_map(|e| chord(e, y, z)) {
                    ends.extend([from, to]);
                    inside.push((mark, from, to));
                }
            }
            ends.sort_by(f64::total_cmp);
            for pair in ends.windows(2) {
                let middle = (pair[0] + pair[1]) / 2.0;
                let here = inside.iter().filter(|(_, from, to)| (*from..*to).contains(&middle));
                lengths[here.fold(0, |bits, (mark, ..)| bits | 1 << mark)] += pair[1] - pair[0];
            }
        }
        lengths
    };
    let slices: Vec<Vec<f64>> = (0..nz).into_par_iter().map(slice).collect();
    let total = |bits: usize| slices.iter().map(|s| s[bits]).sum::<f64>() * step_mm * step_mm / 1000.0;
    (0..1 << marks.len()).map(|bits| if bits == 0 { 0.0 } else { total(bits) }).collect()
}

/// The true volumes. Overlaps have no closed form and are measured on fine lines.
pub fn truth() -> Truth {
    let marks_at = |time| MARK_IDS.iter().filter_map(move |id| mark(id, time)).collect::<Vec<_>>();
    let time_points = TIMES.iter().enumerate().map(|(number, &time)| {
        let marks = marks_at(number);
        let by_bits = measured_ml(&marks, STEP_MM);
        let masks = marks.iter().enumerate().map(|(k, m)| MaskTruth {
            id: m.id,
            volume_ml: (1..by_bits.len()).filter(|b| b >> k & 1 == 1).map(|b| by_bits[b]).sum(),
            parts: m.parts.clone(),
            part_volumes_ml: m.parts.iter().map(Ellipsoid::volume_ml).collect(),
        });
        let mut order: Vec<usize> = (1..by_bits.len()).collect();
        order.sort_by_key(|b| (b.count_ones(), *b));
        let regions = order.into_iter().map(|bits| RegionTruth {
            masks: (0..marks.len()).filter(|k| bits >> k & 1 == 1).map(|k| marks[k].id).collect(),
            volume_ml: by_bits[bits],
        });
        TimeTruth { time, masks: masks.collect(), regions: regions.collect() }
    });
    let growth = marks_at(0).into_iter().zip(marks_at(1)).map(|(before, after)| {
        let ((lo0, hi0), (lo1, hi1)) = (before.main_faces_mm(), after.main_faces_mm());
        Growth { id: before.id, left_posterior_inferior_mm: lo0 - lo1, right_anterior_superior_mm: hi1 - hi0 }
    });
    Truth {
        how: format!(
            "Unions of ellipsoids with axes along R, A, S. Volumes of parts: 4/3 pi a b c. Volumes of unions \
             and regions: exact lengths along lines in R that are {STEP_MM} mm apart in A and S, within \
             0.0005 ml. Millimetres are RAS+. Growth is how far each main body's bounding faces moved outward."
        ),
        time_points: time_points.collect(),
        growth: growth.collect(),
    }
}
