//! Pages before they are written: what lies where, and what it means. All lengths are points from the upper left corner.

use krilla::tagging::{Tag, TagKind};

use super::text::{Fonts, Line};

/// A4.
pub const PAGE_PT: [f64; 2] = [595.28, 841.89];
/// 16 mm.
pub const MARGIN_PT: f64 = 45.35;
/// Between the margins.
pub const WIDTH_PT: f64 = PAGE_PT[0] - 2.0 * MARGIN_PT;
/// Where the text ends; the foot lies below it.
const BOTTOM_PT: f64 = PAGE_PT[1] - MARGIN_PT - 18.0;
/// Height of a page's text.
pub const HEIGHT_PT: f64 = BOTTOM_PT - MARGIN_PT;

/// Ink of text.
pub const INK: [u8; 3] = [31, 35, 40];
/// Ink of notes and captions.
pub const SOFT: [u8; 3] = [75, 83, 92];
/// Thin lines.
pub const RULE: [u8; 3] = [208, 215, 222];

/// How text looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Height of the type.
    pub size_pt: f64,
    /// Distance of base lines.
    pub leading_pt: f64,
    /// Its colour, sRGB.
    pub color: [u8; 3],
    /// Whether it is set stronger.
    pub is_bold: bool,
}

impl Style {
    /// Plain type.
    pub const fn plain(size_pt: f64, color: [u8; 3]) -> Self {
        Self { size_pt, leading_pt: size_pt * 1.4, color, is_bold: false }
    }

    /// Strong type.
    pub const fn bold(size_pt: f64) -> Self {
        Self { size_pt, leading_pt: size_pt * 1.3, color: INK, is_bold: true }
    }
}

/// Something on a page.
#[derive(Clone, Debug)]
pub enum Mark {
    /// A line of text; `at` is where its base line begins.
    Text { at: [f64; 2], line: Line, style: Style },
    /// A filled rectangle.
    Rect { at: [f64; 2], size: [f64; 2], color: [u8; 3] },
    /// The picture in this block of the report.
    Picture { at: [f64; 2], size: [f64; 2], block: usize },
    /// The plot in this block of the report.
    Plot { at: [f64; 2], scale: f64, block: usize },
}

/// A part of a page's content that a [`Node`] names.
pub type Leaf = usize;

/// A part of the tree of meanings.
#[derive(Clone, Debug)]
pub enum Node {
    /// Content.
    Leaf(Leaf),
    /// Parts that are one thing.
    Group(TagKind, Vec<Node>),
}

impl Node {
    /// Parts that are one thing.
    pub fn group(tag: impl Into<TagKind>, parts: Vec<Self>) -> Self {
        Self::Group(tag.into(), parts)
    }
}

/// A heading's place.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Its text.
    pub text: String,
    /// Its page, from 0.
    pub page: usize,
    /// Its upper edge.
    pub y_pt: f64,
}

/// A heading that waits for what it must not be parted from.
struct Waiting {
    text: String,
    above_pt: f64,
    lines: Vec<(Line, Leaf)>,
    style: Style,
    is_ruled: bool,
}

impl Waiting {
    fn height_pt(&self) -> f64 {
        self.above_pt + self.lines.len() as f64 * self.style.leading_pt + HEADING_BELOW_PT
    }
}

/// Lengths that differ by less are equal.
pub const ROUNDING_PT: f64 = 1e-6;

/// Between a heading and what follows.
const HEADING_BELOW_PT: f64 = 5.0;

/// Pages in the making.
pub struct Draft<'a> {
    /// The fonts.
    pub fonts: &'a Fonts,
    /// What lies on each page, with what it belongs to; `None`: nothing that means something.
    pub pages: Vec<Vec<(Mark, Option<Leaf>)>>,
    /// The tree of meanings.
    pub tree: Vec<Node>,
    /// The headings.
    pub outline: Vec<Entry>,
    /// Number of leaves.
    pub leaves: usize,
    y_pt: f64,
    waiting: Vec<Waiting>,
}

impl<'a> Draft<'a> {
    /// An empty page.
    pub fn new(fonts: &'a Fonts) -> Self {
        Self {
            fonts,
            pages: vec![Vec::new()],
            tree: Vec::new(),
            outline: Vec::new(),
            leaves: 0,
            y_pt: MARGIN_PT,
            waiting: Vec::new(),
        }
    }

    /// The last page, from 0.
    pub fn page(&self) -> usize {
        self.pages.len() - 1
    }

    /// What is left of the page, without headings that wait.
    pub fn room_pt(&self) -> f64 {
        BOTTOM_PT - self.y_pt - self.waiting.iter().map(Waiting::height_pt).sum::<f64>()
    }

    /// Begins a page.
    pub fn turn(&mut self) {
        self.pages.push(Vec::new());
        self.y_pt = MARGIN_PT;
    }

    /// Leaves room below what was placed, except at the top of a page.
    pub fn gap(&mut self, height_pt: f64) {
        if self.y_pt > MARGIN_PT {
            self.y_pt += height_pt;
        }
    }

