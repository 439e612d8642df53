//! Tests of the whole view: painted areas, counted in pixels, and the commands that clicks send.

use std::{cell::RefCell, rc::Rc};

use egui::{Key, Pos2, Theme, pos2, vec2};
use egui_kittest::{
    Harness,
    kittest::{NodeT as _, Queryable as _},
};
use glioscope_core::{
    Regions, Selection,
    measure::{self, Pair},
};
use glioscope_render::{MaskColors, Palette};

use super::{
    OverlapInput, OverlapMode, show, show_diagram,
    testing::{index, regions},
};
use crate::{
    command::{Command, Commands, EditCommand},
    model::overlap::whole_masks,
};

/// The commands sent so far, and the region under the cursor in the last frame.
#[derive(Default)]
struct Events {
    commands: Vec<EditCommand>,
    hovered: Option<u32>,
}

type SharedEvents = Rc<RefCell<Events>>;

struct Setup {
    regions: Regions,
    pairs: Vec<Pair>,
    selection: Selection,
    mode: OverlapMode,
    size: [f32; 2],
    pixels_per_point: f32,
    theme: Theme,
    only_diagram: bool,
}

impl Setup {
    fn new(regions: Regions) -> Self {
        Self {
            regions,
            pairs: Vec::new(),
            selection: Selection::all(),
            mode: OverlapMode::Regions,
            size: [450.0, 350.0],
            pixels_per_point: 2.0,
            theme: Theme::Dark,
            only_diagram: false,
        }
    }

    /// The running view and its events.
    fn harness(self) -> (Harness<'static>, SharedEvents) {
        let sent = SharedEvents::default();
        let out = Rc::clone(&sent);
        let colors = MaskColors::new(Palette::Thesis, &vec![None; self.regions.mask_ids().len()]);
        let (size, theme) = (self.size, self.theme);
        let harness = Harness::builder()
            .with_size(vec2(size[0], size[1]))
            .with_pixels_per_point(self.pixels_per_point)
            .with_theme(theme)
            .with_step_dt(1.0 / 60.0)
            .build_ui(move |ui| {
                let input = OverlapInput {
                    names: self.regions.mask_ids(),
                    regions: &self.regions,
                    selection: &self.selection,
                    colors: &colors,
                    mode: self.mode,
                    is_picture: false,
                };
                let mut new = Commands::default();
                let hovered = if self.only_diagram {
                    show_diagram(ui, &input, &mut new)
                } else {
                    show(ui, &input, &self.pairs, &mut new)
                };
                let events = &mut *out.borrow_mut();
                events.hovered = hovered;
                for command in new.into_vec() {
                    let Command::Edit(command) = command else { panic!("{command:?}") };
                    events.commands.push(command);
                }
            });
        (harness, sent)
    }
}

/// Saves the view as a PNG file in the folder named by `GLIOSCOPE_OVERLAP_PICTURES`; does nothing if that isn't set.
fn save_picture(name: &str, harness: &mut Harness<'_>) {
    if let Some(folder) = std::env::var_os("GLIOSCOPE_OVERLAP_PICTURES") {
        let picture = harness.render().unwrap();
        picture.save(std::path::Path::new(&folder).join(name).with_extension("png")).unwrap();
    }
}

const THREE: [(u32, usize); 7] =
    [(1, 4200), (2, 15300), (3, 3800), (4, 1300), (5, 950), (6, 2420), (7, 4900)];
const NAMES: [&str; 9] = ["T1", "T2", "PET", "R4", "R5", "R6", "Rater seven", "R8", "R9"];

fn three() -> Regions {
    regions(&NAMES[..3], &THREE)
}

/// Many regions of masks that mostly agree, as those of different raters.
fn raters(masks: usize, seed: u64) -> Regions {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as u32
    };
    let all = (1_u32 << masks) - 1;
    let mut sizes = std::collections::BTreeMap::new();
    for i in 0..44 {
        let bits = if i < 10 { all & !(1 << (next() % masks as u32)) } else { next() & all };
        if bits != 0 {
            *sizes.entry(bits).or_insert(0) += (next() % 3000 / (1 + i % 7)) as usize + 3;
        }
    }
    sizes.insert(all, 21_000);
    regions(&NAMES[..masks], &sizes.into_iter().collect::<Vec<_>>())
}

