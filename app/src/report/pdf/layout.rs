//! A report's blocks on pages.

use std::num::NonZeroU16;

use krilla::{
    geom::Rect,
    tagging::{BBox, ListNumbering, Tag, TagKind},
};

use super::{
    draft::{Draft, HEIGHT_PT, INK, MARGIN_PT, Mark, Node, ROUNDING_PT, SOFT, Style, WIDTH_PT, shown},
    picture::is_whole,
    table,
    text::{Fonts, Line},
};
use crate::report::document::{Block, Finding, Picture, Report};
use crate::words::Words;

const TITLE: Style = Style::bold(17.0);
const HEADING: Style = Style::bold(12.5);
const TEXT: Style = Style::plain(10.0, INK);
const CAPTION: Style = Style::plain(8.5, SOFT);

/// Between blocks.
const GAP_PT: f64 = 8.0;
/// Between pictures side by side.
const GUTTER_PT: f64 = 14.0;
/// Captions with more lines than this may go on on the next page.
const CAPTION_LINES: usize = 12;
/// Inside the boxes of findings: left, right, above and below.
const BOX_PT: [f64; 3] = [12.0, 8.0, 4.5];
/// Width of the bar on the left of findings.
const BAR_PT: f64 = 3.5;

/// Bar and paper of warnings; the text says it, too.
const WARNING: [[u8; 3]; 2] = [[179, 89, 0], [255, 244, 229]];
/// Bar and paper of notes.
const NOTE: [[u8; 3]; 2] = [[140, 149, 159], [246, 248, 250]];

/// The report on pages. `title` isn't empty.
pub fn layout<'a>(report: &Report, title: &str, words: &Words, fonts: &'a Fonts) -> Draft<'a> {
    let mut draft = Draft::new(fonts);
    let second = NonZeroU16::MIN.saturating_add(1);
    draft.heading(NonZeroU16::MIN, title, TITLE, false);
    let mut blocks = report.blocks.iter().enumerate().peekable();
    while let Some((at, block)) = blocks.next() {
        match block {
            Block::Heading(text) if !shown(text).is_empty() => draft.heading(second, text, HEADING, true),
            Block::Text(text) if !shown(text).is_empty() => paragraph(&mut draft, text),
            Block::Heading(_) | Block::Text(_) => {}
            Block::Findings(list) => findings(&mut draft, list, words),
            Block::Facts(list) => table::facts(&mut draft, list),
            Block::Table(one) => table::table(&mut draft, one),
            Block::Plot(plot) => {
                let alt = description(&plot.caption, title);
                figure(
                    &mut draft,
                    [plot.size_pt[0], plot.size_pt[1]],
                    false,
                    &plot.caption,
                    alt,
                    |at_pt, scale| Mark::Plot { at: at_pt, scale, block: at },
                );
            }
            Block::Picture(one) => {
                let Some(size) = size(one) else { continue };
                let is_narrow = |one: &Picture| one.size[0] <= one.size[1] && has_short_caption(one, fonts);
                let next = blocks.peek().and_then(|(n, block)| Some((*n, block.as_picture()?)));
                let pair = next.and_then(|(n, other)| Some((n, other, self::size(other)?)));
                match pair.filter(|(_, other, _)| is_narrow(one) && is_narrow(other)) {
                    Some((n, other, other_size)) => {
                        blocks.next();
                        side_by_side(&mut draft, [(at, one, size), (n, other, other_size)], title);
                    }
                    None => {
                        let alt = description(&one.caption, &one.name);
                        figure(&mut draft, size, is_narrow(one), &one.caption, alt, |at_pt, scale| {
                            let size = size.map(|length| length * scale);
                            Mark::Picture { at: at_pt, size, block: at }
                        });
                    }
                }
            }
        }
    }
    draft.keep(0.0);
    draft
}

fn paragraph(draft: &mut Draft<'_>, text: &str) {
    let lines = draft.fonts.wrapped(text, WIDTH_PT / TEXT.size_pt);
    let nodes = draft.flow(lines, TEXT);
    draft.tree.push(Node::group(Tag::P, nodes));
    draft.gap(GAP_PT);
}

