//! What follows from a measurement's ends, and how they are dragged.

use glam::DVec3;

use super::{rulers::Ruler, shape::Shape};

impl Ruler {
    /// Length of the diameter across.
    pub fn across_mm(&self) -> Option<f64> {
        match self.shape {
            Shape::Diameters { across_mm: [one, other] } => Some(one.distance(other)),
            _ => None,
        }
    }

    /// The angle, degrees from 0 to 180; `None` for other shapes, and where an arm has no length.
    pub fn angle_degrees(&self) -> Option<f64> {
        let Shape::Angle { third_mm } = self.shape else { return None };
        let arms = [self.from_mm - self.to_mm, third_mm - self.to_mm];
        let is_known = arms.iter().all(|arm| arm.length() > 0.0);
        // More exact near 0 and 180 degrees than the arc cosine.
        is_known.then(|| arms[0].cross(arms[1]).length().atan2(arms[0].dot(arms[1])).to_degrees())
    }

    /// Area of the circle, square millimetres.
    pub fn area_mm2(&self) -> Option<f64> {
        matches!(self.shape, Shape::Circle { .. }).then(|| std::f64::consts::PI * self.length_mm().powi(2))
    }

    /// The places by which it is dragged.
    pub fn handles_mm(&self) -> Vec<DVec3> {
        let mut all = vec![self.from_mm, self.to_mm];
        match self.shape {
            Shape::Line | Shape::Circle { .. } => {}
            Shape::Diameters { across_mm } => all.extend(across_mm),
            Shape::Angle { third_mm } => all.push(third_mm),
        }
        all
    }

    /// With a handle moved to a place: diameters stay at right angles and cross at the same share of the long one unless the one across is
    /// moved along it; the centre of a circle takes its rim along. `None` for no such handle, and where nothing would be left.
    pub fn with_handle_at(&self, handle: usize, to_mm: DVec3) -> Option<Self> {
        let mut new = self.clone();
        match (handle, &mut new.shape) {
            (0, Shape::Circle { .. }) => {
                new.to_mm += to_mm - self.from_mm;
                new.from_mm = to_mm;
            }
            (0 | 1, Shape::Diameters { across_mm }) => {
                *(if handle == 0 { &mut new.from_mm } else { &mut new.to_mm }) = to_mm;
                *across_mm = across_of(self, [new.from_mm, new.to_mm])?;
            }
            (2 | 3, Shape::Diameters { across_mm }) => {
                let along = (self.to_mm - self.from_mm).try_normalize()?;
                let end = handle - 2;
                let side = to_mm - across_mm[end];
                let shift = along * side.dot(along);
                across_mm[1 - end] += shift;
                // At right angles to the long one, in the plane of the slice that it is dragged in.
                across_mm[end] += side;
            }
            (0, _) => new.from_mm = to_mm,
            (1, _) => new.to_mm = to_mm,
            (2, Shape::Angle { third_mm }) => *third_mm = to_mm,
            _ => return None,
        }
        (new.length_mm() > 0.0 && new.across_mm() != Some(0.0)).then_some(new)
    }
}

/// The diameter across a long one that was moved: as far out on both sides, at the same share of its length.
fn across_of(old: &Ruler, [from_mm, to_mm]: [DVec3; 2]) -> Option<[DVec3; 2]> {
    let Shape::Diameters { across_mm } = old.shape else { return None };
    let was = old.to_mm - old.from_mm;
    let (along, now) = (was.try_normalize()?, (to_mm - from_mm).try_normalize()?);
    let across = (across_mm[1] - across_mm[0]).try_normalize()?;
    let normal = along.cross(across).try_normalize()?;
    // The one across turns with the long one, within the plane of both.
    let turned = normal.cross(now).try_normalize()?;
    let share = (across_mm[0] - old.from_mm).dot(along) / was.length();
    let foot = old.from_mm + was * share;
    let crossing = from_mm + (to_mm - from_mm) * share;
    Some(across_mm.map(|end| crossing + turned * (end - foot).dot(across)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{PaneId, Tool};

    fn ruler(tool: Tool) -> Ruler {
        let (from_mm, to_mm) = (DVec3::new(1.0, 2.0, 5.0), DVec3::new(21.0, 2.0, 5.0));
        let shape = Shape::drawn(tool, [from_mm, to_mm], DVec3::Z);
        Ruler { name: "a".into(), from_mm, to_mm, shape, view: PaneId::Axial, time: 0 }
    }

    #[test]
    fn diameters_stay_at_right_angles_however_they_are_dragged() {
        let mut of = ruler(Tool::Diameters);
        assert_eq!((of.length_mm(), of.across_mm()), (20.0, Some(10.0)));
        let moves =
            [(0, [3.0, -4.0]), (2, [9.0, -3.0]), (3, [14.0, 9.0]), (1, [30.0, 11.0]), (3, [12.0, 20.0])];
        for (handle, [x, y]) in moves {
            let before = of.across_mm();
            of = of.with_handle_at(handle, DVec3::new(x, y, 5.0)).unwrap();
            let Shape::Diameters { across_mm: [one, other] } = of.shape else { unreachable!() };
            let angle =
                (other - one).try_normalize().unwrap().dot((of.to_mm - of.from_mm).try_normalize().unwrap());
            assert!(angle.abs() < 1e-12, "{handle}: {angle}");
            assert!(one.z == 5.0 && other.z == 5.0, "in the slice");
            assert!((of.handles_mm()[handle] - DVec3::new(x, y, 5.0)).length() < 1e-12, "{handle}");
            if handle < 2 {
                assert!((of.across_mm().unwrap() - before.unwrap()).abs() < 1e-12, "only turned");
            }
        }
        assert_eq!(of.with_handle_at(0, of.to_mm), None, "nothing is left");
        assert_eq!(of.with_handle_at(4, DVec3::ZERO), None);
    }

    #[test]
    fn angles_and_circles_are_those_of_the_plane() {
        let of = ruler(Tool::Angle);
        assert_eq!(of.angle_degrees(), Some(90.0));
        for degrees in [0.0_f64, 1e-6, 30.0, 179.0, 180.0] {
            let third =
                of.to_mm + DVec3::new(-degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0) * 7.0;
            let found = of.with_handle_at(2, third).unwrap().angle_degrees().unwrap();
            assert!((found - degrees).abs() < 1e-8, "{found}");
        }
        let flat = of.with_handle_at(2, of.to_mm).unwrap();
        assert_eq!(flat.angle_degrees(), None, "an arm without a length");
        let circle = ruler(Tool::Circle);
        assert!((circle.area_mm2().unwrap() - 400.0 * std::f64::consts::PI).abs() < 1e-9);
        let moved = circle.with_handle_at(0, DVec3::new(0.0, 0.0, 5.0)).unwrap();
        assert_eq!(moved.length_mm(), 20.0);
        assert_eq!(circle.with_handle_at(1, DVec3::new(1.0, 7.0, 5.0)).unwrap().length_mm(), 5.0);
    }
}
