//! The order against what it promises, counted; scenes against brute force: steps along lines of sight, counted voxels, differences.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat3, DVec2, DVec3};
use strum::VariantArray;

use super::{
    Answer, Design, Record, Scene, Score, Task, Trial, Truth,
    sheet::{Hill, Sheet},
    solid::Solid,
};
use crate::{optics::Ray, study::records};

fn design(participant: u32, lights: usize) -> Design {
    Design { seed: 5, participant, tasks: Task::VARIANTS.to_vec(), lights, repeats: 6, practice: 2 }
}

fn counted(design: &Design, task: Task) -> Vec<Trial> {
    design.trials().into_iter().filter(|trial| trial.task == task && !trial.practice).collect()
}

#[test]
fn every_light_is_seen_equally_often_and_no_scene_twice() {
    for lights in [2, 4, 5] {
        for participant in [1, 2, 77] {
            let design = design(participant, lights);
            let trials = design.trials();
            for &task in Task::VARIANTS {
                let of: Vec<&Trial> = trials.iter().filter(|trial| trial.task == task).collect();
                let first = of.iter().take_while(|trial| trial.practice).count();
                assert_eq!(first, 2, "practice comes first, and nowhere else");
                assert!(of[2..].iter().all(|trial| !trial.practice));
                let scenes: BTreeSet<u32> = of.iter().map(|trial| trial.scene).collect();
                assert_eq!(scenes.len(), of.len());
                let mut seen = BTreeMap::<usize, usize>::new();
                for trial in counted(&design, task) {
                    for light in [Some(trial.light), trial.other].into_iter().flatten() {
                        *seen.entry(light).or_default() += 1;
                    }
                }
                let times = if task == Task::Preference { 2 * (lights - 1) } else { 6 };
                assert_eq!(seen, (0..lights).map(|light| (light, times)).collect());
            }
        }
    }
}

#[test]
fn every_scene_has_each_light_once_over_as_many_participants() {
    let mut seen = BTreeMap::<u32, BTreeSet<usize>>::new();
    for participant in 11..16 {
        for trial in counted(&design(participant, 5), Task::Nearer) {
            assert!(seen.entry(trial.scene).or_default().insert(trial.light), "{trial:?} again");
        }
    }
    assert_eq!(seen.len(), 30);
    assert!(seen.values().all(|lights| lights.len() == 5));
}

/// Within a group each light once; over a whole square each light follows every other one equally often, and is at each place equally
/// often.
#[test]
fn order_within_groups_is_balanced() {
    for lights in [4, 5] {
        let (mut after, mut places) = (BTreeMap::new(), BTreeMap::new());
        // 10 rows of 5, 4 of 4: five participants of six groups are 30 rows, and two are 12.
        for participant in 0..if lights == 5 { 5 } else { 2 } {
            let trials = counted(&design(participant, lights), Task::Larger);
            for group in trials.chunks(lights) {
                let of: Vec<usize> = group.iter().map(|trial| trial.light).collect();
                assert_eq!(of.iter().collect::<BTreeSet<_>>().len(), lights);
                let levels: BTreeSet<u32> = group.iter().map(|trial| trial.level(lights)).collect();
                assert_eq!(levels.len(), 1, "equally difficult");
                of.windows(2).for_each(|pair| *after.entry([pair[0], pair[1]]).or_insert(0) += 1);
                of.iter().enumerate().for_each(|(at, light)| *places.entry((at, *light)).or_insert(0) += 1);
            }
        }
        assert_eq!(after.len(), lights * (lights - 1));
        assert_eq!(after.values().collect::<BTreeSet<_>>().len(), 1, "{after:?}");
        assert_eq!(places.len(), lights * lights);
        assert_eq!(places.values().collect::<BTreeSet<_>>().len(), 1, "{places:?}");
    }
}

#[test]
fn pairs_of_lights_are_each_seen_on_both_sides() {
    let pairs: BTreeSet<(usize, Option<usize>)> =
        counted(&design(3, 4), Task::Preference).iter().map(|trial| (trial.light, trial.other)).collect();
    assert_eq!(pairs.len(), 12);
    assert!(pairs.iter().all(|(a, b)| Some(*a) != *b));
}

#[test]
fn the_same_seed_and_number_give_the_same_trials_and_another_participant_others() {
    assert_eq!(design(1, 5).trials(), design(1, 5).trials());
    assert_ne!(design(1, 5).trials(), design(2, 5).trials());
}

