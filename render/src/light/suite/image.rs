//! Extreme scenes for the lighting of the context view: every scene with every row of
//! [`LIGHTS`] and every variant that the row lists.

use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use glioscope_core::{
    Grid, RegionVolume, Selection,
    optics::{Camera, Projection, Sight, srgb},
};

use super::{cubic, image_of, lumps, scene, transfer, visible_depths_mm};
use crate::{
    ClipPlane, ContextRenderer, ContextScene,
    image::{ControlPoint, GradientPoint, TransferFunction, uniforms::SPECULAR},
    light::{
        self, LIGHTS,
        slices::{
            plan::{MOST_SLICES, SlicePlan, SliceSettings},
            twin,
        },
    },
    scene::{Lamp, LightSettings, LightingMode, MutualOcclusion, Quality, SliceVariant},
    solid::{
        SURFACE,
        view::{FAR, HAS_OCCLUSION, LINEAR_LIGHT},
    },
    testing::{GPU, grid, noise, volume},
    views::context::shows_image,
};

const SIZE: [u32; 2] = [33, 17];
/// Rounding error of a share.
const ROUNDING: f64 = 1e-5;

/// A lighting mode and a variant of its row.
type ModeVariant = (LightingMode, SliceVariant);

fn mode_variants() -> Vec<ModeVariant> {
    LIGHTS.iter().flat_map(|row| row.suite.variants.iter().map(|variant| (row.mode, *variant))).collect()
}

/// All outputs of a context view's passes.
#[derive(PartialEq)]
struct Rendered {
    /// Radiance and transmittance of slices.
    eye: Vec<[f32; 4]>,
    notes: Vec<[f32; 2]>,
    carried_light: Vec<f32>,
    /// Light grid of cones.
    grid: Vec<[f32; 2]>,
    /// Premultiplied colour and opacity, 16 bits each.
    marched: Vec<[f64; 4]>,
    marched_depths: Vec<f32>,
    depths: Vec<f32>,
    blurred: Vec<u32>,
    rgba: Vec<u8>,
    frame_notes: Vec<String>,
}

fn read<T: bytemuck::Pod>(buffer: Option<&wgpu::Buffer>) -> Vec<T> {
    buffer.map_or_else(Vec::new, |b| {
        bytemuck::pod_collect_to_vec(&GPU.read_buffers(&[(b, 0, b.size())]).unwrap()[0])
    })
}

fn render(
    renderer: &mut ContextRenderer,
    scene: &ContextScene,
    quality: &Quality,
    size: [u32; 2],
) -> Rendered {
    let frame = renderer.render(&GPU, scene, quality, size).unwrap();
    let shown = shows_image(&frame.plan);
    let marched = if shown { frame.read_marched(&GPU) } else { Vec::new() };
    let has_opaque = frame.plan.has(SURFACE);
    let dark = (light::row(quality.lighting.mode).flags.iter())
        .any(|(p, f)| f & HAS_OCCLUSION != 0 && frame.plan.has(*p));
    let mut out = Rendered {
        eye: Vec::new(),
        notes: Vec::new(),
        carried_light: Vec::new(),
        grid: Vec::new(),
        marched: marched.iter().map(|m| m.rgba()).collect(),
        marched_depths: marched.iter().map(|m| m.depth).collect(),
        depths: if has_opaque { frame.read_depths(&GPU) } else { Vec::new() },
        blurred: if dark { frame.read_blurred(&GPU) } else { Vec::new() },
        rgba: frame.read_rgba(&GPU).unwrap(),
        frame_notes: frame.notes.clone(),
    };
    let lights = renderer.lights();
    out.eye = read(lights.probe().eye);
    out.notes = read(lights.probe().notes);
    out.carried_light = read(lights.probe().carried_light);
    // The buffer's tail holds the depths of each pixel's ray in the image, and of a mixture what five numbers say of its first run.
    let (all, pixels) = (out.carried_light.len(), out.eye.len());
    let tail = if (all / pixels.max(1)) % 2 == 1 { 2 + 5 } else { 2 };
    out.carried_light.truncate(all.saturating_sub(tail * pixels));
    out.grid = read(lights.probe().grid.map(|[light, _]| light));
    out
}

