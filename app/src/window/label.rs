//! Names of widgets for screen readers.

/// Labels a combo box for screen readers.
pub(super) fn label_for_screen_readers(combo: &egui::Response, name: &str) {
    combo.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, name));
}
