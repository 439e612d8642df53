//! Links between lesions on which the calls rest, and that nobody has verified: to be gone to and verified from here.

use egui::{Link, RichText, Ui};
use glioscope_core::lesions::LesionsReport;

use crate::{
    command::{Commands, EditCommand},
    views::{lesions, pane::Input},
};

/// A line about the links, which is always there; without any link nothing stands in it.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, report: &LesionsReport, out: &mut Commands) {
    let mut selected = lesions::selected(ui, input);
    selected.keep_in(report);
    let proposed = report.proposed().count();
    ui.horizontal_wrapped(|ui| {
        if report.links.is_empty() {
            ui.label(" ");
            return;
        }
        if proposed == 0 {
            ui.weak("All links between lesions are verified");
            return;
        }
        let text = match proposed {
            1 => "Rests on 1 unverified link".to_owned(),
            several => format!("Rests on {several} unverified links"),
        };
        let link = ui.add(Link::new(RichText::new(text).color(ui.visuals().warn_fg_color)));
        let tip = "Goes to the next one in all views (N): are both one lesion?";
        if link.on_hover_text(tip).clicked() || lesions::is_pressed(ui, lesions::NEXT) {
            lesions::next(input, report, &mut selected, out);
            lesions::select(ui, input, &selected);
        }
        let meant = lesions::verify_meant(report, &selected);
        let button = ui.add_enabled(meant.is_some(), egui::Button::new("Verify it").small());
        let button = button.on_hover_text("Both are one lesion (V, once the link was gone to)");
        let button = button.on_disabled_hover_text("Go to the link first (N)");
        let is_pressed = lesions::is_pressed(ui, lesions::VERIFY);
        let by_key = || lesions::verify(report, &selected).filter(|_| is_pressed);
        if let Some(edit) = meant.filter(|_| button.clicked()).or_else(by_key) {
            out.push(EditCommand::EditLesions(vec![edit]));
        }
    });
}
