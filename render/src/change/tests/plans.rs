//! Plans, layouts, refusals.

use super::*;

fn with_image(mut scene: ChangeScene) -> ChangeScene {
    use glioscope_core::{Samples, Scaling, Volume};
    let grid = Grid::axis_aligned([24; 3], DVec3::splat(2.0), DVec3::splat(-6.0)).unwrap();
    let values: Vec<f32> = (0..grid.voxel_count()).map(|l| noise([l, 0, 0], 7) as f32).collect();
    let volume = Volume::new(grid, Samples::F32(values), Scaling::NONE).unwrap();
    scene.context.volume = Some(Arc::new(ContextVolume::new(Arc::new(volume))));
    scene
}

#[test]
fn each_reason_leaves_out_its_passes_and_changes_no_pixel() {
    let grid = cubic(30);
    let center = DVec3::splat(14.0);
    let plain = scene(frayed(&cubic(30)));
    let full = with_image(plain.clone());
    let look = |scene: &ChangeScene, look: ChangeLook| ChangeScene { look, ..scene.clone() };
    let smooth = ChangeLook { smooth_mm: 1.0, ..plain.look };
    let arrows = ChangeLook { style: ChangeStyle::Arrows, ..smooth };
    let same = scene(surface(&grid, ball(center, 8.0), ball(center, 8.0)));
    let came = scene(surface(&grid, |_| false, ball(center, 8.0)));
    let mut clear = full.clone();
    clear.context.transfer = transfer(0.0);
    use PassName::*;
    const FILTER: [PassName; 2] = [HeightFilterAcross, HeightFilterDown];
    const HEIGHTS: [PassName; 3] = [Heights, HeightFilterAcross, HeightFilterDown];
    const IMAGE: [PassName; 2] = [Context, GradientOpacity];
    let cases: Vec<(&str, ChangeScene, Vec<(&[PassName], &str)>)> = vec![
        (
            "height",
            look(&full, smooth),
            vec![
                (&[Outside, Arrows], "style is height map"),
                (&[GradientOpacity], "transfer function is 1-D"),
            ],
        ),
        (
            "height, unfiltered",
            full.clone(),
            vec![
                (&[Outside, Arrows], "style is height map"),
                (&FILTER, "smoothing is 0"),
                (&[GradientOpacity], "transfer function is 1-D"),
            ],
        ),
        (
            "arrows",
            look(&full, arrows),
            vec![(&HEIGHTS, "style is arrows"), (&[GradientOpacity], "transfer function is 1-D")],
        ),
        (
            "long arrows",
            look(&full, ChangeLook { threshold_mm: 99.0, ..arrows }),
            vec![
                (&HEIGHTS, "style is arrows"),
                (&[Arrows], "every arrow is shorter than the threshold"),
                (&[GradientOpacity], "transfer function is 1-D"),
            ],
        ),
        (
            "no image",
            look(&plain, smooth),
            vec![(&[Outside, Arrows], "style is height map"), (&IMAGE, "no context image")],
        ),
        (
            "transparent",
            look(&clear, smooth),
            vec![(&[Outside, Arrows], "style is height map"), (&IMAGE, "transfer function is transparent")],
        ),
        (
            "identical",
            look(&same, smooth),
            vec![
                (&[Outside, Arrows], "style is height map"),
                (&HEIGHTS, "no change"),
                (&IMAGE, "no context image"),
            ],
        ),
        (
            "identical, arrows",
            look(&same, arrows),
            vec![
                (&[Outside], "nothing is in one date only"),
                (&[Arrows], "no change"),
                (&HEIGHTS, "no change"),
                (&IMAGE, "no context image"),
            ],
        ),
        (
            "from empty",
            look(&came, smooth),
            vec![
                (&[Outside, Arrows], "style is height map"),
                (&HEIGHTS, "no surface voxel has a partner"),
                (&IMAGE, "no context image"),
            ],
        ),
    ];
    let mut bench = bench();
    let Bench { gpu, renderer } = &mut *bench;
    for (name, scene, expected) in cases {
        let plan = change_plan(&scene, &FLAT);
        let mut wanted: Vec<(PassName, &str)> =
            vec![(Occlusion, "occlusion strength is 0"), (OcclusionBlur, "occlusion strength is 0")];
        wanted.extend(expected.iter().flat_map(|(passes, reason)| passes.iter().map(|&p| (p, *reason))));
        wanted.sort();
        let mut omitted = plan.omitted.clone();
        omitted.sort();
        assert_eq!(omitted, wanted, "{name}");
        // With every pass that can be run at all.
        let mut everything = Plan { passes: PassName::CHANGE.to_vec(), omitted: Vec::new() };
        if scene.context.volume.is_none() {
            everything.passes.retain(|p| !IMAGE.contains(p));
        }
        // Occlusion of strength 0 shows nothing, too.
        let found = renderer.render(gpu, &scene, &FLAT, [72, 64]).unwrap().read_rgba(gpu).unwrap();
        let all = renderer.render_planned(gpu, &scene, &FLAT, [72, 64], everything).unwrap();
        assert!(all.read_rgba(gpu).unwrap() == found, "{name}");
        assert!(found.chunks_exact(4).any(|p| p[..3] != [255; 3]), "{name}");
    }
    // Nothing at all: a picture of the background.
    let empty = ChangeScene { surface: None, ..plain.clone() };
    let plan = change_plan(&empty, &FLAT);
    assert_eq!(plan.passes, [Compose]);
    assert!(plan.omitted.contains(&(Surface, "no mask is active")));
    assert!(plan.omitted.contains(&(Heights, "no mask is active")));
    let frame = renderer.render(gpu, &empty, &FLAT, [8, 8]).unwrap().clone();
    assert!(frame.read_rgba(gpu).unwrap().iter().all(|&b| b == 255));
    assert_eq!(frame.pick(gpu, 3, 3).unwrap(), None);
}

