//! Dates in one space in the window: moved by hand, by a file, by registration; side by side and over each other.

use egui::Theme;
use egui_kittest::kittest::Queryable;
use glioscope::{
    command::{AppCommand, EditCommand, LookCommand},
    model::{CaseRef, Fusion, PaneId, SecondImage, session},
};
use glioscope_core::{
    Grid, Samples, Scaling, Volume,
    files::{WriteOptions, write_nifti, write_whole},
    glam::{DAffine3, DMat3, DVec3},
};
use glioscope_render::{ColorMap, flat::Mixing};
use glioscope_tests::{
    Window, count_color, doc, error_text, maximized, pane_picture, perform, sample, wait_for_workers,
    window_with, workstation,
};

const LATER: &str = "2024-04-15";

/// How far the transforms of the open case move the lens' centre back.
fn moved_mm(harness: &Window) -> Option<DVec3> {
    let case = harness.state().work.world.case().unwrap();
    let moved = case.aligned.iter().find(|a| a.time == LATER && a.is_mask)?;
    let at = doc(harness).edit.lens.center_mm;
    Some(moved.case_from_own.transform_point3(at) - at)
}

#[test]
fn a_date_moved_by_hand_is_moved_back_by_undo() {
    let mut harness = sample();
    perform(&mut harness, AppCommand::ShowAlign);
    for _ in 0..2 {
        harness.get_by_label("To the left").click_accesskit();
        wait_for_workers(&mut harness);
    }
    let moved = moved_mm(&harness).unwrap();
    assert!((moved - DVec3::new(-2.0, 0.0, 0.0)).length() < 1e-9, "{moved}");
    assert!(harness.query_by_label("moved by hand").is_some());
    harness.get_by_label("Turn left").click_accesskit();
    wait_for_workers(&mut harness);
    let aligned = &harness.state().work.world.case().unwrap().aligned;
    let turn = aligned[0].case_from_own.matrix3;
    assert!((turn.x_axis.x - 1_f64.to_radians().cos()).abs() < 1e-12, "turned by a degree");

    // A session keeps it.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moved.glioscope.json");
    perform(&mut harness, AppCommand::SaveSessionTo(path.clone()));
    assert_eq!(session::load(&path).unwrap().document.edit.alignments, doc(&harness).edit.alignments);
    // Undo moves it back, and what else was undone stays in its order.
    while harness.state().work.history.can_undo() {
        perform(&mut harness, EditCommand::Undo);
        wait_for_workers(&mut harness);
    }
    assert_eq!(moved_mm(&harness), None);
    perform(&mut harness, EditCommand::Redo);
    wait_for_workers(&mut harness);
    assert!(moved_mm(&harness).is_some());
    assert_eq!(error_text(&harness), "");
}

#[test]
fn a_file_moves_a_date_and_one_that_does_not_is_told_and_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n\
                Parameters: 1 0 0 0 1 0 0 0 1 0 0 5\nFixedParameters: 0 0 0\n";
    write_whole(&at("up.tfm"), text.as_bytes()).unwrap();
    write_whole(&at("bare.txt"), b"1 0 0 3\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").unwrap();
    let mut harness = sample();
    perform(&mut harness, AppCommand::AlignByFile(LATER.into(), at("bare.txt")));
    wait_for_workers(&mut harness);
    assert!(error_text(&harness).contains("a bare 4x4 matrix"), "{}", error_text(&harness));
    assert!(doc(&harness).edit.alignments.is_empty() && moved_mm(&harness).is_none());
    perform(&mut harness, AppCommand::AlignByFile(LATER.into(), at("up.tfm")));
    wait_for_workers(&mut harness);
    // The fixed image's points lie 5 mm higher in the moving one, which is moved down.
    assert_eq!(moved_mm(&harness), Some(DVec3::new(0.0, 0.0, -5.0)));
    perform(&mut harness, AppCommand::ShowAlign);
    harness.get_by_label("Take back").click_accesskit();
    wait_for_workers(&mut harness);
    assert_eq!(moved_mm(&harness), None);
}

