//! The anatomical plane that a slice shows, and its orientation on the screen.

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{Grid, axes};

use crate::scene::{Lens, keywords::keywords};

keywords! {
    /// One of the three anatomical planes.
    #[derive(PartialOrd, Ord)]
    pub enum Plane {
        /// Normal superior.
        Axial,
        /// Normal anterior.
        Coronal,
        /// Normal right.
        Sagittal,
    }
}

impl Plane {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Axial, Self::Coronal, Self::Sagittal];

    /// Its name, capitalised.
    pub fn name(self) -> &'static str {
        match self {
            Self::Axial => "Axial",
            Self::Coronal => "Coronal",
            Self::Sagittal => "Sagittal",
        }
    }

    /// Index of the plane's normal among the world axes R, A, S (0, 1, 2).
    pub fn axis(self) -> usize {
        match self {
            Self::Axial => 2,
            Self::Coronal => 1,
            Self::Sagittal => 0,
        }
    }

    /// Unit normal in world space: superior, anterior or right.
    pub fn normal(self) -> DVec3 {
        [DVec3::X, DVec3::Y, DVec3::Z][self.axis()]
    }

    /// Distance between neighbouring slices of `grid` along the normal, in millimetres: one notch of
    /// scrolling. On an oblique grid, that of the voxel axis nearest the normal.
    pub fn step_mm(self, grid: &Grid) -> f64 {
        let letters = [['L', 'R'], ['P', 'A'], ['I', 'S']][self.axis()];
        let nearest = grid.axis_codes().iter().position(|code| letters.contains(code)).unwrap_or(0);
        let m = grid.world_from_voxel().matrix3;
        let column = [m.x_axis, m.y_axis, m.z_axis][nearest];
        let along = column[self.axis()].abs();
        // A heavily sheared axis may hardly advance along the normal that it was matched with.
        if along > 0.1 * column.length() { along } else { column.length() }
    }
}

keywords! {
    /// Whether the patient's left is displayed on the right.
    #[derive(Default)]
    pub enum Convention {
        /// Axial and coronal: the patient's left is on the right, as seen from the feet and from the front.
        #[default]
        Radiological,
        /// Axial and coronal: the patient's left is on the left.
        Neurological,
    }
}

/// A rectangle of a plane, sampled by pixels.
///
/// Coronal and sagittal have superior up, axial has anterior up. Sagittal has anterior on the left
/// in both conventions: these concern left and right, which a sagittal slice doesn't show.
///
/// Pixel coordinates count from the top left corner, pixel centres at halves, as in
/// [`Camera::ray`](glioscope_core::optics::Camera::ray).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceView {
    /// Which plane; with a turn, which of the turned ones.
    pub plane: Plane,
    /// The rotation that takes the patient's axes R, A and S to those along which slices lie: identity for planes of the patient.
    pub turn: DMat3,
    /// The point of the plane at the centre of the slice, world millimetres.
    pub center_mm: DVec3,
    /// Pixel size. Positive.
    pub mm_per_pixel: f64,
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// Which side the patient's left is on.
    pub convention: Convention,
}

/// A scale bar that fits a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScaleBar {
    /// Its length: 1, 2 or 5 times a power of ten.
    pub mm: f64,
    /// Its length in pixels.
    pub px: f64,
}

impl SliceView {
    /// The slice through `through_mm` that shows all of the bounding box `bounds_mm` (smallest and largest
    /// world coordinates), centred, with a margin of 3 % on each side. Centre and scale are rounded
    /// (1 µm, a thousandth), so that rounding noise of the box doesn't change any pixel.
    pub fn fit(
        plane: Plane,
        convention: Convention,
        bounds_mm: (DVec3, DVec3),
        through_mm: DVec3,
        size_px: [u32; 2],
    ) -> Self {
        Self::fit_turned(plane, (convention, DMat3::IDENTITY), bounds_mm, through_mm, size_px)
    }

