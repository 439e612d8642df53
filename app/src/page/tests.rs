//! The page of the sample, and of small cases with known places.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::OnceLock,
};

use base64::{Engine, engine::general_purpose::STANDARD};
use fluent_bundle::FluentResource;
use glioscope_core::{
    Mask, Progress, Samples, Scaling, Volume,
    case::{self, Case},
    export::{self, SurfaceKind},
    glam::DVec3,
    sample,
};
use sha2::{Digest, Sha256};

use super::{
    compare::{Change, OBJECTS, nearest},
    contour::Field,
    simplify::simplified,
    surface::bounds,
    *,
};
use crate::words::Language;

/// Half of what a page may have: a phone opens it from a message.
const MOST_BYTES: usize = 4_000_000;

fn sample_case() -> &'static Case {
    static CASE: OnceLock<Case> = OnceLock::new();
    CASE.get_or_init(|| {
        case::load(&sample::sample_spec(), &case::LoadOptions::default(), &Progress::new()).unwrap()
    })
}

fn color(_: usize, mask: usize) -> [u8; 3] {
    [[194, 28, 5], [10, 116, 100], [138, 17, 206]][mask % 3]
}

fn options() -> Options<'static> {
    Options {
        has_dates: false,
        image: None,
        text: None,
        agreement_color: &|count, _| [60 * count as u8, 90, 120],
    }
}

fn sample_page() -> &'static Page {
    static PAGE: OnceLock<Page> = OnceLock::new();
    PAGE.get_or_init(|| {
        content(sample_case(), &color, &|_| String::new(), &options(), &Progress::new()).unwrap()
    })
}

fn html_of(page: &Page) -> String {
    super::page(page, &words(Language::En))
}

/// The text between two marks, the first of each.
fn between<'a>(text: &'a str, start: &str, end: &str) -> &'a str {
    text.split_once(start).unwrap().1.split_once(end).unwrap().0
}

#[test]
fn the_sample_is_small_and_the_same_each_time() {
    let again = content(sample_case(), &color, &|_| String::new(), &options(), &Progress::new()).unwrap();
    let html = html_of(&again);
    assert_eq!(html, html_of(sample_page()));
    assert!(html.len() < MOST_BYTES, "{} bytes", html.len());
}

#[test]
fn nothing_of_the_case_is_named() {
    let html = html_of(sample_page());
    let case = sample_case();
    let data = between(&html, "id=\"data\">", "</script>");
    let json: serde_json::Value = serde_json::from_str(data).unwrap();
    // Without stored pictures and numbers, in which any letters may stand.
    let mut text = html.replace(data, "").replace(include_str!("vendor/three.min.js"), "");
    while let Some(at) = text.find("base64,") {
        let end = at + text[at..].find('"').unwrap();
        text.replace_range(at..end, "");
    }
    for date in json["dates"].as_array().unwrap() {
        text += &date["name"].to_string();
    }
    let ids = case.time_points.iter().flat_map(|t| {
        t.masks
            .iter()
            .map(|m| m.mask.id())
            .chain(t.contexts.iter().map(|c| c.id.as_str()))
            .chain([t.label.as_str()])
    });
    let mut count = 0;
    for secret in ids.chain([case.name.as_str(), ".nii", "Glioscope", "glioscope"]) {
        let is_word = |(at, _): (usize, &str)| {
            let is_part = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
            !is_part(text[..at].chars().next_back()) && !is_part(text[at + secret.len()..].chars().next())
        };
        assert!(!text.match_indices(secret).any(is_word), "{secret} is on the page");
        count += 1;
    }
    assert!(count > 10, "{count}");
    // Shown when asked for.
    let options = Options { has_dates: true, ..options() };
    let shown = content(case, &color, &str::to_owned, &options, &Progress::new()).unwrap();
    let html = html_of(&shown);
    assert!(html.contains(&case.time_points[0].label) && html.contains(">PET<"));
}