#[test]
fn the_image_is_around_the_surface_and_can_be_cut() {
    let mut bench = bench();
    let alone = scene(frayed(&cubic(30)));
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

#[test]
fn what_is_no_look_is_refused() {
    let mut bench = bench();
    let s = scene(frayed(&cubic(20)));
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

/// Cameras in, behind and far from everything.
#[test]
fn every_camera_gives_a_picture() {
    let mut bench = bench();
    let mut s = scene(frayed(&cubic(30)));
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

/// Offsets and sizes of every struct that Rust fills, from naga's reflection.
#[test]
fn rust_and_wgsl_lay_structs_out_alike() {
    macro_rules! offsets {
        ($type:ty: $($field:ident),* $(,)?) => {
            (size_of::<$type>() as u32, vec![$((stringify!($field), std::mem::offset_of!($type, $field) as u32)),*])
        };
    }
    use change_uniforms::Change as Uniform;
    let expected = [
        (
            "Change",
            offsets!(Uniform: right, full_mm, up, smooth_mm, away, gap_mm, origin, radius_mm, base, head_radius_mm,
                grow, head_length_mm, shrink, log2_slots, clip_offset, clip_scale, samples, flags, kinds),
        ),
        (
            "View",
            offsets!(View: corner, mm_per_pixel, right, mm_per_pixel_per_mm, up, nearest_mm, forward, voxel_mm,
                dims, log2_ids_per_word, bricks, selected, lens, background, silhouette, size, flags,
                occlusion_samples, occlusion_radius_mm, occlusion_strength, color_bleeding, line_scale, depth_span_mm, outside_opacity, inner_line_strength, outer_line_strength),
        ),
        ("Length", offsets!(Length: key, signed_mm, sure)),
        ("Arrow", offsets!(GpuArrow: start, what, along, unused)),
        ("Marched", offsets!(Marched: red_green, blue_opacity, depth, unused)),
    ];
    let mut seen = vec![0; expected.len()];
    for name in glioscope_shaders::ALL.iter().filter(|n| n.starts_with("change")) {
        let module = naga::front::wgsl::parse_str(&glioscope_shaders::compose(name).unwrap()).unwrap();
        for (_, global) in module.global_variables.iter() {
            let mut ty = &module.types[global.ty];
            if let naga::TypeInner::Array { base, .. } = ty.inner {
                ty = &module.types[base];
            }
            let naga::TypeInner::Struct { members, span } = &ty.inner else { continue };
            let at = expected.iter().position(|(n, _)| Some(*n) == ty.name.as_deref());
            let at = at.unwrap_or_else(|| panic!("{name}: {:?} is bound but not compared", ty.name));
            let found: Vec<(&str, u32)> =
                members.iter().map(|m| (m.name.as_deref().unwrap_or(""), m.offset)).collect();
            assert_eq!((*span, found), expected[at].1, "{name}: {:?}", ty.name);
            seen[at] += 1;
        }
    }
    assert!(seen.iter().all(|&n| n > 0), "{seen:?}");
}
