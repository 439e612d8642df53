//! Arrows as opaque geometry with directional occlusion.

use glioscope_core::optics::Sight;

use super::{plans::with_image, *};
use crate::{
    light::{
        cones::SOLID_CONES,
        slices::{self, plan::SlicePlan, twin},
        suite::visible_depths_mm,
        vicinity::VICINITY,
    },
    scene::{LightSettings, LightingMode, MutualOcclusion, SliceVariant},
};

const SIZE: [u32; 2] = [80, 72];
const PIXELS: usize = 80 * 72;
const LIT: [LightingMode; 2] = [LightingMode::Slices, LightingMode::Cones];

/// Fixed settings: presets change with measurements, and counts of darker pixels would change with them.
fn lit(mode: LightingMode) -> Quality {
    let lighting = LightSettings {
        mode,
        slice_grid: 5,
        reference_mm: 5.0,
        sub_cones: 8,
        cell_mm: 4.0,
        ..LightSettings::DEFAULT
    };
    Quality { lighting, ..Quality::FULL }
}

/// Some arrows of a ball that grew, with `masks` drawn in place of the ball.
fn arrows_on(masks: [&MaskBits; 2]) -> ChangeScene {
    let grid = cubic(34);
    let center = DVec3::splat(16.0);
    let mut change = changed(&grid, [&mask(&grid, ball(center, 8.0)), &mask(&grid, ball(center, 12.0))]);
    change.vectors = change.vectors.into_iter().step_by(9).collect();
    let mut s = scene(Arc::new(ChangeSurface::new(masks[0], masks[1], &grid, Arc::new(change)).unwrap()));
    s.look = ChangeLook { style: ChangeStyle::Arrows, ..s.look };
    s.camera.height_mm = 44.0;
    s
}

fn arrows() -> ChangeScene {
    let (grid, center) = (cubic(34), DVec3::splat(16.0));
    arrows_on([&mask(&grid, ball(center, 8.0)), &mask(&grid, ball(center, 12.0))])
}

struct Found {
    rgba: Vec<u8>,
    depths: Vec<f32>,
    /// Number of the arrow in front, its depth.
    tops: Vec<(u32, f32)>,
}

impl Found {
    fn brightness(&self, i: usize) -> u32 {
        self.rgba[4 * i..4 * i + 3].iter().map(|&c| u32::from(c)).sum()
    }
}

fn found(bench: &mut Bench, scene: &ChangeScene, quality: &Quality, plan: Plan) -> Found {
    let Bench { gpu, renderer } = bench;
    let frame = renderer.render_planned(gpu, scene, quality, SIZE, plan, Switches::ON).unwrap().clone();
    let n = PIXELS as u64;
    let parts =
        gpu.read_buffers(&[(&frame.targets.depths, 0, n * 4), (&frame.data.own.tops, 0, n * 8)]).unwrap();
    let tops: Vec<[u32; 2]> = bytemuck::pod_collect_to_vec(&parts[1]);
    Found {
        rgba: frame.read_rgba(gpu).unwrap(),
        depths: bytemuck::pod_collect_to_vec(&parts[0]),
        tops: tops.iter().map(|t| (t[0], f32::from_bits(t[1]))).collect(),
    }
}

fn without(plan: &Plan, pass: PassName) -> Plan {
    let mut plan = plan.clone();
    plan.passes.retain(|p| *p != pass);
    plan
}

/// Depths of opaque geometry, and depths at which rays through the image end.
fn opaque_depths(bench: &Bench) -> [Vec<f32>; 2] {
    let buffer = &bench.renderer.view.opaque_targets.as_ref().unwrap().depths;
    let read = bench.gpu.read_buffers(&[(buffer, 0, buffer.size())]).unwrap().remove(0);
    let both: Vec<f32> = bytemuck::pod_collect_to_vec(&read);
    let (opaque, ends) = both.split_at(PIXELS);
    [opaque.to_vec(), ends.to_vec()]
}