    /// As [`SliceView::fit`], turned by a rotation.
    pub fn fit_turned(
        plane: Plane,
        (convention, turn): (Convention, DMat3),
        bounds_mm: (DVec3, DVec3),
        through_mm: DVec3,
        size_px: [u32; 2],
    ) -> Self {
        let center_mm = ((bounds_mm.0 + bounds_mm.1) * 500.0).round() / 1000.0;
        let mut view = Self { plane, turn, center_mm, mm_per_pixel: 1.0, size_px, convention };
        if view.is_turned() {
            view.center_mm += view.normal() * view.distance_mm(through_mm);
        } else {
            view.center_mm[plane.axis()] = through_mm[plane.axis()];
        }
        let extent = bounds_mm.1 - bounds_mm.0;
        let needed = [view.right(), view.down()]
            .map(|axis| axis.abs().dot(extent))
            .iter()
            .zip(size_px)
            .map(|(mm, px)| mm / f64::from(px.max(1)))
            .fold(0.0, f64::max);
        let unit = 10f64.powf(needed.log10().floor() - 3.0);
        view.mm_per_pixel = if needed > 0.0 { (needed * 1.06 / unit).ceil() * unit } else { 1.0 };
        view
    }

    /// Whether its plane is none of the patient's.
    pub fn is_turned(&self) -> bool {
        self.turn != DMat3::IDENTITY
    }

    /// Unit normal in world space: superior, anterior or right, turned.
    pub fn normal(&self) -> DVec3 {
        self.turn * self.plane.normal()
    }

    /// Distance between neighbouring slices along the normal, as [`Plane::step_mm`]; turned, that of the voxel axis nearest the
    /// normal.
    pub fn step_mm(&self, grid: &Grid) -> f64 {
        if !self.is_turned() {
            return self.plane.step_mm(grid);
        }
        let m = grid.world_from_voxel().matrix3;
        let normal = self.normal();
        let along = |column: DVec3| (column.dot(normal).abs() / column.length(), column.dot(normal).abs());
        let all = [m.x_axis, m.y_axis, m.z_axis].map(along);
        all.into_iter().fold((0.0, 1.0), |best, one| if one.0 > best.0 { one } else { best }).1
    }

    /// World direction to the right; unit length.
    pub fn right(&self) -> DVec3 {
        self.turn * self.patient_right()
    }

    /// World direction downwards; unit length.
    pub fn down(&self) -> DVec3 {
        self.turn * self.patient_down()
    }

    fn patient_right(&self) -> DVec3 {
        match (self.plane, self.convention) {
            (Plane::Sagittal, _) => DVec3::NEG_Y,
            (_, Convention::Radiological) => DVec3::NEG_X,
            (_, Convention::Neurological) => DVec3::X,
        }
    }

    fn patient_down(&self) -> DVec3 {
        match self.plane {
            Plane::Axial => DVec3::NEG_Y,
            Plane::Coronal | Plane::Sagittal => DVec3::NEG_Z,
        }
    }

    /// World position of a pixel coordinate.
    pub fn world_at(&self, pixel: DVec2) -> DVec3 {
        let from_middle = (pixel - self.middle_px()) * self.mm_per_pixel;
        self.center_mm + self.right() * from_middle.x + self.down() * from_middle.y
    }

    /// Pixel coordinate of a world point, projected along the normal.
    pub fn pixel_of(&self, world_mm: DVec3) -> DVec2 {
        let from_center = world_mm - self.center_mm;
        self.middle_px()
            + DVec2::new(from_center.dot(self.right()), from_center.dot(self.down())) / self.mm_per_pixel
    }

    /// Signed distance of a world point from the plane: positive on the superior, anterior or right
    /// side.
    pub fn distance_mm(&self, world_mm: DVec3) -> f64 {
        (world_mm - self.center_mm).dot(self.normal())
    }

    /// Anatomical letters of the left, right, top and bottom edges. Don't show them where
    /// the image's [`Sides`](glioscope_core::Sides) are unknown.
    pub fn letters(&self) -> [char; 4] {
        let letter = |towards: DVec3| {
            let a = towards.abs();
            let axis = (1..3).fold(0, |best, axis| if a[axis] > a[best] { axis } else { best });
            letter_towards(axis, towards)
        };
        self.edges().map(letter)
    }

