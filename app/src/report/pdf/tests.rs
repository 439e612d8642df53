use std::collections::HashMap;

use proptest::prelude::*;

use super::{
    draft::{Draft, MARGIN_PT, Mark, Node, PAGE_PT, WIDTH_PT},
    layout::layout,
    pdf,
    text::{Fonts, Line, clean},
};
use crate::report::{
    document::{Block, Finding, Picture, Report, Table},
    identity::Identity,
    plot::{Anchor, Plot, Series, Shape},
    recipe::{Recipe, recipe_in},
    sentences,
};
use crate::words::{Language, Words};

fn report(blocks: Vec<Block>) -> Report {
    let recipe = Recipe {
        glioscope_report: 1,
        program: "Glioscope 0.1.0".into(),
        adapter: "none".into(),
        names_reader: false,
        identity: Identity::None,
        language: Language::En,
        inputs: Vec::new(),
        response: None,
        session: serde_json::Value::Null,
    };
    Report { language: "en".into(), title: "A title".into(), signed: None, blocks, recipe }
}

fn words() -> Words {
    sentences::words(Language::En)
}

fn table(columns: usize, rows: usize, cell: &str) -> Table {
    Table {
        head: (0..columns).map(|n| format!("Column {n}")).collect(),
        text_columns: 1,
        rows: (0..rows).map(|r| (0..columns).map(|c| format!("{cell}{r}.{c}")).collect()).collect(),
        note: None,
    }
}

fn picture(size: [u32; 2], caption: &str) -> Picture {
    let bytes = (0..size[0] * size[1]).flat_map(|n| [n as u8, (n / 3) as u8, 90, 255]).collect();
    Picture { name: "one".into(), caption: caption.into(), size, rgba: bytes }
}

fn leaves(nodes: &[Node], out: &mut Vec<usize>) {
    for node in nodes {
        match node {
            Node::Leaf(leaf) => out.push(*leaf),
            Node::Group(_, parts) => leaves(parts, out),
        }
    }
}

fn said(line: &Line) -> String {
    line.glyphs.iter().map(|g| g.shown).collect()
}

/// What lies outside of the margins, on other text, or twice or nowhere in the tree.
fn faults(draft: &Draft<'_>) -> Vec<String> {
    let mut out = Vec::new();
    let mut uses: HashMap<usize, usize> = HashMap::new();
    let mut named = Vec::new();
    leaves(&draft.tree, &mut named);
    named.iter().for_each(|leaf| *uses.entry(*leaf).or_default() += 1);
    if named.len() != draft.leaves || uses.values().any(|n| *n != 1) {
        out.push(format!("{} leaves, {} in the tree", draft.leaves, named.len()));
    }
    let mut drawn: HashMap<usize, usize> = HashMap::new();
    for (page, marks) in draft.pages.iter().enumerate() {
        for run in marks.chunk_by(|a, b| a.1 == b.1) {
            run[0].1.into_iter().for_each(|leaf| *drawn.entry(leaf).or_default() += 1);
        }
        let mut boxes: Vec<[f64; 4]> = Vec::new();
        for (mark, _) in marks {
            let (one, is_text) = match mark {
                Mark::Text { at: [x, y], line, style } => {
                    let size = style.size_pt;
                    ([*x, y - 0.75 * size, x + line.width_em * size, y + 0.2 * size], true)
                }
                Mark::Rect { at, size, .. } | Mark::Picture { at, size, .. } => {
                    ([at[0], at[1], at[0] + size[0], at[1] + size[1]], false)
                }
                Mark::Plot { at, .. } => ([at[0], at[1], at[0], at[1]], false),
            };
            let [left, top, right, bottom] = one;
            let (most_right, most_bottom) = (MARGIN_PT + WIDTH_PT + 0.1, PAGE_PT[1] - MARGIN_PT - 12.0);
            if left < MARGIN_PT - 4.1 || top < MARGIN_PT - 0.1 || right > most_right || bottom > most_bottom {
                out.push(format!("page {page}: {one:?} of {mark:?}"));
            }
            if is_text && right > left {
                let touches = |b: &&[f64; 4]| {
                    left < b[2] - 0.1 && b[0] < right - 0.1 && top < b[3] - 0.1 && b[1] < bottom - 0.1
                };
                if let Some(other) = boxes.iter().find(touches) {
                    out.push(format!("page {page}: {one:?} on {other:?}"));
                }
                boxes.push(one);
            }
        }
    }
    if drawn.len() != draft.leaves || drawn.values().any(|n| *n != 1) {
        out.push(format!(
            "{} leaves, {} drawn once",
            draft.leaves,
            drawn.values().filter(|n| **n == 1).count()
        ));
    }
    out
}

fn checked(blocks: Vec<Block>) -> (usize, usize) {
    let (report, fonts) = (report(blocks), Fonts::new().unwrap());
    let draft = layout(&report, &report.title, &words(), &fonts);
    assert_eq!(faults(&draft), Vec::<String>::new());
    let bytes = pdf(&report, &words()).unwrap();
    assert!(bytes.starts_with(b"%PDF-1.7"));
    (draft.pages.len(), bytes.len())
}