/// Every value is finite, within what the colours allow, and 0 where nothing is drawn.
fn check(name: &str, scene: &ContextScene, mode: LightingMode, rendered: &Rendered) {
    let share = |x: f32| (0.0..=1.0 + ROUNDING).contains(&f64::from(x));
    let most: [f64; 3] = std::array::from_fn(|c| {
        let all = scene.transfer.points().iter().map(|p| f64::from(p.color[c]) / 255.0);
        all.fold(0.0, f64::max)
    });
    // The headlight blends encoded colours and adds a highlight; other lights blend linear light.
    let is_linear = light::row(mode).flags.iter().any(|(_, flag)| flag & LINEAR_LIGHT != 0);
    let most = most.map(|c| if is_linear { srgb::decode(c) } else { c + SPECULAR });
    for e in &rendered.eye {
        assert!(share(e[3]), "{name}: {e:?}");
        for c in 0..3 {
            let allowed = most[c] * (1.0 - f64::from(e[3])) + ROUNDING;
            assert!(e[c] >= 0.0 && f64::from(e[c]) <= allowed, "{name}: {e:?} of {allowed}");
        }
    }
    assert!(rendered.notes.iter().all(|n| share(n[0]) && n[1].is_finite()), "{name}: notes");
    assert!(rendered.carried_light.iter().all(|l| share(*l)), "{name}: lights");
    assert!(rendered.grid.iter().flatten().all(|l| share(*l)), "{name}: light grid");
    for m in &rendered.marched {
        for c in 0..3 {
            assert!(m[c] <= most[c] * m[3] + ROUNDING + 1.0 / 65535.0, "{name}: {m:?} of {most:?}");
        }
    }
    assert!(rendered.marched_depths.iter().chain(&rendered.depths).all(|d| d.is_finite()), "{name}: depths");
    let is_opaque = |i: usize| rendered.depths.get(i).is_some_and(|d| *d < FAR);
    for (i, dark) in rendered.blurred.iter().enumerate() {
        assert!(*dark == 0 || is_opaque(i), "{name}: darkness on the background");
    }
    for (i, pixel) in rendered.rgba.chunks(4).enumerate() {
        assert_eq!(pixel[3], 255);
        let clear = rendered.marched.get(i).is_none_or(|m| m[3] == 0.0);
        if rendered.depths.is_empty() && clear {
            assert_eq!(pixel[..3], scene.background, "{name}: background");
        }
    }
}

fn light() -> LightSettings {
    LightSettings { slice_mm: 1.5, sub_cones: 4, cell_mm: 3.0, ..LightSettings::DEFAULT }
}

/// A ragged box in these voxels of a grid.
fn ragged(of: &Grid, first: [usize; 3], dims: [usize; 3]) -> Option<Arc<RegionVolume>> {
    volume(&of.crop(first, dims).unwrap(), 1, |_, p| noise(p, 4) > 0.3)
}

fn whole(of: &Grid, first: [usize; 3], dims: [usize; 3]) -> Option<Arc<RegionVolume>> {
    volume(&of.crop(first, dims).unwrap(), 1, |_, _| true)
}

/// Lumps on a grid, with a camera that shows all of it.
fn framed(of: &Grid, tumor: Option<Arc<RegionVolume>>) -> ContextScene {
    let corners = of.corners_mm();
    let radius_mm = (0..4).map(|i| corners[i].distance(corners[7 - i]) / 2.0).fold(0.0, f64::max);
    let base = scene(false, false, Projection::Perspective);
    let camera =
        Camera::fit(of.center_mm(), 0.6 * radius_mm, base.camera.world_from_camera, Projection::Perspective);
    ContextScene { volume: Some(lumps(of)), tumor, camera, ..base }
}

/// The scene with the eye (or the middle of its plane) at a point, looking in a direction.
fn eye_at(scene: &ContextScene, at: DVec3, towards: DVec3, projection: Projection) -> ContextScene {
    let back = -towards / towards.length();
    let c =
        Camera { world_from_camera: DQuat::from_rotation_arc(DVec3::Z, back), projection, ..scene.camera };
    ContextScene { camera: Camera { focus_mm: at - back * c.distance_mm(), ..c }, ..scene.clone() }
}

