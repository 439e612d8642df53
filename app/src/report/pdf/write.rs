//! Pages as a PDF file.

use krilla::{
    Document, SerializeSettings,
    color::rgb,
    configure::{Accessibility, Archival, ConfigurationBuilder},
    destination::XyzDestination,
    embed::{AssociationKind, EmbeddedFile, MimeType},
    error::KrillaError,
    geom::{PathBuilder, Point, Rect, Size, Transform},
    metadata::{DateTime, Metadata},
    outline::{Outline, OutlineNode},
    page::PageSettings,
    paint::{Fill, FillRule, LineJoin, Stroke},
    surface::Surface,
    tagging::{Artifact, ArtifactType, ContentTag, Identifier, Node as Tagged, SpanTag, TagGroup, TagTree},
    text::{GlyphId, KrillaGlyph},
};

use super::{
    draft::{Draft, Leaf, MARGIN_PT, Mark, Node, PAGE_PT, RULE, SOFT, Style, WIDTH_PT, shown},
    picture,
    text::{Fonts, Line},
};
use crate::report::{
    document::{Block, Report},
    plot::{Anchor, DOT_PT, Plot, Shape, TEXT_PT},
};
use crate::words::Words;

const FOOT: Style = Style::plain(8.0, SOFT);
/// Thickness of the line around letters, as a share of their height: Ubuntu Light is thin on paper, and has no bold.
const STROKES: [f64; 2] = [0.014, 0.045];
/// Control points of a quarter circle by a cubic curve, as a share of its radius: 4 (√2 − 1) / 3.
const QUARTER: f64 = 0.552_284_749_8;
/// Names of a plot are not set smaller than this share of their height.
const LEAST_WORD: f64 = 0.55;

/// The pages as a file of PDF/A-3a and PDF/UA-1, with the recipe attached.
///
/// # Errors
/// What krilla finds against these standards.
pub fn write(draft: &Draft<'_>, report: &Report, title: &str, words: &Words) -> Result<Vec<u8>, String> {
    let configuration = ConfigurationBuilder::new()
        .with_archival_validator(Archival::A3_A)
        .with_accessibility_validator(Accessibility::UA1)
        .finish()
        .map_err(|e| format!("PDF: found {e:?}, expected standards that go together"))?;
    let mut document =
        Document::new_with(SerializeSettings { configuration, ..SerializeSettings::default() });
    let below = below_pages(report, title, words);
    let mut leaves: Vec<Option<Identifier>> = vec![None; draft.leaves];
    for (number, marks) in draft.pages.iter().enumerate() {
        let [width, height] = PAGE_PT.map(|length| length as f32);
        let settings = PageSettings::from_wh(width, height).ok_or("PDF: found no page, expected A4")?;
        let mut page = document.start_page_with(settings);
        let mut surface = page.surface();
        for run in marks.chunk_by(|a, b| a.1 == b.1) {
            put_run(&mut surface, run, draft.fonts, report, &mut leaves)?;
        }
        let of = words
            .with("page", &[("page", (number + 1).to_string()), ("pages", draft.pages.len().to_string())]);
        foot(&mut surface, draft.fonts, &below, &of);
        surface.finish();
        page.finish();
    }
    // The standard wants a date; the same report is the same file, whenever it is written.
    let date = DateTime::new(2000).month(1).day(1).hour(0).minute(0).second(0).utc_offset_hour(0);
    let language = language(report);
    let mut tree = TagTree::new().with_lang(Some(language.clone()));
    for node in &draft.tree {
        if let Some(node) = tagged(node, &leaves) {
            tree.push(node);
        }
    }
    document.set_tag_tree(tree);
    document.embed_file(recipe(report, words, date)).ok_or("PDF: found two attachments, expected one")?;
    document.set_outline(outline(draft));
    let metadata = Metadata::new()
        .title(title.to_owned())
        .language(language)
        .creator(shown(&report.recipe.program))
        .creation_date(date);
    document.set_metadata(metadata);
    document.finish().map_err(|e| match e {
        KrillaError::Validation(errors) => {
            format!(
                "PDF: found {:?}, expected PDF/A-3a and PDF/UA-1",
                errors.into_iter().map(|(e, _)| e).collect::<Vec<_>>()
            )
        }
        other => format!("PDF: found {other}, expected a report that can be written"),
    })
}

