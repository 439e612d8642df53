//! Directional light among opaque geometry of every kind: fibres, masks, arrows, ellipsoids, with an image and without,
//! compared with Monte Carlo of the whole scene by brute force.

use std::{sync::Arc, time::Duration};

use glam::{DMat3, DVec2, DVec3};
use glioscope_core::{
    Grid, Mask, MaskBits, Progress, RegionVolume, Regions, Selection, Sides, Tracts, TumorIndex,
    change::{ChangeOptions, change},
    optics::{
        Camera, Projection, Ray, Sight,
        medium::Medium,
        monte_carlo::{Phase, direction},
        random::Random,
        solids::{Capsule, cone_openness},
        srgb,
        voxels::OpaqueVoxels,
    },
};
use glioscope_render::{
    ChangeContext, ChangeLook, ChangeScene, ChangeStyle, ChangeSurface, ContextScene, DrawnEllipsoid,
    DrawnTubes, EllipsoidScene, LightSettings, LightingMode, MaskColors, Palette, Preset, Quality, Renderer,
    TransferFunction, TubeLook, TubeSet, TubeShape, View3d,
    light::preset,
    views::{change::Change, context::Context, ellipsoids::Ellipsoids},
};
use rayon::prelude::*;
use strum::VariantArray;

use super::{Axis, Bench, Curve, Defaults, Family, Point, errors::Errors, scenes, sweep::Sweep};
use crate::Outcome;

pub(super) const FAMILY: Family = Family {
    name: "solids",
    title: "Directional light among fibres, masks, arrows and ellipsoids",
    about: "Fraction of the light from the cone around the direction to the eye that reaches what is hit first, by the \
            presets of slices and cones at full resolution, compared with Monte Carlo of the whole scene: capsules, voxels, \
            triangles of arrows and ellipsoids by brute force, and the image's extinction (combined). Lights know fibres, \
            arrows and ellipsoids by their depths alone, so gaps between thin ones are the greatest part of the error: \
            straight down one sees less than what a slanted ray meets. Cones trace masks voxel by voxel; more of them \
            reduce that part.",
    defaults: Defaults::Presets,
    curves,
};

/// Opaque geometry, for brute force.
#[derive(Default)]
struct Solids {
    voxels: Option<OpaqueVoxels>,
    capsules: Vec<Capsule>,
    /// Centre, and what takes an ellipsoid to the unit ball.
    ellipsoids: Vec<(DVec3, DMat3)>,
    /// A capsule about each arrow, and its triangles.
    arrows: Vec<(Capsule, Vec<[DVec3; 3]>)>,
    image: Option<Box<dyn Medium>>,
}

impl Solids {
    fn hidden(&self, ray: &Ray, far_mm: f64) -> bool {
        let in_ball = |(center, to_ball): &(DVec3, DMat3)| {
            let (o, d) = (*to_ball * (ray.origin_mm - center), *to_ball * ray.direction);
            let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
            let root = b * b - a * c;
            root > 0.0 && (root.sqrt() - b) / a > 0.0 && (-b - root.sqrt()) / a < far_mm
        };
        let in_arrow = |(about, triangles): &(Capsule, Vec<[DVec3; 3]>)| {
            about.hidden(ray, far_mm) && triangles.iter().any(|t| meets(t, ray, far_mm))
        };
        self.voxels.as_ref().is_some_and(|v| v.hidden(ray, far_mm))
            || self.capsules.iter().any(|c| c.hidden(ray, far_mm))
            || self.ellipsoids.iter().any(in_ball)
            || self.arrows.iter().any(in_arrow)
    }

    /// Light of the cone at a place, and its standard error.
    fn light(&self, at_mm: DVec3, to_eye: DVec3, samples: u32, random: &mut Random) -> (f64, f64) {
        const FAR_MM: f64 = 400.0;
        let aperture_deg = LightSettings::DEFAULT.aperture_deg;
        let Some(image) = &self.image else {
            let hidden = |ray: &Ray| self.hidden(ray, FAR_MM);
            return cone_openness(&hidden, at_mm, to_eye, aperture_deg, samples, random);
        };
        let found: Vec<f64> = (0..samples)
            .map(|_| {
                let ray = Ray {
                    origin_mm: at_mm,
                    direction: direction(Phase::Cone { aperture_deg }, to_eye, random),
                };
                let through = (-image.thickness(&ray, f64::INFINITY)).exp();
                if self.hidden(&ray, FAR_MM) { 0.0 } else { through }
            })
            .collect();
        let n = f64::from(samples);
        let mean = found.iter().sum::<f64>() / n;
        let spread = found.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (spread / n).sqrt())
    }
}