#[test]
fn the_same_report_is_the_same_file() {
    let one = report(vec![
        Block::Heading("Heading".into()),
        Block::Table(table(4, 90, "12.3 ")),
        Block::Picture(picture([40, 30], "a caption")),
    ]);
    let [a, b] = [pdf(&one, &words()).unwrap(), pdf(&one, &words()).unwrap()];
    assert!(a == b, "{} and {} bytes", a.len(), b.len());
    let has = |text: &str| a.windows(text.len()).any(|part| part == text.as_bytes());
    assert!(has("<pdfaid:part>3") && has("<pdfaid:conformance>A") && has("<pdfuaid:part>1"), "the standards");
    let recipe = serde_json::to_value(&one.recipe).unwrap();
    assert_eq!(recipe_in(&a).unwrap(), Some(recipe), "what it was made with is found again");
    assert!(has("D:20000101") && !has("D:202"), "no date but the fixed one");
}

#[test]
fn an_empty_report_is_one_page() {
    assert_eq!(checked(Vec::new()).0, 1);
    let mut one =
        report(vec![Block::Heading(" \u{7}".into()), Block::Findings(Vec::new()), Block::Facts(Vec::new())]);
    (one.title, one.language, one.recipe.program) = (String::new(), "e n".into(), String::new());
    assert!(pdf(&one, &words()).is_ok());
}

#[test]
fn long_tables_repeat_their_head() {
    let fonts = Fonts::new().unwrap();
    let report = report(vec![Block::Table(table(5, 2000, "mask "))]);
    let draft = layout(&report, "A title", &words(), &fonts);
    assert_eq!(faults(&draft), Vec::<String>::new());
    assert!(draft.pages.len() > 20);
    for (page, marks) in draft.pages.iter().enumerate() {
        let heads = marks.iter().filter(
            |(mark, _)| matches!(mark, Mark::Text { line, .. } if said(line).starts_with("Column 4")),
        );
        let heads: Vec<bool> = heads.map(|(_, leaf)| leaf.is_some()).collect();
        assert_eq!(heads, [page == 0], "page {page}: once, and meaning something on the first page alone");
    }
    assert!(pdf(&report, &words()).is_ok());
}

#[test]
fn nothing_leaves_the_page() {
    let long = "W".repeat(300);
    checked(vec![Block::Table(table(40, 30, "1234.5 "))]);
    checked(vec![Block::Table(table(40, 3, &long))]);
    checked(vec![Block::Table(table(1, 2, &"word ".repeat(3000)))]);
    checked(vec![
        Block::Text(long.clone()),
        Block::Heading(long.clone()),
        Block::Facts(vec![(long.clone(), long.repeat(40))]),
    ]);
    let finding = Finding { is_warning: true, text: "word ".repeat(4000) };
    assert!(checked(vec![Block::Findings(vec![finding])]).0 > 3);
    checked(vec![
        Block::Picture(picture([20, 30], &long)),
        Block::Picture(picture([3, 300], &"caption ".repeat(2000))),
    ]);
}

#[test]
fn a_picture_without_pixels_is_left_out() {
    let pictures = |list: Vec<Picture>| checked(list.into_iter().map(Block::Picture).collect());
    let mut short = picture([4, 4], "");
    short.rgba.pop();
    assert_eq!(pictures(vec![picture([0, 0], ""), picture([0, 9], "nothing"), short]), checked(Vec::new()));
    assert!(pictures(vec![picture([1, 1], "")]).1 > checked(Vec::new()).1);
}

#[test]
fn headings_stay_with_what_follows() {
    // Some of these counts of lines leave room for the heading alone at the foot of the page.
    for lines in 30..60 {
        let mut blocks = vec![Block::Text("x".into()); lines];
        blocks.extend([Block::Heading("Last".into()), Block::Text("line ".repeat(60))]);
        let (report, fonts) = (report(blocks), Fonts::new().unwrap());
        let draft = layout(&report, "A title", &words(), &fonts);
        let place = |text: &str| {
            let is_here =
                |mark: &Mark| matches!(mark, Mark::Text { line, .. } if said(line).starts_with(text));
            draft.pages.iter().position(|marks| marks.iter().any(|(mark, _)| is_here(mark))).unwrap()
        };
        assert_eq!(place("Last"), place("line"), "after {lines} lines");
        assert_eq!(draft.outline.last().map(|entry| entry.page), Some(place("Last")));
    }
}

