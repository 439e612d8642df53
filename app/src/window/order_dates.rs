//! The question for the order of dates that nothing states.

use egui::{Button, Id, Ui};

use super::modal::{self, Reply};
use crate::{
    command::{AppCommand, Command, Commands, Workstation},
    world::load::Unordered,
};

const WIDTH_POINTS: f32 = 460.0;

/// Draws the question while a case waits for it.
pub fn show(ui: &Ui, work: &mut Workstation, out: &mut Commands) {
    let Some(question) = &mut work.order_question else { return };
    let Unordered { times, doubt } = &mut question.unordered;
    let mut without = false;
    let reply = modal::show(ui.ctx(), "Order of the dates", |ui| {
        ui.set_width(WIDTH_POINTS);
        ui.label("The names of these dates don't say which came first. Put the earliest at the top: drag a name, or use the buttons.");
        if let Some(doubt) = doubt {
            let text = format!("Found {doubt}. If they are patients, cancel and open the folder of one.");
            ui.colored_label(ui.visuals().warn_fg_color, text);
        }
        ui.add_space(6.0);
        egui::ScrollArea::vertical().max_height(320.0).show(ui, |ui| list(ui, times));
        ui.add_space(6.0);
        let mut reply = Reply::None;
        ui.horizontal(|ui| {
            if ui.button(Command::from(AppCommand::OrderDates(Some(Vec::new()))).text()).clicked() {
                reply = Reply::Accept;
            }
            // Without an order, folders that may be patients are no dates.
            if doubt.is_none() {
                let tip = "The dates are listed as they are; comparing two asks which is the earlier";
                without = ui.button("Open without an order").on_hover_text(tip).clicked();
            }
            if ui.button("Cancel").clicked() {
                reply = Reply::Cancel;
            }
        });
        reply
    });
    match reply {
        _ if without => out.push(AppCommand::OrderDates(Some(Vec::new()))),
        Reply::None => {}
        Reply::Accept => out.push(AppCommand::OrderDates(Some(times.clone()))),
        Reply::Cancel => out.push(AppCommand::OrderDates(None)),
    }
}

/// The dates, earliest first.
fn list(ui: &mut Ui, times: &mut Vec<String>) {
    let last = times.len().saturating_sub(1);
    // Which date goes where.
    let mut moved = None;
    for (n, time) in times.iter().enumerate() {
        let row = ui.horizontal(|ui| {
            ui.label(format!("{}.", n + 1));
            for (word, enabled, to) in [("Earlier", n > 0, n.saturating_sub(1)), ("Later", n < last, n + 1)] {
                let response = ui.add_enabled(enabled, Button::new(word));
                let label = format!("{word}: {time}");
                response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, enabled, &label));
                if response.clicked() {
                    moved = Some((n, to));
                }
            }
            ui.dnd_drag_source(Id::unique(("date", n)), n, |ui| ui.label(time));
        });
        if let Some(from) = row.response.dnd_release_payload::<usize>() {
            moved = Some((*from, n));
        }
    }
    if let Some((from, to)) = moved.filter(|(from, to)| from != to && (*from).max(*to) <= last) {
        let time = times.remove(from);
        times.insert(to, time);
    }
}
