//! Figures of the lighting modes: directional occlusion and the headlight, apertures and footprints, the four kinds of
//! mutual occlusion added one by one, a clipping plane. Each is checked by pixel values and against a golden.

use glioscope::model::CaseRef;
use glioscope_core::files::write_whole;
use glioscope_tests::{golden, real_data, run, workstation, write_cube, write_tck};
use image::RgbaImage;

use crate::PROGRAM;

fn picture(arguments: &[&str]) -> RgbaImage {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.png");
    let mut all = vec!["render", "--software", "--size", "256x256", "--out", path.to_str().unwrap()];
    all.extend(arguments);
    let output = run(PROGRAM, &all);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    image::open(&path).unwrap().to_rgba8()
}

/// Mean brightness, 0 to 255, of the middle of the picture, which has no annotations and hardly any background.
fn brightness(picture: &RgbaImage) -> f64 {
    let middle = image::imageops::crop_imm(picture, 64, 56, 128, 128).to_image();
    let sum: f64 = middle.pixels().map(|p| p.0[..3].iter().map(|c| f64::from(*c)).sum::<f64>() / 3.0).sum();
    sum / (128.0 * 128.0)
}

const HEAD: [&str; 5] = ["--sample", "--view", "context", "--clip", "front=40"];

fn head(more: &[&str]) -> RgbaImage {
    picture(&[&HEAD[..], more].concat())
}

/// Slices as in the paper: a wider cone passes through more of the surrounding tissue, so the frame is darker; a finer
/// footprint changes little. All lighting modes differ from the headlight.
#[test]
fn directional_occlusion_differs_from_the_headlight() {
    let headlight = head(&[]);
    golden("figure_headlight", &headlight);
    let mut brightnesses = Vec::new();
    for (name, aperture, footprint) in [
        ("figure_slices_50_2", "50", "2"),
        ("figure_slices_50_13", "50", "13"),
        ("figure_slices_85_2", "85", "2"),
        ("figure_slices_85_13", "85", "13"),
    ] {
        let slices = ["--light", "slices", "--slices", "paper", "--slice-mm", "2", "--aperture", aperture];
        let drawn = head(&[&slices[..], &["--footprint", footprint]].concat());
        golden(name, &drawn);
        brightnesses.push(brightness(&drawn));
    }
    let [narrow, narrow_fine, wide, wide_fine] = brightnesses[..] else { panic!() };
    assert!(wide < narrow - 5.0 && wide_fine < narrow_fine - 5.0, "{brightnesses:?}");
    assert!((narrow - narrow_fine).abs() < 2.0 && (wide - wide_fine).abs() < 2.0, "{brightnesses:?}");
    let balanced_slices = head(&["--light", "slices", "--quality", "balanced"]);
    golden("figure_slices_mended", &balanced_slices);
    let cones = head(&["--light", "cones", "--quality", "balanced"]);
    golden("figure_cones", &cones);
    for lit in [&balanced_slices, &cones] {
        assert!((brightness(lit) - brightness(&headlight)).abs() > 1.0);
    }
}

/// Mean brightness of the left and of the right half of the middle.
fn halves(picture: &RgbaImage) -> [f64; 2] {
    [64, 128].map(|x| {
        let half = image::imageops::crop_imm(picture, x, 56, 64, 128).to_image();
        let sum: f64 = half.pixels().map(|p| p.0[..3].iter().map(|c| f64::from(*c)).sum::<f64>() / 3.0).sum();
        sum / (64.0 * 128.0)
    })
}

/// A lamp lights the side that it stands at; from in front, one that stays with the patient is one that goes with the viewer.
#[test]
fn a_placed_lamp_lights_its_side() {
    check_lamp(&["--light", "half-angle"]);
}

/// So it does where the cone of light points to it.
#[test]
fn a_cone_of_light_from_a_lamp_lights_its_side() {
    check_lamp(&["--light", "slices", "--aperture", "20"]);
    check_lamp(&["--light", "cones", "--aperture", "20"]);
}

