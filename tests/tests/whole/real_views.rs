//! Every view on real cases: three, five and nine masks of one glioma, and three modalities on three grids, checked by
//! pixel counts and against goldens. Sources and licences of the data: tests/goldens/README.md.

use std::{collections::BTreeSet, path::Path};

use glam::{DVec2, DVec3};
use glioscope::{
    command::{Commands, Workstation},
    model::{CaseRef, OverlapMode},
    views::{
        closeup,
        overlap::{self, OverlapInput},
    },
    window::offscreen::Offscreen,
};
use glioscope_core::{
    ellipsoid::Of,
    optics::{Camera, Projection},
};
use glioscope_render::{Gpu, Quality, RegionScene};
use glioscope_tests::{MASK_COLORS, count_color, golden, real_data, run, software_gpu, workstation};
use image::RgbaImage;

use crate::PROGRAM;

const WHOLE: [&str; 5] = ["hnfnetv1-20", "isen-20", "scan-20", "sanet0-20", "yixinmpl-20"];
const SIZE: [u32; 2] = [512, 512];

fn glioma(folder: &Path, whole: usize, cores: usize) -> CaseRef {
    let file = |name: &str| folder.join(format!("{name}.nii.gz")).display().to_string();
    let mut masks: Vec<String> =
        WHOLE[..whole].iter().map(|name| format!("{name}={}:1,2,4", file(name))).collect();
    masks.extend(WHOLE[..cores].iter().map(|name| format!("{name}-core={}:1,4", file(name))));
    CaseRef::Arguments { masks, contexts: vec![format!("T1c={}", file("t1c"))] }
}

/// The four cases by name; `None`, with a line on stdout, where the files are absent.
fn cases() -> Vec<(&'static str, Option<CaseRef>)> {
    let glioma_at = real_data("glioma-5-algorithms");
    let of = |whole, cores| glioma_at.as_deref().map(|folder| glioma(folder, whole, cores));
    vec![
        ("three", of(3, 0)),
        ("five", of(5, 0)),
        ("nine", of(5, 4)),
        ("sarcoma", real_data("sarcoma-ct-mr-pet").map(CaseRef::Path)),
    ]
}

fn arguments(case: &CaseRef) -> Vec<String> {
    match case {
        CaseRef::Path(path) => vec![path.display().to_string()],
        CaseRef::Arguments { masks, contexts } => masks
            .iter()
            .map(|m| format!("--mask={m}"))
            .chain(contexts.iter().map(|c| format!("--context={c}")))
            .collect(),
        CaseRef::Sample => vec!["--sample".into()],
        CaseRef::Files { .. } => panic!("it has no arguments"),
    }
}

fn picture(case: &CaseRef, view: &str) -> RgbaImage {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    let mut all: Vec<String> =
        ["render", "--software", "--size", "512x512", "--view", view, "--out", path.to_str().unwrap()]
            .map(str::to_owned)
            .to_vec();
    all.extend(arguments(case));
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let output = run(PROGRAM, &all);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    image::open(&path).unwrap().to_rgba8()
}

/// Case, view and golden. Golden names are literals so that `./x check` finds goldens without a test.
const GOLDENS: [(&str, &str, &str); 28] = [
    ("three", "closeup", "three_closeup"),
    ("three", "context", "three_context"),
    ("three", "ellipsoids", "three_ellipsoids"),
    ("three", "axial", "three_axial"),
    ("three", "coronal", "three_coronal"),
    ("three", "sagittal", "three_sagittal"),
    ("three", "overlap", "three_overlap"),
    ("five", "closeup", "five_closeup"),
    ("five", "context", "five_context"),
    ("five", "ellipsoids", "five_ellipsoids"),
    ("five", "axial", "five_axial"),
    ("five", "coronal", "five_coronal"),
    ("five", "sagittal", "five_sagittal"),
    ("five", "overlap", "five_overlap"),
    ("nine", "closeup", "nine_closeup"),
    ("nine", "context", "nine_context"),
    ("nine", "ellipsoids", "nine_ellipsoids"),
    ("nine", "axial", "nine_axial"),
    ("nine", "coronal", "nine_coronal"),
    ("nine", "sagittal", "nine_sagittal"),
    ("nine", "overlap", "nine_overlap"),
    ("sarcoma", "closeup", "sarcoma_closeup"),
    ("sarcoma", "context", "sarcoma_context"),
    ("sarcoma", "ellipsoids", "sarcoma_ellipsoids"),
    ("sarcoma", "axial", "sarcoma_axial"),
    ("sarcoma", "coronal", "sarcoma_coronal"),
    ("sarcoma", "sagittal", "sarcoma_sagittal"),
    ("sarcoma", "overlap", "sarcoma_overlap"),
];

