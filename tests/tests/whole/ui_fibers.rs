//! How fibre tracts look: coloured by direction or by a scalar, their radius, smooth curves. The fibres are synthetic.

use std::path::{Path, PathBuf};

use egui::Theme;
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand},
    model::{CaseRef, FiberColor, FiberLook, PaneId, session},
};
use glioscope_core::optics::Camera;
use glioscope_render::{ColorMap, tract_color};
use glioscope_tests::{
    Dropped, Window, crop, doc, error_text, pane_picture, perform, refusal, run, wait_for_workers,
    window_with, workstation, write_tck,
};
use image::RgbaImage;

use crate::PROGRAM;

type Fibers = Vec<Vec<[f32; 3]>>;

fn center_mm() -> [f32; 3] {
    workstation(CaseRef::Sample).doc.unwrap().edit.lens.center_mm.as_vec3().to_array()
}

/// Twelve straight fibres of 41 points along one axis, `aside` mm beside the tumour along the next and before it.
fn bundle(axis: usize, aside: f32) -> Fibers {
    let center = center_mm();
    (0..12)
        .map(|n| {
            (0..41)
                .map(|k| {
                    let mut p = center;
                    p[1] += 40.0;
                    p[(axis + 1) % 3] += (n % 4) as f32 * 1.5 + aside;
                    p[(axis + 2) % 3] += (n / 4) as f32 * 1.5 + aside;
                    p[axis] += k as f32 - 20.0;
                    p
                })
                .collect()
        })
        .collect()
}

/// Writes a scalar of the points of `fibers` as MRtrix does.
fn write_tsf(path: &Path, fibers: &[Vec<[f32; 3]>], value: impl Fn(usize) -> f32) {
    let mut bytes = b"mrtrix track scalars\ndatatype: Float32LE\nfile: . 128\nEND\n".to_vec();
    bytes.resize(128, 0);
    let mut push = |v: f32| bytes.extend(v.to_le_bytes());
    for fiber in fibers {
        (0..fiber.len()).for_each(|k| push(value(k)));
        push(f32::NAN);
    }
    push(f32::INFINITY);
    std::fs::write(path, bytes).unwrap();
}

/// Three files of fibres along x, y and z.
fn write_axes(folder: &Path) -> [PathBuf; 3] {
    let paths = ["x", "y", "z"].map(|name| folder.join(format!("{name}.tck")));
    for (axis, (path, aside)) in paths.iter().zip([-14.0, 4.0, 10.0]).enumerate() {
        write_tck(path, &bundle(axis, aside));
    }
    paths
}

/// The picture of the context view with these tracts alone; other files of the folder are beside them.
fn draw(tracts: &[&Path], more: &[&str]) -> RgbaImage {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.png");
    let mut arguments = vec!["render", "--sample", "--view", "context", "--camera", "40,25", "--software"];
    arguments.extend(["--image", "none", "--select", "none", "--lens", "off", "--size", "500x420"]);
    for path in tracts {
        arguments.extend(["--tracts", path.to_str().unwrap()]);
    }
    arguments.extend(["--out", out.to_str().unwrap()]);
    arguments.extend(more);
    let output = run(PROGRAM, &arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    image::open(&out).unwrap().to_rgba8()
}

fn save(name: &str, picture: &RgbaImage) {
    if let Ok(folder) = std::env::var("GLIOSCOPE_TEST_PICTURES") {
        picture.save(Path::new(&folder).join(name)).unwrap();
    }
}

/// Pixels that differ between two pictures, away from the list at the top left, the cube and the scale.
fn different<'a>(
    a: &'a RgbaImage,
    b: &'a RgbaImage,
) -> impl Iterator<Item = ([u8; 4], [u8; 4], (u32, u32))> + 'a {
    let is_drawing = |x: u32, y: u32| y > 110 && y < 350 && x < 410;
    a.enumerate_pixels()
        .zip(b.pixels())
        .filter(move |((x, y, p), q)| is_drawing(*x, *y) && *p != *q)
        .map(|((x, y, p), q)| (p.0, q.0, (x, y)))
}

/// The channel that is far above both others, if one is: shading and highlights keep it so.
fn dominant([r, g, b, _]: [u8; 4]) -> Option<usize> {
    let channels = [r, g, b].map(f32::from);
    (0..3).find(|&c| {
        channels[c] > 25.0 && (0..3).all(|other| other == c || channels[other] < 0.5 * channels[c])
    })
}

/// The file whose colour a pixel has: that with the least angle to it.
fn file_of([r, g, b, _]: [u8; 4]) -> Option<usize> {
    let unit = |c: [u8; 3]| glam::DVec3::from_array(c.map(f64::from)).try_normalize();
    let own = unit([r, g, b])?;
    let angle = |n: &usize| unit(tract_color(*n)).map_or(9.0, |color| color.angle_between(own));
    (0..3).min_by(|a, b| angle(a).total_cmp(&angle(b)))
}