fn eye(bench: &Bench) -> Vec<[f32; 4]> {
    let buffer = bench.renderer.lights().probe().eye.unwrap();
    bytemuck::pod_collect_to_vec(&bench.gpu.read_buffers(&[(buffer, 0, buffer.size())]).unwrap()[0])
}

#[test]
fn the_surface_beside_an_arrow_is_darker() {
    let mut bench = bench();
    let s = arrows();
    for mode in LIT {
        let quality = lit(mode);
        let plan = change_plan(&s, &quality);
        assert!(plan.has(ARROWS_MERGE), "{plan:?}");
        let with = found(&mut bench, &s, &quality, plan.clone());
        let [opaque, ends] = opaque_depths(&bench);
        let off = found(&mut bench, &s, &quality, without(&plan, ARROWS_MERGE));
        assert!(bench.renderer.view.opaque_targets.is_none());
        let (mut beside, mut darker, mut brighter, mut on_arrows, mut dark_arrows) = (0, 0, 0, 0, 0);
        for i in 0..PIXELS {
            let (number, depth) = with.tops[i];
            assert_eq!(with.tops[i], off.tops[i]);
            assert_eq!(opaque[i], if number > 0 { depth } else { with.depths[i] });
            assert_eq!(ends[i], with.depths[i]);
            let (a, b) = (with.brightness(i), off.brightness(i));
            if number > 0 {
                on_arrows += 1;
                dark_arrows += u32::from(a < b);
            } else if with.depths[i] < FAR {
                // A cell of the layers has several pixels: an arrow before part of it hides surfaces that darken the rest.
                assert!(a <= b + 3, "{mode:?} {i}: an arrow makes it brighter, {a} {b}");
                brighter += u32::from(a > b);
                beside += 1;
                darker += u32::from(a + 9 < b);
            } else {
                assert_eq!(a, b, "the background");
            }
        }
        println!("{mode:?}: {darker} of {beside} darker; of {on_arrows} of arrows {dark_arrows}");
        assert!(beside > 300 && darker * 10 > beside, "{mode:?}: {darker} of {beside}");
        assert!(brighter * 100 < beside, "{mode:?}: {brighter} of {beside} are brighter");
        assert!(on_arrows > 300 && dark_arrows * 10 > on_arrows, "{mode:?}: {dark_arrows} of {on_arrows}");
    }
}

#[test]
fn an_arrow_behind_a_dense_image_is_darker() {
    let mut bench = bench();
    let alone = arrows();
    let s = with_image(alone.clone());
    for mode in LIT {
        let quality = lit(mode);
        let plain = found(&mut bench, &alone, &quality, change_plan(&alone, &quality));
        let behind = found(&mut bench, &s, &quality, change_plan(&s, &quality));
        let (mut count, mut before, mut after) = (0, 0, 0);
        // Arrows in front of the surface: no image is visible beside them in the same pixel.
        for i in (0..PIXELS).filter(|&i| plain.tops[i].0 > 0 && plain.depths[i] < FAR) {
            let (a, b) = (plain.brightness(i), behind.brightness(i));
            assert!(b <= a, "{mode:?} {i}: {b} {a}");
            count += 1;
            before += a;
            after += b;
        }
        println!("{mode:?}: {count} pixels, {before} {after}");
        assert!(count > 100 && f64::from(after) < 0.95 * f64::from(before), "{mode:?}: {before} {after}");
    }
}

/// Arrows darken the image behind them, but don't hide it beside them in the same pixel.
#[test]
fn an_arrow_darkens_the_image_and_hides_none_of_it_beside_itself() {
    let mut bench = bench();
    let s = with_image(arrows());
    let quality = lit(LightingMode::Slices);
    let plan = change_plan(&s, &quality);
    let [with, off] = [plan.clone(), without(&plan, ARROWS_MERGE)].map(|plan| {
        let found = found(&mut bench, &s, &quality, plan);
        (found, eye(&bench))
    });
    let (mut in_front, mut darker) = (0, 0);
    for i in 0..PIXELS {
        let (a, b) = (with.1[i], off.1[i]);
        assert!((a[3] - b[3]).abs() < 1e-5, "{i}: {a:?} {b:?}");
        assert!((0..3).all(|c| a[c] <= b[c] + 1e-5), "{i}: {a:?} {b:?}");
        in_front += u32::from(with.0.tops[i].0 > 0 && b[3] < 0.5);
        darker += u32::from(a[0] < 0.9 * b[0] - 1e-3);
    }
    println!("{in_front} pixels of arrows in front of the image, {darker} darker");
    assert!(in_front > 100 && darker > 30, "{in_front} {darker}");
}

