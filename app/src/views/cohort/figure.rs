//! The grid as a figure for papers: SVG in one piece, PDF page by page.

use std::{path::Path, sync::Arc};

use glioscope_cohort::Collected;
use glioscope_core::{Progress, files::write_whole};

use super::{
    color::Colors,
    glyph::{self, Glyphs},
    grid, picker,
};
use crate::{
    error::AppError,
    format,
    model::cohort::{CohortSetting, GlyphScale, Order},
    report::{Anchor, Plot, Shape, TEXT_PT, figures, shortened},
};

/// Width of a cell, points, and its height: glyph, two lines of words and the colour's bar.
const CELL_PT: [f64; 2] = [72.0, 106.0];
/// The largest radius of a glyph, points.
const RADIUS_PT: f64 = 32.0;
/// Cells beside and below each other on a page.
const PAGE: [usize; 2] = [7, 5];
/// Cells beside each other in one piece.
const ACROSS: usize = 12;
/// Height of the legend, points.
const LEGEND_PT: f64 = 34.0;
/// Letters of a name that fit into a cell.
const LETTERS: usize = 15;
const INK: [u8; 3] = [26, 31, 38];
const SECOND: [u8; 3] = [86, 96, 108];

/// What a figure is drawn from.
pub struct Figure {
    /// Name of the cohort.
    pub name: String,
    /// The tables.
    pub collected: Arc<Collected>,
    /// How they are shown.
    pub setting: CohortSetting,
    /// The cases in their order.
    pub shown: Vec<usize>,
    /// All glyphs.
    pub glyphs: Arc<Glyphs>,
    /// What the cases' colours tell.
    pub colors: Option<Colors>,
}