#[test]
fn registering_dates_that_lie_on_each_other_moves_nothing_far() {
    let mut harness = sample();
    perform(&mut harness, AppCommand::ShowAlign);
    harness.get_by_label("loops").click_accesskit();
    harness.get_by_label("Register").click_accesskit();
    harness.run_ok();
    let started = std::time::Instant::now();
    while doc(&harness).edit.alignments.is_empty() && started.elapsed().as_secs() < 120 {
        std::thread::sleep(std::time::Duration::from_millis(50));
        harness.run_ok();
    }
    wait_for_workers(&mut harness);
    // The phantom's head is the same at both dates, and its tumour grew.
    let moved = moved_mm(&harness).unwrap();
    assert!(moved.length() < 0.1, "{moved}");
    assert!(harness.query_by_label_contains("consistency at the tumour").is_some());
    assert!(harness.query_by_label_contains("around a loop").is_some());
    // Both dates on the slices, divided by a line.
    harness.get_by_label("Look").click_accesskit();
    harness.run_ok();
    let fusion = &doc(&harness).edit.fusion;
    let second = SecondImage { id: "T1c".into(), time: Some(LATER.into()) };
    assert_eq!((fusion.second.as_ref(), fusion.mixing), (Some(&second), Mixing::Swipe));
}

#[test]
fn a_second_image_is_chosen_in_the_toolbar_and_drawn() {
    let mut harness = sample();
    maximized(&mut harness, PaneId::Axial);
    let plain = pane_picture(&mut harness, PaneId::Axial);
    let second = Some(SecondImage { id: "PET".into(), time: None });
    let fusion =
        Fusion { second, mixing: Mixing::Over, map: ColorMap::Hot, opacity: 1.0, ..Fusion::default() };
    perform(&mut harness, EditCommand::SetFusion(Box::new(fusion.clone())));
    let over = pane_picture(&mut harness, PaneId::Axial);
    let yellow = |picture: &image::RgbaImage| {
        picture.pixels().filter(|p| p[0] > 240 && p[1] > 150 && p[2] < 120).count()
    };
    assert!(yellow(&over) > yellow(&plain) + 200, "{} {}", yellow(&over), yellow(&plain));
    // A line in the middle, right of which the second image is grey; or at the right edge.
    let swipe = |share| Fusion { mixing: Mixing::Swipe, map: ColorMap::Grey, share, ..fusion.clone() };
    let [swiped, first] = [0.5, 1.0].map(|share| {
        perform(&mut harness, EditCommand::SetFusion(Box::new(swipe(share))));
        pane_picture(&mut harness, PaneId::Axial)
    });
    let differs =
        |x: u32| (0..first.height()).filter(|&y| first.get_pixel(x, y) != swiped.get_pixel(x, y)).count();
    let (left, right) = (first.width() / 4, first.width() * 6 / 10);
    assert_eq!(differs(left), 0);
    assert!(differs(right) > 50);
    while harness.state().work.history.can_undo() {
        perform(&mut harness, EditCommand::Undo);
    }
    assert_eq!(doc(&harness).edit.fusion.second, None);
}

#[test]
fn slices_side_by_side_share_place_and_window_and_name_their_dates() {
    let mut harness = sample();
    perform(&mut harness, EditCommand::TogglePane(PaneId::SideBySide));
    let rect = maximized(&mut harness, PaneId::SideBySide);
    for (x, date) in [(0.25, "2024-01-15"), (0.75, LATER)] {
        let at = rect.min + egui::vec2(rect.width() * x, rect.height() * 0.5);
        harness.event(egui::Event::PointerMoved(at));
        harness.run_ok();
        // The crosshair follows in both, and the place is the same for the same part of either.
        let found = doc(&harness).nav.crosshair_mm();
        assert!(found.is_finite(), "{date}");
    }
    let picture = pane_picture(&mut harness, PaneId::SideBySide);
    // Masks of both dates are outlined, and the later ones are larger.
    let red = |from: f32, to: f32| {
        let (from, to) = ((picture.width() as f32 * from) as u32, (picture.width() as f32 * to) as u32);
        let part = image::imageops::crop_imm(&picture, from, 0, to - from, picture.height()).to_image();
        count_color(&part, [200, 30, 20], 60)
    };
    let (prior, current) = (red(0.0, 0.5), red(0.5, 1.0));
    assert!(prior > 100 && current > prior, "{prior} {current}");
    // A second image lies over the slices of each date: that date's own.
    let second = Some(SecondImage { id: "PET".into(), time: None });
    let fusion =
        Fusion { second, mixing: Mixing::Over, map: ColorMap::Hot, opacity: 1.0, ..Fusion::default() };
    perform(&mut harness, EditCommand::SetFusion(Box::new(fusion)));
    let fused = pane_picture(&mut harness, PaneId::SideBySide);
    let differs = |from: u32, to: u32| {
        let pixels = (from..to).flat_map(|x| (0..fused.height()).map(move |y| (x, y)));
        pixels.filter(|(x, y)| fused.get_pixel(*x, *y) != picture.get_pixel(*x, *y)).count()
    };
    let (half, width) = (fused.width() / 2, fused.width());
    assert!(
        differs(0, half) > 500 && differs(half, width) > 500,
        "{} {}",
        differs(0, half),
        differs(half, width)
    );
    perform(&mut harness, EditCommand::SetFusion(Box::default()));
    // A click pins the crosshair there at whatever date.
    harness.event(egui::Event::PointerMoved(rect.center() + egui::vec2(rect.width() * 0.2, 0.0)));
    perform(&mut harness, LookCommand::SetTime(1));
    assert_eq!(doc(&harness).nav.time, 1);
    assert_eq!(error_text(&harness), "");
}