#[test]
fn slices_beside_arrows_match_their_twin() {
    let mut bench = bench();
    let s = with_image(arrows());
    let around = s.context_scene();
    let sight = Sight::new(&s.camera, SIZE);
    for variant in [SliceVariant::PaperApproximate, SliceVariant::Mended] {
        for mutual in
            [MutualOcclusion::ALL, MutualOcclusion { opaque_on_image: false, ..MutualOcclusion::ALL }]
        {
            let lighting =
                LightSettings { mode: LightingMode::Slices, variant, mutual, ..LightSettings::DEFAULT };
            let quality = Quality { lighting, ..Quality::FULL };
            found(&mut bench, &s, &quality, change_plan(&s, &quality));
            let settings = slices::slice_settings(&lighting, &s.camera);
            let occupied = visible_depths_mm(&around, &sight);
            let whole = Some((occupied[0].0, occupied.last().unwrap().1));
            let plan = SlicePlan::new(&settings, &sight, whole, &occupied);
            let depths = opaque_depths(&bench).map(|depths| {
                let from_eye = |d: &f32| f64::from(*d) + around.reference_mm();
                depths.iter().map(|d| if *d < FAR { from_eye(d) } else { f64::INFINITY }).collect::<Vec<_>>()
            });
            let both = [&depths[0][..], &depths[1][..]];
            let strength = quality.occlusion_strength;
            let twin = twin::slices_with_ray_ends(&around, &sight, &plan, both, &mutual, strength);
            let (mut worst, mut apart) = (0.0_f64, 0);
            for ((eye, twin), ends) in eye(&bench).iter().zip(&twin).zip(depths[0].iter().zip(&depths[1])) {
                let expected = twin.eye.radiance.extend(twin.eye.transmittance);
                worst = (0..4).fold(worst, |w, c| w.max((f64::from(eye[c]) - expected[c]).abs()));
                apart += usize::from(ends.0 < ends.1 && ends.1.is_infinite() && twin.eye.transmittance < 0.8);
            }
            println!("{variant:?} {}: {worst:.1e}, {apart} apart", mutual.opaque_on_image);
            assert!(apart > 30 && worst <= 1e-3, "{variant:?}: {worst} {apart}");
        }
    }
}