/// Moeller and Trumbore's test of a triangle.
fn meets([a, b, c]: &[DVec3; 3], ray: &Ray, far_mm: f64) -> bool {
    let (ab, ac) = (*b - *a, *c - *a);
    let p = ray.direction.cross(ac);
    let det = ab.dot(p);
    if det.abs() < 1e-14 {
        return false;
    }
    let from = ray.origin_mm - *a;
    let u = from.dot(p) / det;
    let q = from.cross(ab);
    let v = ray.direction.dot(q) / det;
    let t = ac.dot(q) / det;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < far_mm
}

/// A scene of a view: the frame's, the camera, and the geometry.
struct Case<V: View3d> {
    name: &'static str,
    scene: V::Scene,
    camera: Camera,
    solids: Solids,
}

fn tubes(lines: &[Vec<DVec3>], radius_mm: f64) -> Outcome<(DrawnTubes, Vec<Capsule>)> {
    let points = lines.iter().flatten().map(|p| p.as_vec3().to_array()).collect();
    let mut offsets = vec![0u32];
    for line in lines {
        offsets.push(offsets.last().copied().unwrap_or(0) + line.len() as u32);
    }
    let tracts = Tracts::new(points, offsets, Sides::Known).ok_or("invalid fibres")?;
    let set = TubeSet::new(&tracts, &TubeShape::default(), &Progress::new())?;
    let look = TubeLook { radius_mm, ..TubeLook::of([200, 180, 120]) };
    let capsules = lines
        .iter()
        .flat_map(|line| line.windows(2))
        .filter_map(|pair| Some(Capsule { a_mm: *pair.first()?, b_mm: *pair.get(1)?, radius_mm }))
        .collect();
    Ok((DrawnTubes { set: Arc::new(set), look, shown: true }, capsules))
}

fn without_image(camera: Camera) -> ContextScene {
    ContextScene {
        volume: None,
        transfer: Arc::new(TransferFunction::transparent()),
        projection: None,
        clip: Vec::new(),
        tumor: None,
        selection: Selection::all(),
        colors: MaskColors::new(Palette::Thesis, &[None; 8]),
        lens: None,
        tubes: Vec::new(),
        camera,
        background: [255; 3],
        silhouette: [0; 3],
    }
}

/// Fibres side by side, 5 mm over one half of a slab: paper 003's case of a sheet before a surface.
fn sheet() -> Outcome<Case<Context>> {
    let lines: Vec<Vec<DVec3>> = (0..20)
        .map(|n| -0.5 - f64::from(n))
        .map(|x| vec![DVec3::new(x, -30.0, 5.5), DVec3::new(x, 30.0, 5.5)])
        .collect();
    let (drawn, capsules) = tubes(&lines, 0.5)?;
    let grid = Grid::axis_aligned([60, 60, 4], DVec3::ONE, DVec3::new(-29.5, -29.5, -3.5))?;
    let bits = MaskBits::from_fn(grid.dims(), |_| true);
    let mask = Mask::new("slab".to_owned(), grid.clone(), bits).ok_or("a mask that doesn't fit its grid")?;
    let index = TumorIndex::new(grid.clone(), &[&mask])?;
    let tumor = RegionVolume::of(&index, &Regions::of(&index)).ok_or("an empty slab")?;
    let camera = Camera {
        height_mm: 36.0,
        ..Camera::fit(DVec3::ZERO, 20.0, Camera::orientation(0.0, 90.0), Projection::Perspective)
    };
    let scene = ContextScene { tumor: Some(Arc::new(tumor)), tubes: vec![drawn], ..without_image(camera) };
    let solids = Solids { voxels: Some(OpaqueVoxels::new(grid, |_| true)), capsules, ..Solids::default() };
    Ok(Case { name: "a sheet of fibres 5 mm before a slab", scene, camera, solids })
}