impl Figure {
    /// Writes the figure in the format of the path's ending, `.svg` or `.pdf`.
    ///
    /// # Errors
    /// [`AppError`]: another ending, a place that can't be written, or cancelled.
    pub fn write(&self, path: &Path, progress: &Progress) -> Result<(), AppError> {
        progress.check()?;
        let bytes = match path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).as_deref() {
            Some("svg") => {
                let rows = self.shown.len().div_ceil(ACROSS);
                figures::svg(&self.page(&self.shown, [ACROSS, rows], self.caption(0, self.shown.len())))
                    .into_bytes()
            }
            Some("pdf") => {
                let on_page = PAGE[0] * PAGE[1];
                let pages = self.shown.chunks(on_page).enumerate();
                let plots = pages.map(|(n, cases)| {
                    let caption = self.caption(n * on_page, cases.len());
                    self.page(cases, [PAGE[0], cases.len().div_ceil(PAGE[0])], caption)
                });
                figures::pdf_of(&format!("Cohort {}", self.name), plots.collect()).map_err(|why| {
                    AppError::file(path, format!("a figure that can't be written ({why})"), "one that can")
                })?
            }
            _ => return Err(AppError::file(path, "another ending", ".svg or .pdf")),
        };
        progress.check()?;
        Ok(write_whole(path, &bytes)?)
    }

    /// Which cases these are: `count` from number `first` on.
    fn caption(&self, first: usize, count: usize) -> String {
        let Self { collected, setting, shown, .. } = self;
        let order = match setting.order {
            Order::Outliers => "outliers first",
            Order::Ascending => "least first",
            Order::Descending => "greatest first",
        };
        let by = |quantity| format!("{}, {order}", picker::title(quantity));
        let sorted = setting.sort.as_ref().map_or_else(|| "name".to_owned(), by);
        let all = collected.cases().len();
        let scale = match setting.scale {
            GlyphScale::Own => "each diagram at its own scale",
            GlyphScale::Same => "all diagrams at the same scale",
        };
        format!(
            "Overlap of {}: cases {} to {} of {} shown ({} in the cohort), {} date, sorted by {sorted}; {scale}.",
            setting.masks.join(", "),
            format::count(first as u64 + 1),
            format::count((first + count) as u64),
            format::count(shown.len() as u64),
            format::count(all as u64),
            setting.date,
        )
    }

    /// A page of these cases in so many columns and rows.
    fn page(&self, cases: &[usize], [across, rows]: [usize; 2], caption: String) -> Plot {
        let mut shapes = self.legend();
        let width = CELL_PT[0] * across as f64;
        for (n, case) in cases.iter().enumerate() {
            let at = [(n % across) as f64 * CELL_PT[0], LEGEND_PT + (n / across) as f64 * CELL_PT[1]];
            self.cell(*case, at, &mut shapes);
        }
        Plot { caption, size_pt: [width, LEGEND_PT + rows as f64 * CELL_PT[1]], shapes }
    }

    /// Masks in the first line, what colours tell in the second.
    fn legend(&self) -> Vec<Shape> {
        let mut shapes = Vec::new();
        let mut line = |y: f64, words: Vec<(Option<[u8; 3]>, String)>| {
            let mut x = 2.0;
            for (color, text) in words {
                if let Some(color) = color {
                    shapes.push(Shape::Area { points: rectangle([x, y - 7.0], [8.0, 8.0]), color });
                    x += 11.0;
                }
                // About half a height per letter.
                let width = text.chars().count() as f64 * TEXT_PT * 0.56;
                if !text.is_empty() {
                    shapes.push(Shape::Word { at: [x, y], anchor: Anchor::Start, text, color: INK });
                    x += width + 8.0;
                } else {
                    x -= 3.0;
                }
            }
        };
        let colors = grid::mask_colors(&self.setting);
        let masks = self.setting.masks.iter().enumerate();
        line(10.0, masks.map(|(k, mask)| (Some(colors.mask(k)), mask.clone())).collect());
        if let (Some(quantity), Some(colors)) = (&self.setting.color, &self.colors) {
            let mut words = vec![(None, format!("Bar: {}", picker::title(quantity)))];
            let mut legend = colors.legend(false);
            // A ramp has its least value before it.
            if let [(_, least), (_, next), ..] = &mut legend[..]
                && next.is_empty()
            {
                words.push((None, std::mem::take(least)));
            }
            words.extend(legend.into_iter().map(|(color, text)| (Some(rgb(color)), text)));
            line(24.0, words);
        }
        shapes
    }

    fn cell(&self, case: usize, [x, y]: [f64; 2], shapes: &mut Vec<Shape>) {
        let middle = x + CELL_PT[0] / 2.0;
        if let Some(found) = self.glyphs.get(case).filter(|glyph| !glyph.is_empty()) {
            let shrunk = self.glyphs.shrunk(found, self.setting.scale, RADIUS_PT);
            for (points, color) in glyph::outlines(found, shrunk, &grid::mask_colors(&self.setting)) {
                let points = points.into_iter().map(|[px, py]| [middle + px, y + 36.0 + py]).collect();
                shapes.push(Shape::Area { points, color });
            }
        }
        let name = self.collected.cases().get(case).cloned().unwrap_or_default();
        let value = self.colors.as_ref().map_or_else(String::new, |colors| colors.text(case));
        for (text, y, color) in [(name, y + 80.0, INK), (value, y + 91.0, SECOND)] {
            if !text.is_empty() {
                let text = shortened(&text, LETTERS);
                shapes.push(Shape::Word { at: [middle, y], anchor: Anchor::Middle, text, color });
            }
        }
        if let Some(color) = self.colors.as_ref().and_then(|colors| colors.of(case, false)) {
            let points = rectangle([x + 4.0, y + 95.0], [CELL_PT[0] - 8.0, 4.0]);
            shapes.push(Shape::Area { points, color: rgb(color) });
        }
    }
}

fn rgb(color: egui::Color32) -> [u8; 3] {
    [color.r(), color.g(), color.b()]
}

fn rectangle([x, y]: [f64; 2], [width, height]: [f64; 2]) -> Vec<[f64; 2]> {
    vec![[x, y], [x + width, y], [x + width, y + height], [x, y + height]]
}