fn check_lamp(light: &[&str]) {
    let lit = |place: &str, frame: &str| {
        let lamp = ["--quality", "balanced", "--lamp", place, "--lamp-frame", frame];
        picture(&[&["--sample", "--view", "context", "--camera", "0,0"][..], light, &lamp].concat())
    };
    let [left, right] = ["-60,20", "60,20"].map(|place| lit(place, "viewer"));
    let [left_halves, right_halves] = [&left, &right].map(halves);
    // Each half against itself by the other lamp: the head isn't the same on both sides.
    assert!(left_halves[0] > right_halves[0] + 10.0, "{left_halves:?} {right_halves:?}");
    assert!(right_halves[1] > left_halves[1] + 10.0, "{left_halves:?} {right_halves:?}");
    let of_patient = lit("-60,20", "patient");
    let off = left.as_raw().iter().zip(of_patient.as_raw()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(off <= 1, "{off}");
}

/// A clipping plane that removes tissue lets light reach what the tissue occluded.
#[test]
fn a_clipping_plane_changes_the_occlusion() {
    let lit = ["--sample", "--view", "context", "--transfer", "mr-tissue", "--light", "cones"];
    let whole = picture(&lit);
    let cut = picture(&[&lit[..], &["--clip", "front=10", "--clip", "top=60"]].concat());
    golden("figure_clip_none", &whole);
    golden("figure_clip", &cut);
    // The removed tissue no longer blocks the light inside the head.
    let changed_pixels =
        whole.pixels().zip(cut.pixels()).filter(|(a, b)| a.0[0].abs_diff(b.0[0]) > 12).count();
    assert!(changed_pixels > 5000, "{changed_pixels}");
}

/// Writes fibres near the sample's tumour: arcs that run superiorly, beside and anterior to it.
fn write_fibers(path: &std::path::Path) {
    let doc = workstation(CaseRef::Sample).doc.unwrap();
    let [x, y, z] = doc.edit.lens.center_mm.as_vec3().to_array();
    let fibers: Vec<Vec<[f32; 3]>> = (0..60)
        .map(|n| {
            let (u, v) = ((n % 10) as f32 * 3.0 - 15.0, (n / 10) as f32 * 3.0);
            (0..80)
                .map(|k| {
                    let t = k as f32 / 79.0 - 0.5;
                    let wave = 3.0 * (7.0 * t + 0.6 * n as f32).sin();
                    [x + u + wave, y + 26.0 + v - 30.0 * t * t, z + 90.0 * t + wave]
                })
                .collect()
        })
        .collect();
    write_tck(path, &fibers);
}

/// Adding each kind of mutual occlusion darkens pixels and lightens hardly any.
#[test]
fn each_kind_of_mutual_occlusion_darkens_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let tracts = folder.path().join("CST.tck");
    write_fibers(&tracts);
    let draw = |darkens: &str| {
        let scene = ["--sample", "--view", "context", "--transfer", "mr-tissue", "--camera", "10,10"];
        let light = ["--light", "slices", "--quality", "balanced", "--zoom", "1.6", "--darkens", darkens];
        picture(&[&scene[..], &light, &["--tracts", tracts.to_str().unwrap()]].concat())
    };
    let all = ["image-image", "solid-solid", "solid-image", "image-solid"];
    let names = ["figure_mutual_1", "figure_mutual_2", "figure_mutual_3", "figure_mutual_4"];
    let mut last = draw("none");
    golden("figure_mutual_0", &last);
    for n in 1..=all.len() {
        let next = draw(&all[..n].join(","));
        golden(names[n - 1], &next);
        let difference = |a: &image::Rgba<u8>, b: &image::Rgba<u8>| i32::from(a.0[1]) - i32::from(b.0[1]);
        let darker = next.pixels().zip(last.pixels()).filter(|(a, b)| difference(a, b) < -2).count();
        let lighter = next.pixels().zip(last.pixels()).filter(|(a, b)| difference(a, b) > 2).count();
        assert!(darker > 150 && lighter * 20 < darker, "{}: {darker} darker, {lighter} lighter", all[n - 1]);
        last = next;
    }
}