/// Where a ray enters, by small steps.
fn stepped(solid: &Solid, ray: &Ray, step: f64) -> Option<f64> {
    (0..(400.0 / step) as usize)
        .map(|n| n as f64 * step)
        .find(|t| solid.contains(ray.origin_mm + ray.direction * *t))
}

fn trial(task: Task, scene: u32, practice: bool) -> Trial {
    Trial { task, number: 1, practice, light: 0, other: None, scene }
}

fn scenes(task: Task) -> Vec<(Scene, u32)> {
    [0, 6, 12, 19].iter().map(|n| (Scene::of(&trial(task, *n, false), 3, 5).unwrap(), n / 5 % 3)).collect()
}

/// The depth of what a line of sight meets first, found by steps through all solids.
fn stepped_depth(scene: &Scene, at: DVec2) -> Option<f64> {
    let space = scene.space();
    let ray = space.sight(at);
    let t = space.solids.iter().filter_map(|(_, solid)| stepped(solid, &ray, 0.02)).min_by(f64::total_cmp)?;
    Some(space.camera.distance_mm() - (ray.origin_mm + ray.direction * t).z)
}

#[test]
fn marked_points_are_seen_where_the_marks_are_and_as_deep_as_stated() {
    for task in [Task::Nearer, Task::Depth, Task::Larger, Task::Shape] {
        for (scene, level) in scenes(task) {
            let [near, far] = scene.depths_mm();
            let depths: Vec<f64> =
                scene.marks.iter().map(|mark| stepped_depth(&scene, mark.at).unwrap()).collect();
            for (mark, depth) in scene.marks.iter().zip(&depths) {
                let back = scene.camera().axes()[2];
                let of_point = scene.camera().distance_mm() - mark.world_mm.dot(back);
                assert!((of_point - depth).abs() < 0.05, "{task}: {of_point} {depth}");
                assert!((0.05..0.95).contains(&mark.at.x) && (0.05..0.95).contains(&mark.at.y));
                assert!(*depth > near - 0.5 && *depth < far + 0.5);
            }
            match (task, scene.truth) {
                (Task::Nearer, Truth::Is(answer)) => {
                    let [left, right] = depths[..] else { panic!("two marks") };
                    assert_eq!(answer, if left < right { Answer::Left } else { Answer::Right });
                    let share = (left - right).abs() / (far - near);
                    assert!((share - scene.difference).abs() < 1e-3);
                    let [low, high] = [[0.18, 0.3], [0.1, 0.18], [0.05, 0.1]][level as usize];
                    assert!(share > low - 1e-3 && share < high + 1e-3);
                    assert!(scene.marks[1].at.x - scene.marks[0].at.x > 0.2);
                }
                (Task::Depth, Truth::Percent(percent)) => {
                    assert!((percent / 100.0 - (depths[0] - near) / (far - near)).abs() < 1e-3);
                }
                (Task::Larger | Task::Shape, Truth::Is(_)) => {}
                other => panic!("{other:?}"),
            }
        }
    }
}

#[test]
fn the_larger_structure_has_more_voxels() {
    for (scene, _) in scenes(Task::Larger) {
        let regions = scene.regions().unwrap();
        let mut voxels = [0_u64; 4];
        for linear in 0..regions.grid().voxel_count() {
            match regions.bits_of_id()[regions.id(linear) as usize] {
                0 => {}
                bits => {
                    assert_eq!(bits.count_ones(), 1, "structures don't overlap");
                    voxels[bits.trailing_zeros() as usize] += 1;
                }
            }
        }
        let [_, left, right, _] = voxels.map(|n| n as f64);
        assert_eq!(scene.truth, Truth::Is(if left > right { Answer::Left } else { Answer::Right }));
        let ratio = (left / right).max(right / left);
        assert!((ratio / scene.difference - 1.0).abs() < 0.01, "{ratio} {}", scene.difference);
    }
}

