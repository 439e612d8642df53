//! Expected lighting error along the path of each lighting mode: the figures that the program shows.

use std::fmt::Write;

use glioscope_render::{LightingMode, TransferPreset, light};

use crate::accuracy::{Curve, Point};

/// A Markdown table with the error of each measured cost of each mode on the head phantom's opaque surfaces and in its
/// tissue; empty unless both scenes were measured. A test of `glioscope-render` compares it with the figures in its
/// rows.
pub(super) fn table(curves: &[Curve]) -> String {
    let mut rows = String::new();
    for mode in [LightingMode::Slices, LightingMode::Cones] {
        let points_in = |preset: TransferPreset| -> Vec<&Point> {
            let is_path =
                |c: &&Curve| c.kernel == mode.name() && c.scene.contains(&format!("T1c, {},", preset.name()));
            curves.iter().filter(is_path).flat_map(|c| &c.points).collect()
        };
        let tissue = points_in(TransferPreset::MrTissue);
        for surface in points_in(TransferPreset::MrSurface) {
            let same_cost = tissue.iter().find(|t| t.value == surface.value);
            if let Some(tissue) = same_cost {
                // Writing to a string can't fail.
                let _ = writeln!(
                    rows,
                    "| {} | {:.3} | {:.4} | {:.4} |",
                    mode.name(),
                    surface.value,
                    surface.error_rms,
                    tissue.error_rms
                );
            }
        }
    }
    if rows.is_empty() {
        return rows;
    }
    let presets = [LightingMode::Slices, LightingMode::Cones]
        .map(|mode| format!("{:.3} by {}", light::row(mode).most_cost, mode.name()));
    format!(
        "\n### Expected error along the path\n\nWhat the window's diagnostics state. Cost is relative to balanced; \
         draft is 0.125, the reference {}. RMS of linear radiance.\n\n\
         | Mode | Cost | On opaque surfaces | In tissue |\n|---|--:|--:|--:|\n{rows}",
        presets.join(", ")
    )
}