/// The convention of tractography, pixel by pixel: where a file's own colour says that its fibres are, along x, y or z, the
/// picture by direction is red, green or blue.
#[test]
fn pixels_have_the_color_of_the_direction_that_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let paths = write_axes(folder.path());
    let tracts: Vec<&Path> = paths.iter().map(PathBuf::as_path).collect();
    for dark in [false, true] {
        let more: &[&str] = if dark { &["--dark"] } else { &[] };
        let none = draw(&[], more);
        let plain = draw(&tracts, more);
        let colored = draw(&tracts, &[&["--fibre-colour", "direction"], more].concat());
        save(&format!("fibres-direction-{dark}.png"), &colored);
        save(&format!("fibres-plain-{dark}.png"), &plain);
        let is_tube: std::collections::HashSet<(u32, u32)> =
            different(&plain, &none).map(|(.., at)| at).collect();
        let (mut counts, mut others) = ([0; 3], 0);
        for (was, is, at) in different(&plain, &colored) {
            assert!(is_tube.contains(&at), "only fibres change: {at:?}");
            match (file_of(was), dominant(is)) {
                (Some(file), Some(channel)) if file == channel => counts[file] += 1,
                _ => others += 1,
            }
        }
        println!("dark {dark}: {counts:?} of {} pixels, {others} otherwise", is_tube.len());
        assert!(counts.iter().all(|&n| n > 800), "{counts:?}");
        assert!(others * 100 < is_tube.len(), "{others} of {}", is_tube.len());
        assert_eq!(counts.iter().sum::<usize>() + others, is_tube.len(), "every pixel of a fibre changes");
    }
}

#[test]
fn scalars_radius_and_curves_are_drawn_from_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let fibers = bundle(2, 0.0);
    let tck = folder.path().join("CST.tck");
    write_tck(&tck, &fibers);
    write_tsf(&folder.path().join("CST.FA.tsf"), &fibers, |k| k as f32 / 40.0);
    let none = draw(&[], &[]);
    let plain = draw(&[&tck], &[]);
    let by_fa = draw(&[&tck], &["--fibre-colour", "FA", "--fibre-map", "inverted-grey"]);
    save("fibres-scalar.png", &draw(&[&tck], &["--fibre-colour", "FA"]));
    // It rises superiorly, towards the top of the picture, and so does the darkness of this map.
    let rows = |picture: &RgbaImage, from: u32, to: u32| {
        let inside = different(picture, &none).filter(|(.., (_, y))| (from..to).contains(y));
        let greys: Vec<f64> = inside.map(|(p, ..)| f64::from(p[1])).collect();
        greys.iter().sum::<f64>() / greys.len().max(1) as f64
    };
    let tube_rows: Vec<u32> = different(&plain, &none).map(|(.., (_, y))| y).collect();
    let (top, bottom) = (*tube_rows.iter().min().unwrap(), *tube_rows.iter().max().unwrap());
    let fifth = (bottom - top) / 5;
    let means: Vec<f64> = (0..5).map(|n| rows(&by_fa, top + n * fifth, top + (n + 1) * fifth)).collect();
    println!("grey by fifths from the top: {means:.1?}");
    assert!(means.windows(2).all(|m| m[0] + 10.0 < m[1]), "{means:?}");
    // Half of the range: the upper half is at its end.
    let narrow = ["--fibre-colour", "FA", "--fibre-map", "inverted-grey", "--fibre-range", "0,0.5"];
    let narrow = draw(&[&tck], &narrow);
    assert!(rows(&narrow, top, top + 2 * fifth) < means[0] + 10.0);
    // Wider tubes cover more, and smooth curves of straight fibres are the same.
    let count = |picture: &RgbaImage| different(picture, &none).count();
    let wide = draw(&[&tck], &["--fibre-radius", "1.5"]);
    assert!(count(&wide) as f64 > 1.2 * count(&plain) as f64, "{} {}", count(&wide), count(&plain));
    let smooth = draw(&[&tck], &["--fibre-smooth"]);
    assert!(different(&smooth, &plain).count() * 50 < count(&plain));

    // Errors in one line.
    let file = tck.to_str().unwrap();
    let mut arguments = vec!["render", "--sample", "--view", "context", "--tracts", file, "--explain"];
    arguments.extend(["--fibre-colour", "MD", "--out", "x.png"]);
    let line = refusal(PROGRAM, &arguments);
    assert!(line.contains("--fibre-colour: found MD, expected one of plain, direction, FA"), "{line}");
    let short = folder.path().join("short.tsf");
    write_tsf(&short, &fibers[..3], |_| 0.0);
    let line = refusal(
        PROGRAM,
        &["tracts", "--sample", "--tracts", file, "--tracts", short.to_str().unwrap(), "--json"],
    );
    assert!(
        line.contains("short.tsf: found scalars of 3 fibres, expected those of 12, as its tracts have"),
        "{line}"
    );
}