/// Shape by brute force: depths about the mark along the sheet's normal, in eight directions.
#[test]
fn the_marked_shape_is_that_of_the_surface() {
    let mut kinds = BTreeSet::new();
    for n in 0..12 {
        let scene = Scene::of(&trial(Task::Shape, n, false), 8, 5).unwrap();
        let Solid::Sheet(sheet) = &scene.space().solids[0].1 else { panic!("a sheet") };
        let to_camera = scene.camera().world_from_camera.inverse();
        let at = sheet.local(to_camera * scene.marks[0].world_mm).truncate();
        let height = |at: DVec2| sheet.local(sheet.surface(at)).z;
        // Bends of the height itself: their signs are those of the curvatures.
        let bend = |k: usize| {
            let d = DVec2::from_angle(k as f64 * std::f64::consts::PI / 16.0) * 0.1;
            (height(at + d) + height(at - d) - 2.0 * height(at)) / 0.01
        };
        let bends: Vec<f64> = (0..16).map(bend).collect();
        let (up, down) = (bends.iter().any(|b| *b > 1e-3), bends.iter().any(|b| *b < -1e-3));
        let expected = match (up, down) {
            (true, false) => Answer::Hollow,
            (false, true) => Answer::Bulge,
            _ => Answer::Saddle,
        };
        assert_eq!(scene.truth, Truth::Is(expected), "{n}: {bends:?}");
        kinds.insert(format!("{:?}", scene.truth));
    }
    assert_eq!(kinds.len(), 3);
}

#[test]
fn curvatures_are_the_changes_of_the_normal() {
    let hill = |x, y, width_mm, height_mm| Hill { center: DVec2::new(x, y), width_mm, height_mm };
    let sheet =
        |hills| Sheet::new(DVec3::new(1.0, 2.0, 3.0), DMat3::from_rotation_x(0.3), [50.0, 3.0], hills);
    // On top of a hill both are height / width².
    let [a, b] = sheet(vec![hill(4.0, 5.0, 6.0, 9.0)]).curvatures(DVec2::new(4.0, 5.0));
    assert!((a - 0.25).abs() < 1e-9 && (b - 0.25).abs() < 1e-9, "{a} {b}");
    let wavy = sheet(vec![hill(0.0, 0.0, 8.0, 6.0), hill(7.0, 3.0, 9.0, -5.0), hill(-5.0, 9.0, 7.0, 4.0)]);
    let at = DVec2::new(3.0, 4.0);
    let point = |p: DVec2| wavy.local(wavy.surface(p));
    let h = 1e-4;
    let tangents = |p: DVec2| [DVec2::X, DVec2::Y].map(|d| (point(p + d * h) - point(p - d * h)) / (2.0 * h));
    let normal = |p: DVec2| {
        let [u, v] = tangents(p);
        let n = u.cross(v);
        n / n.length()
    };
    let [u, v] = tangents(at);
    let [nu, nv] = [DVec2::X, DVec2::Y].map(|d| (normal(at + d * h) - normal(at - d * h)) / (2.0 * h));
    let (e, f, g) = (u.dot(u), u.dot(v), v.dot(v));
    let (l, m, n) = (nu.dot(u), nu.dot(v), nv.dot(v));
    let mean = (l * g - 2.0 * m * f + n * e) / (2.0 * (e * g - f * f));
    let gauss = (l * n - m * m) / (e * g - f * f);
    let [k1, k2] = wavy.curvatures(at);
    assert!(
        ((k1 + k2) / 2.0 - mean).abs() < 1e-5 && (k1 * k2 - gauss).abs() < 1e-5,
        "{k1} {k2} {mean} {gauss}"
    );
}

#[test]
fn rays_enter_solids_where_small_steps_do() {
    let rod =
        Solid::Capsule { from: DVec3::new(-9.0, 2.0, 1.0), to: DVec3::new(8.0, -3.0, 6.0), radius_mm: 4.0 };
    let egg = Solid::Ellipsoid {
        center: DVec3::new(2.0, 1.0, -3.0),
        axes: DMat3::from_rotation_y(0.7),
        radii_mm: DVec3::new(9.0, 4.0, 6.0),
    };
    let mut met = [0, 0];
    for n in 0..200 {
        let target =
            DVec3::new(f64::from(n % 20) - 9.5, f64::from(n / 20) * 2.0 - 9.0, f64::from(n % 7) - 3.0);
        let origin_mm = DVec3::new(f64::from(n % 13) * 5.0 - 30.0, 10.0, 60.0);
        let to = target - origin_mm;
        let ray = Ray { origin_mm, direction: to / to.length() };
        for (k, solid) in [&rod, &egg].into_iter().enumerate() {
            let (found, expected) = (solid.enter(&ray, f64::INFINITY), stepped(solid, &ray, 0.01));
            match (found, expected) {
                (Some(found), Some(expected)) => {
                    met[k] += 1;
                    assert!((found - expected).abs() < 0.011, "{found} {expected}");
                }
                // Steps may jump over a tip.
                (Some(found), None) => {
                    assert!(!solid.contains(ray.origin_mm + ray.direction * (found + 0.05)));
                }
                (None, None) => {}
                (None, Some(_)) => panic!("a ray that misses is inside"),
            }
        }
    }
    assert!(met.iter().all(|met| *met > 30), "{met:?}");
    let along = Ray { origin_mm: DVec3::new(-30.0, 0.0, 0.0), direction: DVec3::X };
    let rod = Solid::Capsule { from: DVec3::ZERO, to: DVec3::X * 5.0, radius_mm: 2.0 };
    assert_eq!(rod.enter(&along, f64::INFINITY), Some(28.0), "along the axis");
}