/// A curved bundle of fibres, nearest to a viewer in front at its ends.
fn bundle_lines(center_mm: DVec3) -> Vec<Vec<DVec3>> {
    (0..36)
        .map(|n| {
            let (row, column) = (f64::from(n / 6) - 2.5, f64::from(n % 6) - 2.5);
            let at = |s: f64| {
                let bend = 14.0 * (s / 40.0).powi(2);
                center_mm
                    + DVec3::new(s, 2.4 * row + bend + 0.8 * (s / 7.0 + row).sin(), 2.4 * column + 0.3 * s)
            };
            (-10..=10).map(|i| at(4.0 * f64::from(i))).collect()
        })
        .collect()
}

fn bundle() -> Outcome<Case<Context>> {
    let closeup = scenes::phantom_closeup()?;
    let tumor = closeup.tumor.ok_or("the phantom has no tumour")?;
    let (drawn, capsules) =
        tubes(&bundle_lines(closeup.camera.focus_mm + DVec3::new(-14.0, 30.0, 8.0)), 0.6)?;
    let voxels = OpaqueVoxels::new(tumor.grid().clone(), |l| tumor.id(l) != 0);
    let scene = ContextScene { tumor: Some(tumor), tubes: vec![drawn], ..without_image(closeup.camera) };
    let solids = Solids { voxels: Some(voxels), capsules, ..Solids::default() };
    Ok(Case {
        name: "a bundle of fibres before the head phantom's tumour",
        scene,
        camera: closeup.camera,
        solids,
    })
}

/// The same bundle in the soft balls of the image's own scenes.
fn bundle_in_image() -> Outcome<Case<Context>> {
    let scene = scenes::soft_balls(48)?;
    let camera = scene.camera;
    let (drawn, capsules) = tubes(&bundle_lines(DVec3::new(0.0, 4.0, 2.0)), 0.6)?;
    let scene = ContextScene { tubes: vec![drawn], ..scene };
    let medium = scene.medium().ok_or("the image can't be converted to a medium")?;
    let solids = Solids { capsules, image: Some(Box::new(medium)), ..Solids::default() };
    Ok(Case { name: "combined: the bundle in soft balls", scene, camera, solids })
}

fn ellipsoids() -> Case<Ellipsoids> {
    let mut random = Random::new(8, 0);
    let list: Vec<DrawnEllipsoid> = (0..24)
        .map(|id| {
            let mut three = || DVec3::new(random.unit(), random.unit(), random.unit());
            let (place, axes, turn) = (three() * 2.0 - 1.0, three() * 6.0 + 3.0, three() * 3.0);
            DrawnEllipsoid {
                id,
                center_mm: place * DVec3::new(22.0, 18.0, 20.0),
                semi_axes_mm: axes,
                rotation: DMat3::from_euler(glam::EulerRot::XYZ, turn.x, turn.y, turn.z),
                color: [200, 200, 200],
                opacity: 1.0,
            }
        })
        .collect();
    let solids = list
        .iter()
        .map(|e| (e.center_mm, DMat3::from_diagonal(1.0 / e.semi_axes_mm) * e.rotation.transpose()))
        .collect();
    let camera = Camera::fit(DVec3::ZERO, 30.0, Camera::orientation(25.0, 18.0), Projection::Perspective);
    let scene = EllipsoidScene {
        ellipsoids: Arc::new(list),
        opacity: 1.0,
        lens: None,
        camera,
        background: [255; 3],
        silhouette: [0; 3],
        plane: None,
    };
    Case {
        name: "24 opaque ellipsoids",
        scene,
        camera,
        solids: Solids { ellipsoids: solids, ..Solids::default() },
    }
}

/// Six-sided shaft and head, as change/arrows.wgsl has them with 1 mm voxels; ends of shafts are open.
fn arrow(from_mm: DVec3, to_mm: DVec3) -> Option<(Capsule, Vec<[DVec3; 3]>)> {
    let (along, length_mm) = (to_mm - from_mm, from_mm.distance(to_mm));
    let axis = along.try_normalize()?;
    let (radius, head_radius, head_length) = (0.15, 0.42, f64::min(1.5, 0.6 * length_mm));
    let a = axis.abs();
    let least = if a.x <= a.y && a.x <= a.z {
        DVec3::X
    } else if a.y <= a.z {
        DVec3::Y
    } else {
        DVec3::Z
    };
    let u = axis.cross(least).try_normalize()?;
    let v = axis.cross(u);
    let neck_mm = from_mm + axis * (length_mm - head_length);
    let ring = |center: DVec3, radius: f64, corner: u32| {
        let (sin, cos) = (f64::from(corner) * std::f64::consts::TAU / 6.0).sin_cos();
        center + radius * (cos * u + sin * v)
    };
    let mut triangles = Vec::new();
    for n in 0..6 {
        let [a, b] = [n, n + 1].map(|c| ring(from_mm, radius, c));
        let [c, d] = [n, n + 1].map(|c| ring(neck_mm, radius, c));
        let [e, f] = [n, n + 1].map(|c| ring(neck_mm, head_radius, c));
        triangles.extend([[a, b, c], [b, d, c], [c, d, e], [d, f, e], [e, f, to_mm]]);
    }
    Some((Capsule { a_mm: from_mm, b_mm: to_mm, radius_mm: head_radius + 1e-6 }, triangles))
}

