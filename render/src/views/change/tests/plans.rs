//! Plans, clipping, hiding, invalid looks, extreme cameras.

use crate::views::change::{EARLIER_OUTLINE, tests::*};

pub(super) fn with_image(mut scene: ChangeScene) -> ChangeScene {
    use glioscope_core::{Samples, Scaling, Volume};
    let grid = Grid::axis_aligned([24; 3], DVec3::splat(2.0), DVec3::splat(-6.0)).unwrap();
    let values: Vec<f32> = (0..grid.voxel_count()).map(|l| noise([l, 0, 0], 7) as f32).collect();
    let volume = Volume::new(grid, Samples::F32(values), Scaling::NONE).unwrap();
    scene.context.volume = Some(Arc::new(ContextVolume::new(Arc::new(volume))));
    scene
}

#[test]
fn each_reason_omits_its_passes_and_changes_no_pixel() {
    let grid = cubic(30);
    let center = DVec3::splat(14.0);
    let plain = scene(ragged(&cubic(30)));
    let full = with_image(plain.clone());
    let look = |scene: &ChangeScene, look: ChangeLook| ChangeScene { look, ..scene.clone() };
    let smooth = ChangeLook { smooth_mm: 1.0, ..plain.look };
    let arrows = ChangeLook { style: ChangeStyle::Arrows, ..smooth };
    let same = scene(surface(&grid, ball(center, 8.0), ball(center, 8.0)));
    let appeared = scene(surface(&grid, |_| false, ball(center, 8.0)));
    let mut clear = full.clone();
    clear.context.transfer = transfer(0.0);
    const FILTER: [PassName; 2] = [HEIGHT_FILTER_ACROSS, HEIGHT_FILTER_DOWN];
    const ALL_HEIGHTS: [PassName; 3] = [HEIGHTS, HEIGHT_FILTER_ACROSS, HEIGHT_FILTER_DOWN];
    const IMAGE: [PassName; 2] = [CONTEXT, GRADIENT_OPACITY];
    type Omitted<'a> = Vec<(&'a [PassName], &'a str)>;
    let cases: Vec<(&str, ChangeScene, Omitted<'_>)> = vec![
        (
            "height",
            look(&full, smooth),
            vec![
                (&[OUTSIDE, ARROWS], "style is height map"),
                (&[GRADIENT_OPACITY], "transfer function is 1-D"),
            ],
        ),
        (
            "height, unfiltered",
            full.clone(),
            vec![
                (&[OUTSIDE, ARROWS], "style is height map"),
                (&FILTER, "smoothing is 0"),
                (&[GRADIENT_OPACITY], "transfer function is 1-D"),
            ],
        ),
        (
            "arrows",
            look(&full, arrows),
            vec![(&ALL_HEIGHTS, "style is arrows"), (&[GRADIENT_OPACITY], "transfer function is 1-D")],
        ),
        (
            "long arrows",
            look(&full, ChangeLook { threshold_mm: 99.0, ..arrows }),
            vec![
                (&ALL_HEIGHTS, "style is arrows"),
                (&[ARROWS], "every arrow is shorter than the threshold"),
                (&[GRADIENT_OPACITY], "transfer function is 1-D"),
            ],
        ),
        (
            "no image",
            look(&plain, smooth),
            vec![(&[OUTSIDE, ARROWS], "style is height map"), (&IMAGE, "no context image")],
        ),
        (
            "transparent",
            look(&clear, smooth),
            vec![(&[OUTSIDE, ARROWS], "style is height map"), (&IMAGE, "transfer function is transparent")],
        ),
        (
            "identical",
            look(&same, smooth),
            vec![
                (&[OUTSIDE, ARROWS], "style is height map"),
                (&ALL_HEIGHTS, "no change"),
                (&IMAGE, "no context image"),
            ],
        ),
        (
            "identical, arrows",
            look(&same, arrows),
            vec![
                (&[OUTSIDE], "nothing is in one date only"),
                (&[ARROWS], "no change"),
                (&ALL_HEIGHTS, "no change"),
                (&IMAGE, "no context image"),
            ],
        ),
        (
            "from empty",
            look(&appeared, smooth),
            vec![
                (&[OUTSIDE, ARROWS], "style is height map"),
                (&ALL_HEIGHTS, "no surface voxel has a partner"),
                (&IMAGE, "no context image"),
            ],
        ),
    ];
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    for (name, scene, expected) in cases {
        let plan = change_plan(&scene, &FLAT);
        let mut expected_omissions: Vec<(PassName, &str)> =
            vec![(OCCLUSION, "occlusion strength is 0"), (OCCLUSION_BLUR, "occlusion strength is 0")];
        expected_omissions
            .extend([EARLIER, EARLIER_OUTLINE].map(|p| (p, "the outline of the earlier date is off")));
        expected_omissions
            .extend(expected.iter().flat_map(|(passes, reason)| passes.iter().map(|&p| (p, *reason))));
        expected_omissions.sort();
        let mut omitted = plan.omitted.clone();
        omitted.sort();
        assert_eq!(omitted, expected_omissions, "{name}");
        // With every pass that can be run at all.
        let mut everything = every_pass(LightingMode::ScreenSpace);
        if scene.context.volume.is_none() {
            everything.passes.retain(|p| !IMAGE.contains(p));
        }
        // Occlusion of strength 0 has no effect either.
        let found = renderer.render(gpu, &scene, &FLAT, [72, 64]).unwrap().read_rgba(gpu).unwrap();
        let all = renderer.render_planned(gpu, &scene, &FLAT, [72, 64], everything, Switches::ON).unwrap();
        assert!(all.read_rgba(gpu).unwrap() == found, "{name}");
        assert!(found.chunks_exact(4).any(|p| p[..3] != [255; 3]), "{name}");
    }
    // An empty scene: only the background.
    let empty = ChangeScene { surface: None, ..plain };
    let plan = change_plan(&empty, &FLAT);
    assert_eq!(plan.passes, [COMPOSE]);
    assert!(plan.omitted.contains(&(SURFACE, "no mask is active")));
    assert!(plan.omitted.contains(&(HEIGHTS, "no mask is active")));
    let frame = renderer.render(gpu, &empty, &FLAT, [8, 8]).unwrap().clone();
    assert!(frame.read_rgba(gpu).unwrap().iter().all(|&b| b == 255));
    assert_eq!(frame.pick(gpu, 3, 3).unwrap(), None);
}

