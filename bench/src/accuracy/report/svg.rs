//! Marks as SVG.

use std::fmt::Write;

use super::plot::{Anchor, Mark};

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn rgb([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// A whole document on a white ground.
pub(super) fn document(marks: &[Mark], [width, height]: [u32; 2]) -> String {
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for mark in marks {
        // Writing to a string can't fail.
        let _ = match mark {
            Mark::Line { from: [x1, y1], to: [x2, y2], color, width, dashed } => {
                let dash = if *dashed { " stroke-dasharray=\"6 4\"" } else { "" };
                writeln!(
                    out,
                    "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{}\" \
                     stroke-width=\"{width}\"{dash}/>",
                    rgb(*color)
                )
            }
            Mark::Dot { at: [x, y], radius, color, filled } => {
                let color = rgb(*color);
                let look = if *filled {
                    format!("fill=\"{color}\"")
                } else {
                    format!("fill=\"none\" stroke=\"{color}\" stroke-width=\"1.3\"")
                };
                writeln!(out, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {look}/>")
            }
            Mark::Text { at: [x, y], anchor, size, color, text } => {
                let anchor = match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                writeln!(
                    out,
                    "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{size}\" text-anchor=\"{anchor}\" \
                     dominant-baseline=\"middle\" fill=\"{}\">{}</text>",
                    rgb(*color),
                    escaped(text)
                )
            }
        };
    }
    out.push_str("</svg>\n");
    out
}
