//! Text as glyphs: which font has a sign, how wide it is, where lines are broken.

use std::{borrow::Cow, collections::HashMap};

use icu_normalizer::ComposingNormalizerBorrowed;
use krilla::text::Font;
use skrifa::{
    FontRef, MetadataProvider,
    charmap::Charmap,
    instance::{LocationRef, Size},
    metrics::GlyphMetrics,
};

/// The fonts, the preferred first. Both may be embedded in any document (OS/2 `fsType` 0; Ubuntu Font Licence 1.0, and the
/// licences of Hack and Bitstream Vera).
const FILES: [&[u8]; 2] = [epaint_default_fonts::UBUNTU_LIGHT, epaint_default_fonts::HACK_REGULAR];

/// Spaces that only the second font has, as wide as its letters, with their widths in em (Unicode 16, chapter 6.2, table 6-2;
/// U+202F as wide as U+2009).
const SPACES_EM: &[(char, f64)] = &[
    ('\u{2002}', 0.5),
    ('\u{2003}', 1.0),
    ('\u{2004}', 1.0 / 3.0),
    ('\u{2005}', 0.25),
    ('\u{2006}', 1.0 / 6.0),
    ('\u{2008}', 0.2),
    ('\u{2009}', 0.2),
    ('\u{200a}', 0.1),
    ('\u{202f}', 0.2),
    ('\u{205f}', 4.0 / 18.0),
    ('\u{3000}', 1.0),
];

/// Signs after which a word that is too long is rather broken than elsewhere.
const JOINTS: &str = "-_/\\+,;:.=)]|";

/// A glyph of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glyph {
    /// Its font's place in [`Fonts::fonts`].
    pub font: usize,
    /// Its number in the font.
    pub id: u32,
    /// How far the next glyph lies from it, em.
    pub advance_em: f64,
    /// The sign that it shows.
    pub shown: char,
    /// The sign that is copied from the file: the first of those that look the same in the font.
    pub copied: char,
}

/// Glyphs on one line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Line {
    /// The glyphs from left to right; a space where the line was broken is kept.
    pub glyphs: Vec<Glyph>,
    /// The width without spaces at the end, em.
    pub width_em: f64,
}

impl Line {
    fn of(glyphs: &[Glyph]) -> Self {
        Self { glyphs: glyphs.to_vec(), width_em: width_em(glyphs) }
    }

    /// The first glyphs, and the others.
    pub fn parted(&self, first: usize) -> [Self; 2] {
        let (a, b) = self.glyphs.split_at(first.min(self.glyphs.len()));
        [a, b].map(Self::of)
    }
}

/// The fonts with their tables.
pub struct Fonts {
    fonts: Vec<Font>,
    tables: Vec<Tables>,
}

/// What is read of a font.
struct Tables {
    signs: Charmap<'static>,
    /// The first sign of each glyph: one that stood for two could be copied only where readers know more than PDF's maps.
    first_signs: HashMap<u32, char>,
    metrics: GlyphMetrics<'static>,
    units_per_em: f64,
}

impl Fonts {
    /// Reads the fonts.
    ///
    /// # Errors
    /// One that can't be read.
    pub fn new() -> Result<Self, String> {
        let (mut fonts, mut tables) = (Vec::new(), Vec::new());
        for (n, file) in FILES.into_iter().enumerate() {
            let unread =
                || format!("font {n} of the report: found one that can't be read, expected OpenType");
            fonts.push(Font::new(file.into(), 0).ok_or_else(unread)?);
            let font = FontRef::new(file).map_err(|_| unread())?;
            let metrics = font.glyph_metrics(Size::unscaled(), LocationRef::default());
            let units_per_em = f64::from(font.metrics(Size::unscaled(), LocationRef::default()).units_per_em);
            let signs = font.charmap();
            let mut first_signs = HashMap::new();
            for (sign, id) in signs.mappings() {
                let sign = char::from_u32(sign).filter(|c| !is_dropped(*c) && !is_private(*c));
                sign.into_iter().for_each(|sign| {
                    let first = first_signs.entry(id.to_u32()).or_insert(sign);
                    *first = sign.min(*first);
                });
            }
            tables.push(Tables { signs, first_signs, metrics, units_per_em });
        }
        Ok(Self { fonts, tables })
    }

    /// The font at its place.
    pub fn font(&self, place: usize) -> Option<&Font> {
        self.fonts.get(place)
    }

    /// The glyph of a sign; `None` where no font has it.
    fn glyph(&self, shown: char) -> Option<Glyph> {
        self.tables.iter().enumerate().find_map(|(font, table)| {
            let id = table.signs.map(shown).filter(|id| id.to_u32() != 0)?;
            let natural = || Some(f64::from(table.metrics.advance_width(id)?) / table.units_per_em);
            let space = SPACES_EM.iter().find(|(c, _)| *c == shown).map(|(_, em)| *em);
            let advance_em = space.or_else(natural)?;
            let copied = table.first_signs.get(&id.to_u32()).copied().unwrap_or(shown);
            Some(Glyph { font, id: id.to_u32(), advance_em, shown, copied })
        })
    }