#[test]
fn names_and_text_are_shown_as_they_stand() {
    let hostile = "</script><script>alert(1)</script>&\"'<img src=x onerror=alert(1)>";
    let mut page = sample_page().clone();
    let plain = html_of(&page);
    page.masks[0].name = hostile.to_owned();
    page.dates[1].label = Some(hostile.to_owned());
    page.text = Some(parse(&format!("# {hostile}\n\n{hostile}")));
    let html = html_of(&page);
    assert!(html.contains("&lt;img src=x onerror=alert(1)&gt;"));
    for tag in ["<script", "</script", "<img", "onerror=alert(1)>"] {
        assert_eq!(html.matches(tag).count(), plain.matches(tag).count(), "{tag}");
    }
    let json: serde_json::Value = serde_json::from_str(between(&html, "id=\"data\">", "</script>")).unwrap();
    assert_eq!(json["dates"][1]["name"], hostile);
}

#[test]
fn only_its_own_script_and_style_run() {
    let html = html_of(sample_page());
    let policy = between(&html, "Content-Security-Policy\" content=\"", "\"").replace("&#39;", "'");
    assert!(policy.starts_with("default-src 'none'; img-src data:;"), "{policy}");
    assert!(!policy.contains("unsafe"), "{policy}");
    let hash = |text: &str| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text.as_bytes())));
    let style = between(&html, "<style>", "</style>");
    assert!(policy.contains(&hash(style)), "the style");
    let scripts: Vec<&str> =
        html.split("<script>").skip(1).map(|rest| rest.split_once("</script>").unwrap().0).collect();
    assert_eq!(scripts.len(), 2);
    assert!(scripts.iter().all(|script| policy.contains(&hash(script))));
    // Inline styles and handlers would be refused.
    let body = html.replace(scripts[0], "").replace(scripts[1], "");
    assert!(!body.contains(" style=\"") && !body.contains(" onclick="));
}

#[test]
fn larger_volumes_have_larger_objects() {
    assert!(OBJECTS.windows(2).all(|w| w[0].diameter_mm < w[1].diameter_mm));
    // A ball of 40 mm has 33.51 ml: table tennis.
    let ball = OBJECTS.iter().find(|o| o.key == "object-table-tennis-ball").unwrap();
    assert!((ball.volume_ml() - 33.510).abs() < 0.001, "{}", ball.volume_ml());
    let mut last = 0.0;
    let mut worst: f64 = 1.0;
    for step in 0..4000 {
        let volume_ml = 0.003 * 1.003_f64.powi(step);
        let Some(object) = nearest(volume_ml) else {
            assert!(volume_ml > 700.0, "{volume_ml} ml has none");
            break;
        };
        assert!(object.volume_ml() >= last, "{volume_ml}");
        last = object.volume_ml();
        worst = worst.max((last / volume_ml).max(volume_ml / last));
    }
    // "About as large": the largest gap is between a pinhead and a peppercorn, of 2.5 in diameter.
    assert!(worst < 4.0, "{worst}");
    assert!([0.0, -1.0, f64::NAN, f64::INFINITY, 1e4].into_iter().all(|ml| nearest(ml).is_none()));
}

#[test]
fn a_tenth_is_about_the_same() {
    let known =
        [(10.0, 11.0), (10.0, 9.0), (10.0, 11.1), (10.0, 8.9), (0.0, 3.0), (10.0, 0.0), (f64::NAN, 1.0)];
    let found = known.map(|(a, b)| Change::between(a, b));
    let [same, larger, smaller] = [Change::Same, Change::Larger, Change::Smaller].map(Some);
    assert_eq!(found, [same, same, larger, smaller, None, smaller, None]);
}