/// What stands below every page, as one may come to lie apart from the first: the title, and who read it.
pub(super) fn below_pages(report: &Report, title: &str, words: &Words) -> String {
    let signed = report.signed.as_ref().map(|reader| format!(" · {} {reader}", words.get("read-by")));
    format!("{title}{}", signed.unwrap_or_default())
}

/// What the report was made with. Not compressed: it is found again without a reader of PDF.
fn recipe(report: &Report, words: &Words, date: DateTime) -> EmbeddedFile {
    EmbeddedFile {
        path: "glioscope-recipe.json".to_owned(),
        mime_type: MimeType::new("application/json"),
        description: Some(words.get("section-made")),
        association_kind: AssociationKind::Source,
        data: report.recipe.text().into_bytes().into(),
        modification_date: Some(date),
        compress: Some(false),
        location: None,
    }
}

/// The language's code, or that of an unknown one.
fn language(report: &Report) -> String {
    let is_code = !report.language.is_empty()
        && report.language.len() <= 8
        && report.language.chars().all(|c| c.is_ascii_alphabetic());
    if is_code { report.language.clone() } else { "und".to_owned() }
}

fn outline(draft: &Draft<'_>) -> Outline {
    let mut entries = draft.outline.iter().map(|entry| {
        let point = Point::from_xy(MARGIN_PT as f32, (entry.y_pt - 8.0) as f32);
        OutlineNode::new(entry.text.clone(), XyzDestination::new(entry.page, point))
    });
    let mut outline = Outline::new();
    // The title comes first, and holds the others.
    if let Some(mut title) = entries.next() {
        entries.for_each(|entry| title.push_child(entry));
        outline.push_child(title.with_open(true));
    }
    outline
}

fn tagged(node: &Node, leaves: &[Option<Identifier>]) -> Option<Tagged> {
    match node {
        Node::Leaf(leaf) => leaves.get(*leaf).copied().flatten().map(Tagged::Leaf),
        Node::Group(tag, parts) => {
            let parts = parts.iter().filter_map(|part| tagged(part, leaves)).collect();
            Some(Tagged::Group(TagGroup::with_children(tag.clone(), parts)))
        }
    }
}

/// Draws marks that belong to one leaf, or to none.
fn put_run(
    surface: &mut Surface<'_>,
    run: &[(Mark, Option<Leaf>)],
    fonts: &Fonts,
    report: &Report,
    leaves: &mut [Option<Identifier>],
) -> Result<(), String> {
    let Some((first, leaf)) = run.first() else { return Ok(()) };
    let tag = match (leaf, first) {
        (None, _) => ContentTag::Artifact(Artifact::with_kind(ArtifactType::Layout)),
        (Some(_), Mark::Text { .. }) => ContentTag::Span(SpanTag::empty()),
        (Some(_), _) => ContentTag::Other,
    };
    let identifier = surface.start_tagged(tag);
    let mut outcome = Ok(());
    for (mark, _) in run {
        outcome = outcome.and_then(|()| put(surface, mark, fonts, report));
    }
    surface.end_tagged();
    if let Some(place) = leaf.and_then(|leaf| leaves.get_mut(leaf)) {
        *place = Some(identifier);
    }
    outcome
}