#[test]
fn every_view_of_every_case_matches_its_golden() {
    for (name, case) in cases() {
        let Some(case) = case else { continue };
        for (_, view, stem) in GOLDENS.iter().filter(|(of, ..)| *of == name) {
            golden(stem, &picture(&case, view));
        }
    }
}

/// Area of the union's projection onto the coronal plane: that of the voxel columns along the anterior-posterior axis.
fn projected_area_mm2(work: &Workstation) -> f64 {
    let index = &work.world.time_point(work.doc.as_ref().unwrap()).unwrap().index;
    let grid = index.grid();
    assert!(!grid.is_oblique(0.01), "voxel columns are parallel to the anterior-posterior axis");
    let front = (0..3).find(|&axis| {
        let mut step = [0.0; 3];
        step[axis] = 1.0;
        grid.world_from_voxel().transform_vector3(DVec3::from_array(step)).y.abs() > 0.1
    });
    let front = front.unwrap();
    let mut columns = BTreeSet::new();
    for linear in 0..grid.voxel_count() {
        if index.get(linear) != 0 {
            let mut at = grid.ijk(linear);
            at[front] = 0;
            columns.insert(at);
        }
    }
    columns.len() as f64 * grid.voxel_volume_mm3() / grid.spacing_mm()[front]
}

fn from_the_front(work: &Workstation) -> Camera {
    let mut camera = work.doc.as_ref().unwrap().nav.camera;
    camera.world_from_camera = Camera::orientation(0.0, 0.0);
    camera.projection = Projection::Orthographic;
    camera
}

/// Counts of pixels that differ from the background, and of those in black lines.
fn count_covered(rgba: &[u8], background: [u8; 3]) -> (usize, usize) {
    let pixels: Vec<&[u8]> = rgba.chunks_exact(4).collect();
    let differs = |p: &&&[u8]| (0..3).any(|i| p[i].abs_diff(background[i]) > 3);
    let black = |p: &&&[u8]| p[..3].iter().all(|&c| c < 90);
    (pixels.iter().filter(differs).count(), pixels.iter().filter(black).count())
}

/// The closeup and the context view (without an image) show the tumour with the projected area that a voxel count
/// gives.
#[test]
fn closeup_and_context_show_the_tumour_with_its_projected_area() {
    let gpu = software_gpu();
    for (name, case) in cases() {
        let Some(case) = case else { continue };
        let work = workstation(case);
        let expected_mm2 = projected_area_mm2(&work);
        let doc = work.doc.as_ref().unwrap();
        let mut scene = closeup::scene(doc, &work.world, false);
        (scene.lens, scene.camera) = (None, from_the_front(&work));
        let mm2_per_pixel = (scene.camera.height_mm / f64::from(SIZE[1])).powi(2);
        let mut renderer = glioscope_render::CloseupRenderer::new(&gpu).unwrap();
        let closeup = renderer.render(&gpu, &scene, &Quality::FULL, SIZE).unwrap();
        let context = context_of_masks_alone(&gpu, &scene);
        for (view, rgba) in [("closeup", closeup.read_rgba(&gpu).unwrap()), ("context", context)] {
            let (all, black) = count_covered(&rgba, scene.background);
            let with_lines_mm2 = all as f64 * mm2_per_pixel;
            let without_lines_mm2 = (all - black) as f64 * mm2_per_pixel;
            assert!(
                without_lines_mm2 < expected_mm2 && expected_mm2 < with_lines_mm2 * 1.001,
                "{name} {view}: {without_lines_mm2:.1} < {expected_mm2:.1} < {with_lines_mm2:.1} mm²"
            );
            assert!(with_lines_mm2 < 1.09 * expected_mm2, "{name} {view}: the silhouette is thin");
        }
    }
}

fn context_of_masks_alone(gpu: &Gpu, scene: &RegionScene) -> Vec<u8> {
    let context = glioscope_render::ContextScene {
        projection: None,
        volume: None,
        transfer: std::sync::Arc::new(glioscope_render::TransferFunction::transparent()),
        clip: Vec::new(),
        tumor: scene.tumor.clone(),
        selection: scene.selection.clone(),
        colors: scene.colors.clone(),
        lens: None,
        tubes: Vec::new(),
        camera: scene.camera,
        background: scene.background,
        silhouette: scene.silhouette,
    };
    let mut renderer = glioscope_render::ContextRenderer::new(gpu).unwrap();
    renderer.render(gpu, &context, &Quality::FULL, SIZE).unwrap().read_rgba(gpu).unwrap()
}