    /// The same with a second letter where an edge lies between two sides: its direction is more than 22.5 degrees off the first.
    pub fn edge_names(&self) -> [String; 4] {
        let name = |towards: DVec3| {
            let a = towards.abs();
            let mut axes = [0, 1, 2];
            axes.sort_by(|&one, &other| a[other].total_cmp(&a[one]));
            let shown = axes
                .into_iter()
                .enumerate()
                .filter(|&(rank, axis)| rank == 0 || (rank == 1 && a[axis] > SECOND_LETTER));
            shown.map(|(_, axis)| letter_towards(axis, towards)).collect()
        };
        self.edges().map(name)
    }

    fn edges(&self) -> [DVec3; 4] {
        [-self.right(), self.right(), -self.down(), self.down()]
    }

    /// Position of the plane: `S 12.5 mm`. `+12.5 mm` where the sides are unknown. Turned: by how much.
    pub fn position_label(&self, sides_known: bool) -> String {
        if self.is_turned() {
            return format!("turned {:.0}\u{b0}", axes::turn_deg(self.turn));
        }
        let at = self.center_mm[self.plane.axis()];
        if sides_known { signed_letter(self.plane.axis(), at) } else { format!("{at:+.1} mm") }
    }

    /// The longest scale bar of 1, 2 or 5 times a power of ten millimetres that takes at most
    /// `max_px` pixels. `None` when the view's scale or `max_px` isn't positive and finite.
    pub fn scale_bar(&self, max_px: f64) -> Option<ScaleBar> {
        let max_mm = max_px * self.mm_per_pixel;
        if !(max_mm > 0.0 && max_mm.is_finite() && self.mm_per_pixel > 0.0) {
            return None;
        }
        // The largest of 5, 2, 1 times its decade that fits; the tolerance keeps 10 from becoming 5.
        let decade = 10f64.powi((max_mm * (1.0 + 1e-12)).log10().floor() as i32);
        let mm = [5.0, 2.0, 1.0].map(|m| m * decade).into_iter().find(|&mm| mm <= max_mm * (1.0 + 1e-12))?;
        Some(ScaleBar { mm, px: mm / self.mm_per_pixel })
    }

    /// Circle in which the plane cuts the lens: centre and radius in pixels. `None` when it misses.
    pub fn lens_circle(&self, lens: &Lens) -> Option<(DVec2, f64)> {
        let distance = self.distance_mm(lens.center_mm);
        let squared = lens.radius_mm * lens.radius_mm - distance * distance;
        (squared > 0.0).then(|| (self.pixel_of(lens.center_mm), squared.sqrt() / self.mm_per_pixel))
    }

    fn middle_px(&self) -> DVec2 {
        DVec2::new(f64::from(self.size_px[0]), f64::from(self.size_px[1])) * 0.5
    }
}

/// The sine of 22.5 degrees.
const SECOND_LETTER: f64 = 0.382_683_432_365_089_8;

fn letter_towards(axis: usize, towards: DVec3) -> char {
    [['L', 'R'], ['P', 'A'], ['I', 'S']][axis][usize::from(towards[axis] > 0.0)]
}

/// `R 12.5 mm` for +12.5 on world axis 0, `L 12.5 mm` for −12.5.
fn signed_letter(axis: usize, mm: f64) -> String {
    let letters = [['L', 'R'], ['P', 'A'], ['I', 'S']][axis];
    // A value printed as 0.0 counts as positive.
    let letter = letters[usize::from(mm > -0.05)];
    format!("{letter} {:.1} mm", mm.abs())
}

