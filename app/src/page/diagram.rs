//! Diagrams of how much the masks share, as SVG: each part shows and hides what it stands for.

use maud::{Markup, html};

use super::{Date, Page, hundredths, text};
use crate::{format::hex, words::Words};

/// Width in units, about a phone's width in CSS pixels, so that letters keep their size.
const WIDTH: f64 = 320.0;
/// Height of a row: what a finger hits (WCAG 2.2, 2.5.5).
const ROW: f64 = 44.0;
/// Radius of the largest disc.
const RADIUS: f64 = 76.0;
/// Letters that fit into a row beside a number.
const MOST_LETTERS: usize = 30;

fn short(name: &str) -> String {
    if name.chars().count() <= MOST_LETTERS {
        return name.to_owned();
    }
    let start: String = name.chars().take(MOST_LETTERS - 1).collect();
    format!("{}…", start.trim_end())
}

/// A part that toggles a mask or a level, where it is a button.
fn part([mask, level]: [Option<usize>; 2], is_button: bool, content: &Markup) -> Markup {
    if !is_button {
        return html! { g { (content) } };
    }
    html! {
        g class="part" role="button" tabindex="0" aria-pressed="true" data-mask=[mask] data-level=[level] {
            (content)
        }
    }
}

/// Discs within each other, each as large as what at least 1, 2, … masks hold; a row for each. `None` without levels.
pub fn agreement(date: &Date, words: &Words, is_button: bool) -> Option<Markup> {
    let most = date.levels.first().map(|level| level.volume_ml).filter(|ml| *ml > 0.0)?;
    let of = date.levels.len();
    let top = 2.0 * RADIUS + 16.0;
    let height = top + ROW * of as f64;
    let one = |n: usize| {
        let level = &date.levels[n];
        let radius = RADIUS * (level.volume_ml / most).sqrt();
        let y = top + ROW * n as f64;
        let name = text::level_name(level.count, of, words);
        let volume = text::ml(level.volume_ml, words);
        let color = hex(level.color);
        let content = html! {
            rect class="hit" x="0" y=(y) width=(WIDTH) height=(ROW) fill="none" {}
            circle class="fill" cx=(WIDTH / 2.0) cy=(hundredths(8.0 + 2.0 * RADIUS - radius)) r=(hundredths(radius)) fill=(color) {}
            rect class="fill" x="4" y=(y + 12.0) width="20" height="20" rx="5" fill=(color) {}
            text x="34" y=(y + 27.0) { (name) " " }
            text class="value" x=(WIDTH - 4.0) y=(y + 27.0) text-anchor="end" { (volume) }
        };
        part([None, Some(n)], is_button, &content)
    };
    Some(figure(height, &words.get("diagram-agreement"), is_button, &html! { @for n in 0..of { (one(n)) } }))
}

/// A bar for each mask.
pub fn volumes(page: &Page, date: &Date, words: &Words, is_button: bool) -> Option<Markup> {
    let most = date.masks.iter().flatten().map(|m| m.volume_ml).fold(0.0, f64::max);
    if most <= 0.0 {
        return None;
    }
    let shown: Vec<(usize, f64)> =
        date.masks.iter().enumerate().filter_map(|(n, m)| m.as_ref().map(|m| (n, m.volume_ml))).collect();
    let row = ROW + 8.0;
    let one = |place: usize, n: usize, volume_ml: f64| {
        let y = row * place as f64;
        let name = text::mask_name(page, n, words);
        let volume = text::ml(volume_ml, words);
        let width = hundredths((WIDTH - 8.0) * volume_ml / most);
        let color = page.color(n);
        let content = html! {
            rect class="hit" x="0" y=(y) width=(WIDTH) height=(row) fill="none" {}
            text x="4" y=(y + 18.0) { (short(&name)) " " }
            text class="value" x=(WIDTH - 4.0) y=(y + 18.0) text-anchor="end" { (volume) }
            rect class="fill" x="4" y=(y + 26.0) width=(width) height="16" rx="4" fill=(hex(color)) {}
        };
        part([Some(n), None], is_button, &content)
    };
    let rows = html! { @for (place, (n, ml)) in shown.iter().enumerate() { (one(place, *n, *ml)) } };
    Some(figure(row * shown.len() as f64, &words.get("diagram-volumes"), is_button, &rows))
}

fn figure(height: f64, label: &str, is_button: bool, content: &Markup) -> Markup {
    let role = if is_button { "group" } else { "img" };
    html! {
        svg class="diagram" viewBox={ "0 0 " (WIDTH) " " (height) } role=(role) aria-label=(label) { (content) }
    }
}