#[test]
#[ignore = "writes pictures for visual inspection to the folder in GLIOSCOPE_OVERLAP_PICTURES"]
fn pictures_for_visual_inspection() {
    for theme in [Theme::Dark, Theme::Light] {
        let word = if theme == Theme::Dark { "dark" } else { "light" };
        for masks in [1, 2, 3, 5, 9] {
            for (size, tag) in [([450.0, 350.0], "small"), ([420.0, 720.0], "tall"), ([900.0, 520.0], "wide")]
            {
                let r = match masks {
                    1 => regions(&["T1"], &[(1, 3400)]),
                    2 => regions(&["T1", "PET"], &[(1, 3400), (2, 900), (3, 1700)]),
                    3 => three(),
                    n => raters(n, n as u64),
                };
                let mut setup = Setup::new(r);
                if masks > 1 {
                    setup.selection.set(2, false);
                    setup.selection.set(3, false);
                }
                (setup.size, setup.theme) = (size, theme);
                let (mut h, _) = setup.harness();
                h.run();
                save_picture(&format!("{masks}_{word}_{tag}"), &mut h);
            }
        }
    }
}

/// Number of nearly pure red, green and blue pixels above `to` points from the top.
fn pure_pixels(picture: &image::RgbaImage, to: f32, pixels_per_point: f32) -> [f64; 3] {
    let rows = 0..((to * pixels_per_point) as u32).min(picture.height());
    let mut counts = [0.0; 3];
    for y in rows {
        for x in 0..picture.width() {
            let p = picture.get_pixel(x, y).0;
            for (k, count) in counts.iter_mut().enumerate() {
                let others = (0..3).filter(|&o| o != k).map(|o| p[o]).max().unwrap();
                if p[k] > 140 && others < 115 {
                    *count += 1.0;
                }
            }
        }
    }
    counts
}

/// Asserts that pixels per voxel are the same for every mask, to 1 %.
fn assert_areas(what: &str, counts: [f64; 3], sizes: &[(u32, usize)]) {
    let mask = |k: usize| sizes.iter().filter(|s| s.0 >> k & 1 == 1).map(|s| s.1).sum::<usize>() as f64;
    let total = (0..3).map(mask).sum::<f64>();
    let pixels: f64 = counts.iter().sum();
    assert!(pixels > 5000.0, "{what}: only {pixels} pixels");
    for (k, count) in counts.into_iter().enumerate() {
        let expected = pixels * mask(k) / total;
        let error = if expected > 0.0 { count / expected - 1.0 } else { count };
        assert!(
            error.abs() < 0.01,
            "{what}, mask {k}: {} pixels, {expected:.0} expected, error {:.2} %",
            count,
            error * 100.0
        );
    }
}

#[test]
fn painted_areas_are_proportional_to_mask_sizes() {
    let skewed = [(1, 900), (2, 21_000), (3, 2500), (4, 300), (5, 120), (6, 800), (7, 600)];
    let cases: [(&str, &[(u32, usize)]); 7] = [
        ("three", &THREE),
        ("skewed", &skewed),
        ("no triple", &[(1, 5000), (2, 3000), (3, 700), (6, 900), (4, 2000)]),
        ("two", &[(1, 5000), (2, 3000), (3, 700)]),
        ("nested", &[(1, 9000), (3, 4000), (7, 1500)]),
        ("mostly common", &[(1, 300), (2, 200), (4, 250), (7, 12_000)]),
        ("pairs", &[(3, 400), (5, 300), (6, 500)]),
    ];
    for (name, sizes) in cases {
        for (size, pixels_per_point, theme) in [
            ([420.0, 460.0], 2.0, Theme::Dark),
            ([900.0, 800.0], 1.0, Theme::Light),
            ([240.0, 300.0], 3.0, Theme::Dark),
        ] {
            let mut setup = Setup::new(regions(&NAMES[..3], sizes));
            (setup.size, setup.pixels_per_point, setup.theme, setup.only_diagram) =
                (size, pixels_per_point, theme, true);
            let (mut h, _) = setup.harness();
            h.run();
            let picture = h.render().unwrap();
            let bar = size[1] - super::bar::HEIGHT_PT - 10.0;
            let what = format!("{name} {size:?}");
            assert_areas(&format!("{what} ring"), pure_pixels(&picture, bar, pixels_per_point), sizes);
            assert_areas(&format!("{what} all"), pure_pixels(&picture, size[1], pixels_per_point), sizes);
        }
    }
}

