//! The true shapes of the three masks: unions of ellipsoids, at two dates.

use glam::DVec3;
use serde::Serialize;

/// The two dates.
pub const TIMES: [&str; 2] = ["2024-01-15", "2024-04-15"];

/// The three masks, in the case's order.
pub const MARK_IDS: [&str; 3] = ["T1", "T2", "PET"];

/// An ellipsoid with axes along R, A and S.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ellipsoid {
    /// Its centre.
    pub center_mm: DVec3,
    /// Its semi-axes along R, A and S.
    pub semi_axes_mm: DVec3,
}

impl Ellipsoid {
    /// The ellipsoid that touches all six faces of a box.
    pub fn in_box(lo_mm: DVec3, hi_mm: DVec3) -> Self {
        Self { center_mm: (lo_mm + hi_mm) / 2.0, semi_axes_mm: (hi_mm - lo_mm) / 2.0 }
    }

    /// The ellipsoid with this centre and these semi-axes.
    pub const fn new(center_mm: DVec3, semi_axes_mm: DVec3) -> Self {
        Self { center_mm, semi_axes_mm }
    }

    /// Distance from the centre in units of the radius in that direction: 1 on the surface.
    pub fn radius_at(&self, point_mm: DVec3) -> f64 {
        ((point_mm - self.center_mm) / self.semi_axes_mm).length()
    }

    /// Whether a point is inside, the surface included.
    pub fn contains(&self, point_mm: DVec3) -> bool {
        self.radius_at(point_mm) <= 1.0
    }

    /// Signed distance to the surface, accurate to first order near it; negative inside.
    pub fn distance_mm(&self, point_mm: DVec3) -> f64 {
        let v = (point_mm - self.center_mm) / self.semi_axes_mm;
        let steepness = (v / self.semi_axes_mm).length();
        if steepness > 0.0 {
            v.length() * (v.length() - 1.0) / steepness
        } else {
            -self.semi_axes_mm.min_element()
        }
    }

    /// 4/3 π a b c.
    pub fn volume_ml(&self) -> f64 {
        self.semi_axes_mm.element_product() * 4.0 / 3.0 * std::f64::consts::PI / 1000.0
    }
}

/// The true shape of one mask at one date: the union of its parts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mark {
    /// The mask's id.
    pub id: &'static str,
    /// Its parts; the first is the main body.
    pub parts: Vec<Ellipsoid>,
}

impl Mark {
    /// Whether a point is in any part.
    pub fn contains(&self, point_mm: DVec3) -> bool {
        self.parts.iter().any(|e| e.contains(point_mm))
    }

    /// The main body's bounding box in RAS+ millimetres: left, posterior, inferior and right, anterior,
    /// superior faces, as x, y, z. Growth between the dates is the difference of these.
    pub fn main_faces_mm(&self) -> (DVec3, DVec3) {
        let main = self.parts[0];
        (main.center_mm - main.semi_axes_mm, main.center_mm + main.semi_axes_mm)
    }
}

/// The mark of mask `id` at date number `time` (0 or 1); `None` for another id or date.
///
/// From the first date to the second: T1 grows 5 mm anteriorly and recedes 3 mm from the midline,
/// and a new lesion appears in front of and below it; T2 grows 6 mm posteriorly and recedes 4 mm
/// from the left; PET grows 3 mm to the left and recedes 4 mm from above.
pub fn mark(id: &str, time: usize) -> Option<Mark> {
    let at = DVec3::new;
    let second = match time {
        0 => 0.0,
        1 => 1.0,
        _ => return None,
    };
    Some(match id {
        "T1" => {
            let main =
                Ellipsoid::in_box(at(-48.0, 8.0, 3.0), at(-12.0 - 3.0 * second, 52.0 + 5.0 * second, 37.0));
            let lobe = Ellipsoid::new(at(-24.0, 38.0, 31.0), at(11.0, 12.0, 10.0));
            let mut parts = vec![main, lobe];
            if time == 1 {
                parts.push(Ellipsoid::new(at(-16.0, 56.0, -4.0), DVec3::splat(4.5)));
            }
            Mark { id: "T1", parts }
        }
        "T2" => {
            let main = Ellipsoid::in_box(
                at(-54.0 + 4.0 * second, -16.0 - 6.0 * second, -1.0),
                at(-10.0, 44.0, 37.0),
            );
            let satellite = Ellipsoid::new(at(-34.0, -37.0, 24.0), at(5.0, 6.0, 5.0));
            Mark { id: "T2", parts: vec![main, satellite] }
        }
        "PET" => {
            let main =
                Ellipsoid::in_box(at(-36.0 - 3.0 * second, 6.0, 19.0), at(-8.0, 38.0, 47.0 - 4.0 * second));
            Mark { id: "PET", parts: vec![main] }
        }
        _ => return None,
    })
}
