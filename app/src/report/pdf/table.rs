//! Tables: widths of columns, rows on pages.

use krilla::tagging::{TableHeaderScope, Tag, TagKind};

use super::{
    draft::{Draft, HEIGHT_PT, INK, MARGIN_PT, Mark, Node, ROUNDING_PT, RULE, SOFT, Style, WIDTH_PT, shown},
    text::{Fonts, Line},
};
use crate::report::document::Table;

/// Heights of type, tried from the largest.
const SIZES_PT: [f64; 4] = [9.0, 8.0, 7.0, 6.2];
/// Room left and right of a cell's text.
const PAD_PT: f64 = 4.0;
/// Room above and below a cell's text.
const PAD_ABOVE_PT: f64 = 2.2;
/// A word wider than this may be broken so that the columns fit, em.
const WORD_EM: f64 = 9.0;
/// A number wider than this may be broken at spaces, em.
const NUMBER_EM: f64 = 8.0;
/// Notes below tables.
const NOTE: Style = Style::plain(8.5, SOFT);
/// A note with more lines isn't kept with the table's last row.
const NOTE_LINES: usize = 8;
/// Between a table and its note, and below both.
const NOTE_GAP_PT: f64 = 4.0;
const GAP_PT: f64 = 9.0;
/// A heading row higher than this share of a page isn't repeated.
const MOST_HEAD: f64 = 0.3;

/// A column's place.
#[derive(Clone, Copy, Debug)]
struct Column {
    x_pt: f64,
    width_pt: f64,
    is_number: bool,
}

/// A row's cells as lines.
struct Row {
    cells: Vec<Vec<Line>>,
    style: Style,
}

impl Row {
    fn of<'t>(cells: impl Iterator<Item = &'t str>, columns: &[Column], style: Style, fonts: &Fonts) -> Self {
        let lines = |(text, column): (&str, &Column)| {
            fonts.wrapped(text, (column.width_pt - 2.0 * PAD_PT) / style.size_pt)
        };
        Self { cells: cells.zip(columns).map(lines).collect(), style }
    }

    fn lines(&self) -> usize {
        self.cells.iter().map(Vec::len).max().unwrap_or(0)
    }

    fn height_pt(&self) -> f64 {
        self.lines() as f64 * self.style.leading_pt + 2.0 * PAD_ABOVE_PT
    }
}

/// Puts a table on pages. One that is too wide even in small type becomes several below each other, each beginning with the
/// first column.
pub fn table(draft: &mut Draft<'_>, one: &Table) {
    let text = one.note.as_deref().filter(|note| !shown(note).is_empty());
    let note = text.map_or_else(Vec::new, |note| draft.fonts.wrapped(note, WIDTH_PT / NOTE.size_pt));
    let note_pt = match note.len() {
        1..=NOTE_LINES => note.len() as f64 * NOTE.leading_pt + NOTE_GAP_PT,
        _ => 0.0,
    };
    if !one.head.is_empty() {
        let needs = needs(one, draft.fonts);
        for (n, (size_pt, columns)) in parts(&needs).into_iter().enumerate() {
            if n > 0 {
                draft.gap(GAP_PT);
            }
            part(draft, one, &needs, (size_pt, &columns), note_pt);
        }
    }
    if !note.is_empty() {
        draft.gap(NOTE_GAP_PT);
        let nodes = draft.flow(note, NOTE);
        draft.tree.push(Node::group(Tag::P, nodes));
    }
    draft.gap(GAP_PT);
}

/// Names with their values, as a table without a heading row.
pub fn facts(draft: &mut Draft<'_>, list: &[(String, String)]) {
    let style = Style::plain(9.5, INK);
    let widest = list.iter().map(|(name, _)| draft.fonts.line(name).width_em).fold(0.0, f64::max);
    let name_pt = (widest * style.size_pt + 2.0 * PAD_PT + 10.0).min(WIDTH_PT * 0.35);
    let columns = [
        Column { x_pt: MARGIN_PT - PAD_PT, width_pt: name_pt, is_number: false },
        Column {
            x_pt: MARGIN_PT - PAD_PT + name_pt,
            width_pt: WIDTH_PT + PAD_PT - name_pt,
            is_number: false,
        },
    ];
    let mut rows = Vec::new();
    for (name, value) in list {
        let row = Row::of([name.as_str(), value].into_iter(), &columns, style, draft.fonts);
        draft.keep(row.height_pt().min(HEIGHT_PT / 4.0));
        let tags = [TagKind::from(Tag::TH(TableHeaderScope::Row)), Tag::TD.into()];
        rows.push(put_row(draft, &row, &columns, tags.into_iter(), 0.0, &|_| {}));
    }
    if !rows.is_empty() {
        draft.tree.push(Node::group(Tag::Table, rows));
    }
    draft.gap(GAP_PT);
}