/// `R 3.0  A 12.5  S 40.0 mm`, or `x 3.0  y 12.5  z 40.0 mm` where the sides are unknown.
pub fn place_label(world_mm: DVec3, sides_known: bool) -> String {
    let parts: [String; 3] = std::array::from_fn(|axis| {
        if sides_known {
            signed_letter(axis, world_mm[axis]).trim_end_matches(" mm").to_owned()
        } else {
            format!("{} {:.1}", ['x', 'y', 'z'][axis], world_mm[axis])
        }
    });
    format!("{} mm", parts.join("  "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(plane: Plane, convention: Convention) -> SliceView {
        let center_mm = DVec3::new(1e6, -20.0, 30.0);
        SliceView {
            plane,
            turn: DMat3::IDENTITY,
            center_mm,
            mm_per_pixel: 0.5,
            size_px: [400, 300],
            convention,
        }
    }

    #[test]
    fn letters_match_the_patient_s_sides() {
        use Convention::{Neurological, Radiological};
        let expected = [
            (Plane::Axial, Radiological, ['R', 'L', 'A', 'P']),
            (Plane::Axial, Neurological, ['L', 'R', 'A', 'P']),
            (Plane::Coronal, Radiological, ['R', 'L', 'S', 'I']),
            (Plane::Coronal, Neurological, ['L', 'R', 'S', 'I']),
            (Plane::Sagittal, Radiological, ['A', 'P', 'S', 'I']),
            (Plane::Sagittal, Neurological, ['A', 'P', 'S', 'I']),
        ];
        for (plane, convention, letters) in expected {
            let v = view(plane, convention);
            assert_eq!(v.letters(), letters, "{plane:?} {convention:?}");
            // A step towards each letter moves towards that edge.
            let steps = [
                ('R', DVec3::X),
                ('L', -DVec3::X),
                ('A', DVec3::Y),
                ('P', -DVec3::Y),
                ('S', DVec3::Z),
                ('I', -DVec3::Z),
            ];
            let edges = [-DVec2::X, DVec2::X, -DVec2::Y, DVec2::Y];
            for (edge, letter) in edges.into_iter().zip(letters) {
                let step = steps.iter().find(|s| s.0 == letter).unwrap().1;
                let moved = v.pixel_of(v.center_mm + step * 10.0) - DVec2::new(200.0, 150.0);
                assert!((moved - edge * 20.0).length() < 1e-6, "{plane:?} {letter} {moved}");
            }
        }
    }

    #[test]
    fn pixel_of_inverts_world_at() {
        for plane in Plane::ALL {
            let v = view(plane, Convention::Radiological);
            for pixel in [DVec2::new(0.5, 0.5), DVec2::new(399.5, 17.25)] {
                let world = v.world_at(pixel);
                assert!(v.pixel_of(world).distance(pixel) < 1e-6);
                assert_eq!(v.distance_mm(world), 0.0);
                assert!((v.distance_mm(world + plane.normal() * 3.0) - 3.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn the_scale_bar_is_the_longest_round_length_that_fits() {
        let mut v = view(Plane::Axial, Convention::Radiological);
        for (mm_per_pixel, max_px, mm) in [
            (0.5, 100.0, 50.0),
            (1.0, 100.0, 100.0),
            (1.0, 99.0, 50.0),
            (1.0, 10.0, 10.0),
            (0.1, 100.0, 10.0),
            (0.1, 99.0, 5.0),
            (0.01, 45.0, 0.2),
            (0.7, 100.0, 50.0),
        ] {
            v.mm_per_pixel = mm_per_pixel;
            let bar = v.scale_bar(max_px).unwrap();
            assert!((bar.mm / mm - 1.0).abs() < 1e-9, "{mm_per_pixel} {max_px}: {bar:?}");
            let ends = [DVec2::new(10.0, 10.0), DVec2::new(10.0 + bar.px, 10.0)].map(|p| v.world_at(p));
            assert!((ends[0].distance(ends[1]) - bar.mm).abs() < 1e-8);
        }
        v.mm_per_pixel = 0.0;
        assert_eq!(v.scale_bar(100.0), None);
        v.mm_per_pixel = f64::NAN;
        assert_eq!(v.scale_bar(100.0), None);
    }

    #[test]
    fn the_lens_circle_is_the_section_of_the_lens() {
        let v = view(Plane::Coronal, Convention::Radiological);
        let lens = Lens { center_mm: v.center_mm + DVec3::new(10.0, 3.0, 4.0), radius_mm: 5.0 };
        let (middle, radius) = v.lens_circle(&lens).unwrap();
        assert!((radius - 4.0 / 0.5).abs() < 1e-9, "3-4-5");
        assert!(middle.distance(DVec2::new(200.0 - 20.0, 150.0 - 8.0)) < 1e-6);
        assert_eq!(v.lens_circle(&Lens { radius_mm: 2.9, ..lens }), None);
    }

    #[test]
    fn a_fitted_view_contains_the_box_with_a_small_margin() {
        let bounds = (DVec3::new(-100.0, -50.0, 0.0), DVec3::new(100.0, 150.0, 90.0));
        for plane in Plane::ALL {
            let through = DVec3::new(7.0, 8.0, 9.0);
            let v = SliceView::fit(plane, Convention::Radiological, bounds, through, [300, 200]);
            assert_eq!(v.distance_mm(through), 0.0);
            let pixels = [bounds.0, bounds.1].map(|c| v.pixel_of(c));
            let (lo, hi) = (pixels[0].min(pixels[1]), pixels[0].max(pixels[1]));
            assert!(lo.min_element() > 0.0 && hi.x < 300.0 && hi.y < 200.0);
            assert!((hi.x - lo.x) / 300.0 > 0.94 || (hi.y - lo.y) / 200.0 > 0.94);
        }
    }

    #[test]
    fn step_mm_is_the_slice_distance() {
        let grid = Grid::axis_aligned([4, 5, 6], DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO).unwrap();
        assert_eq!(Plane::ALL.map(|p| p.step_mm(&grid)), [3.0, 2.0, 1.0]);
    }

    #[test]
    fn position_labels_have_anatomical_letters() {
        assert_eq!(place_label(DVec3::new(-3.0, 12.54, -0.01), true), "L 3.0  A 12.5  S 0.0 mm");
        assert_eq!(place_label(DVec3::new(-3.0, 12.54, 0.0), false), "x -3.0  y 12.5  z 0.0 mm");
        assert_eq!(view(Plane::Coronal, Convention::Radiological).position_label(true), "P 20.0 mm");
        assert_eq!(view(Plane::Axial, Convention::Radiological).position_label(false), "+30.0 mm");
    }

    #[test]
    fn a_turned_view_has_its_own_plane_and_names_its_edges() {
        let turn = DMat3::from_axis_angle(DVec3::X, 30_f64.to_radians());
        let bounds_mm = (DVec3::splat(-50.0), DVec3::splat(50.0));
        let through_mm = DVec3::new(3.0, -7.0, 11.0);
        for plane in Plane::ALL {
            let v = SliceView::fit_turned(
                plane,
                (Convention::Radiological, turn),
                bounds_mm,
                through_mm,
                [300, 200],
            );
            assert!(v.distance_mm(through_mm).abs() < 1e-12, "{plane:?}");
            assert!(v.right().dot(v.normal()).abs() < 1e-12 && v.right().dot(v.down()).abs() < 1e-12);
            let pixel = v.pixel_of(through_mm);
            assert!(v.world_at(pixel).distance(through_mm) < 1e-9);
            // All of the box is in the picture.
            for corner in 0..8 {
                let at =
                    DVec3::from_array([0, 1, 2].map(|k| if corner >> k & 1 == 1 { 50.0 } else { -50.0 }));
                let pixel = v.pixel_of(at);
                assert!(pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(DVec2::new(300.0, 200.0)).all());
            }
        }
        // Turned about R by 30 degrees: anterior goes up.
        let v = SliceView::fit_turned(
            Plane::Axial,
            (Convention::Radiological, turn),
            bounds_mm,
            through_mm,
            [300, 200],
        );
        assert_eq!(v.edge_names(), ["R", "L", "AS", "PI"]);
        assert_eq!(v.position_label(true), "turned 30\u{b0}");
        let less = DMat3::from_axis_angle(DVec3::X, 20_f64.to_radians());
        assert_eq!(SliceView { turn: less, ..v }.edge_names(), ["R", "L", "A", "P"]);
        let grid = Grid::axis_aligned([10; 3], DVec3::new(1.0, 1.0, 4.0), DVec3::ZERO).unwrap();
        assert!((v.step_mm(&grid) - 4.0 * 30_f64.to_radians().cos()).abs() < 1e-12);
    }
}