/// The ellipsoid diagram covers the pixels whose rays intersect an ellipsoid, tested in f64.
#[test]
fn ellipsoid_diagram_covers_the_rays_that_hit_an_ellipsoid() {
    let gpu = software_gpu();
    for (name, case) in cases() {
        let Some(case) = case else { continue };
        let work = workstation(case);
        let doc = work.doc.as_ref().unwrap();
        let time_point = work.world.time_point(doc).unwrap();
        let found = glioscope_core::ellipsoid::ellipsoids_of(
            &time_point.index,
            glioscope_core::Connectivity::TwentySix,
            &glioscope_core::ellipsoid::Options::default(),
            &glioscope_core::Progress::new(),
        )
        .unwrap();
        let shown: Vec<_> =
            found.iter().filter(|c| matches!(c.of, Of::Region(_)) && c.volume_ml >= 0.1).collect();
        assert!(!shown.is_empty());
        let drawn: Vec<_> = shown
            .iter()
            .zip(0_u32..)
            .map(|(c, id)| glioscope_render::DrawnEllipsoid {
                id,
                center_mm: c.enclosing.center_mm,
                semi_axes_mm: c.enclosing.semi_axes_mm,
                rotation: c.enclosing.rotation,
                color: [200, 60, 40],
                opacity: 1.0,
            })
            .collect();
        let mut camera = doc.nav.camera;
        camera.height_mm *= 1.3;
        let background = [244, 244, 242];
        let scene = glioscope_render::EllipsoidScene {
            ellipsoids: std::sync::Arc::new(drawn),
            opacity: 0.6,
            lens: None,
            camera,
            background,
            silhouette: [0, 0, 0],
            plane: None,
        };
        let mut renderer = glioscope_render::EllipsoidRenderer::new(&gpu).unwrap();
        let rgba = renderer.render(&gpu, &scene, &Quality::FULL, SIZE).unwrap().read_rgba(&gpu).unwrap();
        let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
        let mut expected = 0;
        for y in 0..SIZE[1] {
            for x in 0..SIZE[0] {
                let ray = camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), size);
                let is_hit = shown.iter().any(|c| {
                    let e = &c.enclosing;
                    let unit = |v: DVec3| e.rotation.transpose() * v / e.semi_axes_mm;
                    let (o, d) = (unit(ray.origin_mm - e.center_mm), unit(ray.direction));
                    let nearest = o - d * (o.dot(d) / d.length_squared());
                    nearest.length_squared() <= 1.0
                });
                expected += usize::from(is_hit);
            }
        }
        let (all, _) = count_covered(&rgba, background);
        // Outlines may extend about a pixel outside.
        let rim = (expected as f64).sqrt() * 4.0 * 1.6;
        assert!(
            all as f64 >= expected as f64 * 0.998 && (all as f64) < expected as f64 + rim,
            "{name}: {all} of {expected} pixels, {} ellipsoids",
            shown.len()
        );
    }
}

/// In the overlap ring of three real masks each mask's colour covers an area proportional to its volume.
#[test]
fn overlap_ring_areas_are_proportional_to_mask_volumes() {
    let (_, Some(case)) = cases().swap_remove(0) else { return };
    let work = workstation(case);
    let doc = work.doc.as_ref().unwrap();
    let regions = &work.world.time_point(doc).unwrap().regions;
    let colors = work.world.colors(doc);
    let input = OverlapInput {
        regions,
        names: regions.mask_ids(),
        selection: &doc.edit.selection.at(regions),
        colors: &colors,
        mode: OverlapMode::Regions,
        is_picture: false,
    };
    let rgba = Offscreen::new(&software_gpu(), false)
        .picture([900, 900], 1.0, |ui| {
            overlap::show_diagram(ui, &input, &mut Commands::default());
        })
        .unwrap();
    let picture = RgbaImage::from_raw(900, 900, rgba).unwrap();
    let sizes: Vec<f64> = (0..3).map(|k| regions.mask_voxels(k) as f64).collect();
    let areas = MASK_COLORS.map(|c| count_color(&picture, c, 8) as f64);
    let (sum_of_sizes, sum_of_areas) = (sizes.iter().sum::<f64>(), areas.iter().sum::<f64>());
    for k in 0..3 {
        let (size, area) = (sizes[k] / sum_of_sizes, areas[k] / sum_of_areas);
        assert!(
            (size / area - 1.0).abs() < 0.01,
            "mask {k}: {area:.4} of the colour, {size:.4} of the sizes"
        );
    }
}