/// The height of type and the columns, by their numbers, of each part of a table.
fn parts(needs: &[(f64, f64)]) -> Vec<(f64, Vec<usize>)> {
    let all: Vec<usize> = (0..needs.len()).collect();
    let least = |columns: &[usize], size: f64| -> f64 {
        columns.iter().map(|n| needs[*n].0 * size + 2.0 * PAD_PT).sum()
    };
    if let Some(size) = SIZES_PT.into_iter().find(|size| least(&all, *size) <= WIDTH_PT) {
        return vec![(size, all)];
    }
    let size = SIZES_PT[SIZES_PT.len() - 1];
    let (mut parts, mut columns) = (Vec::new(), vec![0]);
    for n in 1..needs.len() {
        columns.push(n);
        if columns.len() > 2 && least(&columns, size) > WIDTH_PT {
            columns.pop();
            parts.push((size, std::mem::replace(&mut columns, vec![0, n])));
        }
    }
    parts.push((size, columns));
    parts
}

/// The least and the best width of each column, em.
fn needs(one: &Table, fonts: &Fonts) -> Vec<(f64, f64)> {
    let need = |(column, name): (usize, &String)| {
        let (mut least, mut best) = (fonts.widest_word_em(name).min(WORD_EM), fonts.line(name).width_em);
        for text in one.rows.iter().filter_map(|row| row.get(column)) {
            let whole = fonts.line(text).width_em;
            let is_number = column >= one.text_columns && whole <= NUMBER_EM;
            least = least.max(if is_number { whole } else { fonts.widest_word_em(text).min(WORD_EM) });
            best = best.max(whole);
        }
        (least, best)
    };
    one.head.iter().enumerate().map(need).collect()
}

/// Columns as wide as the page: each its least width, and a share of the rest by what it would like to have.
fn widths(needs: &[(f64, f64)], size_pt: f64) -> Vec<f64> {
    let width = |em: f64| em * size_pt + 2.0 * PAD_PT;
    let least: f64 = needs.iter().map(|(least, _)| width(*least)).sum();
    let best: f64 = needs.iter().map(|(_, best)| width(*best)).sum();
    if least >= WIDTH_PT {
        return needs.iter().map(|(em, _)| width(*em) * WIDTH_PT / least).collect();
    }
    if best <= WIDTH_PT {
        return needs.iter().map(|(_, em)| width(*em) * WIDTH_PT / best).collect();
    }
    let share = (WIDTH_PT - least) / (best - least);
    needs.iter().map(|(least, best)| width(*least) + (best - least) * size_pt * share).collect()
}

/// Puts a part of a table on pages, its last row with `below_pt` of room below it.
fn part(
    draft: &mut Draft<'_>,
    one: &Table,
    needs: &[(f64, f64)],
    (size_pt, numbers): (f64, &[usize]),
    below_pt: f64,
) {
    let needs: Vec<(f64, f64)> = numbers.iter().filter_map(|n| needs.get(*n).copied()).collect();
    let mut x_pt = MARGIN_PT;
    let columns: Vec<Column> = numbers
        .iter()
        .zip(widths(&needs, size_pt))
        .map(|(n, width_pt)| {
            x_pt += width_pt;
            Column { x_pt: x_pt - width_pt, width_pt, is_number: *n >= one.text_columns }
        })
        .collect();
    let cells = |row: &'_ [String]| -> Vec<String> {
        numbers.iter().map(|n| row.get(*n).cloned().unwrap_or_default()).collect()
    };
    let row = |texts: &[String], style: Style, fonts: &Fonts| {
        Row::of(cells(texts).iter().map(String::as_str), &columns, style, fonts)
    };
    let (plain, strong) = (Style::plain(size_pt, INK), Style::bold(size_pt));
    let head = row(&one.head, strong, draft.fonts);
    let first = one.rows.first().map_or(0.0, |texts| row(texts, plain, draft.fonts).height_pt());
    let below_first_pt = if one.rows.len() < 2 { below_pt } else { 0.0 };
    draft.keep((head.height_pt() + first + below_first_pt).min(HEIGHT_PT / 2.0));
    let column_tag = || TagKind::from(Tag::TH(TableHeaderScope::Column));
    let head_node = put_row(draft, &head, &columns, columns.iter().map(|_| column_tag()), 0.0, &|_| {});
    let is_repeated = head.height_pt() <= HEIGHT_PT * MOST_HEAD;
    let again = |draft: &mut Draft<'_>| {
        if is_repeated {
            // The repeated row means nothing new.
            put_lines_of(draft, &head, &columns, 0..head.lines(), &mut None);
        }
    };
    let mut rows = Vec::with_capacity(one.rows.len());
    for (n, texts) in one.rows.iter().enumerate() {
        let below_pt = if n + 1 == one.rows.len() { below_pt } else { 0.0 };
        let row = row(texts, plain, draft.fonts);
        let tags = (0..columns.len()).map(|n| match n {
            0 => TagKind::from(Tag::TH(TableHeaderScope::Row)),
            _ => Tag::TD.into(),
        });
        rows.push(put_row(draft, &row, &columns, tags, below_pt, &again));
    }
    let mut nodes = vec![Node::group(Tag::THead, vec![head_node])];
    if !rows.is_empty() {
        nodes.push(Node::group(Tag::TBody, rows));
    }
    draft.tree.push(Node::group(Tag::Table, nodes));
}

