//! Expected lighting error along the path of each lighting mode: the figures that the program shows.

use std::fmt::Write;

use glioscope_render::{LightingMode, Preset, TransferPreset, light};

use crate::accuracy::{Curve, Point, TRACED_KERNEL};

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
    let shown = light::preset(LightingMode::Slices, Preset::Reference).occlusion_strength;
    let ambient = 100.0 * (1.0 - shown);
    let presets = [LightingMode::Slices, LightingMode::Cones]
        .map(|mode| format!("{:.3} by {}", light::row(mode).most_cost, mode.name()));
    format!(
        "\n### Expected error along the path\n\nErrors of light without an ambient share. The window's pictures have \
         {ambient:.0} % of ambient light (a control), which hides as much of the error: its diagnostics state what is left, \
         {shown:.2} of these figures. Cost is relative to balanced; draft is 0.125, the reference {}. RMS of linear \
         radiance.\n\n\
         | Mode | Cost | On opaque surfaces | In tissue |\n|---|--:|--:|--:|\n{rows}",
        presets.join(", ")
    )
}

/// A Markdown table with the error of traced ambient occlusion for each measured number of rays, on the two scenes; empty
/// unless both were measured. As [`table`], a test compares it.
pub(super) fn occlusion_table(curves: &[Curve]) -> String {
    let points_in = |scene: &str| -> Vec<&Point> {
        let is_traced = |c: &&Curve| c.kernel == TRACED_KERNEL && c.scene.starts_with(scene);
        curves.iter().filter(is_traced).flat_map(|c| &c.points).collect()
    };
    let tumor = points_in("head phantom's tumour");
    let mut rows = String::new();
    for folds in points_in("a mask of deep folds") {
        if let Some(tumor) = tumor.iter().find(|point| point.value == folds.value) {
            // Writing to a string can't fail.
            let _ = writeln!(rows, "| {} | {:.4} | {:.4} |", folds.value, tumor.error_rms, folds.error_rms);
        }
    }
    if rows.is_empty() {
        return rows;
    }
    format!(
        "\n### Expected error of traced occlusion\n\nWhat the window's diagnostics state for the closeup. RMS of the share of \
         light that is lost.\n\n| Rays | On the head phantom's tumour | On deep folds |\n|--:|--:|--:|\n{rows}"
    )
}