#[test]
fn every_sign_is_seen() {
    let fonts = Fonts::new().unwrap();
    let seen = |text: &str| fonts.line(text).glyphs.iter().map(|g| g.shown).collect::<String>();
    let known = "äöüÄÖÜß ≥ ≤ − × → ∩ ∪ ± θ 30\u{2009}169 1–2 αΩμ ЖДя °²³ …„“‚‘ \u{2011}\u{202f}\u{a0}½≈≠∞√";
    assert_eq!(seen(known), known);
    assert!(fonts.line(known).glyphs.iter().all(|g| g.id != 0));
    assert_eq!(seen("a中א🙂\u{e000}"), "a[U+4E2D][U+05D0][U+1F642][U+E000]");
    let copied: String = fonts.line("a b\u{a0}c 30\u{2009}169 µμ").glyphs.iter().map(|g| g.copied).collect();
    assert_eq!(copied.replace(['\u{a0}', '\u{2009}'], " ").replace('μ', "µ"), "a b c 30 169 µµ");
    assert_eq!(seen("u\u{308}ber"), "über", "names of files come decomposed");
    assert_eq!(seen("a\u{0}\u{7}\u{200f}\u{feff}\u{fffe}b\nc\td"), "ab c d");
}

#[test]
fn plots_with_odd_values_are_drawn() {
    let series = [Series { name: "W".repeat(40), color: [1, 2, 3], values: vec![Some(1.0), Some(2.0)] }];
    let labels = ["2024-01-01".to_owned(), "2024-02-01".to_owned()];
    let plot =
        Plot::over_time("volumes".into(), &[0.0, 31.0], &labels, &series, &|v| format!("{v}")).unwrap();
    let mut odd = plot.clone();
    odd.shapes.push(Shape::Dot { at: [f64::NAN, 1.0], color: [0; 3] });
    odd.shapes.push(Shape::Line {
        points: vec![[0.0, f64::INFINITY], [1.0, 2.0]],
        color: [0; 3],
        width_pt: -1.0,
    });
    odd.shapes.push(Shape::Word {
        at: [900.0, 5.0],
        anchor: Anchor::Start,
        text: "out".into(),
        color: [0; 3],
    });
    let sizes = [[0.0, 5.0], [f64::NAN, 1.0], [1e9, 1e-9]].map(|size_pt| Plot { size_pt, ..plot.clone() });
    checked([plot, odd].into_iter().chain(sizes).map(Block::Plot).collect());
}

fn text() -> impl Strategy<Value = String> {
    let sign = prop_oneof![
        8 => proptest::char::range('a', 'z'),
        3 => Just(' '),
        2 => proptest::sample::select("WÄß≥−×\u{2009}–/_-.0123456789[]".chars().collect::<Vec<_>>()),
        1 => any::<char>(),
    ];
    let length = prop_oneof![5 => 0..30_usize, 2 => 0..400_usize, 1 => 0..4000_usize];
    length
        .prop_flat_map(move |n| proptest::collection::vec(sign.clone(), n))
        .prop_map(|signs| signs.into_iter().collect())
}

fn block() -> impl Strategy<Value = Block> {
    let table =
        (1..14_usize, 0..9_usize, proptest::option::of(text())).prop_flat_map(|(columns, rows, note)| {
            let cells = proptest::collection::vec(proptest::collection::vec(text(), columns), rows);
            (proptest::collection::vec(text(), columns), 0..=columns, cells).prop_map(
                move |(head, text_columns, rows)| Table { head, text_columns, rows, note: note.clone() },
            )
        });
    prop_oneof![
        text().prop_map(Block::Heading),
        text().prop_map(Block::Text),
        proptest::collection::vec((any::<bool>(), text()), 0..4).prop_map(|list| {
            let finding = |(is_warning, text)| Finding { is_warning, text };
            Block::Findings(list.into_iter().map(finding).collect())
        }),
        proptest::collection::vec((text(), text()), 0..4).prop_map(Block::Facts),
        table.prop_map(Block::Table),
        (0..50_u32, 0..50_u32, text()).prop_map(|(x, y, caption)| Block::Picture(picture([x, y], &caption))),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_report_can_be_written(title in text(), blocks in proptest::collection::vec(block(), 0..10)) {
        let mut one = report(blocks);
        one.title = title;
        let fonts = Fonts::new().unwrap();
        let draft = layout(&one, "A title", &words(), &fonts);
        prop_assert_eq!(faults(&draft), Vec::<String>::new());
        let bytes = pdf(&one, &words());
        prop_assert!(bytes.is_ok(), "{:?}", bytes.err());
    }

    #[test]
    fn lines_hold_the_text(text in text(), limit in 1.0..40.0_f64) {
        let lines = Fonts::new().unwrap().wrapped(&text, limit);
        let whole: String = lines.iter().map(said).collect();
        if !whole.contains("[U+") {
            prop_assert_eq!(whole, clean(&text));
        }
        for line in &lines {
            prop_assert!(line.width_em <= limit + 1e-6 || line.glyphs.len() == 1, "{} of {}", line.width_em, limit);
        }
    }
}

#[test]
fn every_page_says_who_read_it() {
    let words = sentences::words(Language::De);
    let of = |signed: Option<&str>| Report { signed: signed.map(str::to_owned), ..report(Vec::new()) };
    let below = |signed| super::write::below_pages(&of(signed), "A title", &words);
    assert_eq!(below(None), "A title");
    assert_eq!(below(Some("A. B., 2024-05-15")), "A title · Befundet von A. B., 2024-05-15");
}
