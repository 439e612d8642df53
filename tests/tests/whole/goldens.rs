//! Views of the sample rendered on the software adapter, checked by pixel counts and against goldens.

use glam::DVec3;
use glioscope::model::CaseRef;
use glioscope_tests::{MASK_COLORS, count_color, golden, run, workstation};
use image::RgbaImage;

use crate::PROGRAM;

const BACKGROUND: [u8; 3] = [244, 244, 242];

fn picture(arguments: &[&str]) -> RgbaImage {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    let mut all =
        vec!["render", "--sample", "--software", "--size", "512x512", "--out", path.to_str().unwrap()];
    all.extend(arguments);
    let output = run(PROGRAM, &all);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    image::open(&path).unwrap().to_rgba8()
}

/// In an orthographic view from the front, the union's projected area equals that of the voxel columns that contain
/// tissue.
#[test]
fn closeup_silhouette_has_the_tumour_area() {
    let work = workstation(CaseRef::Sample);
    let doc = work.doc.as_ref().unwrap();
    let index = &work.world.time_point(doc).unwrap().index;
    let grid = index.grid();
    assert!(!grid.is_oblique(0.01), "the sample's case grid has axes along the patient's");
    let front = (0..3).find(|&axis| {
        let mut step = [0.0; 3];
        step[axis] = 1.0;
        grid.world_from_voxel().transform_vector3(DVec3::from_array(step)).y.abs() > 0.1
    });
    let front = front.unwrap();
    let (dims, mut columns) = (grid.dims(), std::collections::BTreeSet::new());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                if index.get(grid.linear([x, y, z])) != 0 {
                    let mut column = [x, y, z];
                    column[front] = 0;
                    columns.insert(column);
                }
            }
        }
    }
    let face_mm2 = grid.voxel_volume_mm3() / grid.spacing_mm()[front];
    let expected_mm2 = columns.len() as f64 * face_mm2;

    let closeup = picture(&["--plain", "--camera", "0,0", "--orthographic", "--lens", "off"]);
    let mm_per_pixel = doc.nav.camera.height_mm / 512.0;
    let tissue = 512 * 512 - count_color(&closeup, BACKGROUND, 3);
    let black = count_color(&closeup, [0, 0, 0], 90);
    // The silhouette covers both sides of the edge: with it the area is overestimated, without it (and without the
    // lines between regions) underestimated.
    let with_lines_mm2 = tissue as f64 * mm_per_pixel * mm_per_pixel;
    let without_lines_mm2 = (tissue - black) as f64 * mm_per_pixel * mm_per_pixel;
    assert!(
        without_lines_mm2 < expected_mm2 && expected_mm2 < with_lines_mm2,
        "{without_lines_mm2:.1} < {expected_mm2:.1} < {with_lines_mm2:.1} mm²"
    );
    assert!(with_lines_mm2 < 1.05 * expected_mm2, "the silhouette is thin");
}

#[test]
fn closeup_with_the_lens_matches_its_golden() {
    let closeup = picture(&[]);
    for color in MASK_COLORS {
        assert!(count_color(&closeup, color, 40) > 1500, "{color:?}");
    }
    golden("closeup_lens_on", &closeup);
}

#[test]
fn closeup_without_the_lens_has_no_ring() {
    let closeup = picture(&["--lens", "off"]);
    let ring = |picture| count_color(picture, [255, 255, 255], 3);
    let (with_lens, without_lens) = (ring(&picture(&[])), ring(&closeup));
    assert!(
        with_lens > 300 && without_lens * 100 < with_lens,
        "no ring is drawn: {without_lens} of {with_lens} pixels"
    );
    golden("closeup_lens_off", &closeup);
}

#[test]
fn deselected_regions_are_hidden_in_the_closeup() {
    let closeup = picture(&["--select", "T1,PET,T1+T2,T1+PET,T2+PET,T1+T2+PET"]);
    let pure_green = count_color(&closeup, MASK_COLORS[1], 30);
    // The remaining pixels are the legend's swatch.
    assert!(pure_green < 200, "T2 alone is hidden in the lens: {pure_green} pixels");
    golden("closeup_deselected", &closeup);
}

#[test]
fn dark_closeup_in_the_thesis_colours_matches_its_golden() {
    let closeup = picture(&["--dark", "--palette", "thesis"]);
    for color in [[255, 0, 0], [0, 255, 0], [0, 0, 255]] {
        assert!(count_color(&closeup, color, 40) > 1500, "{color:?}");
    }
    golden("closeup_dark_thesis", &closeup);
}

#[test]
fn slices_match_their_goldens() {
    golden("slice_axial", &picture(&["--view", "axial"]));
    golden("slice_coronal", &picture(&["--view", "coronal"]));
    golden("slice_sagittal", &picture(&["--view", "sagittal", "--dark"]));
}

/// The neurological convention mirrors the radiological one: the tumour changes sides.
#[test]
fn display_conventions_mirror_the_slice() {
    let green_pixels = |picture: &RgbaImage, left: bool| -> u64 {
        picture
            .enumerate_pixels()
            .filter(|(x, _, _)| (*x < 256) == left)
            .filter(|(_, _, p)| p.0[1] > p.0[0].saturating_add(35) && p.0[1] > p.0[2].saturating_add(35))
            .map(|_| 1)
            .sum()
    };
    let fill = ["--view", "axial", "--overlay", "fill", "--palette", "thesis"];
    let radiological = picture(&fill);
    let neurological = picture(&[&fill[..], &["--neurological"]].concat());
    // The tumour is in the left hemisphere: on the right in the radiological convention.
    assert!(green_pixels(&radiological, false) > 10 * green_pixels(&radiological, true).max(1));
    assert!(green_pixels(&neurological, true) > 10 * green_pixels(&neurological, false).max(1));
}

#[test]
fn overlap_diagrams_match_their_goldens() {
    golden("overlap_ring", &picture(&["--view", "overlap", "--select", "all"]));
    golden("overlap_whole_masks", &picture(&["--view", "overlap", "--whole-masks", "--dark"]));
}

/// The sample's T1 grew anteriorly and has a new component: red where it grew, hatched where it is new.
#[test]
fn change_between_two_dates_is_coloured_and_matches_its_goldens() {
    let height = picture(&["--view", "change", "--camera", "20,10"]);
    let reddish = |p: &RgbaImage| {
        let is = |p: &&image::Rgba<u8>| i32::from(p.0[0]) - i32::from(p.0[1].max(p.0[2])) > 60;
        p.pixels().filter(is).count()
    };
    let unchanged = picture(&["--view", "change", "--camera", "20,10", "--of", "T2"]);
    assert!(reddish(&height) > 3000, "growth of 5 mm is coloured: {} pixels", reddish(&height));
    assert_ne!(height, unchanged);
    golden("change_height", &height);
    let arrows = picture(&["--view", "change", "--camera", "20,10", "--style", "arrows", "--dark"]);
    golden("change_arrows", &arrows);
    golden("change_rim", &picture(&["--view", "axial", "--changed-rim"]));
    golden("dates", &picture(&["--view", "dates"]));
}
