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
    scalars: Vec<TractScalar>,
}

/// What each value of a scalar belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScalarPer {
    /// A point.
    Point,
    /// A fibre.
    Fiber,
}

/// A named quantity along fibres (fractional anisotropy, say), in the unit of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct TractScalar {
    name: String,
    per: ScalarPer,
    values: Vec<f32>,
    range: Option<[f32; 2]>,
}

impl TractScalar {
    /// A scalar with one value for each point or fibre, in their order. Values that aren't finite are missing.
    pub fn new(name: String, per: ScalarPer, values: Vec<f32>) -> Self {
        let finite = values.iter().copied().filter(|v| v.is_finite());
        let range = finite.fold(None, |range: Option<[f32; 2]>, v| {
            Some(range.map_or([v, v], |[low, high]| [low.min(v), high.max(v)]))
        });
        Self { name, per, values, range }
    }

    /// Its name; unique among those of its tracts.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its least and its greatest finite value; `None` without any.
    pub fn range(&self) -> Option<[f32; 2]> {
        self.range
    }

    /// Whether some values are missing.
    pub fn has_gaps(&self) -> bool {
        self.values.iter().any(|v| !v.is_finite())
    }
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
        valid.then_some(Self { points_mm, offsets, sides, scalars: Vec::new() })
    }

    /// These tracts with more scalars. `None` where one hasn't a value for each of its points or fibres. A name that is
    /// taken gets a number.
    pub fn with_scalars(mut self, scalars: Vec<TractScalar>) -> Option<Self> {
        for mut scalar in scalars {
            let expected = match scalar.per {
                ScalarPer::Point => self.points_mm.len(),
                ScalarPer::Fiber => self.fiber_count(),
            };
            if scalar.values.len() != expected {
                return None;
            }
            let own = scalar.name.clone();
            for number in 2.. {
                if self.scalar(&scalar.name).is_none() {
                    break;
                }
                scalar.name = format!("{own} {number}");
            }
            self.scalars.push(scalar);
        }
        Some(self)
    }

    /// Its scalars, in the order of their files.
    pub fn scalars(&self) -> &[TractScalar] {
        &self.scalars
    }

    /// The scalar with this name.
    pub fn scalar(&self, name: &str) -> Option<&TractScalar> {
        self.scalars.iter().find(|scalar| scalar.name == name)
    }

    /// The values of one of its scalars at the points of fibre `n`; NaN where it has none.
    pub fn values_along(&self, scalar: &TractScalar, n: usize) -> Vec<f32> {
        let first = self.offsets.get(n).map_or(0, |&at| at as usize);
        let count = self.fiber(n).len();
        let value = |at: usize| match scalar.per {
            ScalarPer::Point => scalar.values.get(first + at),
            ScalarPer::Fiber => scalar.values.get(n),
        };
        (0..count).map(|at| value(at).copied().unwrap_or(f32::NAN)).collect()
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
    fn scalars_have_a_value_for_each_point_or_fiber() {
        let points = vec![[0.0; 3], [1.0; 3], [5.0; 3]];
        let tracts = Tracts::new(points, vec![0, 2, 2, 3], Sides::Known).unwrap();
        let per_point = TractScalar::new("FA".into(), ScalarPer::Point, vec![0.5, f32::NAN, 0.25]);
        let per_fiber = TractScalar::new("FA".into(), ScalarPer::Fiber, vec![7.0, 8.0, f32::INFINITY]);
        assert_eq!((per_point.range(), per_fiber.range()), (Some([0.25, 0.5]), Some([7.0, 8.0])));
        assert!(per_point.has_gaps());
        assert_eq!(TractScalar::new("x".into(), ScalarPer::Point, vec![f32::NAN]).range(), None);
        let both = tracts.clone().with_scalars(vec![per_point, per_fiber]).unwrap();
        let names: Vec<&str> = both.scalars().iter().map(TractScalar::name).collect();
        assert_eq!(names, ["FA", "FA 2"]);
        let along = |name: &str, n| both.values_along(both.scalar(name).unwrap(), n);
        assert_eq!((along("FA", 2), along("FA 2", 0)), (vec![0.25], vec![7.0, 7.0]));
        assert_eq!((along("FA", 1), along("FA 2", 9)), (vec![], vec![]));
        for short in [ScalarPer::Point, ScalarPer::Fiber] {
            assert_eq!(
                tracts.clone().with_scalars(vec![TractScalar::new("x".into(), short, vec![1.0])]),
                None
            );
        }
    }

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
