//! Histories in a short notation, so that a table of them can be read.
//!
//! Scans are parted by `|`; each begins with its day (day 0 is 2024-01-01). `A=20x10` is a lesion of 20 by 10 mm, seen on 3
//! slices of 1 mm; `/3.5` behind it its volume in ml, `@1,6` its number of slices and their thickness; names with F are
//! non-enhancing, all others enhancing. Facts are known and harmless, but for `fact=value`, and for `?fact`, which is
//! unknown. In the head, `{28}` is the date of day 28; the first scan is the stated baseline, unless it says `#auto`.

use super::super::*;

/// The date of a day.
pub fn date(day: i32) -> String {
    (jiff::civil::Date::constant(2024, 1, 1) + jiff::Span::new().days(day)).to_string()
}

fn with_dates(head: &str) -> String {
    let mut text = String::new();
    let mut rest = head;
    while let Some((before, after)) = rest.split_once('{') {
        let Some((day, after)) = after.split_once('}').filter(|(day, _)| day.parse::<i32>().is_ok()) else {
            text += before;
            text.push('{');
            rest = after;
            continue;
        };
        text += before;
        text += &date(day.parse().unwrap());
        rest = after;
    }
    text + rest
}

const FACTS: [(&str, &str, &str); 11] = [
    ("new", "new_lesion", "\"none\""),
    ("nt", "non_target", "\"none\""),
    ("cl", "clinical", "\"stable\""),
    ("st", "steroids_mg", "0"),
    ("fl", "flair", "\"not-worse\""),
    ("tech", "technique_changed", "[]"),
    ("reason", "steroids_reason", ""),
    ("field", "field", ""),
    ("hist", "histology", "\"not-done\""),
    ("looked", "new_lesions_looked_for", ""),
    ("days", "days", ""),
];

fn lesion(date: &str, name: &str, size: &str) -> String {
    let compartment = if name.starts_with('F') { "non-enhancing" } else { "enhancing" };
    let head =
        format!("[[measurement]]\ndate = \"{date}\"\nlesion = \"{name}\"\ncompartment = \"{compartment}\"\n");
    if size == "gone" {
        return head + "gone = true\n";
    }
    let (size, slices) = size.split_once('@').unwrap_or((size, "3,1"));
    let (slices, thickness) = slices.split_once(',').unwrap();
    let (diameters, volume) = size.split_once('/').unwrap_or((size, ""));
    let mut text = head;
    if let Some((a, b)) = diameters.split_once('x') {
        let a_is_longer = a.parse::<f64>().unwrap() >= b.parse().unwrap();
        let (longest, perpendicular) = if a_is_longer { (a, b) } else { (b, a) };
        text += &format!("longest_mm = {longest}\nperpendicular_mm = {perpendicular}\n");
    }
    if !volume.is_empty() {
        text += &format!("volume_ml = {volume}\n");
    }
    text + &format!("slices = {slices}\nslice_thickness_mm = {thickness}\n")
}

/// The TOML text of a history.
pub fn toml(criterion: Criterion, head: &str, scans: &str) -> String {
    let id = serde_json::to_string(&criterion).unwrap();
    let mut top = format!("response = 1\ncriterion = {id}\n");
    let mut body = String::new();
    for (k, scan) in scans.split('|').enumerate() {
        let mut tokens = scan.split_whitespace();
        let day: i32 = tokens.next().unwrap().parse().unwrap();
        let date = date(day);
        if k == 0 && !head.contains("#auto") {
            top += &format!("baseline = \"{date}\"\n");
        }
        let mut facts: Vec<(&str, String)> = FACTS.iter().map(|fact| (fact.0, fact.2.to_owned())).collect();
        let mut lesions = String::new();
        for token in tokens {
            let (key, value) = token.split_once('=').unwrap_or((token, ""));
            if let Some(unknown) = token.strip_prefix('?') {
                facts.iter_mut().find(|fact| fact.0 == unknown).unwrap().1.clear();
            } else if key.starts_with(char::is_uppercase) {
                lesions += &lesion(&date, key, value);
            } else {
                let quoted = value.parse::<f64>().is_ok() || value.starts_with('[') || value == "false";
                let value = if quoted { value.to_owned() } else { format!("{value:?}") };
                facts.iter_mut().find(|fact| fact.0 == key).unwrap().1 = value;
            }
        }
        body += &format!("[[date]]\ndate = \"{date}\"\n");
        for (key, value) in facts.iter().filter(|fact| !fact.1.is_empty()) {
            let name = FACTS.iter().find(|fact| fact.0 == *key).unwrap().1;
            body += &format!("{name} = {value}\n");
        }
        body += &lesions;
    }
    let plain = [("disease", "\"newly-diagnosed\""), ("radiotherapy_end", "\"none\""), ("treatment", "[]")];
    for (key, value) in plain {
        if !head.contains(key) {
            top += &format!("{key} = {value}\n");
        }
    }
    // `?key` in the head leaves it unknown.
    let head: String =
        head.lines().filter(|line| !line.starts_with('?')).map(|line| format!("{line}\n")).collect();
    format!("{top}{}{body}", with_dates(&head))
}

/// A made history and what is expected of one of its scans.
pub struct Made {
    pub name: &'static str,
    pub criterion: Criterion,
    pub head: &'static str,
    pub scans: &'static str,
    /// Index of the scan, and `v` for the call by volume.
    pub at: (usize, char),
    /// The call; `@56`: dated from day 56; `[…]`: the unknown inputs that can change it.
    pub expected: &'static str,
    /// The rule that must be among the reasons.
    pub rule: &'static str,
}

pub const fn m(
    name: &'static str,
    criterion: Criterion,
    head: &'static str,
    scans: &'static str,
    at: (usize, char),
    expected: &'static str,
    rule: &'static str,
) -> Made {
    Made { name, criterion, head, scans, at, expected, rule }
}

impl Made {
    pub fn judgement(&self) -> Judgement {
        let text = toml(self.criterion, self.head, self.scans);
        let history = History::parse(&text).unwrap_or_else(|error| panic!("{}: {error}\n{text}", self.name));
        let response =
            evaluate(&history, &[]).unwrap_or_else(|error| panic!("{}: {error}\n{text}", self.name));
        let date = &response.dates[self.at.0];
        if self.at.1 == 'v' { date.by_volume.clone() } else { date.by_diameters.clone() }
    }

    /// What was found, in the notation of `expected`.
    pub fn found(judgement: &Judgement) -> String {
        let mut text = judgement.call.short().to_owned();
        if let Some(dated) = &judgement.dated {
            let first = jiff::civil::Date::constant(2024, 1, 1);
            text += &format!(" @{}", (dated.parse::<jiff::civil::Date>().unwrap() - first).get_days());
        }
        let mut missing: Vec<String> = judgement.missing.iter().map(|m| id_of(&m.input)).collect();
        missing.sort();
        missing.dedup();
        if !missing.is_empty() {
            text += &format!(" [{}]", missing.join(","));
        }
        text
    }
}

/// The name of a value in JSON.
pub fn id_of(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap().trim_matches('"').to_owned()
}
