//! Labels of a frame that no segment of its file declares.

use std::collections::BTreeMap;

use super::Segment;
use crate::{Check, Volume, check::listed};

/// Most labels that are told apart: more are no label map.
const MAX_LABELS: usize = 1000;

/// A check of the labels other than 0 in `volume`, frame `frame` of the file, that none of `segments` declares.
pub(super) fn undeclared(volume: &Volume, segments: &[Segment], frame: usize, name: &str) -> Option<Check> {
    let here: Vec<Option<i64>> = segments.iter().filter(|s| s.frame == frame).map(|s| s.label).collect();
    // A segment without a label has every voxel.
    if segments.is_empty() || here.contains(&None) {
        return None;
    }
    let mut found: BTreeMap<i64, u64> = BTreeMap::new();
    let (mut last, mut run) = (0, 0_u64);
    for at in 0..volume.samples().len() {
        // Saturates for values that are no label.
        let value = volume.value(at).round() as i64;
        if value == last {
            run += 1;
            continue;
        }
        if last != 0 {
            *found.entry(last).or_default() += run;
        }
        (last, run) = (value, 1);
        if found.len() > MAX_LABELS {
            break;
        }
    }
    if last != 0 {
        *found.entry(last).or_default() += run;
    }
    found.retain(|label, _| !here.contains(&Some(*label)));
    let each: Vec<String> =
        found.iter().map(|(label, voxels)| format!("{label} ({voxels} voxels)")).collect();
    (!each.is_empty()).then(|| {
        Check::warning(
            "segment-undeclared",
            format!("{name}: found labels that no segment declares, in frame {frame}: {}", listed(&each, 8)),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Grid, Samples, Scaling};
    use glam::DVec3;

    #[test]
    fn labels_without_a_segment_are_counted() {
        let grid = Grid::axis_aligned([7, 1, 1], DVec3::ONE, DVec3::ZERO).unwrap();
        let volume = Volume::new(grid, Samples::U8(vec![0, 1, 1, 4, 4, 2, 4]), Scaling::NONE).unwrap();
        let segment = |label, frame| Segment { number: 0, name: String::new(), color: None, frame, label };
        let text = |segments: &[Segment]| undeclared(&volume, segments, 0, "t").map(|check| check.message);
        let found = text(&[segment(Some(1), 0), segment(Some(4), 1)]).unwrap();
        assert!(found.ends_with("in frame 0: 2 (1 voxels), 4 (3 voxels)"), "{found}");
        assert_eq!(text(&[1, 2, 4].map(|label| segment(Some(label), 0))), None);
        assert_eq!(text(&[segment(None, 0)]), None);
        assert_eq!(text(&[]), None);
    }
}