    /// The glyphs of a text. A sign that no font has is shown by its number, as in `[U+4E2D]`, so that names that differ look
    /// different.
    fn glyphs(&self, text: &str) -> Vec<Glyph> {
        let mut out = Vec::with_capacity(text.len());
        for c in clean(text).chars() {
            match self.glyph(c).filter(|_| !is_private(c)) {
                Some(glyph) => out.push(glyph),
                None => {
                    let number = format!("[U+{:04X}]", u32::from(c));
                    out.extend(number.chars().filter_map(|c| self.glyph(c)));
                }
            }
        }
        out
    }

    /// A text on one line.
    pub fn line(&self, text: &str) -> Line {
        Line::of(&self.glyphs(text))
    }

    /// A text on one line no wider than `limit_em`, its end cut off with an ellipsis if need be.
    pub fn shortened(&self, text: &str, limit_em: f64) -> Line {
        let mut line = self.line(text);
        let Some(end) = self.glyph('…').filter(|_| line.width_em > limit_em) else { return line };
        let mut width = end.advance_em;
        let fitting = line.glyphs.iter().take_while(|g| {
            width += g.advance_em;
            width <= limit_em
        });
        line.glyphs.truncate(fitting.count());
        line.glyphs.push(end);
        Line::of(&line.glyphs)
    }

    /// A text on lines no wider than `limit_em`, broken after spaces, and in words where these are wider; a single glyph may
    /// be wider. One line at least.
    pub fn wrapped(&self, text: &str, limit_em: f64) -> Vec<Line> {
        let glyphs = self.glyphs(text);
        let (mut lines, mut start) = (Vec::new(), 0);
        while start < glyphs.len() {
            let rest = &glyphs[start..];
            let end = line_end(rest, limit_em);
            lines.push(Line::of(&rest[..end]));
            start += end;
        }
        if lines.is_empty() {
            lines.push(Line::default());
        }
        lines
    }

    /// The width of the widest word of a text, em.
    pub fn widest_word_em(&self, text: &str) -> f64 {
        let glyphs = self.glyphs(text);
        glyphs.split(|g| g.shown == ' ').map(width_em).fold(0.0, f64::max)
    }
}

/// How many glyphs go on the first line, spaces after it included; at least one of any.
fn line_end(glyphs: &[Glyph], limit_em: f64) -> usize {
    let (mut width, mut after_space, mut fitting) = (0.0, 0, glyphs.len());
    for (n, glyph) in glyphs.iter().enumerate() {
        if glyph.shown == ' ' {
            after_space = n + 1;
        } else if width + glyph.advance_em > limit_em + 1e-9 {
            fitting = n;
            break;
        }
        width += glyph.advance_em;
    }
    if fitting == glyphs.len() {
        return fitting;
    }
    if after_space > 0 {
        return after_space;
    }
    let fitting = fitting.max(1);
    let joint = glyphs[..fitting].iter().rposition(|g| JOINTS.contains(g.shown)).map_or(0, |at| at + 1);
    if joint * 2 > fitting { joint } else { fitting }
}

fn width_em(glyphs: &[Glyph]) -> f64 {
    let end = glyphs.iter().rposition(|g| g.shown != ' ').map_or(0, |at| at + 1);
    glyphs[..end].iter().map(|g| g.advance_em).sum()
}

/// A text as it is set: composed (NFC), as names of files may come decomposed; line ends and tabs as spaces; without control
/// characters, marks of direction and width, and numbers that are no characters.
pub fn clean(text: &str) -> String {
    let composed: Cow<'_, str> = ComposingNormalizerBorrowed::new_nfc().normalize(text);
    let spaced = composed.chars().map(|c| if matches!(c, '\n' | '\r' | '\t') { ' ' } else { c });
    spaced.filter(|c| !is_dropped(*c)).collect()
}

fn is_dropped(c: char) -> bool {
    let is_mark = matches!(c,
        '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}'
        | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e0fff}');
    let is_no_character = matches!(u32::from(c), 0xfdd0..=0xfdef) || u32::from(c) & 0xfffe == 0xfffe;
    c.is_control() || is_mark || is_no_character
}

/// Whether a sign has no agreed meaning; such signs are forbidden in PDF/A-2a (ISO 19005-2, 6.2.11.7.3).
fn is_private(c: char) -> bool {
    matches!(u32::from(c), 0xe000..=0xf8ff | 0xf_0000..=0x10_ffff)
}