fn put(surface: &mut Surface<'_>, mark: &Mark, fonts: &Fonts, report: &Report) -> Result<(), String> {
    match mark {
        Mark::Text { at, line, style } => text(surface, *at, line, *style, fonts),
        Mark::Rect { at, size, color } => rectangle(surface, *at, *size, *color),
        Mark::Picture { at, size, block } => {
            let size = Size::from_wh(size[0] as f32, size[1] as f32);
            if let (Some(Block::Picture(one)), Some(size)) = (report.blocks.get(*block), size) {
                let image = picture::image(one)?;
                surface.push_transform(&Transform::from_translate(at[0] as f32, at[1] as f32));
                surface.draw_image(image, size);
                surface.pop();
            }
        }
        Mark::Plot { at, scale, block } => {
            if let Some(Block::Plot(one)) = report.blocks.get(*block) {
                let scale = *scale as f32;
                surface.push_transform(&Transform::from_row(
                    scale,
                    0.0,
                    0.0,
                    scale,
                    at[0] as f32,
                    at[1] as f32,
                ));
                plot(surface, one, fonts);
                surface.pop();
            }
        }
    }
    Ok(())
}

fn fill([r, g, b]: [u8; 3]) -> Fill {
    Fill { paint: rgb::Color::new(r, g, b).into(), ..Fill::default() }
}

fn stroke([r, g, b]: [u8; 3], width_pt: f64) -> Stroke {
    let paint = rgb::Color::new(r, g, b).into();
    Stroke { paint, width: width_pt as f32, line_join: LineJoin::Round, ..Stroke::default() }
}

fn rectangle(surface: &mut Surface<'_>, at: [f64; 2], size: [f64; 2], color: [u8; 3]) {
    let [x, y, width, height] = [at[0], at[1], size[0], size[1]].map(|length| length as f32);
    let mut path = PathBuilder::new();
    if let Some(rect) = Rect::from_xywh(x, y, width, height) {
        path.push_rect(rect);
    }
    if let Some(path) = path.finish() {
        surface.set_fill(Some(fill(color)));
        surface.set_stroke(None);
        surface.draw_path(&path);
    }
}

fn text(surface: &mut Surface<'_>, at: [f64; 2], line: &Line, style: Style, fonts: &Fonts) {
    surface.set_fill(Some(fill(style.color)));
    surface.set_stroke(Some(stroke(style.color, style.size_pt * STROKES[usize::from(style.is_bold)])));
    let mut x = at[0];
    for run in line.glyphs.chunk_by(|a, b| a.font == b.font) {
        let Some(font) = run.first().and_then(|glyph| fonts.font(glyph.font)) else { continue };
        let mut copied = String::with_capacity(run.len());
        let glyphs: Vec<KrillaGlyph> = run
            .iter()
            .map(|glyph| {
                let start = copied.len();
                copied.push(glyph.copied);
                let id = GlyphId::new(glyph.id);
                KrillaGlyph::new(id, glyph.advance_em as f32, 0.0, 0.0, 0.0, start..copied.len(), None)
            })
            .collect();
        let start = Point::from_xy(x as f32, at[1] as f32);
        surface.draw_glyphs(start, &glyphs, font.clone(), &copied, style.size_pt as f32, false);
        x += run.iter().map(|glyph| glyph.advance_em).sum::<f64>() * style.size_pt;
    }
    surface.set_stroke(None);
}

/// The title, and which page it is.
fn foot(surface: &mut Surface<'_>, fonts: &Fonts, title: &str, page: &str) {
    surface.start_tagged(ContentTag::Artifact(Artifact::with_kind(ArtifactType::Footer)));
    let y = PAGE_PT[1] - MARGIN_PT;
    rectangle(surface, [MARGIN_PT, y - 12.0], [WIDTH_PT, 0.5], RULE);
    let page = fonts.line(page);
    let width = page.width_em * FOOT.size_pt;
    let title = fonts.shortened(title, (WIDTH_PT - width - 20.0) / FOOT.size_pt);
    text(surface, [MARGIN_PT, y], &title, FOOT, fonts);
    text(surface, [MARGIN_PT + WIDTH_PT - width, y], &page, FOOT, fonts);
    surface.end_tagged();
}

