//! The page as one HTML file.

use base64::{Engine, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::{Date, Page, Slice, Surface, diagram, hundredths, print, text};
use glioscope_render::flat::Plane;

use crate::{
    format::{hex, json_in_element},
    words::Words,
};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// three.js, what the page uses of it: `vendor/README.md`.
const LIBRARY: &str = include_str!("vendor/three.min.js");

/// The page as HTML. Nothing is loaded, and nothing runs but its own two scripts, by their hashes.
pub fn page(content: &Page, words: &Words) -> String {
    let style = format!("{STYLE}{}", colors(content));
    let policy = format!(
        "default-src 'none'; img-src data:; style-src {}; script-src {} {}; base-uri 'none'; form-action 'none'",
        hash(&style),
        hash(LIBRARY),
        hash(SCRIPT)
    );
    let default = content.text.is_none().then(|| text::paragraphs(content, words));
    let paragraphs = default.as_deref().or(content.text.as_deref()).unwrap_or_default();
    let markup = html! {
        (DOCTYPE)
        html lang=(words.get("language-code")) {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="referrer" content="no-referrer";
                meta name="robots" content="noindex";
                title { (words.get("title")) }
                style { (PreEscaped(&style)) }
            }
            body {
                header class="top" { h1 { (words.get("title")) } p { (words.get("lead")) } }
                main {
                    (view(content, words))
                    @for (n, date) in content.dates.iter().enumerate() { (date_part(content, n, date, words)) }
                    section class="card words" { (print::paragraphs_of(paragraphs, "h2")) }
                    (true_size(content, words))
                }
                footer { p { (words.get("footer")) } button type="button" id="print" hidden { (words.get("print")) } }
                (print::sheet(content, paragraphs, words))
                script type="application/json" id="data" { (PreEscaped(json_in_element(&data(content, words).to_string()))) }
                script { (PreEscaped(LIBRARY)) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    markup.into_string()
}

/// The hash by which a policy allows an element's text.
fn hash(text: &str) -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text.as_bytes())))
}

/// A rule for the colour of each mask and level.
fn colors(page: &Page) -> String {
    let rule = |class: String, color| format!(".{class}{{background:{}}}\n", hex(color));
    let masks = page.masks.iter().enumerate().map(|(n, mask)| rule(format!("m{n}"), mask.color));
    let levels = page.dates.iter().enumerate().flat_map(|(d, date)| {
        date.levels.iter().enumerate().map(move |(n, level)| rule(format!("d{d}l{n}"), level.color))
    });
    masks.chain(levels).collect()
}