#[test]
fn the_image_surrounds_the_surface_and_can_be_clipped() {
    let mut bench = bench();
    let alone = scene(ragged(&cubic(30)));
    let with = with_image(alone.clone());
    let [expected, found] = [&alone, &with].map(|s| draw(&mut bench, s, [80, 80]));
    let mut around = 0;
    for i in 0..found.depths.len() {
        let (a, b) = (&expected.rgba[i * 4..i * 4 + 4], &found.rgba[i * 4..i * 4 + 4]);
        if found.depths[i] < FAR {
            assert_eq!(a, b, "the image hides the surface");
        } else {
            around += usize::from(a != b);
        }
    }
    assert!(around > 1000, "{around}");
    let mut cut = with.clone();
    cut.context.clip = vec![ClipPlane { normal: DVec3::Z, offset_mm: -1e4 }];
    assert!(draw(&mut bench, &cut, [80, 80]).rgba == expected.rgba);
    assert!(with != alone && with != cut && with == with.clone());
}

/// Rays that pass close to an arrow's axis meet the arrow, or something nearer.
#[test]
fn arrows_hide_what_is_behind_them_and_are_hidden_by_the_surface() {
    let grid = cubic(34);
    let center = DVec3::splat(16.0);
    let mut s = scene(surface(&grid, ball(center, 7.0), ball(center, 12.0)));
    s.look = ChangeLook { style: ChangeStyle::Arrows, threshold_mm: 0.0, ..s.look };
    s.camera.focus_mm = center + s.camera.axes()[2] * 6.0 + s.camera.axes()[0] * 6.0;
    s.camera.height_mm = 14.0;
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    let size = 128;
    for projection in [Projection::Perspective, Projection::Orthographic] {
        s.camera.projection = projection;
        let frame = renderer.render(gpu, &s, &FLAT, [size; 2]).unwrap().clone();
        let found = read(gpu, &frame);
        let vectors = &s.surface.as_ref().unwrap().change().vectors;
        let (mut visible, mut hidden) = (0, 0);
        for y in (0..size).step_by(5) {
            for x in (0..size).step_by(5) {
                let middle = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let ray = s.camera.ray(middle, DVec2::splat(f64::from(size)));
                let along_ray = |p: DVec3| (p - ray.origin_mm).dot(ray.direction);
                let nearest = vectors
                    .iter()
                    .filter_map(|v| {
                        // Closest approach of the ray and the arrow's axis.
                        let axis = v.to_mm - v.from_mm;
                        let off = v.from_mm - ray.origin_mm;
                        let across = axis - axis.dot(ray.direction) * ray.direction;
                        let aside = off - off.dot(ray.direction) * ray.direction;
                        let t = (-aside.dot(across) / across.length_squared().max(1e-12)).clamp(0.0, 1.0);
                        // The tip has no width.
                        let close = t < 0.9 && (aside + t * across).length() < 0.04;
                        close.then(|| along_ray(v.from_mm + t * axis))
                    })
                    .filter(|d| *d > 0.0)
                    .fold(f64::INFINITY, f64::min);
                let pick = frame.pick(gpu, x, y).unwrap();
                let met = pick.map_or(f64::INFINITY, |p| along_ray(p.world_mm));
                assert!(met <= nearest + 0.02, "{x} {y}: met {met}, an arrow is at {nearest}");
                if found.depths[(y * size + x) as usize] < FAR && nearest.is_finite() {
                    let is_arrow = pick.is_some_and(|p| p.vector.is_some());
                    visible += usize::from(is_arrow);
                    hidden += usize::from(!is_arrow);
                }
            }
        }
        println!("{projection:?}: {visible} visible, {hidden} hidden");
        assert!(visible > 20 && hidden > 5, "{visible} {hidden}");
    }
}