/// A plot at the origin, cut off at its edges.
fn plot(surface: &mut Surface<'_>, one: &Plot, fonts: &Fonts) {
    let mut edge = PathBuilder::new();
    if let Some(rect) = Rect::from_xywh(0.0, 0.0, one.size_pt[0] as f32, one.size_pt[1] as f32) {
        edge.push_rect(rect);
    }
    let Some(edge) = edge.finish() else { return };
    surface.push_clip_path(&edge, &FillRule::NonZero);
    for shape in &one.shapes {
        match shape {
            Shape::Line { points, color, width_pt } => polyline(surface, points, *color, *width_pt),
            Shape::Area { points, color } => polygon(surface, points, *color),
            Shape::Dot { at, color } if is_drawable(*at) => circle(surface, *at, *color),
            Shape::Word { at, anchor, text: word, color } if is_drawable(*at) => {
                let free = match anchor {
                    Anchor::Start => one.size_pt[0] - at[0],
                    Anchor::Middle => 2.0 * at[0].min(one.size_pt[0] - at[0]),
                    Anchor::End => at[0],
                };
                // A word that would be cut off is set smaller, then shortened.
                let natural = fonts.line(word).width_em.max(1e-6);
                let size_pt = (free / natural).clamp(TEXT_PT * LEAST_WORD, TEXT_PT);
                let line = fonts.shortened(word, free.max(0.0) / size_pt);
                let share = match anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => 0.5,
                    Anchor::End => 1.0,
                };
                let x = at[0] - line.width_em * size_pt * share;
                text(surface, [x, at[1]], &line, Style::plain(size_pt, *color), fonts);
            }
            Shape::Dot { .. } | Shape::Word { .. } => {}
        }
    }
    surface.pop();
}

/// Whether a place can be written; PDF's numbers end at about 32767 in old readers.
fn is_drawable(at: [f64; 2]) -> bool {
    at.iter().all(|length| length.is_finite() && length.abs() < 30_000.0)
}

fn polygon(surface: &mut Surface<'_>, points: &[[f64; 2]], color: [u8; 3]) {
    let mut path = PathBuilder::new();
    for (n, [x, y]) in points.iter().filter(|at| is_drawable(**at)).enumerate() {
        match n {
            0 => path.move_to(*x as f32, *y as f32),
            _ => path.line_to(*x as f32, *y as f32),
        }
    }
    path.close();
    if let Some(path) = path.finish() {
        surface.set_fill(Some(fill(color)));
        surface.set_stroke(None);
        surface.draw_path(&path);
    }
}

fn polyline(surface: &mut Surface<'_>, points: &[[f64; 2]], color: [u8; 3], width_pt: f64) {
    let mut path = PathBuilder::new();
    for (n, [x, y]) in points.iter().filter(|at| is_drawable(**at)).enumerate() {
        match n {
            0 => path.move_to(*x as f32, *y as f32),
            _ => path.line_to(*x as f32, *y as f32),
        }
    }
    let Some(path) = path.finish().filter(|_| width_pt.is_finite() && width_pt > 0.0) else { return };
    surface.set_fill(None);
    surface.set_stroke(Some(stroke(color, width_pt)));
    surface.draw_path(&path);
    surface.set_stroke(None);
}

fn circle(surface: &mut Surface<'_>, [x, y]: [f64; 2], color: [u8; 3]) {
    let (r, k) = (DOT_PT, DOT_PT * QUARTER);
    let mut path = PathBuilder::new();
    path.move_to((x + r) as f32, y as f32);
    for quarter in [
        [x + r, y + k, x + k, y + r, x, y + r],
        [x - k, y + r, x - r, y + k, x - r, y],
        [x - r, y - k, x - k, y - r, x, y - r],
        [x + k, y - r, x + r, y - k, x + r, y],
    ] {
        let [a, b, c, d, e, f] = quarter.map(|length| length as f32);
        path.cubic_to(a, b, c, d, e, f);
    }
    path.close();
    if let Some(path) = path.finish() {
        surface.set_fill(Some(fill(color)));
        surface.set_stroke(None);
        surface.draw_path(&path);
    }
}