/// The window with the context view maximised, looking from the front.
fn window() -> Window {
    let mut work = workstation(CaseRef::Sample);
    let doc = work.doc.as_mut().unwrap();
    doc.edit.maximized = Some(PaneId::Context);
    doc.nav.camera.world_from_camera = Camera::orientation(0.0, 0.0);
    let mut harness = window_with(work, [900.0, 700.0], Theme::Light);
    harness.run_ok();
    harness
}

fn look(harness: &Window) -> FiberLook {
    doc(harness).edit.tract_look("CST")
}

fn click(harness: &mut Window, label: &str) {
    harness.get_by_label(label).click();
    harness.run_ok();
    wait_for_workers(harness);
}

#[test]
fn the_list_s_menu_sets_the_look_which_is_undone_and_saved() {
    let folder = tempfile::tempdir().unwrap();
    let fibers = bundle(2, 0.0);
    let (tck, tsf) = (folder.path().join("CST.tck"), folder.path().join("FA.tsf"));
    write_tck(&tck, &fibers);
    write_tsf(&tsf, &fibers, |k| k as f32 / 40.0);
    let mut harness = window();
    for file in [&tck, &tsf] {
        harness.input_mut().dropped_files.push(std::sync::Arc::new(Dropped(file.clone())));
    }
    harness.run_steps(1);
    wait_for_workers(&mut harness);
    assert_eq!(error_text(&harness), "");
    assert_eq!(look(&harness), FiberLook::default());
    let blue = |harness: &mut Window| {
        let picture = pane_picture(harness, PaneId::Context);
        let middle =
            crop(&picture, egui::Rect::from_min_size(egui::pos2(200.0, 150.0), egui::vec2(400.0, 350.0)));
        middle.pixels().filter(|p| dominant(p.0) == Some(2)).count()
    };
    let before = blue(&mut harness);

    harness.get_by_label("Show or hide fibre tracts CST").click_secondary();
    harness.run_ok();
    click(&mut harness, "Colour of the fibres: direction");
    assert_eq!(look(&harness).color, FiberColor::Direction);
    let by_direction = blue(&mut harness);
    println!("{before} blue pixels of one colour, {by_direction} by direction");
    assert!(by_direction > before + 500, "{before} {by_direction}");
    save("fibres-menu-direction.png", &pane_picture(&mut harness, PaneId::Context));
    // The menu stays open: a scalar, its map, smooth curves.
    click(&mut harness, "Colour of the fibres: FA");
    click(&mut harness, "Colours of the scalar: inferno");
    click(&mut harness, "smooth curves");
    let set = look(&harness);
    let scalar = FiberColor::Scalar("FA".into());
    assert_eq!((&set.color, set.map, set.smooth), (&scalar, ColorMap::Inferno, Some(0.05)));
    save("fibres-menu-scalar.png", &pane_picture(&mut harness, PaneId::Context));
    for name in
        ["Radius of the fibres in millimetres", "Scalar of the first colour", "Scalar of the last colour"]
    {
        assert!(harness.query_by_label(name).is_some(), "{name}");
    }
    // Undo takes the changes back: in one step where they followed each other quickly.
    while harness.state().work.history.can_undo() {
        perform(&mut harness, EditCommand::Undo);
    }
    assert_eq!(look(&harness), FiberLook::default());
    while harness.state().work.history.can_redo() {
        perform(&mut harness, EditCommand::Redo);
    }
    assert_eq!(look(&harness), set);
    // Sessions keep it.
    let saved = folder.path().join("a.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(saved.clone()));
    let document = session::load(&saved).unwrap().document;
    assert_eq!((document.edit.tract_look("CST"), document.tracts.len()), (set.clone(), 2));
    let mut again = window();
    perform(&mut again, AppCommand::OpenSession(saved.clone()));
    wait_for_workers(&mut again);
    assert_eq!((error_text(&again).as_str(), look(&again)), ("", set));
    let case = again.state().work.world.case().unwrap();
    assert_eq!(case.tracts[0].tracts.scalars()[0].name(), "FA");
    let text = std::fs::read_to_string(&saved).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["document"]["edit"].as_object_mut().unwrap().remove("tract_looks").unwrap();
    std::fs::write(&saved, value.to_string()).unwrap();
    assert!(session::load(&saved).unwrap().document.edit.tract_looks.is_empty());
}
