//! A proposed case of several dates in a few lines: where nothing of its files is doubtful, they are asked about by date.

use egui::{Grid, Ui};
use glioscope_core::{
    Severity,
    case::{Proposal, ProposedFile, Role},
};

/// More dates would be no shorter than the table of files.
const MOST_DATES: usize = 8;

/// Whether a proposal can be told by its dates: every file is an image, or a mask without a choice of labels, of a date; nothing is warned of.
pub fn suffices(proposal: &Proposal) -> bool {
    let is_plain = |file: &ProposedFile| {
        let has_role = match file.role {
            Role::Image => true,
            Role::Mask => file.masks.len() == 1 && file.labels.len() < 2,
            Role::Tracts | Role::LeftOut => false,
        };
        has_role && file.series.is_none() && !file.time.trim().is_empty()
    };
    let is_warned = proposal.notes.iter().any(|note| note.severity != Severity::Note);
    let count = dates(proposal).len();
    (2..=MOST_DATES).contains(&count)
        && proposal.files.iter().all(is_plain)
        && proposal.doubt.is_none()
        && !is_warned
        && proposal.frames_of_reference() <= 1
        && proposal.problems().is_empty()
}

/// Draws the dates with the images and masks of each, in words.
pub fn show(ui: &mut Ui, proposal: &Proposal) {
    Grid::new("dates of the case").striped(true).spacing([24.0, 6.0]).show(ui, |ui| {
        for title in ["date", "images", "masks"] {
            ui.strong(title);
        }
        ui.end_row();
        for date in dates(proposal) {
            ui.label(date);
            let of = |role: Role| {
                proposal.files.iter().filter(move |file| file.role == role && file.time.trim() == date)
            };
            let images: Vec<&str> = of(Role::Image).map(|file| file.id.as_str()).collect();
            let masks: Vec<&str> =
                of(Role::Mask).flat_map(|file| &file.masks).map(|mask| mask.id.as_str()).collect();
            for all in [images, masks] {
                ui.label(if all.is_empty() { "none".to_owned() } else { all.join(", ") });
            }
            ui.end_row();
        }
    });
}

/// The dates in their order, else as first listed.
fn dates(proposal: &Proposal) -> Vec<&str> {
    let mut all: Vec<&str> = Vec::new();
    let stated = proposal.order.iter().map(String::as_str);
    let named = || proposal.files.iter().map(|file| file.time.trim());
    for date in stated.filter(|date| named().any(|of| of == *date)).chain(named()) {
        if !all.contains(&date) {
            all.push(date);
        }
    }
    all
}