/// A ball that grew on one side: arrows, and the earlier mask below them.
fn arrows() -> Outcome<Case<Change>> {
    let grid = Grid::axis_aligned([36; 3], DVec3::ONE, DVec3::splat(-17.5))?;
    let ball = |at: DVec3, radius: f64| {
        MaskBits::from_fn(grid.dims(), |l| grid.center_of_voxel_mm(grid.ijk(l)).distance(at) < radius)
    };
    let (before, after) = (ball(DVec3::ZERO, 10.0), ball(DVec3::new(0.0, 3.0, 0.0), 11.5));
    let found = change(&before, &after, &grid, &ChangeOptions::default(), &Progress::new())?;
    let surface = ChangeSurface::new(&before, &after, &grid, Arc::new(found)).ok_or("the masks are empty")?;
    let camera = Camera::fit(
        DVec3::new(0.0, 2.0, 0.0),
        13.0,
        Camera::orientation(70.0, 20.0),
        Projection::Perspective,
    );
    let look = ChangeLook { style: ChangeStyle::Arrows, threshold_mm: 3.5, ..ChangeLook::default() };
    let vectors = surface.arrows(look.threshold_mm).filter_map(|i| surface.change().vectors.get(i));
    let arrows = vectors.filter_map(|v| arrow(v.from_mm, v.to_mm)).collect();
    let voxels = OpaqueVoxels::new(grid.clone(), |l| before.get(grid.ijk(l)));
    let scene = ChangeScene {
        surface: Some(Arc::new(surface)),
        look,
        base: ChangeLook::BASE,
        context: ChangeContext {
            volume: None,
            transfer: Arc::new(TransferFunction::transparent()),
            clip: Vec::new(),
        },
        camera,
        background: [255; 3],
        silhouette: [0; 3],
    };
    let solids = Solids { voxels: Some(voxels), arrows, ..Solids::default() };
    Ok(Case { name: "arrows of a ball that grew", scene, camera, solids })
}

/// Scenes of fibres with masks or an image: name, what they hold, scene.
pub(crate) fn lit_solids() -> Outcome<Vec<(&'static str, String, ContextScene)>> {
    let described = |case: Case<Context>| {
        let volume = case.scene.volume.as_ref().map(|v| v.grid().dims().map(|d| d.to_string()).join("x"));
        let segments = case.solids.capsules.len();
        let voxels = case.scene.tumor.as_ref().map(|t| t.grid().dims().map(|d| d.to_string()).join("x"));
        let image = volume.map_or("no image".to_owned(), |v| format!("image of {v}"));
        let masks = voxels.map_or(String::new(), |v| format!(", masks of {v}"));
        (case.name, format!("{image}, {segments} segments{masks}"), case.scene)
    };
    Ok([sheet()?, bundle()?, bundle_in_image()?].map(described).into_iter().collect())
}

fn kernels() -> Vec<(String, (f64, Quality))> {
    let mut out = Vec::new();
    for mode in [LightingMode::Slices, LightingMode::Cones] {
        for of in Preset::VARIANTS {
            let quality = preset(mode, *of);
            out.push((format!("{}, {}", mode.name(), of.name()), (quality.cost.unwrap_or(1.0), quality)));
        }
    }
    out
}