#[test]
fn hidden_regions_have_no_pure_colour_and_leave_other_areas_unchanged() {
    let count = |selection: Selection| {
        let mut setup = Setup::new(three());
        (setup.only_diagram, setup.size, setup.selection) = (true, [420.0, 460.0], selection);
        let (mut h, _) = setup.harness();
        h.run();
        pure_pixels(&h.render().unwrap(), 400.0, 2.0)
    };
    let (all, some) = (count(Selection::all()), count(Selection::only(&three(), &[1, 3, 5, 7])));
    // All of T1 is shown, of T2 and PET only the overlaps with T1.
    assert!((some[0] / all[0] - 1.0).abs() < 0.005, "{all:?} {some:?}");
    assert!((some[1] / all[1] / (8700.0 / 26420.0) - 1.0).abs() < 0.01, "{all:?} {some:?}");
    assert!((some[2] / all[2] / (5850.0 / 9570.0) - 1.0).abs() < 0.01, "{all:?} {some:?}");
    assert_eq!(count(Selection::only(&three(), &[])), [0.0; 3]);
}

fn middle(h: &Harness<'_>, label: &str) -> Pos2 {
    h.get_by_label(label).rect().center()
}

/// Accessible text of every region of [`three`].
const REGION_TEXTS: [&str; 7] = [
    "T1 only, 4.20 ml, 12.8 % of union, shown",
    "T2 only, 15.30 ml, 46.5 % of union, shown",
    "T1+T2, 3.80 ml, 11.6 % of union, shown",
    "PET only, 1.30 ml, 4.0 % of union, shown",
    "T1+PET, 0.950 ml, 2.9 % of union, shown",
    "T2+PET, 2.42 ml, 7.4 % of union, shown",
    "T1+T2+PET, 4.90 ml, 14.9 % of union, shown",
];

#[test]
fn a_click_toggles_the_segment_under_it() {
    let (mut h, sent) = Setup::new(three()).harness();
    h.run();
    for (label, bits) in REGION_TEXTS.iter().zip(1..) {
        h.get_by_label(label).click();
        h.run();
        assert_eq!(
            sent.borrow_mut().commands.drain(..).collect::<Vec<_>>(),
            [EditCommand::ToggleRegion(bits)],
            "{label}"
        );
        // Time passes, so that the next click isn't a double-click.
        h.run_steps(30);
    }
    h.get_by_label("Mask T2, 26.42 ml, 80.4 % of union, shown").click();
    h.run();
    assert_eq!(sent.borrow().commands, [EditCommand::ToggleMask(1)]);
    // A click outside all pieces does nothing.
    sent.borrow_mut().commands.clear();
    h.hover_at(pos2(20.0, 60.0));
    h.drag_at(pos2(20.0, 60.0));
    h.drop_at(pos2(20.0, 60.0));
    h.run();
    assert_eq!(sent.borrow().commands, []);
}

#[test]
fn a_double_click_shows_only_its_region() {
    let (mut h, sent) = Setup::new(three()).harness();
    h.run();
    h.get_by_label(REGION_TEXTS[2]).click();
    h.get_by_label(REGION_TEXTS[2]).click();
    h.run();
    assert_eq!(sent.borrow().commands, [EditCommand::ToggleRegion(3), EditCommand::OnlyRegion(3)]);
    sent.borrow_mut().commands.clear();
    h.run_steps(30);
    h.get_by_label(REGION_TEXTS[6]).click_modifiers(egui::Modifiers::SHIFT);
    h.run();
    assert_eq!(sent.borrow().commands, [EditCommand::OnlyRegion(7)]);
}

#[test]
fn a_click_anywhere_on_a_row_toggles_its_region_and_a_double_click_shows_only_it() {
    for text in ["T1+T2", "11.6 %"] {
        let (mut h, sent) = Setup::new(three()).harness();
        h.run();
        let at = h.get_by_label(text).rect().center();
        let click = |h: &mut Harness<'_>| {
            h.hover_at(at);
            h.drag_at(at);
            h.drop_at(at);
            h.run();
        };
        click(&mut h);
        assert_eq!(sent.borrow().commands, [EditCommand::ToggleRegion(3)], "{text}");
        click(&mut h);
        let both = [EditCommand::ToggleRegion(3), EditCommand::OnlyRegion(3)];
        assert_eq!(sent.borrow().commands, both, "{text}");
        // The check box toggles once, not twice.
        sent.borrow_mut().commands.clear();
        h.run_steps(60);
        h.get_by_label("Show T1+T2").click();
        h.run();
        assert_eq!(sent.borrow().commands, [EditCommand::SetRegion(3, false)]);
    }
}