/// Both languages have every sentence that is asked for, with the same variables.
#[test]
fn every_language_has_every_sentence() {
    let known = |language: Language| -> BTreeMap<String, BTreeSet<String>> {
        let resource = FluentResource::try_new(sentences::source(language).to_owned());
        assert!(resource.is_ok(), "{language:?}: {:?}", resource.err().map(|(_, errors)| errors));
        let lines = sentences::source(language).lines().filter_map(|line| line.split_once(" = "));
        let variables = |text: &str| {
            text.split("{ $").skip(1).map(|v| v.split_once(" }").unwrap().0.to_owned()).collect()
        };
        lines.map(|(key, text)| (key.to_owned(), variables(text))).collect()
    };
    let en = known(Language::En);
    assert_eq!(en, known(Language::De));
    assert!(en.len() > 80, "{}", en.len());
    assert!(OBJECTS.iter().all(|object| en.contains_key(object.key)));
    // A key without a sentence would be shown itself.
    let mut odd = sample_page().clone();
    odd.has_sides = false;
    odd.is_ordered = false;
    odd.dates[1].largest.as_mut().unwrap().size_mm = [400.0, 400.0];
    odd.dates[1].masks[0].as_mut().unwrap().volume_ml = 2000.0;
    odd.dates[1].masks[1].as_mut().unwrap().volume_ml = 0.001;
    for page in [sample_page(), &odd] {
        for language in [Language::En, Language::De] {
            let html = super::page(page, &words(language));
            for key in en.keys().filter(|key| key.contains('-')) {
                for shown in [format!(">{key}<"), format!("\"{key}\""), format!(" {key} ")] {
                    let is_id = html.contains(&format!("id=\"{key}\""));
                    assert!(
                        is_id || !html.replace(include_str!("vendor/three.min.js"), "").contains(&shown),
                        "{key}"
                    );
                }
            }
            let own = html.replace(include_str!("vendor/three.min.js"), "");
            assert!(!own.contains("{$") && !own.contains("{ $"));
        }
    }
}

fn sample_mask() -> &'static Mask {
    &sample_case().time_points[0].masks[1].mask
}

#[test]
fn stored_positions_are_within_a_tenth_of_a_millimetre() {
    let mesh = export::mesh(sample_mask(), SurfaceKind::Smoothed, &Progress::new()).unwrap();
    let stored = Surface::of_triangles(mesh.positions_mm(), mesh.triangles().to_vec());
    let worst =
        mesh.positions_mm().iter().zip(stored.positions_mm()).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
    let (lo, hi) = bounds(mesh.positions_mm());
    // Half a step along each axis.
    let bound = (hi - lo).max_element() / 65_535.0 * 0.5 * 3.0_f64.sqrt();
    assert!(worst <= bound * (1.0 + 1e-6) && worst < 0.1 && worst > 0.0, "{worst} mm of {bound} mm");
}

/// Six times the volume of triangles, each with the origin.
fn volume_mm3(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let six = triangles.iter().map(|t| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        a.dot(b.cross(c))
    });
    six.sum::<f64>() / 6.0
}

#[test]
fn fewer_triangles_enclose_the_same() {
    let mesh = export::mesh(sample_mask(), SurfaceKind::Smoothed, &Progress::new()).unwrap();
    let (positions, triangles) = simplified(mesh.positions_mm(), mesh.triangles(), 0.08);
    assert!(
        triangles.len() * 2 < mesh.triangles().len(),
        "{} of {}",
        triangles.len(),
        mesh.triangles().len()
    );
    let share = volume_mm3(&positions, &triangles) / mesh.volume_mm3();
    assert!((share - 1.0).abs() < 0.003, "{share}");
    // Closed: each edge in both directions equally often.
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for t in &triangles {
        for n in 0..3 {
            let [a, b] = [t[n], t[(n + 1) % 3]];
            assert_ne!(a, b);
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|balance| *balance == 0));
    // Every corner of the first lies near the second: brute force over triangles, every 40th corner.
    let worst = mesh.positions_mm().iter().step_by(40).map(|p| {
        let distance = |t: &[u32; 3]| to_triangle(*p, t.map(|v| positions[v as usize]));
        triangles.iter().map(distance).fold(f64::MAX, f64::min)
    });
    let worst = worst.fold(0.0, f64::max);
    assert!(worst < 0.5, "{worst} mm");
}