/// Puts a row on the page, or on the next one, after `again`; on several only if it is higher than a page. It has `below_pt` of
/// room below it. Its node.
fn put_row(
    draft: &mut Draft<'_>,
    row: &Row,
    columns: &[Column],
    tags: impl Iterator<Item = TagKind>,
    below_pt: f64,
    again: &dyn Fn(&mut Draft<'_>),
) -> Node {
    let mut cells: Option<Vec<Vec<Node>>> = Some(vec![Vec::new(); columns.len()]);
    let (lines, mut done, mut is_turned) = (row.lines(), 0, false);
    while done < lines {
        let rest = (lines - done) as f64 * row.style.leading_pt + 2.0 * PAD_ABOVE_PT;
        // A row higher than three quarters of a page is broken anywhere.
        let is_breakable = is_turned || row.height_pt() > HEIGHT_PT * (1.0 - MOST_HEAD);
        let fitting = ((draft.room_pt() + ROUNDING_PT - 2.0 * PAD_ABOVE_PT) / row.style.leading_pt)
            .floor()
            .max(0.0) as usize;
        let is_fitting = |below_pt: f64| rest + below_pt <= draft.room_pt() + ROUNDING_PT;
        let count = match () {
            () if is_fitting(if is_turned { 0.0 } else { below_pt }) => lines - done,
            () if is_breakable && fitting >= 2 => fitting.min(lines - done),
            () => 0,
        };
        if count == 0 {
            draft.turn();
            again(draft);
            is_turned = true;
            continue;
        }
        put_lines_of(draft, row, columns, done..done + count, &mut cells);
        done += count;
    }
    let cells = cells.unwrap_or_default();
    Node::group(Tag::TR, tags.zip(cells).map(|(tag, nodes)| Node::Group(tag, nodes)).collect())
}

/// Puts some of a row's lines on the page. Without `cells` they mean nothing.
fn put_lines_of(
    draft: &mut Draft<'_>,
    row: &Row,
    columns: &[Column],
    range: std::ops::Range<usize>,
    cells: &mut Option<Vec<Vec<Node>>>,
) {
    let style = row.style;
    let y = draft.take(range.len() as f64 * style.leading_pt + 2.0 * PAD_ABOVE_PT);
    for (n, (column, lines)) in columns.iter().zip(&row.cells).enumerate() {
        let shown = lines.get(range.start.min(lines.len())..range.end.min(lines.len())).unwrap_or_default();
        for (k, line) in shown.iter().enumerate() {
            let free = column.width_pt - 2.0 * PAD_PT - line.width_em * style.size_pt;
            let x = column.x_pt + PAD_PT + if column.is_number { free.max(0.0) } else { 0.0 };
            let leaf = cells.as_mut().and_then(|cells| {
                let leaf = draft.leaf();
                cells.get_mut(n)?.push(Node::Leaf(leaf));
                Some(leaf)
            });
            let y = y + PAD_ABOVE_PT + k as f64 * style.leading_pt;
            draft.put_line([x, y], line.clone(), style, leaf);
        }
    }
    let (height, thickness) = (draft.take(0.0), if style.is_bold { 1.0 } else { 0.5 });
    let rule = Mark::Rect { at: [MARGIN_PT, height - thickness], size: [WIDTH_PT, thickness], color: RULE };
    draft.put(rule, None);
}