/// A column for each mask, with the colour of that mask alone, and a row for each plane.
#[test]
fn masks_stand_side_by_side_each_alone_in_all_planes() {
    let mut harness = sample();
    perform(&mut harness, EditCommand::TogglePane(PaneId::SideBySide));
    maximized(&mut harness, PaneId::SideBySide);
    harness.get_by_label("Masks by planes").click_accesskit();
    harness.run_ok();
    for plane in ["Axial", "Coronal", "Sagittal"] {
        let slices = harness.query_all_by_label_contains(&format!("{plane} slice")).count();
        assert_eq!(slices, 3, "{plane}");
    }
    let picture = pane_picture(&mut harness, PaneId::SideBySide);
    let (world, third) = (&harness.state().work.world, picture.width() / 3);
    let colors = world.colors(doc(&harness));
    for column in 0..3 {
        let part = image::imageops::crop_imm(&picture, column * third, 0, third, picture.height()).to_image();
        let outlines = [0, 1, 2].map(|mask| count_color(&part, colors.mask(mask), 3));
        for (mask, pixels) in (0..).zip(outlines) {
            assert!(if mask == column { pixels > 100 } else { pixels == 0 }, "{column}: {outlines:?}");
        }
    }
    harness.get_by_label("Masks by planes").click_accesskit();
    harness.run_ok();
    assert_eq!(harness.query_all_by_label_contains("Axial slice").count(), 2, "both dates again");
}

/// Both images in turn, each for 0.7 s.
#[test]
fn two_images_blink() {
    let mut harness = sample();
    maximized(&mut harness, PaneId::Axial);
    let second = Some(SecondImage { id: "PET".into(), time: None });
    let fusion = Fusion { second, mixing: Mixing::Blink, map: ColorMap::Hot, ..Fusion::default() };
    perform(&mut harness, EditCommand::SetFusion(Box::new(fusion)));
    let yellow: Vec<usize> = (0..8)
        .map(|_| {
            harness.step();
            let picture = harness.render().unwrap();
            picture.pixels().filter(|p| p[0] > 240 && p[1] > 150 && p[2] < 120).count()
        })
        .collect();
    let (least, most) = (yellow.iter().min().unwrap(), yellow.iter().max().unwrap());
    assert!(most > &(least + 200), "{yellow:?}");
    let changes = yellow.windows(2).filter(|pair| pair[0].abs_diff(pair[1]) > 100).count();
    assert!((1..=4).contains(&changes), "{yellow:?}");
}