#[test]
fn glioma_lit_by_slices_and_by_cones_matches_its_goldens() {
    let Some(folder) = real_data("glioma-5-algorithms") else { return };
    let file = |name: &str| folder.join(format!("{name}.nii.gz")).display().to_string();
    let masks =
        ["hnfnetv1-20", "isen-20", "scan-20"].map(|name| format!("--mask={name}={}:1,2,4", file(name)));
    let context = format!("--context=T1c={}", file("t1c"));
    let mut arguments: Vec<&str> = masks.iter().map(String::as_str).collect();
    arguments.extend([context.as_str(), "--quality", "balanced"]);
    for (name, light) in [("figure_glioma_slices", "slices"), ("figure_glioma_cones", "cones")] {
        let view = picture(&[&arguments[..], &["--view", "context", "--light", light]].concat());
        golden(name, &view);
    }
    let closeup = picture(&[&arguments[..], &["--light", "cones"]].concat());
    golden("figure_glioma_closeup_cones", &closeup);
    let default_light = picture(&arguments);
    assert!(brightness(&closeup) < brightness(&default_light), "cones darken tilted surfaces");
}

/// The FLAIR shapes show the glioma, which is bright and wide enough to have a middle of small gradients, with its border within the faint surface
/// of the brain: four fifths of their green pixels lie in its place. By values alone the same range is spread over the brain, three
/// tenths of it there. Its place: all voxels of `consensus.nii.gz`, projected
/// along the camera's axis at 1.2 mm a pixel by NumPy, lie within 109 to 150 and 118 to 158 pixels; with a margin for perspective.
#[test]
fn glioma_by_a_2_d_transfer_function_matches_its_golden() {
    let Some(data) = real_data("glioma-5-algorithms") else { return };
    let folder = tempfile::tempdir().unwrap();
    // A mask in the corner of the image, so that nothing of the head is left out in front of it.
    let mask = folder.path().join("corner.nii.gz");
    write_cube(&mask, 2, 1.0, |_| 1);
    let (mask, image) = (
        format!("--mask=corner={}", mask.display()),
        format!("--context=FLAIR={}", data.join("fla.nii.gz").display()),
    );
    let scene =
        [&mask, &image, "--view", "context", "--select", "none", "--lens", "off", "--quality", "balanced"];
    let draw = |more: &[&str]| picture(&[&scene[..], &["--camera", "-50,25"], more].concat());
    let in_place = |picture: &RgbaImage| {
        let is_green = |p: &image::Rgba<u8>| i32::from(p.0[1]) > i32::from(p.0[0]) + 40;
        let green: Vec<(u32, u32)> =
            picture.enumerate_pixels().filter(|(.., p)| is_green(p)).map(|(x, y, _)| (x, y)).collect();
        let there = green.iter().filter(|(x, y)| (105..154).contains(x) && (114..166).contains(y));
        (there.count(), green.len())
    };
    let by_shapes = draw(&["--transfer", "flair-shapes"]);
    golden("figure_glioma_border", &by_shapes);
    let values = folder.path().join("values.transfer.json");
    let form = r#"{"box": {"values": [230, 342], "gradients_per_mm": [0, 10000], "soft": 0.3}}"#;
    let text = format!(
        r#"{{"glioscope_transfer": 1, "shapes": [{{"form": {form}, "color": [60, 165, 160], "opacity": 0.4}}]}}"#
    );
    write_whole(&values, text.as_bytes()).unwrap();
    let by_values = draw(&["--transfer", values.to_str().unwrap()]);
    let (there, all) = in_place(&by_shapes);
    assert!(there > 700 && there * 10 > all * 7, "{there} of {all}");
    let (there, all) = in_place(&by_values);
    assert!(there * 20 < all * 7, "{there} of {all}");
}
