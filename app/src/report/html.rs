//! A report as one HTML file: nothing is loaded from elsewhere.

use std::collections::BTreeMap;

use base64::{Engine, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::document::{Block, Finding, Picture, Report, Table};
use crate::{error::AppError, output, words::Words};

/// The id of the element that holds the recipe.
const RECIPE_ID: &str = "glioscope-recipe";

const STYLE: &str = include_str!("report.css");

/// The report as HTML.
///
/// # Errors
/// [`AppError`] where a picture can't be encoded.
pub fn html(report: &Report, words: &Words) -> Result<String, AppError> {
    let pictures = report.blocks.iter().filter_map(Block::as_picture);
    let images: Vec<String> = pictures.map(data_uri).collect::<Result<_, _>>()?;
    let headings: Vec<&str> = report
        .blocks
        .iter()
        .filter_map(|block| match block {
            Block::Heading(text) => Some(text.as_str()),
            _ => None,
        })
        .collect();
    let page = html! {
        (DOCTYPE)
        html lang=(report.language) {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                // Nothing is loaded and nothing runs, whatever a name holds.
                meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'";
                meta name="generator" content=(report.recipe.program);
                title { (report.title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    h1 { (report.title) }
                    nav aria-label=(words.get("contents")) {
                        ul { @for (n, text) in headings.iter().enumerate() { li { a href={ "#s" (n) } { (text) } } } }
                    }
                    (blocks(report, &images, words))
                }
                script type="application/json" id=(RECIPE_ID) { (PreEscaped(report.recipe.text())) }
            }
        }
    };
    Ok(page.into_string())
}

/// What each table is called: as the heading above it, which stands for one table; those that follow are numbered.
fn table_names(report: &Report) -> Vec<String> {
    let (mut heading, mut tables) = (report.title.as_str(), BTreeMap::<&str, usize>::new());
    let mut names = Vec::new();
    for block in &report.blocks {
        match block {
            Block::Heading(text) => heading = text,
            Block::Table(_) => {
                let number = tables.entry(heading).and_modify(|n| *n += 1).or_insert(1);
                names.push(if *number == 1 { heading.to_owned() } else { format!("{heading} ({number})") });
            }
            _ => {}
        }
    }
    names
}

/// `images`: those of the pictures, in their order.
fn blocks(report: &Report, images: &[String], words: &Words) -> Markup {
    let blocks = &report.blocks;
    let (mut number, mut images) = (0, images.iter());
    let mut names = table_names(report).into_iter();
    html! {
        @for (at, block) in blocks.iter().enumerate() {
            @match block {
                Block::Heading(text) => {
                    h2 id={ "s" ({ number += 1; number - 1 }) } { (text) }
                }
                Block::Text(text) => { p { (text) } }
                Block::Findings(list) => { (findings(list, words)) }
                Block::Facts(list) => { (facts(list)) }
                Block::Table(one) => { (table(one, &names.next().unwrap_or_default())) }
                Block::Plot(plot) => { figure class="plot" { (PreEscaped(plot.svg())) figcaption { (plot.caption) } } }
                // A run of pictures is a grid.
                Block::Picture(_) => {
                    @if at == 0 || !matches!(blocks[at - 1], Block::Picture(_)) {
                        div class="pictures" {
                            @for (one, image) in blocks[at..].iter().map_while(Block::as_picture).zip(images.by_ref()) {
                                (picture(one, image))
                            }
                        }
                    }
                }
            }
        }
    }
}

fn findings(list: &[Finding], words: &Words) -> Markup {
    html! {
        ul class="findings" {
            @for one in list {
                li class=(if one.is_warning { "warning" } else { "note" }) {
                    strong { (words.get(if one.is_warning { "warning-mark" } else { "note-mark" })) ": " }
                    (one.text)
                }
            }
        }
    }
}

fn facts(list: &[(String, String)]) -> Markup {
    html! { dl { @for (name, value) in list { div { dt { (name) } dd { (value) } } } } }
}

fn table(one: &Table, name: &str) -> Markup {
    let class = |column: usize| (column >= one.text_columns).then_some("number");
    html! {
        // A wide table scrolls in itself; by the keyboard, too.
        div class="table" tabindex="0" role="region" aria-label=(name) {
            table {
                thead { tr { @for (n, name) in one.head.iter().enumerate() { th scope="col" class=[class(n)] { (name) } } } }
                tbody {
                    @for row in &one.rows {
                        tr {
                            @for (n, cell) in row.iter().enumerate() {
                                @if n == 0 { th scope="row" { (cell) } } @else { td class=[class(n)] { (cell) } }
                            }
                        }
                    }
                }
            }
        }
        @if let Some(note) = &one.note { p class="small" { (note) } }
    }
}

/// A picture within the page.
fn data_uri(one: &Picture) -> Result<String, AppError> {
    let png = output::png(&one.name, one.size, &one.rgba)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(png)))
}

fn picture(one: &Picture, image: &str) -> Markup {
    let [width, height] = one.size;
    html! {
        figure class=[(width > height).then_some("wide")] {
            img src=(image) alt=(one.caption) width=(width) height=(height);
            figcaption { (one.caption) }
        }
    }
}
