//! BT-RADS as a guided form: the questions up to a category, for the date shown.

use egui::{CollapsingHeader, Ui};
use glioscope_core::response::{BtRads, bt_rads};

use super::{calls::mark, fields::By};
use crate::{model::ResponseSetting, views::pane::Input};

/// The form.
pub(super) fn show(ui: &mut Ui, input: &Input<'_>, new: &mut ResponseSetting, by: &By) {
    CollapsingHeader::new("BT-RADS, question by question").id_salt("bt-rads").show(ui, |ui| {
        let time = input.time_point.label.clone();
        let date = if time.is_empty() { "this scan" } else { &time };
        let given_before = new.bt_rads.get(&time).cloned().unwrap_or_default();
        let mut answers = given_before.clone();
        ui.weak(format!("Of {date}"));
        // Follows the form from its first question, with one answer more each time.
        let mut followed = std::collections::BTreeMap::new();
        loop {
            match bt_rads(&followed) {
                Ok(BtRads::Next(question)) => {
                    ui.strong(question.text);
                    let mut given = answers.get(question.id).cloned();
                    ui.horizontal_wrapped(|ui| {
                        for answer in question.answers {
                            let is_given = given.as_deref() == Some(answer.id);
                            if ui.radio(is_given, answer.text).clicked() {
                                given = Some(answer.id.to_owned());
                            }
                        }
                    });
                    let Some(given) = given else { break };
                    answers.insert(question.id.to_owned(), given.clone());
                    followed.insert(question.id.to_owned(), given);
                }
                Ok(BtRads::Result { category, reason, flow_mark, flow_source }) => {
                    ui.heading(format!("BT-RADS {}: {}", category.id, category.meaning));
                    ui.label(reason);
                    ui.weak(format!(
                        "Meaning {}: {}; order of questions {}: {flow_source}",
                        mark(category.mark),
                        category.source,
                        mark(flow_mark)
                    ));
                    break;
                }
                Err(error) => {
                    ui.colored_label(ui.visuals().error_fg_color, error.to_string());
                    break;
                }
            }
        }
        if !answers.is_empty() && ui.small_button("Clear the answers").clicked() {
            answers.clear();
        }
        if answers.is_empty() {
            new.bt_rads.remove(&time);
            new.bt_rads_by.remove(&time);
        } else {
            if answers != given_before {
                new.bt_rads_by.insert(time.clone(), by.stated());
            }
            new.bt_rads.insert(time, answers);
        }
    });
}