#[test]
fn invalid_looks_are_errors() {
    let mut bench = bench();
    let s = scene(ragged(&cubic(20)));
    let Bench { gpu, renderer } = &mut *bench;
    for look in [
        ChangeLook { full_mm: 0.0, ..s.look },
        ChangeLook { full_mm: f64::NAN, ..s.look },
        ChangeLook { smooth_mm: -1.0, ..s.look },
        ChangeLook { threshold_mm: f64::INFINITY, ..s.look },
    ] {
        let refused = ChangeScene { look, ..s.clone() };
        let e = renderer.render(gpu, &refused, &FLAT, [8, 8]).unwrap_err();
        assert!(matches!(e, RenderError::Scene(_)), "{e}");
        assert!(renderer.frame().is_none());
    }
    assert!(renderer.render(gpu, &s, &FLAT, [8, 8]).is_ok());
    assert!(matches!(renderer.render(gpu, &s, &FLAT, [0, 8]), Err(RenderError::Size { .. })));
}

/// Cameras inside, behind and far from everything.
#[test]
fn every_camera_draws_a_frame() {
    let mut bench = bench();
    let mut s = scene(ragged(&cubic(30)));
    s.look.threshold_mm = 0.0;
    for style in [ChangeStyle::Height, ChangeStyle::Arrows] {
        s.look.style = style;
        for projection in [Projection::Perspective, Projection::Orthographic] {
            for (height_mm, back_mm) in [(1e-3, 0.0), (4.0, 0.0), (1e5, 0.0), (60.0, -400.0), (60.0, 20.0)] {
                let mut s = s.clone();
                s.camera.projection = projection;
                s.camera.height_mm = height_mm;
                s.camera.focus_mm += s.camera.axes()[2] * back_mm;
                let found = draw(&mut bench, &s, [40, 32]);
                assert!(found.rgba.chunks_exact(4).all(|p| p[3] == 255));
            }
        }
    }
}
