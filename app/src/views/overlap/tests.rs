//! The view as a whole: what is painted, counted in pixels, and what clicks send.

use std::{cell::RefCell, rc::Rc};

use egui::{Theme, vec2};
use egui_kittest::{
    Harness,
    kittest::{NodeT as _, Queryable as _},
};
use glioscope_core::{Regions, Selection};
use glioscope_render::{MaskColors, Palette};

use super::{OverlapInput, OverlapMode, show, show_diagram, testing::regions};
use crate::commands::Command;

type Sent = Rc<RefCell<Vec<Command>>>;

struct Setup {
    regions: Regions,
    selection: Selection,
    mode: OverlapMode,
    size: [f32; 2],
    theme: Theme,
    only_diagram: bool,
}

impl Setup {
    fn new(regions: Regions) -> Self {
        Self {
            regions,
            selection: Selection::all(),
            mode: OverlapMode::Regions,
            size: [450.0, 350.0],
            theme: Theme::Dark,
            only_diagram: false,
        }
    }

    /// The running view, and the commands that it sends.
    fn harness(self) -> (Harness<'static>, Sent) {
        let sent = Sent::default();
        let out = Rc::clone(&sent);
        let colors = MaskColors::new(Palette::Thesis, &vec![None; self.regions.mask_ids().len()]);
        let (size, theme) = (self.size, self.theme);
        let harness = Harness::builder()
            .with_size(vec2(size[0], size[1]))
            .with_pixels_per_point(2.0)
            .with_theme(theme)
            .wgpu()
            .build_ui(move |ui| {
                let input = OverlapInput {
                    regions: &self.regions,
                    selection: &self.selection,
                    colors: &colors,
                    mode: self.mode,
                };
                let draw = if self.only_diagram { show_diagram } else { show };
                draw(ui, &input, &mut out.borrow_mut());
            });
        (harness, sent)
    }
}

/// Where `GLIOSCOPE_OVERLAP_PICTURES` names a folder, the picture is put there to be looked at.
fn keep(name: &str, harness: &mut Harness<'_>) {
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

/// Many regions of masks that mostly agree, as raters do.
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
fn pictures_to_look_at() {
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
                keep(&format!("{masks}_{word}_{tag}"), &mut h);
            }
        }
    }
}
