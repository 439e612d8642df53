//! Makes the spaces of the tasks, and chooses what is marked in them.

use glam::{DMat3, DQuat, DVec2, DVec3};

use super::{
    answer::{Answer, Task, Truth},
    sheet::{Hill, Sheet},
    solid::Solid,
    space::{Hit, Space},
};
use crate::optics::{Camera, Projection, random::Random};

/// Radius of what the camera shows with a margin.
const RADIUS_MM: f64 = 50.0;
/// Around a mark, in shares of the picture's side, no edge is seen.
const CLEAR: f64 = 0.026;
/// Largest difference of depth around a mark: what is steeper has no single depth.
const CLEAR_MM: f64 = 4.0;
/// Least distance between two marks from left to right, in shares of the picture's side.
const APART: f64 = 0.2;
/// Differences of depth in shares of the depth seen, by level; for practice.
const NEARER: [[f64; 2]; 3] = [[0.18, 0.30], [0.10, 0.18], [0.05, 0.10]];
const NEARER_EASY: [f64; 2] = [0.35, 0.8];
/// Depths asked for, by level.
const DEPTH: [[f64; 2]; 3] = [[0.05, 0.35], [0.35, 0.65], [0.65, 0.95]];
/// Ratios of volumes, by level; for practice.
const LARGER: [[f64; 2]; 3] = [[2.0, 2.6], [1.55, 2.0], [1.25, 1.55]];
const LARGER_EASY: [f64; 2] = [3.5, 5.0];
/// Curvedness of the marked place, 1/mm, by level; for practice.
const CURVED: [[f64; 2]; 3] = [[0.12, 0.4], [0.09, 0.12], [0.065, 0.09]];
const CURVED_EASY: [f64; 2] = [0.13, 0.5];
/// Shape index (Koenderink and van Doorn 1992) from which a place is a bulge or a hollow, and up to which it is a saddle.
const DOMED: f64 = 0.75;
const SADDLED: f64 = 0.25;

/// A space with what is marked in it.
pub(super) struct Made {
    pub space: Space,
    /// Marked points in the camera's axes, from left to right.
    pub marks: Vec<DVec3>,
    pub truth: Truth,
    /// How easy it is: see [`super::Scene::difference`].
    pub difference: f64,
}

/// Random numbers as the scenes need them.
struct Dice(Random);

impl Dice {
    fn within(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.0.unit()
    }

    fn below(&mut self, count: usize) -> usize {
        ((count as f64 * self.0.unit()) as usize).min(count.saturating_sub(1))
    }

    fn coin(&mut self) -> bool {
        self.0.unit() < 0.5
    }

    /// Uniform in the disc.
    fn in_disc(&mut self, radius: f64) -> DVec2 {
        let (r, angle) = (radius * self.0.unit().sqrt(), std::f64::consts::TAU * self.0.unit());
        DVec2::from_angle(angle) * r
    }

    fn direction(&mut self) -> DVec3 {
        let z = self.within([-1.0, 1.0]);
        DVec2::from_angle(std::f64::consts::TAU * self.0.unit()).extend(0.0) * (1.0 - z * z).sqrt()
            + DVec3::Z * z
    }

    /// Uniform among all rotations (Shoemake 1992).
    fn rotation(&mut self) -> DQuat {
        let share = self.0.unit();
        let [a, b] = [0, 1].map(|_| DVec2::from_angle(std::f64::consts::TAU * self.0.unit()));
        let (a, b) = (a * (1.0 - share).sqrt(), b * share.sqrt());
        DQuat::from_xyzw(a.x, a.y, b.x, b.y)
    }

    /// A rotation of the camera's axes by at most `degrees`.
    fn tilt(&mut self, degrees: f64) -> DMat3 {
        let axis = DVec2::from_angle(std::f64::consts::TAU * self.0.unit()).extend(0.0);
        DMat3::from_axis_angle(axis, self.within([0.0, degrees.to_radians()]))
    }

    fn hills(&mut self, count: usize, radius: f64, width: [f64; 2], height: [f64; 2]) -> Vec<Hill> {
        let hill = |_| {
            let sign = if self.coin() { 1.0 } else { -1.0 };
            let (center, width_mm) = (self.in_disc(radius), self.within(width));
            Hill { center, width_mm, height_mm: sign * self.within(height) }
        };
        (0..count).map(hill).collect()
    }

    /// An empty space; voxels lie askew to the camera, so that their steps point nowhere.
    fn space(&mut self) -> Space {
        let camera = Camera::fit(DVec3::ZERO, RADIUS_MM, self.rotation(), Projection::Perspective);
        Space { camera, solids: Vec::new() }
    }