#[test]
fn keyboard_and_screen_reader_toggle_regions() {
    let (mut h, sent) = Setup::new(three()).harness();
    h.run();
    h.get_by_label(REGION_TEXTS[4]).focus();
    h.run();
    h.key_press(Key::Space);
    h.run();
    h.get_by_label(REGION_TEXTS[5]).click_accesskit();
    h.run();
    assert_eq!(sent.borrow().commands, [EditCommand::ToggleRegion(5), EditCommand::ToggleRegion(6)]);
    // Tab reaches every segment.
    let mut reached = std::collections::BTreeSet::<&str>::new();
    for _ in 0..40 {
        h.key_press(Key::Tab);
        h.run();
        reached.extend(REGION_TEXTS.iter().filter(|l| h.get_by_label(l).is_focused()));
    }
    assert_eq!(reached.len(), REGION_TEXTS.len());
}

#[test]
fn hovering_reports_the_region_in_ring_and_table() {
    let (mut h, sent) = Setup::new(three()).harness();
    h.run();
    assert_eq!(sent.borrow().hovered, None);
    h.hover_at(middle(&h, REGION_TEXTS[6]));
    h.run();
    assert_eq!(sent.borrow().hovered, Some(7));
    h.run_steps(60);
    assert!(h.query_by_label("4.90 ml · 14.9 % of union").is_some(), "no tooltip");
    h.hover_at(middle(&h, "Show T2+PET") + vec2(60.0, 0.0));
    h.run();
    assert_eq!(sent.borrow().hovered, Some(6));
}

#[test]
fn the_table_shows_and_sets_visibility() {
    let mut setup = Setup::new(three());
    setup.selection.set(2, false);
    setup.pairs = measure::pairs(&index(&NAMES[..3], &THREE), &three());
    let (mut h, sent) = setup.harness();
    h.run();
    let toggled = |h: &Harness<'_>, label: &str| h.get_by_label(label).accesskit_node().toggled();
    assert_eq!(toggled(&h, "Show T2"), Some(egui::accesskit::Toggled::False));
    assert_eq!(toggled(&h, "Show T1"), Some(egui::accesskit::Toggled::True));
    h.get_by_label("Show T2").click();
    h.run();
    h.get_by_label("Show T1+PET").click();
    h.run();
    h.get_by_label("Show all").click();
    h.run();
    h.get_by_label("Whole masks").click();
    h.run();
    assert_eq!(
        sent.borrow().commands,
        [
            EditCommand::SetRegion(2, true),
            EditCommand::SetRegion(5, false),
            EditCommand::ShowAllRegions,
            EditCommand::SetOverlapMode(OverlapMode::WholeMasks)
        ]
    );
    // 2 * 8700 / (13850 + 26420), 5850 / (13850 + 9570 - 5850).
    assert!(h.query_by_label("0.432").is_some() && h.query_by_label("0.333").is_some());
}

#[test]
fn clicks_in_whole_mask_mode_select_masks() {
    let mut setup = Setup::new(three());
    setup.mode = OverlapMode::WholeMasks;
    setup.selection = whole_masks(&three(), 0b011);
    let (mut h, sent) = setup.harness();
    h.run();
    save_picture("whole_3_dark_small", &mut h);
    // The mask is in ring and bar; the ring comes first.
    let found: Vec<_> = h.get_all_by_label("Mask T2, 26.42 ml, 80.4 % of union, shown").collect();
    assert_eq!(found.len(), 2);
    found[0].click();
    h.run();
    h.run_steps(30);
    let pet = h.get_all_by_label("Mask PET, 9.57 ml, 29.1 % of union, partly shown").next().unwrap();
    pet.click();
    pet.click();
    h.run();
    assert_eq!(
        sent.borrow().commands,
        [EditCommand::ToggleMask(1), EditCommand::ToggleMask(2), EditCommand::OnlyMask(2)]
    );
    assert_eq!(sent.borrow().hovered, None);
}

