//! The sheet that is printed: one page of A4 with the largest slice in true size.

use maud::{Markup, html};

use super::{Page, Paragraph, Slice, diagram, hundredths, text};
use crate::{format::hex, words::Words};

/// Length of the bar by which a reader checks the size.
pub const BAR_MM: f64 = 50.0;
/// Masks up to which the sheet has room for the diagram of agreement, and for a bar each.
const MOST_MASKS: [usize; 2] = [12, 6];
/// What fits on the sheet in true size beside the bar, width and height.
const MOST_MM: [f64; 2] = [180.0, 105.0];

/// Whether a slice fits in true size.
pub fn fits(slice: &Slice) -> bool {
    slice.size_mm.iter().zip(MOST_MM).all(|(size, most)| *size <= most)
}

/// The outlines of a slice, a unit being a millimetre. `id`: of the element, where it needs one. Its size in CSS is set by its
/// attributes.
pub fn true_size(page: &Page, slice: &Slice, words: &Words, id: Option<&str>) -> Markup {
    let [width, height] = slice.size_mm;
    html! {
        svg class="outlines" id=[id] viewBox={ "0 0 " (hundredths(width)) " " (hundredths(height)) } width={ (hundredths(width)) "mm" }
            height={ (hundredths(height)) "mm" } data-width=(hundredths(width)) data-height=(hundredths(height)) role="img"
            aria-label=(words.get("true-size-alt")) {
            @for (n, path) in slice.masks.iter().enumerate() {
                @if !path.is_empty() {
                    path d=(path) fill=(color(page, n)) fill-opacity="0.14" stroke=(color(page, n)) stroke-width="0.6"
                        fill-rule="evenodd" stroke-linejoin="round" {}
                }
            }
        }
    }
}

/// The bar, `BAR_MM` long.
pub fn bar(id: Option<&str>) -> Markup {
    html! {
        svg class="bar" id=[id] viewBox="0 0 50 4" width="50mm" height="4mm" data-width=(BAR_MM) data-height="4" aria-hidden="true" {
            rect x="0" y="1" width=(BAR_MM) height="2" fill="currentColor" {}
            @for n in 0..6 {
                rect x=(if n == 5 { 49.7 } else { f64::from(n) * 10.0 }) y="0" width="0.3" height="4" fill="currentColor" {}
            }
        }
    }
}

fn color(page: &Page, n: usize) -> String {
    hex(page.color(n))
}

/// The sheet of the last date.
pub fn sheet(page: &Page, paragraphs: &[Paragraph], words: &Words) -> Markup {
    let last = page.dates.len().saturating_sub(1);
    let date = page.dates.last();
    let slice = date.and_then(|date| date.largest.as_ref());
    html! {
        section class="sheet" lang=(words.get("language-code")) {
            h2 { (words.get("title")) }
            @if let Some(date) = date.filter(|_| page.dates.len() > 1 || page.dates.iter().any(|d| d.label.is_some())) {
                p class="when" { (text::date_name(date, last, words)) }
            }
            @if let Some(slice) = slice {
                @if fits(slice) {
                    div class="true" {
                        (true_size(page, slice, words, None))
                        div class="beside" {
                            p { strong { (words.get("true-size-heading")) "." } " " (words.get("true-size-text")) }
                            (bar(None))
                            p { (words.get("true-size-check")) }
                            ul class="names" {
                                @for (n, path) in slice.masks.iter().enumerate() {
                                    @if !path.is_empty() { li { span class={ "swatch m" (n) } {} (text::mask_name(page, n, words)) } }
                                }
                            }
                        }
                    }
                } @else {
                    p { (words.get("true-size-too-large")) }
                }
            }
            div class="columns" {
                div class="words" { (paragraphs_of(paragraphs, "h3")) p class="side" { (side(page, words)) } }
                @if let Some(date) = date {
                    div class="diagrams" {
                        @if let Some(one) = diagram::agreement(date, words, false).filter(|_| page.masks.len() <= MOST_MASKS[0]) { (one) }
                        @if let Some(one) = diagram::volumes(page, date, words, false).filter(|_| page.masks.len() <= MOST_MASKS[1]) { (one) }
                    }
                }
            }
        }
    }
}

/// Which side is where.
pub fn side(page: &Page, words: &Words) -> String {
    words.get(if page.has_sides { "sides" } else { "sides-unknown" })
}

/// Text with headings of a level.
pub fn paragraphs_of(paragraphs: &[Paragraph], heading: &str) -> Markup {
    html! {
        @for one in paragraphs {
            @match one {
                Paragraph::Heading(text) => {
                    @if heading == "h3" { h3 { (text) } } @else { h2 { (text) } }
                }
                Paragraph::Text(text) => { p { (text) } }
            }
        }
    }
}