    /// A wavy wall behind everything, on which shadows fall.
    fn wall(&mut self) -> Solid {
        let axes = self.tilt(12.0);
        let hills = self.hills(9, 46.0, [8.0, 14.0], [2.0, 5.0]);
        Solid::Sheet(Sheet::new(DVec3::Z * -34.0, axes, [54.0, 3.0], hills))
    }

    /// A ball, a rod or an ellipsoid before the wall.
    fn solid(&mut self) -> Solid {
        let center = self.in_disc(35.0).extend(self.within([-24.0, 34.0]));
        match self.below(3) {
            0 => {
                let radius = self.within([4.0, 8.0]);
                Solid::Ellipsoid { center, axes: DMat3::IDENTITY, radii_mm: DVec3::splat(radius) }
            }
            1 => {
                let half = self.direction() * self.within([8.0, 17.0]);
                Solid::Capsule { from: center - half, to: center + half, radius_mm: self.within([3.0, 5.5]) }
            }
            _ => {
                let radii_mm =
                    DVec3::new(self.within([4.0, 10.0]), self.within([4.0, 7.0]), self.within([4.0, 10.0]));
                Solid::Ellipsoid { center, axes: DMat3::from_quat(self.rotation()), radii_mm }
            }
        }
    }

    fn furnished(&mut self) -> Space {
        let mut space = self.space();
        space.solids.push((0, self.wall()));
        for _ in 0..10 {
            space.solids.push((0, self.solid()));
        }
        space
    }

    /// What is seen through a random place of the picture, where it is clear.
    fn seen(&mut self, space: &Space) -> Option<(DVec2, Hit)> {
        let at = DVec2::splat(0.5) + self.in_disc(0.4);
        Some((at, clear(space, at)?))
    }
}

/// What is at a place of the picture, if all around it is the same solid at about the same depth.
fn clear(space: &Space, at: DVec2) -> Option<Hit> {
    let hit = space.first(at)?;
    let is_alike = |n: i32| {
        let around = at + DVec2::from_angle(f64::from(n) * std::f64::consts::FRAC_PI_4) * CLEAR;
        space
            .first(around)
            .is_some_and(|other| other.solid == hit.solid && (other.depth_mm - hit.depth_mm).abs() < CLEAR_MM)
    };
    (0..8).all(is_alike).then_some(hit)
}

/// The range of a level, or that of practice.
fn range(levels: [[f64; 2]; 3], easy: [f64; 2], level: Option<u32>) -> [f64; 2] {
    level.map_or(easy, |level| levels[level as usize % levels.len()])
}

fn nearer(dice: &mut Dice, level: Option<u32>) -> Option<Made> {
    let space = dice.furnished();
    let [near, far] = space.depths_mm();
    let [low, high] = range(NEARER, NEARER_EASY, level);
    let is_left = dice.coin();
    let seen: Vec<(DVec2, Hit)> = (0..250).filter_map(|_| dice.seen(&space)).collect();
    let share = |left: &Hit, right: &Hit| {
        (right.depth_mm - left.depth_mm) / (far - near) * if is_left { 1.0 } else { -1.0 }
    };
    let pairs: Vec<[Hit; 2]> = seen
        .iter()
        .flat_map(|left| seen.iter().map(move |right| [left, right]))
        .filter(|[(a, left), (b, right)]| {
            b.x - a.x > APART && left.solid != right.solid && (low..high).contains(&share(left, right))
        })
        .map(|pair| pair.map(|(_, hit)| *hit))
        .collect();
    let [left, right] = *pairs.get(dice.below(pairs.len()))?;
    let truth = Truth::Is(if is_left { Answer::Left } else { Answer::Right });
    let difference = share(&left, &right);
    Some(Made { space, marks: vec![left.point, right.point], truth, difference })
}

fn depth(dice: &mut Dice, level: Option<u32>) -> Option<Made> {
    let space = dice.furnished();
    let [near, far] = space.depths_mm();
    let [low, high] = range(DEPTH, [0.0, 1.0], level);
    let target = dice.within([low, high]);
    let seen: Vec<Hit> = (0..250).filter_map(|_| Some(dice.seen(&space)?.1)).collect();
    let share = |hit: &Hit| (hit.depth_mm - near) / (far - near);
    let off = |hit: &&Hit| (share(hit) - target).abs();
    let hit = seen.iter().filter(|hit| off(hit) < 0.03).min_by(|a, b| off(a).total_cmp(&off(b)))?;
    let percent = 100.0 * share(hit).clamp(0.0, 1.0);
    Some(Made { marks: vec![hit.point], truth: Truth::Percent(percent), difference: 0.0, space })
}