/// Distance of a point to a triangle: to its plane where the foot is inside, else to its sides.
fn to_triangle(p: DVec3, corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let inside = (0..3).all(|n| {
        let (from, to) = (corners[n], corners[(n + 1) % 3]);
        (to - from).cross(p - from).dot(normal) >= 0.0
    });
    let side = |n: usize| {
        let (from, along) = (corners[n], corners[(n + 1) % 3] - corners[n]);
        let t = ((p - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        p.distance(from + along * t)
    };
    if inside { (p - a).dot(normal).abs() } else { side(0).min(side(1)).min(side(2)) }
}

/// A cube's sides are flat: its twelve triangles remain, corners in place.
#[test]
fn a_cube_keeps_its_corners() {
    let grid = glioscope_core::Grid::axis_aligned([12; 3], DVec3::ONE, DVec3::ZERO).unwrap();
    let bits = glioscope_core::MaskBits::full([12; 3]);
    let mesh =
        export::mesh(&Mask::new("", grid, bits).unwrap(), SurfaceKind::VoxelFaces, &Progress::new()).unwrap();
    let (positions, triangles) = simplified(mesh.positions_mm(), mesh.triangles(), 0.01);
    assert!((volume_mm3(&positions, &triangles) - 1728.0).abs() < 1.0);
    assert!(triangles.len() < 100 && triangles.len() >= 12, "{}", triangles.len());
    let (lo, hi) = bounds(&positions);
    assert!(lo.distance(DVec3::splat(-0.5)) + hi.distance(DVec3::splat(11.5)) < 1e-9, "{lo} {hi}");
}

#[test]
fn an_outline_has_the_area_of_its_disc() {
    let (center, radius) = (20.0, 12.3);
    let values = (0..40 * 40).map(|n| {
        let [x, y] = [n % 40, n / 40].map(|v| f64::from(v) + 0.5 - center);
        0.5 + radius - x.hypot(y)
    });
    let field = Field { values: values.collect(), size: [40, 40], pixel_mm: 0.5 };
    let loops = field.loops_mm();
    assert_eq!(loops.len(), 1);
    let next = loops[0].iter().cycle().skip(1);
    let area = loops[0].iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>().abs() / 2.0;
    let true_area = std::f64::consts::PI * (radius * 0.5_f64).powi(2);
    assert!((area / true_area - 1.0).abs() < 0.003, "{area} of {true_area}");
    // A ring has two, and what touches the border is closed.
    let ring = Field {
        values: (0..25).map(|n| f64::from(u8::from(n != 12))).collect(),
        size: [5, 5],
        pixel_mm: 1.0,
    };
    assert_eq!(ring.loops_mm().len(), 2);
}

/// What lies in the patient's left (x < 0) is in the right half of pictures, what is in front in the upper.
#[test]
fn left_is_at_the_right() {
    let page = sample_page();
    for (date, time) in page.dates.iter().zip(&sample_case().time_points) {
        let center = time.regions.centroid_mm().unwrap();
        let (lo, hi) = page.head.as_ref().unwrap().bounds_mm();
        let middle = (lo + hi) / 2.0;
        assert!(center.x < middle.x - 10.0, "the sample's tumour is on the left: {center}");
        for slice in date.slices.iter().filter(|slice| slice.plane != Plane::Sagittal) {
            let numbers: Vec<f64> = slice.levels[0]
                .split(['M', 'L', 'Z'])
                .filter_map(|pair| pair.split_once(' ')?.0.parse().ok())
                .collect();
            let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
            let expected = hi.x + 4.0 - center.x;
            assert!(
                mean > slice.size_mm[0] / 2.0 && (mean - expected).abs() < 10.0,
                "{mean} mm, {expected} mm"
            );
        }
    }
}

/// Filters leave values below air at edges; on what surrounds a ball they must not make the box of the image its outline.
#[test]
fn a_few_values_below_air_leave_the_outline() {
    let (side, radius_mm) = (60, 40.0);
    let grid = glioscope_core::Grid::axis_aligned([side; 3], DVec3::splat(2.0), DVec3::ZERO).unwrap();
    let middle = DVec3::splat(side as f64 - 1.0);
    let value = |n: usize| match grid.center_of_voxel_mm(grid.ijk(n)).distance(middle) {
        r if r < radius_mm => 200,
        r if r < radius_mm + 2.0 && n.is_multiple_of(50) => -45,
        _ => 0,
    };
    let samples = Samples::I16((0..side * side * side).map(value).collect());
    let image = Volume::new(grid, samples, Scaling::NONE).unwrap();
    let outline = head::head(&image, &Progress::new()).unwrap().unwrap();
    let (lo, hi) = outline.bounds_mm();
    for (bound, sign) in [(lo, -1.0), (hi, 1.0)] {
        let off = (bound - middle - sign * radius_mm).abs().max_element();
        // A coarse voxel.
        assert!(off < 3.5, "{bound}: {off} mm off");
    }
}

#[test]
fn edited_text_replaces_the_default() {
    let words = words(Language::En);
    let default = default_text(sample_page(), &words);
    assert_eq!(parse(&default), text::paragraphs(sample_page(), &words), "what is written is read again");
    let edited = parse("\u{feff}# Dear patient\nOne\ntwo.\n\n\nThree.\n##\n");
    let expected = [
        Paragraph::Heading("Dear patient".into()),
        Paragraph::Text("One two.".into()),
        Paragraph::Text("Three.".into()),
    ];
    assert_eq!(edited, expected);
    let options = Options { text: Some(&edited), ..options() };
    let page = content(sample_case(), &color, &|_| String::new(), &options, &Progress::new()).unwrap();
    let html = html_of(&page);
    assert!(html.contains("<h2>Dear patient</h2>") && !html.contains("What this page cannot say"));
}

/// Relative luminance and contrast of WCAG 2.2, from the text of the style.
#[test]
fn colours_of_letters_have_contrast() {
    let style = include_str!("page.css");
    let value = |block: &str, name: &str| {
        let hex = u32::from_str_radix(&between(block, &format!("{name}: #"), ";")[..6], 16).unwrap();
        let linear = [16, 8, 0].map(|shift| {
            let v = f64::from(hex >> shift & 0xff) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    };
    let blocks: Vec<&str> =
        style.split(":root {").skip(1).take(2).map(|b| b.split_once('}').unwrap().0).collect();
    for block in blocks {
        for (ink, paper) in [
            ("--ink", "--paper"),
            ("--ink", "--back"),
            ("--soft", "--paper"),
            ("--soft", "--back"),
            ("--on-accent", "--accent"),
            ("--accent", "--paper"),
        ] {
            let [a, b] = [value(block, ink), value(block, paper)];
            let contrast = (a.max(b) + 0.05) / (a.min(b) + 0.05);
            assert!(contrast >= 4.5, "{ink} on {paper}: {contrast}");
        }
    }
}

#[test]
fn what_cannot_be_shown_is_refused_in_one_line() {
    let progress = Progress::new();
    let name = |_: &str| String::new();
    let missing = Options { image: Some("nothing of the kind"), ..options() };
    let why = content(sample_case(), &color, &name, &missing, &progress).unwrap_err().to_string();
    assert!(why.contains("nothing of the kind") && !why.contains('\n'));
    let mut empty = sample_case().clone();
    empty.time_points.clear();
    assert!(matches!(content(&empty, &color, &name, &options(), &progress), Err(PageError::Nothing)));
    let stopped = Progress::new();
    stopped.cancel();
    assert!(content(sample_case(), &color, &name, &options(), &stopped).is_err());
}
