//! The About dialog: version, intended use, graphics device and licence.

use egui::{RichText, Ui};

use glioscope_render::Gpu;

use super::modal::{self, Reply};

/// Notice of the intended use; it must always be shown.
pub const NOTICE: &str =
    "For research use only. Not a medical device: not for diagnosis or treatment decisions.";

/// Version, operating system and architecture.
pub fn version() -> String {
    format!("Glioscope {} ({} {})", env!("CARGO_PKG_VERSION"), std::env::consts::OS, std::env::consts::ARCH)
}

/// Draws the dialog if it is open.
pub fn show(ui: &mut Ui, open: &mut bool, gpu: Option<&Gpu>) {
    if !*open {
        return;
    }
    let reply = modal::show(ui.ctx(), "About Glioscope", |ui| {
        ui.set_width(440.0);
        ui.label(RichText::new(version()).strong());
        ui.label("Compares tumour segmentations: several modalities, several raters, one screen.");
        ui.add_space(6.0);
        ui.label(RichText::new(NOTICE).strong());
        ui.add_space(6.0);
        ui.label(format!("Graphics: {}", gpu.map_or_else(|| "no adapter".to_owned(), Gpu::describe)));
        ui.label("After F. Lindemann's thesis (Münster 2014), chapter 7. Licence: MIT OR Apache-2.0.");
        ui.label("No network is used. Nothing about a case is logged or sent.");
        ui.add_space(6.0);
        if ui.button("Close").clicked() { Reply::Accept } else { Reply::None }
    });
    *open = reply == Reply::None;
}
