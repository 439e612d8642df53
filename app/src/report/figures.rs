//! Diagrams without a report around them, for papers: one as SVG, several as PDF.

use super::{
    document::{Block, Report},
    identity::Identity,
    pdf,
    plot::Plot,
    recipe::{Recipe, VERSION},
    sentences::words,
};
use crate::words::Language;

/// A diagram as an SVG file of its own.
pub fn svg(plot: &Plot) -> String {
    let [width, height] = plot.size_pt;
    let root = format!("<svg width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" ");
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n", plot.svg().replacen("<svg ", &root, 1))
}

/// Diagrams below each other as PDF, as in reports. The same diagrams give the same bytes.
///
/// # Errors
/// What the writer finds that the standards forbid, and fonts that can't be read.
pub fn pdf_of(title: &str, plots: Vec<Plot>) -> Result<Vec<u8>, String> {
    let recipe = Recipe {
        glioscope_report: VERSION,
        program: format!("Glioscope {}", env!("CARGO_PKG_VERSION")),
        adapter: String::new(),
        names_reader: false,
        identity: Identity::None,
        language: Language::En,
        inputs: Vec::new(),
        response: None,
        session: serde_json::Value::Null,
    };
    let blocks = plots.into_iter().map(Block::Plot).collect();
    let report = Report { language: "en".into(), title: title.to_owned(), signed: None, blocks, recipe };
    pdf::pdf(&report, &words(Language::En))
}