#[test]
fn clicks_in_the_upset_plot_of_five_masks_toggle_regions() {
    let sizes = [(31, 900), (1, 500), (6, 400), (9, 300), (16, 200), (30, 100)];
    let mut setup = Setup::new(regions(&NAMES[..5], &sizes));
    setup.selection.set(6, false);
    let (mut h, sent) = setup.harness();
    h.run();
    let labels = [
        (31, "T1+T2+PET+R4+R5, 0.900 ml, 37.5 % of union, shown"),
        (1, "T1 only, 0.500 ml, 20.8 % of union, shown"),
        (6, "T2+PET, 0.400 ml, 16.7 % of union, hidden"),
        (9, "T1+R4, 0.300 ml, 12.5 % of union, shown"),
        (16, "R5 only, 0.200 ml, 8.3 % of union, shown"),
        (30, "T2+PET+R4+R5, 0.100 ml, 4.2 % of union, shown"),
    ];
    for pair in labels.windows(2) {
        assert!(middle(&h, pair[0].1).x < middle(&h, pair[1].1).x, "not by size");
    }
    for (bits, label) in labels {
        h.get_by_label(label).click();
        h.run();
        h.run_steps(30);
        assert_eq!(
            sent.borrow_mut().commands.drain(..).collect::<Vec<_>>(),
            [EditCommand::ToggleRegion(bits)]
        );
    }
    // The whole column is clickable: a dot toggles like the check box.
    let dot: Pos2 = middle(&h, labels[3].1) + vec2(0.0, 40.0);
    for _ in 0..2 {
        h.hover_at(dot);
        h.drag_at(dot);
        h.drop_at(dot);
    }
    h.hover_at(dot);
    h.run();
    assert_eq!(sent.borrow().commands, [EditCommand::ToggleRegion(9), EditCommand::OnlyRegion(9)]);
    assert_eq!(sent.borrow().hovered, Some(9));
    sent.borrow_mut().commands.clear();
    h.run_steps(30);
    h.get_by_label("Mask R5, 1.20 ml, 50.0 % of union, shown").click();
    h.run();
    assert_eq!(sent.borrow().commands, [EditCommand::ToggleMask(4)]);
}

#[test]
fn all_of_many_regions_are_in_the_accessibility_tree() {
    let r = raters(9, 9);
    let expected: Vec<u32> = r.list().iter().map(|x| x.bits).collect();
    assert!(expected.len() >= 31);
    let (mut h, _) = Setup::new(r).harness();
    h.run();
    let found = h.get_all_by(|n| n.label().is_some_and(|l| l.ends_with("of union, shown"))).count();
    assert_eq!(found, expected.len() + 9);
}

#[test]
fn the_context_menu_shows_only_its_region() {
    let mut setup = Setup::new(regions(&["T1", "T2"], &[(1, 3400)]));
    setup.selection.set(1, false);
    let (mut h, sent) = setup.harness();
    h.run();
    h.get_by_label("T1 only, 3.40 ml, 100.0 % of union, hidden").click_secondary();
    h.run();
    save_picture("menu_dark_small", &mut h);
    h.get_by_label("Show only T1").click();
    h.run();
    assert_eq!(sent.borrow().commands, [EditCommand::OnlyRegion(1)]);
}

#[test]
fn empty_masks_give_a_message() {
    for ids in [&NAMES[..3], &NAMES[..9], &NAMES[..0]] {
        let (mut h, _) = Setup::new(regions(ids, &[])).harness();
        h.run();
        assert!(h.query_by_label("No active voxels").is_some());
        save_picture(&format!("empty_{}", ids.len()), &mut h);
    }
}

#[test]
fn an_empty_mask_among_others_is_listed() {
    let (mut h, _) = Setup::new(regions(&NAMES[..3], &[(1, 500), (3, 400)])).harness();
    h.run();
    save_picture("one_empty_dark_small", &mut h);
    assert!(h.query_by_label("Mask PET, 0.0 ml, 0.0 % of union, hidden").is_some());
}

#[test]
fn tiny_panes_are_drawn_without_panic() {
    for size in [[20.0, 20.0], [120.0, 90.0], [200.0, 60.0], [60.0, 400.0]] {
        for r in [three(), raters(9, 1)] {
            for mode in [OverlapMode::Regions, OverlapMode::WholeMasks] {
                let mut setup = Setup::new(r.clone());
                (setup.size, setup.mode) = (size, mode);
                setup.harness().0.run();
            }
        }
    }
}
