//! A report as Markdown, without its pictures.

use super::document::{Block, Report, Table};
use crate::words::Words;

/// The report as Markdown.
pub fn markdown(report: &Report, words: &Words) -> String {
    let mut parts = vec![format!("# {}", plain(&report.title))];
    parts.extend(report.blocks.iter().filter_map(|block| part(block, words)));
    // What it was made with: shown by nothing, and read again.
    parts.push(format!("<!-- glioscope-recipe {} -->", report.recipe.text()));
    parts.join("\n\n") + "\n"
}

fn part(block: &Block, words: &Words) -> Option<String> {
    Some(match block {
        Block::Heading(text) => format!("## {}", plain(text)),
        Block::Text(text) => plain(text),
        Block::Findings(list) => {
            let line = |one: &super::document::Finding| {
                let mark = words.get(if one.is_warning { "warning-mark" } else { "note-mark" });
                format!("- **{mark}**: {}", plain(&one.text))
            };
            list.iter().map(line).collect::<Vec<_>>().join("\n")
        }
        Block::Facts(list) => {
            let line = |(name, value): &(String, String)| format!("- {}: {}", plain(name), plain(value));
            list.iter().map(line).collect::<Vec<_>>().join("\n")
        }
        Block::Table(one) => table(one),
        Block::Picture(_) => return None,
        // Its numbers stand in the table beside it.
        Block::Plot(_) => return None,
    })
}

fn table(one: &Table) -> String {
    let line =
        |cells: &[String]| format!("| {} |", cells.iter().map(|c| plain(c)).collect::<Vec<_>>().join(" | "));
    let rule: Vec<&str> =
        (0..one.head.len()).map(|n| if n < one.text_columns { "---" } else { "---:" }).collect();
    let mut lines = vec![line(&one.head), format!("|{}|", rule.join("|"))];
    lines.extend(one.rows.iter().map(|row| line(row)));
    let table = lines.join("\n");
    match &one.note {
        Some(note) => format!("{table}\n\n{}", plain(note)),
        None => table,
    }
}

/// Text on one line whose signs mean themselves.
fn plain(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if "\\`*_[]<>|#".contains(c) {
            out.push('\\');
        }
        out.push(if c.is_control() { ' ' } else { c });
    }
    out
}