#[test]
fn practice_is_easy_and_goes_through_the_shapes() {
    let of = |task, n: u32| Scene::of(&trial(task, 1_000_000 + n, true), 3, 5).unwrap();
    assert!(of(Task::Nearer, 0).difference >= 0.35);
    assert!(of(Task::Larger, 0).difference >= 3.4);
    let shapes: BTreeSet<String> = (0..3).map(|n| of(Task::Shape, n).truth.text()).collect();
    assert_eq!(shapes.len(), 3);
}

#[test]
fn sides_are_right_about_equally_often() {
    let left = |task| {
        let is_left =
            |n: &u32| Scene::of(&trial(task, *n, false), 21, 5).unwrap().truth == Truth::Is(Answer::Left);
        (0..24).filter(is_left).count()
    };
    // Of 24 fair coins fewer than 4 or more than 20 are left in one of 3,500 cases.
    for task in [Task::Nearer, Task::Larger] {
        assert!((4..=20).contains(&left(task)), "{task}: {}", left(task));
    }
}

fn record(task: Task, answer: Answer, score: Score) -> Record {
    Record {
        participant: 7,
        seed: u64::MAX,
        program: "0.1.0".into(),
        task,
        trial: 3,
        practice: false,
        light: "traced".into(),
        other_light: if task == Task::Preference { "cones".into() } else { String::new() },
        scene: 12,
        difference: 0.25,
        truth: "left".into(),
        answer,
        score,
        time_s: 1.25,
    }
}

#[test]
fn records_survive_the_file() {
    let all = vec![
        record(Task::Nearer, Answer::Left, Score::Correct(true)),
        record(Task::Depth, Answer::Percent(40), Score::Error(2.5)),
        record(Task::Shape, Answer::Saddle, Score::Correct(false)),
        record(Task::Preference, Answer::Right, Score::Taste),
    ];
    let mut table = crate::csv::Table::new(super::COLUMNS);
    all.iter().for_each(|record| table.row(record.fields()));
    let text = String::from_utf8(table.into_bytes()).unwrap();
    assert_eq!(records(&text).unwrap(), all);
    assert_eq!(records(&format!("\u{feff}{text}")).unwrap(), all, "with a byte order mark");
}

#[test]
fn what_is_no_record_is_named_with_its_line() {
    let mut table = crate::csv::Table::new(super::COLUMNS);
    table.row(record(Task::Nearer, Answer::Left, Score::Correct(true)).fields());
    let good = String::from_utf8(table.into_bytes()).unwrap();
    let wrong = |from: &str, to: &str| records(&good.replacen(from, to, 1)).unwrap_err().0;
    assert_eq!(wrong(",left,left,", ",left,40,"), "\"40\" as answer in line 2");
    assert_eq!(wrong("1.250", "NaN"), "\"NaN\" as time_s in line 2");
    assert_eq!(wrong("1.250", "-1"), "\"-1\" as time_s in line 2");
    assert_eq!(wrong("nearer", "nearest"), "\"nearest\" as task in line 2");
    assert_eq!(wrong(",traced,,", ",traced,cones,"), "\"cones\" as other_light in line 2");
    assert_eq!(wrong("participant", "who"), "another first line");
    assert!(records("").is_err());
    // A row that ends early, as no file of ours does.
    let cut = good.trim_end().rsplit_once(',').unwrap().0;
    assert_eq!(records(cut).unwrap_err().0, "\"\" as time_s in line 2");
}

#[test]
fn answers_are_scored() {
    assert_eq!(Truth::Is(Answer::Left).score(Answer::Right), Score::Correct(false));
    assert_eq!(Truth::Percent(30.0).score(Answer::Percent(42)), Score::Error(12.0));
    assert_eq!(Truth::Taste.score(Answer::Left), Score::Taste);
    for text in ["101", "-1", "up", ""] {
        assert_eq!(Answer::of_text(text), None);
    }
}
