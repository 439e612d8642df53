//! Fibre tracts: polylines in patient space.

use crate::Sides;

/// Fibres (streamlines) as polylines in RAS+ millimetres, one after another.
///
/// Fibres keep their numbers from the file: one without points stays as an empty one. Coordinates are
/// `f32`: precise to 0.001 mm within 8 m of the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracts {
    points_mm: Vec<[f32; 3]>,
    offsets: Vec<u32>,
    sides: Sides,
}

impl Tracts {
    /// Fibre n has the points `offsets[n]..offsets[n + 1]`; `sides` states whether their position in
    /// the patient is known. `None` unless the offsets begin with 0, never fall and end with the number
    /// of points, and every coordinate is finite.
    pub fn new(points_mm: Vec<[f32; 3]>, offsets: Vec<u32>, sides: Sides) -> Option<Self> {
        let valid = offsets.first() == Some(&0)
            && offsets.is_sorted()
            && offsets.last().map(|&end| end as usize) == Some(points_mm.len())
            && points_mm.iter().flatten().all(|v| v.is_finite());
        valid.then_some(Self { points_mm, offsets, sides })
    }

    /// Number of fibres, including those without points.
    pub fn fiber_count(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The points of fibre `n`, in order along it; empty where there is no such fibre.
    pub fn fiber(&self, n: usize) -> &[[f32; 3]] {
        match (self.offsets.get(n), self.offsets.get(n + 1)) {
            (Some(&from), Some(&to)) => self.points_mm.get(from as usize..to as usize).unwrap_or_default(),
            _ => &[],
        }
    }

    /// All points, fibre after fibre.
    pub fn points_mm(&self) -> &[[f32; 3]] {
        &self.points_mm
    }

    /// Where each fibre's points begin, and the number of points at the end: one more than fibres.
    pub fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    /// Whether the file states where the points are in the patient. With [`Sides::Unknown`] they are
    /// millimetres in an unknown frame: shape and length are valid, distances to anything else are
    /// unknown.
    pub fn sides(&self) -> Sides {
        self.sides
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_offsets_and_points_are_rejected() {
        let points = vec![[0.0, 1.0, 2.0], [1.0, 1.0, 2.0], [5.0, 5.0, 5.0]];
        let tracts = Tracts::new(points.clone(), vec![0, 2, 2, 3], Sides::Known).unwrap();
        assert_eq!(tracts.fiber_count(), 3);
        assert_eq!([0, 1, 2, 3].map(|n| tracts.fiber(n).len()), [2, 0, 1, 0]);
        assert_eq!(tracts.fiber(2), &points[2..]);
        for bad in [vec![], vec![0], vec![1, 3], vec![0, 2, 1, 3], vec![0, 4]] {
            assert_eq!(Tracts::new(points.clone(), bad, Sides::Known), None);
        }
        assert_eq!(Tracts::new(vec![[0.0, f32::NAN, 0.0]], vec![0, 1], Sides::Known), None);
        assert_eq!(Tracts::new(Vec::new(), vec![0], Sides::Known).unwrap().fiber_count(), 0);
    }
}