#[test]
fn arrows_are_merged_only_if_light_passes_need_it() {
    let s = arrows();
    let with = with_image(s.clone());
    let look = |look: ChangeLook| ChangeScene { look, ..with.clone() };
    let long = look(ChangeLook { threshold_mm: 99.0, ..s.look });
    let height = look(ChangeLook { style: ChangeStyle::Height, ..s.look });
    let grid = cubic(34);
    let still = ball(DVec3::splat(16.0), 8.0);
    let same = ChangeScene { surface: Some(surface(&grid, &still, &still)), ..with.clone() };
    let reason = |s: &ChangeScene, q: &Quality, pass| {
        change_plan(s, q).omitted.iter().find(|o| o.0 == pass).map(|o| o.1)
    };
    let screen = change_plan(&with, &Quality::FULL);
    assert!(screen.has(ARROWS) && !screen.has(ARROWS_MERGE));
    assert!(screen.omitted.iter().all(|o| o.0 != ARROWS_MERGE), "another mode's pass, not an omitted one");
    let mut bench = bench();
    for mode in LIT {
        let quality = lit(mode);
        let flat = Quality { occlusion_strength: 0.0, ..quality };
        for (scene, quality, expected) in [
            (&long, &quality, "every arrow is shorter than the threshold"),
            (&height, &quality, "style is height map"),
            (&same, &quality, "no change"),
            (&with, &flat, "occlusion strength is 0"),
        ] {
            assert_eq!(reason(scene, quality, ARROWS_MERGE), Some(expected));
            let lean = change_plan(scene, quality);
            let mut all = lean.clone();
            all.passes.extend([ARROWS, ARROWS_MERGE].iter().filter(|p| !lean.has(**p)));
            let lean = found(&mut bench, scene, quality, lean);
            // Fill every buffer with arrows first.
            found(&mut bench, &with, &lit(mode), change_plan(&with, &lit(mode)));
            let all = found(&mut bench, scene, quality, all);
            assert!(lean.rgba == all.rgba, "{mode:?}: {expected}");
        }
        // No part of the surface is opaque, but the arrows are.
        let halves = [|v: DVec3| v.z < 16.0, |v: DVec3| v.z >= 16.0]
            .map(|half| mask(&grid, move |v| half(v) && ball(DVec3::splat(16.0), 12.0)(v)));
        let apart = arrows_on([&halves[0], &halves[1]]);
        let plan = change_plan(&apart, &quality);
        assert!(!plan.has(SURFACE) && plan.has(ARROWS) && plan.has(ARROWS_MERGE), "{plan:?}");
        assert!(plan.has(if mode == LightingMode::Cones { SOLID_CONES } else { VICINITY }));
        // Leaves the depths of a surface in the buffer.
        found(&mut bench, &with, &quality, change_plan(&with, &quality));
        let drawn = found(&mut bench, &apart, &quality, plan.clone());
        assert!(drawn.depths.iter().all(|d| *d >= FAR));
        let off = found(&mut bench, &apart, &quality, without(&plan, ARROWS_MERGE));
        let on = |i: &usize| drawn.tops[*i].0 > 0;
        let darker = |i: &usize| drawn.brightness(*i) < off.brightness(*i);
        assert!((0..PIXELS).filter(on).filter(darker).count() > 10);
    }
    // Not where no light pass would read it.
    let mutual = MutualOcclusion {
        opaque_on_image: false,
        opaque_on_opaque: false,
        image_on_opaque: false,
        ..MutualOcclusion::ALL
    };
    let quality =
        Quality { lighting: LightSettings { mutual, ..lit(LightingMode::Slices).lighting }, ..Quality::FULL };
    assert_eq!(reason(&with, &quality, ARROWS_MERGE), Some("nothing darkens opaque surfaces"));
    let every = every_pass(LightingMode::Slices).passes;
    let plan = change_plan(&with, &quality);
    // And the outline of the earlier date, which isn't among them.
    assert_eq!(plan.passes.len() + plan.omitted.len(), every.len() + 2);
}

/// A frame drawn in parts equals one drawn at once; the previous frame stays until then.
#[test]
fn a_change_view_can_be_drawn_in_parts() {
    let Bench { gpu, renderer } = &mut *bench();
    let scene = with_image(arrows());
    let quality = lit(LightingMode::Slices);
    let expected = renderer.render(gpu, &scene, &quality, SIZE).unwrap().read_rgba(gpu).unwrap();
    let mut other = scene.clone();
    other.camera.height_mm *= 1.4;
    let before = renderer.render(gpu, &other, &quality, SIZE).unwrap().read_rgba(gpu).unwrap();
    assert!(before != expected);
    renderer.begin(gpu, &scene, &quality, SIZE).unwrap();
    let mut parts = 0;
    while !renderer.resume(gpu, 0.0).unwrap() {
        parts += 1;
        let share = renderer.share_done().unwrap();
        assert!(share > 0.0 && share < 1.0);
        assert!(renderer.frame().unwrap().read_rgba(gpu).unwrap() == before, "part {parts}");
    }
    assert!(parts > 10, "{parts}");
    assert_eq!(renderer.share_done(), None);
    assert!(renderer.frame().unwrap().read_rgba(gpu).unwrap() == expected);
}