/// An image of the same date that lies elsewhere is registered to the one shown, with the mask that was drawn on its grid; and what
/// a reader says of it is kept.
#[test]
fn an_image_is_registered_within_its_date_and_a_reader_accepts_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let given = sample();
    let case = given.state().work.world.case().unwrap().clone();
    let center_mm = doc(&given).edit.lens.center_mm;
    let time = &case.time_points[0];
    let image = |id: &str| time.contexts.iter().find(|c| c.id == id).unwrap().volume.clone();
    let (t1c, pet) = (image("T1c"), image("PET"));
    // Truth: where the files of PET are put.
    let turn = DMat3::from_axis_angle(DVec3::new(0.2, 0.3, 1.0).try_normalize().unwrap(), 4_f64.to_radians());
    let shift = DAffine3 { matrix3: turn, translation: DVec3::new(6.0, -4.0, 5.0) };
    let moved =
        Grid::new(pet.grid().dims(), shift * pet.grid().world_from_voxel(), pet.grid().sides()).unwrap();
    let write =
        |name: &str, volume: &Volume| write_nifti(&at(name), volume, &WriteOptions::default()).unwrap();
    write("t1c.nii", &t1c);
    write("pet.nii", &Volume::new(moved.clone(), pet.samples().clone(), pet.scaling()).unwrap());
    let ball = |grid: &Grid, inside: &dyn Fn([usize; 3]) -> bool| {
        let values = (0..grid.voxel_count()).map(|l| u8::from(inside(grid.ijk(l)))).collect();
        Volume::new(grid.clone(), Samples::U8(values), Scaling::NONE).unwrap()
    };
    let near = |grid: &Grid, ijk: [usize; 3]| grid.center_of_voxel_mm(ijk).distance(center_mm) < 12.0;
    write("pet-mask.nii", &ball(&moved, &|ijk| near(pet.grid(), ijk)));
    write("t1-mask.nii", &ball(t1c.grid(), &|ijk| near(t1c.grid(), ijk)));
    drop(given);

    let file = |id: &str, name: &str| format!("{id}={}", at(name).display());
    let case = CaseRef::Arguments {
        masks: vec![file("T1", "t1-mask.nii"), file("PETseg", "pet-mask.nii")],
        contexts: vec![file("T1c", "t1c.nii"), file("PET", "pet.nii")],
    };
    let mut harness = window_with(workstation(case), [1280.0, 800.0], Theme::Dark);
    harness.run_ok();
    perform(&mut harness, LookCommand::SetContext(Some("T1c".into())));
    perform(&mut harness, AppCommand::ShowAlign);
    harness.get_by_label("Register images").click_accesskit();
    harness.run_ok();
    let started = std::time::Instant::now();
    while doc(&harness).edit.alignments.is_empty() && started.elapsed().as_secs() < 200 {
        std::thread::sleep(std::time::Duration::from_millis(50));
        harness.run_ok();
    }
    wait_for_workers(&mut harness);
    let aligned = |harness: &Window| harness.state().work.world.case().unwrap().aligned.clone();
    let moved: Vec<(String, bool)> = aligned(&harness).into_iter().map(|a| (a.id, a.is_mask)).collect();
    assert_eq!(moved, [("PET".into(), false), ("PETseg".into(), true)]);
    for one in aligned(&harness) {
        let off_mm =
            one.case_from_own.transform_point3(shift.transform_point3(center_mm)).distance(center_mm);
        // Voxels of 3 mm.
        assert!(off_mm < 0.5 && one.accepted.is_none(), "{off_mm}");
    }
    assert!(harness.query_by_label_contains("no reader has accepted it").is_some());
    // Both on the slices, divided by a line.
    harness.get_by_label("Look").click_accesskit();
    harness.run_ok();
    let fusion = doc(&harness).edit.fusion.clone();
    assert_eq!((fusion.second.unwrap().id.as_str(), fusion.mixing), ("PET", Mixing::Swipe));
    // Not accepted yet, it can be rejected; undo brings it back.
    harness.get_by_label("Reject").click_accesskit();
    wait_for_workers(&mut harness);
    assert_eq!(aligned(&harness), []);
    perform(&mut harness, EditCommand::Undo);
    wait_for_workers(&mut harness);
    assert_eq!(aligned(&harness).len(), 2);
    harness.get_by_label("Accept").click_accesskit();
    wait_for_workers(&mut harness);
    let day = aligned(&harness)[1].accepted.clone().unwrap();
    assert!(harness.query_by_label_contains(&format!("(accepted {day})")).is_some(), "{day}");
    harness.get_by_label("Take back").click_accesskit();
    wait_for_workers(&mut harness);
    assert_eq!(aligned(&harness), []);
    assert_eq!(error_text(&harness), "");
}

#[test]
fn a_drag_with_alt_moves_the_date_shown_and_never_the_first() {
    let mut harness = sample();
    let rect = maximized(&mut harness, PaneId::Axial);
    let drag = |harness: &mut Window, by: egui::Vec2| {
        let (from, alt) = (rect.center(), egui::Modifiers::ALT);
        harness.event(egui::Event::PointerMoved(from));
        harness.run_ok();
        let button = |pressed, pos| egui::Event::PointerButton {
            pos,
            button: egui::PointerButton::Primary,
            pressed,
            modifiers: alt,
        };
        harness.event(button(true, from));
        harness.run_ok();
        harness.event(egui::Event::PointerMoved(from + by));
        harness.run_ok();
        harness.event(button(false, from + by));
        harness.run_ok();
        wait_for_workers(harness);
    };
    drag(&mut harness, egui::vec2(60.0, 0.0));
    assert!(doc(&harness).edit.alignments.is_empty(), "the first date's space is the case's");
    perform(&mut harness, LookCommand::SetTime(1));
    drag(&mut harness, egui::vec2(60.0, -30.0));
    // To the right on the screen is the patient's left; up is anterior: half as far.
    let moved = moved_mm(&harness).unwrap();
    assert!(
        moved.x < -2.0 && (moved.y + moved.x / 2.0).abs() < 0.05 * moved.x.abs() && moved.z == 0.0,
        "{moved}"
    );
    assert_eq!(error_text(&harness), "");
}