    /// Makes sure that something of this height follows whole, together with the headings before it, on a new page if need be.
    /// What is higher than a page begins one.
    pub fn keep(&mut self, height_pt: f64) {
        if self.room_pt() + ROUNDING_PT < height_pt && self.y_pt > MARGIN_PT {
            self.turn();
        }
        for mut heading in std::mem::take(&mut self.waiting) {
            if self.y_pt <= MARGIN_PT {
                heading.above_pt = 0.0;
            }
            self.set_heading(heading);
        }
    }

    /// Takes this height of the page; where it begins. It must have been kept.
    pub fn take(&mut self, height_pt: f64) -> f64 {
        let y = self.y_pt;
        self.y_pt += height_pt;
        y
    }

    /// A new leaf; it must get into the tree.
    pub fn leaf(&mut self) -> Leaf {
        self.leaves += 1;
        self.leaves - 1
    }

    /// Puts something on the page.
    pub fn put(&mut self, mark: Mark, leaf: Option<Leaf>) {
        if let Some(page) = self.pages.last_mut() {
            page.push((mark, leaf));
        }
    }

    /// Puts a line of text with its upper edge at `at` on the page.
    pub fn put_line(&mut self, at: [f64; 2], line: Line, style: Style, leaf: Option<Leaf>) {
        // The base line lies so that capitals are in the middle of the line's height (capitals are about 0.69 em high).
        let base = at[1] + style.leading_pt / 2.0 + style.size_pt * 0.345;
        self.put(Mark::Text { at: [at[0], base], line, style }, leaf);
    }

    /// Puts lines of text below each other; their nodes.
    pub fn put_lines(&mut self, at: [f64; 2], lines: Vec<Line>, style: Style) -> Vec<Node> {
        let mut nodes = Vec::with_capacity(lines.len());
        for (n, line) in lines.into_iter().enumerate() {
            let leaf = self.leaf();
            self.put_line([at[0], at[1] + n as f64 * style.leading_pt], line, style, Some(leaf));
            nodes.push(Node::Leaf(leaf));
        }
        nodes
    }

    /// Lines that go on on the next page, two at least on each; their nodes.
    pub fn flow(&mut self, lines: Vec<Line>, style: Style) -> Vec<Node> {
        let (count, mut nodes) = (lines.len(), Vec::with_capacity(lines.len()));
        for (n, line) in lines.into_iter().enumerate() {
            let together = if (n == 0 && count > 1) || (n + 2 == count && count > 3) { 2.0 } else { 1.0 };
            self.keep(together * style.leading_pt);
            let y = self.take(style.leading_pt);
            nodes.extend(self.put_lines([MARGIN_PT, y], vec![line], style));
        }
        nodes
    }

    /// A heading, which stays with what follows. One longer than a third of a page doesn't.
    pub fn heading(&mut self, level: std::num::NonZeroU16, text: &str, style: Style, is_ruled: bool) {
        let lines = self.fonts.wrapped(text, WIDTH_PT / style.size_pt);
        let tag = Tag::Hn(level, Some(shown(text)));
        let above_pt =
            if self.y_pt > MARGIN_PT || !self.waiting.is_empty() { style.size_pt * 1.1 } else { 0.0 };
        if lines.len() as f64 * style.leading_pt > HEIGHT_PT / 3.0 {
            self.keep(style.leading_pt);
            self.outline.push(Entry { text: shown(text), page: self.page(), y_pt: self.y_pt });
            let nodes = self.flow(lines, style);
            self.tree.push(Node::group(tag, nodes));
            self.gap(HEADING_BELOW_PT);
            return;
        }
        let lines: Vec<_> = lines.into_iter().map(|line| (line, self.leaf())).collect();
        self.tree.push(Node::group(tag, lines.iter().map(|(_, leaf)| Node::Leaf(*leaf)).collect()));
        self.waiting.push(Waiting { text: shown(text), above_pt, lines, style, is_ruled });
        // Many headings in a row must not outgrow a page.
        if self.waiting.iter().map(Waiting::height_pt).sum::<f64>() > HEIGHT_PT / 2.0 {
            self.keep(0.0);
        }
    }

    fn set_heading(&mut self, heading: Waiting) {
        self.y_pt += heading.above_pt;
        self.outline.push(Entry { text: heading.text, page: self.page(), y_pt: self.y_pt });
        for (line, leaf) in heading.lines {
            let y = self.take(heading.style.leading_pt);
            self.put_line([MARGIN_PT, y], line, heading.style, Some(leaf));
        }
        if heading.is_ruled {
            let at = [MARGIN_PT, self.y_pt + 1.0];
            self.put(Mark::Rect { at, size: [WIDTH_PT, 1.0], color: RULE }, None);
        }
        self.y_pt += HEADING_BELOW_PT;
    }
}

/// The longest text of a heading's entry or of a description, in characters; strings of PDF/A-2 may have 32767 bytes (ISO
/// 19005-2, 6.1.13), and each character may take four.
const LONGEST: usize = 4000;

/// A text outside pages: clean, and cut where it is too long.
pub fn shown(text: &str) -> String {
    super::text::clean(text).trim().chars().take(LONGEST).collect()
}