fn findings(draft: &mut Draft<'_>, list: &[Finding], words: &Words) {
    let items: Vec<Node> = list.iter().map(|one| finding(draft, one, words)).collect();
    if !items.is_empty() {
        draft.tree.push(Node::group(Tag::L(ListNumbering::None), items));
    }
    draft.gap(GAP_PT / 2.0);
}

fn finding(draft: &mut Draft<'_>, one: &Finding, words: &Words) -> Node {
    let [left, right, above] = BOX_PT;
    let ([bar, paper], key) = if one.is_warning { (WARNING, "warning-mark") } else { (NOTE, "note-mark") };
    let mark = format!("{}: ", words.get(key));
    let marked = draft.fonts.line(&mark).glyphs.len();
    let text = format!("{mark}{}", one.text);
    let lines = draft.fonts.wrapped(&text, (WIDTH_PT - left - right) / TEXT.size_pt);
    let mut nodes = Vec::with_capacity(lines.len() + 1);
    let (mut rest, mut is_first) = (lines.into_iter().peekable(), true);
    while rest.peek().is_some() {
        let height = |lines: usize| lines as f64 * TEXT.leading_pt + 2.0 * above;
        // A box stays whole unless it is higher than half a page.
        draft.keep(height(rest.len()).min(HEIGHT_PT / 2.0));
        let fitting =
            ((draft.room_pt() + ROUNDING_PT - 2.0 * above) / TEXT.leading_pt).floor().max(1.0) as usize;
        let count = rest.len().min(fitting);
        let y = draft.take(height(count));
        draft.put(Mark::Rect { at: [MARGIN_PT, y], size: [WIDTH_PT, height(count)], color: paper }, None);
        draft.put(Mark::Rect { at: [MARGIN_PT, y], size: [BAR_PT, height(count)], color: bar }, None);
        for n in 0..count {
            let Some(line) = rest.next() else { break };
            let at = [MARGIN_PT + left, y + above + n as f64 * TEXT.leading_pt];
            let parted = if is_first { line.parted(marked) } else { [Line::default(), line] };
            is_first = false;
            nodes.extend(marked_line(draft, at, parted));
        }
    }
    draft.gap(GAP_PT / 2.0);
    Node::group(Tag::LI, vec![Node::group(Tag::LBody, nodes)])
}

/// A line whose first part is strong.
fn marked_line(draft: &mut Draft<'_>, at: [f64; 2], [strong, plain]: [Line; 2]) -> Vec<Node> {
    let mut nodes = Vec::new();
    let mut x = at[0];
    for (line, is_bold) in [(strong, true), (plain, false)] {
        if line.glyphs.is_empty() {
            continue;
        }
        let advance: f64 = line.glyphs.iter().map(|g| g.advance_em).sum();
        let parts = draft.put_lines([x, at[1]], vec![line], Style { is_bold, ..TEXT });
        x += advance * TEXT.size_pt;
        nodes.extend(if is_bold { vec![Node::group(Tag::Strong, parts)] } else { parts });
    }
    nodes
}

/// What stands for a figure that can't be seen; never empty.
fn description(caption: &str, otherwise: &str) -> String {
    let texts = [shown(caption), shown(otherwise)];
    texts.into_iter().find(|text| !text.is_empty()).unwrap_or_else(|| "–".to_owned())
}

/// The size of a picture in any unit; `None` where there is nothing to show.
fn size(one: &Picture) -> Option<[f64; 2]> {
    is_whole(one).then(|| one.size.map(f64::from))
}

fn column_pt() -> f64 {
    (WIDTH_PT - GUTTER_PT) / 2.0
}

fn has_short_caption(one: &Picture, fonts: &Fonts) -> bool {
    fonts.wrapped(&one.caption, column_pt() / CAPTION.size_pt).len() <= CAPTION_LINES
}