/// The 3D view with its buttons; hidden until the script has drawn it.
fn view(page: &Page, words: &Words) -> Markup {
    let button = |id: &str, key: &str, sign: &str| {
        html! { button type="button" id=(id) class="round" aria-label=(words.get(key)) title=(words.get(key)) { span aria-hidden="true" { (sign) } } }
    };
    html! {
        p class="card" id="flat" { (words.get("no-3d")) }
        section id="view" class="card" aria-label=(words.get("view")) hidden {
            div id="stage" {
                canvas id="canvas" tabindex="0" role="img" aria-label=(words.get("view-alt")) {}
                @if page.has_sides {
                    span class="tag" id="tag-left" aria-hidden="true" { (words.get("your-left")) }
                    span class="tag" id="tag-right" aria-hidden="true" { (words.get("your-right")) }
                }
                div class="tools" role="group" aria-label=(words.get("view-tools")) {
                    (button("turn-left", "turn-left", "↺")) (button("turn-right", "turn-right", "↻"))
                    (button("closer", "closer", "+")) (button("farther", "farther", "−"))
                    button type="button" id="reset" { (words.get("reset")) }
                }
            }
            p class="hint" { (words.get("view-hint")) }
            @if page.dates.len() > 1 {
                div class="row" role="group" aria-label=(words.get("dates")) {
                    button type="button" id="play" class="main" { span class="sign" aria-hidden="true" { "▶ " } span class="text" { (words.get("play")) } }
                    @for (n, date) in page.dates.iter().enumerate() {
                        button type="button" class="date-button" data-date=(n) aria-pressed="false" { (text::date_name(date, n, words)) }
                    }
                }
                p id="when" aria-live="polite" {}
            }
            @if page.masks.len() > 1 {
                div class="row modes" role="group" aria-label=(words.get("modes")) {
                    button type="button" id="mode-masks" aria-pressed="false" { (words.get("mode-masks")) }
                    button type="button" id="mode-levels" aria-pressed="false" { (words.get("mode-levels")) }
                }
            }
            h2 class="small" id="show-heading" { (words.get("show")) }
            div class="masks" role="group" aria-labelledby="show-heading" {
                @for n in 0..page.masks.len() {
                    button type="button" class="mask" data-of-mode="masks" data-mask=(n) aria-pressed="true" {
                        span class={ "swatch m" (n) } {}
                        span class="name" { (text::mask_name(page, n, words)) }
                        span class="value" data-volume=(n) {}
                    }
                }
                @for (d, date) in page.dates.iter().enumerate() {
                    @for (n, level) in date.levels.iter().enumerate() {
                        button type="button" class="mask" data-of-mode="levels" data-of-date=(d) data-level=(n) aria-pressed="true" hidden {
                            span class={ "swatch d" (d) "l" (n) } {}
                            span class="name" { (text::level_name(level.count, date.levels.len(), words)) }
                            span class="value" { (text::ml(level.volume_ml, words)) }
                        }
                    }
                }
                @if page.head.is_some() {
                    button type="button" class="mask" id="head" aria-pressed="true" {
                        span class="swatch ghost" {} span class="name" { (words.get("around")) }
                    }
                }
            }
        }
    }
}

/// Pictures, diagrams and sizes of a date.
fn date_part(page: &Page, n: usize, date: &Date, words: &Words) -> Markup {
    let name = text::date_name(date, n, words);
    let has_name = page.dates.len() > 1 || date.label.is_some();
    html! {
        section class="date" data-date=(n) aria-label=(name) {
            @if !date.slices.is_empty() {
                div class="card" {
                    h2 { (words.get("pictures")) @if has_name { span class="when" { " " (name) } } }
                    p { (print::side(page, words)) }
                    div class="pictures" { @for slice in &date.slices { (picture(page, date, slice, words)) } }
                }
            }
            div class="card" {
                h2 { (words.get(if date.levels.is_empty() { "sizes" } else { "agreement" })) @if has_name { span class="when" { " " (name) } } }
                @if !date.levels.is_empty() { p { (words.get("agreement-text")) } }
                div class="diagrams" {
                    @if let Some(one) = diagram::agreement(date, words, true) { (one) }
                    @if let Some(one) = diagram::volumes(page, date, words, true) { (one) }
                }
                ul class="sizes" {
                    @for (n, mask) in date.masks.iter().enumerate() {
                        @if let Some(mask) = mask {
                            li { strong { (text::mask_name(page, n, words)) ": " } (text::size(mask.volume_ml, words)) }
                        }
                    }
                }
            }
        }
    }
}