fn measure<V: View3d>(bench: &Bench<'_>, case: &Case<V>) -> Outcome<Curve> {
    let size = bench.effort.of([40, 30], [160, 120], [240, 180]);
    let (most, samples) = bench.effort.of((40, 64), (300, 256), (900, 1024));
    let sweep = Sweep {
        label: &format!("solids: {}", case.name),
        rounds: bench.effort.of(1, 1, 3),
        time_budget: Duration::from_millis(3000),
        on_device: true,
    };
    let full = |quality: &Quality| Quality { occlusion_strength: 1.0, resolution_scale: 1.0, ..*quality };
    let mut truth: Option<Vec<(usize, f64, f64)>> = None;
    let run = |renderer: &mut Renderer<V>, (_, quality): &(f64, Quality)| {
        renderer.render(bench.gpu, &case.scene, &full(quality), size)?;
        Ok(bench.gpu.wait()?)
    };
    let evaluate = |renderer: &mut Renderer<V>, (cost, _): &(f64, Quality)| {
        let frame = renderer.frame().ok_or("no frame was drawn")?;
        let found = frame.occlusion(bench.gpu)?;
        if truth.is_none() {
            truth = Some(truth_of(
                (&case.camera, &case.solids),
                frame.size_px,
                &found.depths_mm,
                (most, samples),
            ));
        }
        let truth = truth.as_deref().unwrap_or_default();
        let error = |(at, light, _): &(usize, f64, f64)| {
            srgb::decode(1.0 - found.dark.get(*at).copied().unwrap_or(f64::NAN)) - light
        };
        Ok(Point { is_default: true, ..Point::new(*cost, &Errors::of(truth.iter().map(error))) })
    };
    let points = bench.sweep(&sweep, &mut Renderer::<V>::new(bench.gpu)?, &kernels(), run, evaluate)?;
    let truth = truth.unwrap_or_default();
    Ok(Curve {
        family: FAMILY.name,
        kernel: "presets, at full resolution".to_owned(),
        scene: format!("{}, {}x{} pixels", case.name, size[0], size[1]),
        knob: "light::at_cost",
        truth: format!(
            "Monte Carlo of the whole scene, cone of {} degrees, {samples} samples at each of {} pixels, mean {:.3}",
            LightSettings::DEFAULT.aperture_deg,
            truth.len(),
            truth.iter().map(|(_, l, _)| l).sum::<f64>() / truth.len().max(1) as f64
        ),
        truth_error: Some(Errors::of(truth.iter().map(|(_, _, e)| *e)).rms()),
        unit: "fraction of light, 0 to 1",
        axis: Axis::Time,
        points,
    })
}

/// Light at a random sample of the pixels that show opaque geometry: pixel index, light, standard error.
fn truth_of(
    (camera, solids): (&Camera, &Solids),
    size: [u32; 2],
    depths_mm: &[f64],
    (most, samples): (usize, u32),
) -> Vec<(usize, f64, f64)> {
    let sight = Sight::new(camera, size);
    let mut shown: Vec<usize> =
        (0..depths_mm.len()).filter(|i| depths_mm.get(*i).is_some_and(|d| d.is_finite())).collect();
    // A random but reproducible sample: regular ones meet the same place of every fibre.
    let mut random = Random::new(12, 0);
    let mut sample = Vec::new();
    while sample.len() < most && !shown.is_empty() {
        sample.push(shown.swap_remove(((random.unit() * shown.len() as f64) as usize).min(shown.len() - 1)));
    }
    let at_pixel = |number: &usize| {
        let pixel = [(*number as u32) % size[0], (*number as u32) / size[0]];
        let depth_mm = *depths_mm.get(*number)?;
        // Single precision and the widths of lines leave hits a little inside.
        let nearer_mm = sight.at_mm(pixel, depth_mm - 0.02);
        let center = DVec2::new(f64::from(pixel[0]), f64::from(pixel[1])) + 0.5;
        let ray = camera.ray(center, DVec2::new(f64::from(size[0]), f64::from(size[1])));
        let (light, error) =
            solids.light(nearer_mm, -ray.direction, samples, &mut Random::new(6, *number as u64));
        Some((*number, light, error))
    };
    sample.par_iter().filter_map(at_pixel).collect()
}

fn curves(bench: &Bench<'_>) -> Outcome<Vec<Curve>> {
    let mut out = vec![measure(bench, &sheet()?)?, measure(bench, &bundle()?)?];
    out.push(measure(bench, &bundle_in_image()?)?);
    out.push(measure(bench, &arrows()?)?);
    out.push(measure(bench, &ellipsoids())?);
    Ok(out)
}