/// A figure with its caption, across the page or in half of it, whole on a page.
fn figure(
    draft: &mut Draft<'_>,
    size: [f64; 2],
    is_narrow: bool,
    caption: &str,
    alt: String,
    mark: impl Fn([f64; 2], f64) -> Mark,
) {
    let width = if is_narrow { column_pt() } else { WIDTH_PT };
    let lines = caption_lines(draft.fonts, caption, width);
    let is_short = lines.len() <= CAPTION_LINES;
    let below = if is_short { lines.len() as f64 * CAPTION.leading_pt + 3.0 } else { 3.0 };
    let Some(scale) = scale(size, [width, HEIGHT_PT * 0.8 - below]) else { return };
    let [_, height] = size.map(|length| length * scale);
    draft.keep(height + below);
    let y = draft.take(height + 3.0);
    let mut node =
        figure_node(draft, alt, [MARGIN_PT, y], size.map(|length| length * scale), |at| mark(at, scale));
    let captions = draft.flow(lines, CAPTION);
    with_caption(&mut node, captions);
    draft.tree.push(node);
    draft.gap(GAP_PT);
}

/// Two pictures beside each other with their captions.
fn side_by_side(draft: &mut Draft<'_>, pair: [(usize, &Picture, [f64; 2]); 2], title: &str) {
    let width = column_pt();
    let captions = pair.map(|(_, one, _)| caption_lines(draft.fonts, &one.caption, width));
    let below_pt = |lines: &Vec<Line>| lines.len() as f64 * CAPTION.leading_pt + 3.0;
    let most_below = captions.iter().map(below_pt).fold(0.0, f64::max);
    let scales = pair.map(|(_, _, size)| scale(size, [width, HEIGHT_PT * 0.8 - most_below]).unwrap_or(0.0));
    let heights = pair.iter().zip(scales).zip(&captions);
    let height =
        heights.map(|(((_, _, size), scale), lines)| size[1] * scale + below_pt(lines)).fold(0.0, f64::max);
    draft.keep(height);
    let y = draft.take(height);
    for (n, (((block, one, size), scale), lines)) in pair.into_iter().zip(scales).zip(captions).enumerate() {
        let x = MARGIN_PT + n as f64 * (width + GUTTER_PT);
        let size = size.map(|length| length * scale);
        let alt = description(&one.caption, if one.name.is_empty() { title } else { &one.name });
        let mut node = figure_node(draft, alt, [x, y], size, |at| Mark::Picture { at, size, block });
        let captions = draft.put_lines([x, y + size[1] + 3.0], lines, CAPTION);
        with_caption(&mut node, captions);
        draft.tree.push(node);
    }
    draft.gap(GAP_PT);
}

fn caption_lines(fonts: &Fonts, caption: &str, width_pt: f64) -> Vec<Line> {
    if shown(caption).is_empty() { Vec::new() } else { fonts.wrapped(caption, width_pt / CAPTION.size_pt) }
}

/// How much larger a figure may be in a space; `None` where it has no size.
fn scale(size: [f64; 2], space: [f64; 2]) -> Option<f64> {
    let scale = (space[0] / size[0]).min(space[1] / size[1]);
    (size.iter().all(|length| length.is_finite() && *length > 0.0) && scale.is_finite() && scale > 0.0)
        .then_some(scale)
}

/// Puts a figure on the page; its node.
fn figure_node(
    draft: &mut Draft<'_>,
    alt: String,
    at: [f64; 2],
    size: [f64; 2],
    mark: impl Fn([f64; 2]) -> Mark,
) -> Node {
    let leaf = draft.leaf();
    draft.put(mark(at), Some(leaf));
    let [x, y, width, height] = [at[0], at[1], size[0], size[1]].map(|length| length as f32);
    let place = Rect::from_xywh(x, y, width, height).map(|rect| BBox::new(draft.page(), rect));
    let tag = Tag::Figure(Some(alt)).with_bbox(place);
    Node::Group(TagKind::from(tag), vec![Node::Leaf(leaf)])
}

fn with_caption(figure: &mut Node, lines: Vec<Node>) {
    if let Node::Group(_, parts) = figure
        && !lines.is_empty()
    {
        parts.push(Node::group(Tag::Caption, lines));
    }
}