fn picture(page: &Page, date: &Date, slice: &Slice, words: &Words) -> Markup {
    let (key, letters) = match slice.plane {
        Plane::Axial => ("axial", true),
        Plane::Coronal => ("coronal", true),
        Plane::Sagittal => ("sagittal", false),
    };
    let [width, height] = slice.size_mm.map(hundredths);
    let line = 0.9;
    html! {
        figure {
            svg viewBox={ "0 0 " (width) " " (height) } role="img" aria-label=(words.get(&format!("{key}-alt"))) {
                rect width=(width) height=(height) fill="#000" {}
                @if let Some(png) = &slice.png {
                    image href={ "data:image/png;base64," (STANDARD.encode(png)) } width=(width) height=(height) preserveAspectRatio="none" {}
                }
                @for (n, path) in slice.levels.iter().enumerate() {
                    @if let Some(level) = date.levels.get(n).filter(|_| !path.is_empty()) {
                        path class="level" data-level-path=(n) d=(path) fill=(hex(level.color)) fill-opacity="0.75" fill-rule="evenodd" {}
                    }
                }
                @for (n, path) in slice.masks.iter().enumerate() {
                    @if let Some(mask) = page.masks.get(n).filter(|_| !path.is_empty()) {
                        path class="halo" data-mask-path=(n) d=(path) fill="none" stroke="#fff" stroke-width=(line * 2.2) stroke-linejoin="round" {}
                        path data-mask-path=(n) d=(path) fill="none" stroke=(hex(mask.color)) stroke-width=(line * 1.3) stroke-linejoin="round" {}
                    }
                }
            }
            @if letters && page.has_sides {
                div class="sides" aria-hidden="true" { span { (words.get("your-right")) } span { (words.get("your-left")) } }
            }
            figcaption { (words.get(key)) }
        }
    }
}

/// The largest slice in true size on the screen, by a bank card.
fn true_size(page: &Page, words: &Words) -> Markup {
    let Some(slice) = page.dates.last().and_then(|date| date.largest.as_ref()) else { return html! {} };
    html! {
        section class="card" id="true-size" {
            h2 { (words.get("true-size-heading")) }
            p { (words.get("true-size-text")) }
            div class="true" tabindex="0" role="region" aria-label=(words.get("true-size-heading")) {
                (print::true_size(page, slice, words, Some("true-outlines")))
            }
            (print::bar(Some("true-bar")))
            p { (words.get("true-size-check")) }
            div id="fit" hidden {
                p { (words.get("fit-text")) }
                div class="fit" {
                    svg id="card" viewBox="0 0 6 85.6" width="6mm" height="85.6mm" data-width="6" data-height="85.6" aria-hidden="true" {
                        path d="M0.5 0.15H5.5M0.5 85.45H5.5M3 0.15V85.45" fill="none" stroke="currentColor" stroke-width="0.3" {}
                    }
                    label { (words.get("fit-label")) input type="range" id="fit-scale" min="0.5" max="2.5" step="0.005" value="1"; }
                }
            }
        }
    }
}

/// What the script draws and says.
fn data(page: &Page, words: &Words) -> Value {
    let mut surfaces = Vec::new();
    let mut add = |surface: Option<&Surface>| {
        surface.map(|surface| {
            let (indices, is_wide) = surface.index_bytes();
            surfaces.push(json!({
                "origin": surface.origin_mm,
                "step": surface.step_mm,
                "positions": STANDARD.encode(surface.position_bytes()),
                "indices": STANDARD.encode(indices),
                "wide": is_wide,
            }));
            surfaces.len() - 1
        })
    };
    let head = add(page.head.as_ref());
    let mut dates = Vec::new();
    for (n, date) in page.dates.iter().enumerate() {
        let masks: Vec<_> =
            date.masks.iter().map(|m| add(m.as_ref().and_then(|m| m.surface.as_ref()))).collect();
        let volumes: Vec<String> = date
            .masks
            .iter()
            .map(|m| m.as_ref().map(|m| text::ml(m.volume_ml, words)).unwrap_or_default())
            .collect();
        let levels: Vec<_> = date.levels.iter().map(|level| add(level.surface.as_ref())).collect();
        let level_colors: Vec<_> = date.levels.iter().map(|level| level.color).collect();
        dates.push(json!({
            "name": text::date_name(date, n, words),
            "masks": masks,
            "volumes": volumes,
            "levels": levels,
            "levelColors": level_colors,
        }));
    }
    let colors: Vec<[u8; 3]> = page.masks.iter().map(|mask| mask.color).collect();
    json!({
        "surfaces": surfaces,
        "head": head,
        "dates": dates,
        "colors": colors,
        "hasSides": page.has_sides,
        "words": { "play": words.get("play"), "stop": words.get("stop") },
    })
}