fn clipped(scene: &ContextScene, normal: DVec3, offset_mm: f64) -> ContextScene {
    ContextScene { clip: vec![ClipPlane { normal, offset_mm }], ..scene.clone() }
}

struct Row {
    name: &'static str,
    scene: ContextScene,
    lighting: LightSettings,
    size: [u32; 2],
    /// Whether the image is visible.
    shows: bool,
}

fn row(name: &'static str, scene: &ContextScene, lighting: LightSettings) -> Row {
    Row { name, scene: scene.clone(), lighting, size: SIZE, shows: true }
}

fn opaque() -> Arc<TransferFunction> {
    let points = [(10.0, [90, 60, 40], 0.0), (20.0, [250, 240, 230], 1.0)]
        .map(|(value, color, opacity)| ControlPoint { value, color, opacity });
    Arc::new(TransferFunction::new(points.to_vec(), None).unwrap())
}

fn steep() -> Arc<TransferFunction> {
    let gradient = [(0.0, 0.0), (1.0, 1.0)].map(|(gradient, factor)| GradientPoint { gradient, factor });
    Arc::new(TransferFunction::new(opaque().points().to_vec(), Some(gradient.to_vec())).unwrap())
}

/// Rows that vary the scene.
fn scene_rows() -> Vec<Row> {
    let n = 20;
    let cube = cubic(n, DVec3::ONE);
    let with = framed(&cube, ragged(&cube, [7, 6, 8], [5, 6, 4]));
    let alone = framed(&cube, None);
    let lit = light();
    let look = |s: &ContextScene, t: Arc<TransferFunction>| ContextScene { transfer: t, ..s.clone() };
    let with_tumor = |t| ContextScene { tumor: t, ..with.clone() };
    let broken = |f: &dyn Fn(usize) -> Option<f64>| {
        let like = lumps(&cube);
        let values = (0..n * n * n).map(|i| f(i).unwrap_or_else(|| like.image().value(i))).collect();
        ContextScene { volume: Some(image_of(&cube, values)), ..with.clone() }
    };
    // In one half: it is invisible, as each interpolated value includes one that is not finite.
    let bad = broken(&|i| match i % 7 {
        _ if i < n * n * n / 2 => None,
        0 => Some(f64::NAN),
        3 => Some(f64::INFINITY),
        5 => Some(f64::NEG_INFINITY),
        _ => None,
    });
    let behind = eye_at(&with, DVec3::Z * 40.0, DVec3::Z, Projection::Perspective);
    let anisotropic = |spacing: DVec3| {
        let dims = [24, 20, 6].map(|d: usize| d.min(24));
        let origin = -spacing * DVec3::new(11.5, 9.5, 2.5);
        let g = Grid::axis_aligned(dims, spacing, origin).unwrap();
        framed(&g, ragged(&g, [9, 8, 2], [6, 5, 2]))
    };
    let sheet = Grid::axis_aligned([24, 20, 1], DVec3::ONE, DVec3::new(-11.5, -9.5, 0.0)).unwrap();
    let voxel = Grid::axis_aligned([1; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let shear =
        DMat3::from_cols(DVec3::new(1.0, 0.2, 0.0), DVec3::new(0.5, -0.9, 0.1), DVec3::new(0.0, 0.3, 1.2));
    assert!(shear.determinant() < 0.0);
    let sheared = grid([n; 3], shear, DVec3::new(1e6, -1e6, 1e6));
    let mut hidden = Selection::all();
    hidden.set(1, false);
    let box_face = with_tumor(whole(&cube, [8, 8, 16], [4, 4, 4]));
    let mut rows = vec![
        row("plain", &with, lit),
        row("without tumour", &alone, lit),
        row("tiny opacity", &look(&with, transfer(false, 1e-9)), lit),
        row("infinite extinction", &look(&with, opaque()), lit),
        row("infinite extinction, 2-D", &look(&with, steep()), lit),
        row(
            "camera inside",
            &eye_at(&with, DVec3::splat(6.0), DVec3::new(-1.0, -0.8, -0.9), Projection::Perspective),
            lit,
        ),
        // The tumour is all around.
        Row {
            shows: false,
            ..row(
                "camera inside the tumour",
                &eye_at(
                    &with,
                    DVec3::new(-0.2, -1.1, 0.3),
                    DVec3::new(0.3, -0.2, -1.0),
                    Projection::Perspective,
                ),
                lit,
            )
        },
        row("camera at its face", &eye_at(&with, DVec3::Z * 10.0, -DVec3::Z, Projection::Perspective), lit),
        row(
            "along its diagonal",
            &eye_at(&with, DVec3::splat(10.0), -DVec3::ONE, Projection::Perspective),
            lit,
        ),
        row(
            "near plane cuts the image",
            &eye_at(&with, DVec3::new(0.0, 0.0, 6.0), -DVec3::Z, Projection::Orthographic),
            lit,
        ),
        row(
            "near plane cuts the tumour",
            &eye_at(&with, DVec3::new(0.0, -1.0, 0.1), -DVec3::Z, Projection::Orthographic),
            lit,
        ),
        Row { shows: false, ..row("all behind the camera", &behind, lit) },
        row("voxels 1:12", &anisotropic(DVec3::new(0.5, 0.5, 6.0)), lit),
        row("voxels 12:1", &anisotropic(DVec3::new(6.0, 0.5, 0.5)), lit),
        row("a sheet", &framed(&sheet, None), lit),
        row(
            "a sheet edge on",
            &eye_at(&framed(&sheet, None), DVec3::X * -30.0, DVec3::X, Projection::Orthographic),
            lit,
        ),
        row("one voxel", &framed(&voxel, None), lit),
        row("sheared, negative, at 1e6 mm", &framed(&sheared, ragged(&sheared, [7, 6, 8], [5, 6, 4])), lit),
        Row {
            shows: false,
            ..row("tumour as large as the image", &with_tumor(whole(&cube, [0; 3], [n; 3])), lit)
        },
        row("tumour box in the image's face", &box_face, lit),
        row("clip plane in a voxel face", &clipped(&box_face, DVec3::X, -2.0), lit),
        row("clip plane in the image's face", &clipped(&box_face, DVec3::Z, 10.0), lit),
        Row { shows: false, ..row("all cut away", &clipped(&with, DVec3::Z, -11.0), lit) },
        row("NaN and infinite intensities", &bad, lit),
        row("NaN and infinite intensities, 2-D", &look(&bad, steep()), lit),
        Row { shows: false, ..row("no finite intensity", &broken(&|_| Some(f64::NAN)), lit) },
        Row {
            shows: false,
            ..row(
                "intensities of 1e308",
                &broken(&|i| (i % 5 == 0).then_some(if i % 2 == 0 { 1e308 } else { -1e308 })),
                lit,
            )
        },
        row("empty selection", &ContextScene { selection: hidden, ..with.clone() }, lit),
        Row { size: [1, 1], ..row("one pixel", &alone, lit) },
    ];
    // Every third row with infinite extinction too, where accumulated rounding errors would show.
    let again: Vec<Row> = rows
        .iter()
        .skip(5)
        .step_by(3)
        .filter(|r| r.shows)
        .map(|r| Row {
            name: r.name,
            scene: look(&r.scene, opaque()),
            lighting: r.lighting,
            size: r.size,
            shows: true,
        })
        .collect();
    rows.extend(again);
    rows
}

/// Rows that vary a setting, and the notes expected from slices and from cones.
fn setting_rows() -> Vec<(Row, &'static str, &'static str)> {
    let cube = cubic(20, DVec3::ONE);
    let with = framed(&cube, ragged(&cube, [7, 6, 8], [5, 6, 4]));
    let lit = light();
    let of = |name, lighting| row(name, &with, lighting);
    let aperture = |aperture_deg| LightSettings { aperture_deg, ..lit };
    let slice = |slice_mm| LightSettings { slice_mm, ..lit };
    let cell = |cell_mm| LightSettings { cell_mm, ..lit };
    let cones = |sub_cones| LightSettings { sub_cones, ..lit };
    let step = |cone_step| LightSettings { cone_step, coarsest_level: 0, ..lit };
    let samples = |vicinity_samples| LightSettings { vicinity_samples, ..lit };
    let vicinity = |vicinity_mm| LightSettings { vicinity_mm, ..lit };
    let lamp = |azimuth_deg, elevation_deg, aperture_deg| LightSettings {
        lamp: Lamp { azimuth_deg, elevation_deg, ..Lamp::DEFAULT },
        towards_lamp: true,
        aperture_deg,
        ..lit
    };
    vec![
        (of("aperture 0", aperture(0.0)), "", ""),
        (of("aperture 85", aperture(85.0)), "", ""),
        (
            of("aperture 89.9", aperture(89.9)),
            "aperture 89.9 degrees: 85 is used",
            "aperture 89.9 degrees: 85 is used",
        ),
        (
            of("aperture NaN", aperture(f64::NAN)),
            "aperture NaN degrees: 0 is used",
            "aperture NaN degrees: 0 is used",
        ),
        (
            of("aperture -5", aperture(-5.0)),
            "aperture -5 degrees: 0 is used",
            "aperture -5 degrees: 0 is used",
        ),
        (of("slices 1e9 mm", slice(1e9)), "slice distance 1000000000 mm", ""),
        (of("slices NaN mm", slice(f64::NAN)), "slice distance NaN mm", ""),
        (of("slices -1 mm", slice(-1.0)), "slice distance -1 mm", ""),
        (of("reference NaN mm", LightSettings { reference_mm: f64::NAN, ..lit }), "", ""),
        (of("reference 1e9 mm", LightSettings { reference_mm: 1e9, ..lit }), "", ""),
        (of("grid 0", LightSettings { slice_grid: 0, ..lit }), "grid 0x0: 1x1 is used", ""),
        (of("grid 1e9", LightSettings { slice_grid: 1_000_000_000, ..lit }), "13x13 is used", ""),
        (of("cells 0 mm", cell(0.0)), "", ""),
        (of("cells 1e-9 mm", cell(1e-9)), "", ""),
        (of("cells NaN mm", cell(f64::NAN)), "", ""),
        (of("cells 1e9 mm", cell(1e9)), "", ""),
        (of("0 sub-cones", cones(0)), "", "0 sub-cones: 1 are used"),
        (of("1 sub-cone", cones(1)), "", ""),
        (of("128 sub-cones", cones(128)), "", ""),
        (of("1e9 sub-cones", cones(1_000_000_000)), "", "1000000000 sub-cones: 128 are used"),
        (of("cone step NaN", step(f64::NAN)), "", "cone step NaN: 1 is used"),
        (of("cone step 0", step(0.0)), "", "cone step 0: 0.0625 is used"),
        (of("cone step 1", step(1.0)), "", ""),
        (of("cone step 1/16", step(0.0625)), "", ""),
        (of("vicinity of 0 samples", samples(0)), "", ""),
        (of("vicinity of 1e9 samples", samples(1_000_000_000)), "", ""),
        (of("vicinity of 118 samples", samples(118)), "", ""),
        (of("vicinity of NaN mm", vicinity(f64::NAN)), "", ""),
        (of("vicinity of infinite mm", vicinity(f64::INFINITY)), "", ""),
        (of("vicinity of 0 mm", vicinity(0.0)), "", ""),
        (of("vicinity of 1e300 mm", vicinity(1e300)), "", ""),
        (of("lamp aside", lamp(-45.0, 45.0, 20.0)), "", ""),
        (of("lamp NaN, infinite", lamp(f64::NAN, f64::INFINITY, 20.0)), "", ""),
        (
            of("lamp beside", lamp(90.0, 0.0, 5.0)),
            "lamp 90 degrees from the line of sight: light from 75 degrees before the scene (50 %) and behind it (50 %) is used",
            "",
        ),
        (of("lamp right behind", lamp(180.0, 0.0, 5.0)), "", ""),
        (
            of("lamp beside, behind", lamp(100.0, 0.0, 5.0)),
            "lamp 100 degrees from the line of sight: light from 75 degrees before the scene (17 %) and behind it (83 %) is used",
            "",
        ),
        (of("lamp aside, wide", lamp(0.0, 60.0, 60.0)), "aperture 60 degrees: 25 is used", ""),
    ]
}

fn quality_of(row: &Row, (mode, variant): ModeVariant) -> Quality {
    let lighting = LightSettings { mode, variant, ..row.lighting };
    Quality { lighting, occlusion_strength: 1.0, context_step_mm: 0.5, ..Quality::FULL }
}

/// Draws a row twice, checks that both frames are equal, and returns one.
fn run(renderer: &mut ContextRenderer, row: &Row, mode: ModeVariant) -> Rendered {
    let quality = quality_of(row, mode);
    let found = render(renderer, &row.scene, &quality, row.size);
    check(row.name, &row.scene, mode.0, &found);
    let again = render(renderer, &row.scene, &quality, row.size);
    assert!(found == again, "{} {mode:?}: two frames are equal", row.name);
    found
}

fn mean_opacity(rendered: &Rendered) -> f64 {
    rendered.marched.iter().map(|m| m[3]).sum::<f64>() / rendered.marched.len().max(1) as f64
}

/// A renderer for each lighting mode and variant.
fn renderers() -> Vec<(ContextRenderer, ModeVariant)> {
    mode_variants().into_iter().map(|mode| (ContextRenderer::new(&GPU).unwrap(), mode)).collect()
}

#[test]
fn every_scene_in_every_lighting_mode() {
    let mut renderers = renderers();
    let rows = scene_rows();
    let mut first: Vec<Rendered> = Vec::new();
    for row in &rows {
        let mut opacities = Vec::new();
        for (renderer, mode) in &mut renderers {
            let found = run(renderer, row, *mode);
            opacities.push(mean_opacity(&found));
            if row.name == "plain" && first.len() < mode_variants().len() {
                first.push(found);
            }
        }
        println!("{}: mean opacity {opacities:.4?}", row.name);
        // The tiniest opacity vanishes in 16 bits.
        let shows = row.shows && row.name != "tiny opacity";
        assert!(opacities.iter().all(|o| (*o > 1e-3) == shows), "{}: {opacities:?}", row.name);
        let spread = opacities.iter().fold(0.0f64, |a, o| a.max((o - opacities[0]).abs()));
        assert!(spread < 0.1, "{}: modes have similar opacity: {opacities:?}", row.name);
    }
    // After all those frames, the first one again.
    for ((renderer, mode), before) in renderers.iter_mut().zip(&first) {
        assert!(run(renderer, &rows[0], *mode) == *before, "{mode:?}: earlier frames have no effect");
    }
}

#[test]
fn every_setting_in_every_lighting_mode() {
    let mut renderers = renderers();
    let mut found: Vec<(&str, Vec<Rendered>)> = Vec::new();
    for (row, by_slices, by_cones) in setting_rows() {
        let name = row.name;
        let mut frames = Vec::new();
        for (renderer, mode) in &mut renderers {
            let rendered = run(renderer, &row, *mode);
            let expected = match mode.0 {
                LightingMode::Slices => by_slices,
                LightingMode::Cones => by_cones,
                LightingMode::HalfAngle if by_slices.starts_with("slice distance") => by_slices,
                LightingMode::SphericalHarmonics if by_cones.starts_with("aperture") => by_cones,
                _ => "",
            };
            let used: Vec<&String> = rendered.frame_notes.iter().filter(|s| s.contains("used")).collect();
            assert_eq!(used.len(), usize::from(!expected.is_empty()), "{name} {mode:?}: {used:?}");
            assert!(used.iter().all(|s| s.contains(expected)), "{name} {mode:?}: {used:?}");
            frames.push(rendered);
        }
        println!("{name}: mean opacity {:.4?}", frames.iter().map(mean_opacity).collect::<Vec<_>>());
        found.push((name, frames));
    }
    let of = |name: &str| &found.iter().find(|(n, _)| *n == name).unwrap().1;
    // A value out of range is clamped to the limit.
    for (past, end) in [
        ("aperture 89.9", "aperture 85"),
        ("aperture NaN", "aperture 0"),
        ("aperture -5", "aperture 0"),
        ("slices NaN mm", "slices -1 mm"),
        ("cells 0 mm", "cells 1e-9 mm"),
        ("cells NaN mm", "cells 1e-9 mm"),
        ("0 sub-cones", "1 sub-cone"),
        ("1e9 sub-cones", "128 sub-cones"),
        ("cone step NaN", "cone step 1"),
        ("cone step 0", "cone step 1/16"),
        ("vicinity of 1e9 samples", "vicinity of 118 samples"),
        ("vicinity of NaN mm", "vicinity of 0 mm"),
        ("vicinity of infinite mm", "vicinity of 0 mm"),
    ] {
        for (a, b) in of(past).iter().zip(of(end)) {
            assert!(a.rgba == b.rgba && a.grid == b.grid && a.eye == b.eye, "{past} is {end}");
        }
    }
    // Settings that matter change the frame.
    for (a, b) in
        [("aperture 0", "aperture 85"), ("cells 0 mm", "cells 1e9 mm"), ("0 sub-cones", "128 sub-cones")]
    {
        let differ = of(a).iter().zip(of(b)).any(|(a, b)| a.rgba != b.rgba);
        assert!(differ, "{a} is not {b}");
    }
}

/// Slices of a nanometre are limited to the maximum, 8,000 are 8,000, and the opacity is as with slices of
/// a millimetre and a half. The paper's variants take a dispatch per slice, minutes on the software driver:
/// their twin is tested instead.
#[test]
fn thousands_of_slices() {
    let cube = cubic(20, DVec3::ONE);
    let with = framed(&cube, ragged(&cube, [7, 6, 8], [5, 6, 4]));
    let mended = (LightingMode::Slices, SliceVariant::Mended);
    let draw = |row: &Row| run(&mut ContextRenderer::new(&GPU).unwrap(), row, mended);
    let few = mean_opacity(&draw(&row("few", &with, light())));
    for (name, slice_mm) in [("1e-6 mm", 1e-6), ("8,000 slices", 38.0 / 8000.0)] {
        let many = row(name, &with, LightSettings { slice_mm, ..light() });
        let mended = draw(&many);
        assert_eq!(
            mended.frame_notes.iter().any(|s| s.contains("is used")),
            slice_mm == 1e-6,
            "{:?}",
            mended.frame_notes
        );
        let opacity = mean_opacity(&mended);
        println!("{name}: opacity {opacity:.5}, of few {few:.5}");
        assert!((opacity - few).abs() < 0.003, "{name}: {opacity} {few}");
        for variant in [SliceVariant::PaperExact, SliceVariant::PaperApproximate] {
            let sight = Sight::new(&with.camera, [3, 3]);
            let settings = SliceSettings {
                variant,
                aperture_deg: 60.0,
                grid: 5,
                slice_mm,
                reference_mm: 5.0,
                lamp: None,
            };
            let depths = visible_depths_mm(&with, &sight);
            let whole = depths.first().zip(depths.last()).map(|(first, last)| (first.0, last.1));
            let plan = SlicePlan::new(&settings, &sight, whole, &depths);
            assert!((7000..=MOST_SLICES).contains(&plan.slices()), "{}", plan.slices());
            let eyes = twin::slices(&with, &sight, &plan, &[], &MutualOcclusion::ALL, 1.0);
            let least = eyes.iter().map(|c| c.eye.transmittance).fold(1.0, f64::min);
            assert!(least < 0.7, "the image is visible: {least}");
            for c in &eyes {
                let share = |x: f64| (0.0..=1.0 + ROUNDING).contains(&x);
                let radiance = c.eye.radiance.to_array();
                assert!(share(c.eye.transmittance) && share(c.on_opaque) && radiance.into_iter().all(share));
            }
        }
    }
}