fn larger(dice: &mut Dice, level: Option<u32>) -> Option<Made> {
    let ratio = dice.within(range(LARGER, LARGER_EASY, level));
    let is_left = dice.coin();
    let small_mm = dice.within([5.5, 7.0]);
    let radii = |is_large: bool| small_mm * if is_large { ratio.cbrt() } else { 1.0 };
    let mut space = dice.space();
    space.solids.push((0, dice.wall()));
    let compared = [(-1.0, is_left), (1.0, !is_left)].map(|(side, is_large)| {
        let stretch = DVec3::new(dice.within([0.75, 1.35]), dice.within([0.75, 1.35]), 1.0);
        let radii_mm = stretch * (radii(is_large) / stretch.element_product().cbrt());
        let center = DVec3::new(
            side * dice.within([14.0, 24.0]),
            dice.within([-18.0, 18.0]),
            dice.within([-18.0, 26.0]),
        );
        Solid::Ellipsoid { center, axes: DMat3::from_quat(dice.rotation()), radii_mm }
    });
    let balls = compared.each_ref().map(Solid::ball);
    // Without a difference of depth, size in the picture would tell.
    if (balls[0].0.z - balls[1].0.z).abs() < 14.0 {
        return None;
    }
    for (n, solid) in compared.into_iter().enumerate() {
        space.solids.push((n + 1, solid));
    }
    let mut others = 0;
    for _ in 0..40 {
        let solid = dice.solid();
        let (center, radius) = solid.ball();
        if others < 5 && balls.iter().all(|(c, r)| c.distance(center) > radius + r + 1.0) {
            space.solids.push((0, solid));
            others += 1;
        }
    }
    let volume = |solid: usize| space.solids[solid].1.volume_mm3();
    let difference = (volume(1) / volume(2)).max(volume(2) / volume(1));
    let marks: Vec<DVec3> = [1, 2]
        .into_iter()
        .map(|solid| {
            let hit = clear(&space, space.place(balls[solid - 1].0))?;
            (hit.solid == solid && space.visible_share(solid) > 0.92).then_some(hit.point)
        })
        .collect::<Option<_>>()?;
    let truth = Truth::Is(if volume(1) > volume(2) { Answer::Left } else { Answer::Right });
    Some(Made { space, marks, truth, difference })
}

fn shape(dice: &mut Dice, level: Option<u32>, number: u32) -> Option<Made> {
    // In practice each is seen in turn.
    let shapes = [Answer::Bulge, Answer::Hollow, Answer::Saddle];
    let wanted = shapes[if level.is_none() { number as usize % 3 } else { dice.below(3) }];
    let [low, high] = range(CURVED, CURVED_EASY, level);
    let mut space = dice.space();
    let axes = dice.tilt(20.0);
    let hills = dice.hills(18, 46.0, [6.0, 9.5], [4.0, 10.0]);
    let sheet = Sheet::new(DVec3::ZERO, axes, [50.0, 4.0], hills);
    space.solids.push((0, Solid::Sheet(sheet.clone())));
    let mut places = Vec::new();
    for _ in 0..500 {
        let at = dice.in_disc(36.0);
        let [k1, k2] = sheet.curvatures(at);
        let curvedness = ((k1 * k1 + k2 * k2) / 2.0).sqrt();
        let index = std::f64::consts::FRAC_2_PI * (k1 + k2).atan2(k1 - k2);
        let is_wanted = match wanted {
            Answer::Bulge => index > DOMED,
            Answer::Hollow => index < -DOMED,
            _ => index.abs() < SADDLED,
        };
        if !is_wanted || !(low..high).contains(&curvedness) {
            continue;
        }
        let point = sheet.surface(at);
        if let Some(hit) = clear(&space, space.place(point)).filter(|hit| hit.point.distance(point) < 0.01) {
            places.push((hit.point, curvedness));
        }
    }
    let (point, difference) = *places.get(dice.below(places.len()))?;
    Some(Made { space, marks: vec![point], truth: Truth::Is(wanted), difference })
}

/// The space of a task: `level` of difficulty, `None` for practice. The first of many arrangements that fits; `None` if none does.
pub(super) fn make(task: Task, seed: u64, number: u32, level: Option<u32>) -> Option<Made> {
    let arrange = |attempt: u64| {
        let stream = attempt << 40 | u64::from(number) << 8 | 0x80 | task as u64;
        let dice = &mut Dice(Random::new(seed, stream));
        match task {
            Task::Nearer => nearer(dice, level),
            Task::Depth => depth(dice, level),
            Task::Larger => larger(dice, level),
            Task::Shape => shape(dice, level, number),
            Task::Preference => Some(Made {
                space: dice.furnished(),
                marks: Vec::new(),
                truth: Truth::Taste,
                difference: 0.0,
            }),
        }
    };
    (0..400).find_map(arrange)
}
