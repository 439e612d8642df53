//! The sections of numbers: volumes, agreement, regions, change.

use glioscope_core::{
    Check, Severity,
    case::{Case, TimePoint},
    change::{ChangeReport, Explains, GroupReport, Lengths, NotSaid},
    dates, decimal,
    lesions::{
        EventKind, LesionDate, LesionReport, LesionsReport, LinkState, Values, diameters::DiameterMode,
    },
    measure::{self, Agreement, DateComparison, Pair},
    self_check::SelfCheckReport,
};

use super::{
    agreement,
    document::{Block, Finding, Table},
    identity::{Identity, Redactor, initials},
    plot::{Plot, Series},
    self_checks,
    sentences::finding,
};
use crate::words::Words;
use crate::{format, model::Document, world::colors_of};

/// Rows of the table of regions; the smallest ones beyond are counted.
const MOST_REGIONS: usize = 24;

/// Lesions in the table of lesions; others beyond are counted.
const MOST_LESIONS: usize = 20;

/// What the sections are made of.
pub struct Content<'a> {
    /// The case.
    pub case: &'a Case,
    /// The document: names and colours of masks.
    pub doc: &'a Document,
    /// Changes between consecutive dates, and from the first to the last.
    pub changes: &'a [ChangeReport],
    /// The masks of each date, compared.
    pub compared: &'a [DateComparison],
    /// The check of the change on this case, where it was run.
    pub self_check: Option<&'a SelfCheckReport>,
    /// The lesions; `None` without a mask.
    pub lesions: Option<&'a LesionsReport>,
    /// Sentences.
    pub words: &'a Words,
    /// Takes out what identifies the patient.
    pub redactor: &'a Redactor,
    /// How much of the identity is shown.
    pub identity: Identity,
}

impl Content<'_> {
    /// Whose masks of when are compared.
    pub fn header(&self) -> Vec<Block> {
        let words = self.words;
        let patient = &self.case.patient;
        let stated = |text: &str| if text.is_empty() { words.get("not-stated") } else { text.to_owned() };
        let mut facts = Vec::new();
        match self.identity {
            Identity::None => facts.push((words.get("patient"), words.get("not-shown"))),
            Identity::Initials => facts.push((words.get("patient"), stated(&initials(&patient.name)))),
            Identity::Full => {
                let birth =
                    dates::dicom_date(&patient.birth_date).unwrap_or_else(|| patient.birth_date.clone());
                facts.push((words.get("patient"), stated(&patient.name)));
                // Once is enough for what no file states.
                let sex = match patient.sex.as_str() {
                    "M" => words.get("sex-male"),
                    "F" => words.get("sex-female"),
                    "O" => words.get("sex-other"),
                    other => other.to_owned(),
                };
                let known = [("patient-id", patient.id.clone()), ("born", birth), ("sex", sex)];
                let known = known.into_iter().filter(|(_, value)| !value.is_empty());
                facts.extend(known.map(|(key, value)| (words.get(key), value)));
                facts.extend(self.studies().map(|study| (words.get("study"), study)));
                facts.push((words.get("case"), self.case.name.clone()));
            }
        }
        let labels: Vec<&str> =
            self.case.time_labels().into_iter().filter(|label| !label.is_empty()).collect();
        if !labels.is_empty() {
            facts.push((words.get("dates"), labels.join(", ")));
        }
        let images = self.distinct(|time| time.contexts.iter().map(|c| c.id.clone()).collect());
        let masks = self.distinct(|time| time.masks.iter().map(|m| self.name(m.mask.id())).collect());
        let list = |names: Vec<String>| if names.is_empty() { words.get("none") } else { names.join(", ") };
        facts.push((words.get("images"), list(images)));
        facts.push((words.get("masks"), list(masks)));
        vec![Block::Facts(facts)]
    }

    /// The studies, each in a line: date, description, accession number.
    fn studies(&self) -> impl Iterator<Item = String> {
        self.case.patient.studies.iter().map(|study| {
            let number = [("number", study.accession_number.clone())];
            let number = (!study.accession_number.is_empty()).then(|| self.words.with("accession", &number));
            let texts = [study.time.clone(), study.description.clone()].into_iter().chain(number);
            texts.filter(|text| !text.is_empty()).collect::<Vec<_>>().join(", ")
        })
    }

    /// The warnings, for the front, and the notes, for the end; `more`: warnings that the case doesn't have; `has_doubts`: whether others
    /// stand with the calls.
    pub fn findings(&self, own: &[Check], more: &[String], has_doubts: bool) -> (Vec<Block>, Vec<Block>) {
        let words = self.words;
        let all = own.iter().chain(&self.case.checks);
        let said = |check: &Check| Finding {
            is_warning: check.severity >= Severity::Warning,
            text: self.redactor.text(&finding(check, words)),
        };
        let more = more.iter().map(|text| Finding { is_warning: true, text: self.redactor.text(text) });
        let (mut warnings, mut notes): (Vec<Finding>, Vec<Finding>) = Default::default();
        for one in more.chain(all.map(said)) {
            let list = if one.is_warning { &mut warnings } else { &mut notes };
            if !list.contains(&one) {
                list.push(one);
            }
        }
        let said = if warnings.is_empty() {
            Block::Text(words.get(if has_doubts { "warnings-of-calls" } else { "no-warnings" }))
        } else {
            Block::Findings(warnings)
        };
        let mut front = vec![Block::Heading(words.get("warnings")), said];
        let mut end = Vec::new();
        if !notes.is_empty() {
            end = vec![Block::Heading(words.get("section-notes")), Block::Findings(notes)];
        }
        // Where the language is one in which particulars stay English: said once, at the first findings.
        if words.has("findings-note") {
            let of_front =
                self.case.checks.iter().chain(own).any(|check| check.severity >= Severity::Warning);
            let first =
                if of_front { Some(&mut front) } else { Some(&mut end).filter(|end| !end.is_empty()) };
            first.into_iter().for_each(|blocks| blocks.push(Block::Text(words.get("findings-note"))));
        }
        (front, end)
    }

    /// The most important numbers in sentences. `compares_masks`: how far the masks of each date agree, too.
    pub fn summary(&self, compares_masks: bool) -> Vec<Block> {
        let words = self.words;
        let mut blocks = vec![Block::Heading(words.get("summary"))];
        let time_points = self.case.time_points.iter().filter(|_| compares_masks);
        for time in time_points {
            let text = self.summary_of(time);
            let Some(text) = text else { continue };
            let date = if time.label.is_empty() { String::new() } else { format!("{}: ", time.label) };
            blocks.push(Block::Text(format!("{date}{text}")));
        }
        if let Some(change) = self.changes.last() {
            let (before, after) = (words.ml(change.from_ml), words.ml(change.to_ml));
            let first = words.with(
                "summary-change",
                &[
                    ("mask", self.name(&change.mask)),
                    ("from", change.from.clone()),
                    ("to", change.to.clone()),
                    ("before", before),
                    ("after", after),
                    ("percent", words.signed_percent(change.from_ml, change.to_ml)),
                ],
            );
            let second = if has_no_surface_change(change) {
                words.get("summary-volumes-only")
            } else {
                let key = match (change.growth.max_mm, change.recession.max_mm) {
                    (Some(_), Some(_)) => "summary-surface",
                    (Some(_), None) => "summary-grew",
                    (None, Some(_)) => "summary-receded",
                    (None, None) => "summary-still",
                };
                words.with(
                    key,
                    &[
                        ("growth", words.mm(change.growth.max_mm)),
                        ("recession", words.mm(change.recession.max_mm)),
                        ("uncertainty", uncertainty(change, words)),
                    ],
                )
            };
            blocks.push(Block::Text(format!("{first} {second}")));
            blocks.extend(self.displaced(change).map(Block::Text));
        }
        blocks.extend(self.lesions.and_then(|report| self.summary_of_lesions(report)));
        blocks
    }

    /// What the reader concludes, and who that is; `is_beside`: without its text, which stands beside.
    pub fn conclusion(&self, is_beside: bool) -> Vec<Block> {
        let lines = self.doc.edit.reading.conclusion.lines().map(str::trim).filter(|line| !line.is_empty());
        let mut blocks: Vec<Block> = lines.map(|line| Block::Text(self.redactor.text(line))).collect();
        if is_beside && !blocks.is_empty() {
            blocks = vec![Block::Text(self.words.get("conclusion-beside"))];
        }
        let signed = self.signed();
        if signed.is_some() || !blocks.is_empty() {
            let reader = signed.unwrap_or_else(|| self.on_its_day(self.words.get("reader-unnamed")));
            blocks.push(Block::Facts(vec![(self.words.get("read-by"), reader)]));
        }
        if !blocks.is_empty() {
            blocks.insert(0, Block::Heading(self.words.get("section-conclusion")));
        }
        blocks
    }

    /// Who read it, and when; `None` where that isn't said.
    pub fn signed(&self) -> Option<String> {
        let reader = self.doc.edit.reading.reader.trim();
        (!reader.is_empty()).then(|| self.on_its_day(self.redactor.text(reader)))
    }

    fn on_its_day(&self, reader: String) -> String {
        let day = &self.doc.edit.reading.day;
        if day.is_empty() { reader } else { format!("{reader}, {day}") }
    }

    /// How many lesions are new or gone at the last date.
    fn summary_of_lesions(&self, report: &LesionsReport) -> Option<Block> {
        let count = |kind: EventKind| {
            let last =
                report.lesions.iter().filter(|lesion| !lesion.small).filter_map(|lesion| lesion.dates.last());
            last.filter(|date| date.events.contains(&kind)).count()
        };
        let said = [("summary-born", count(EventKind::Born)), ("summary-gone", count(EventKind::Gone))];
        let said: Vec<String> = said
            .into_iter()
            .filter(|(_, count)| *count > 0)
            .map(|(key, count)| self.words.with(key, &[("count", count.to_string())]))
            .collect();
        (!said.is_empty()).then(|| Block::Text(said.join(" ")))
    }

    fn summary_of(&self, time: &TimePoint) -> Option<String> {
        let words = self.words;
        let regions = &time.regions;
        let volumes =
            time.masks.iter().enumerate().map(|(k, m)| (self.name(m.mask.id()), regions.mask_ml(k)));
        let volumes: Vec<(String, f64)> = volumes.collect();
        let (least, most) = (
            volumes.iter().min_by(|a, b| a.1.total_cmp(&b.1))?,
            volumes.iter().max_by(|a, b| a.1.total_cmp(&b.1))?,
        );
        if volumes.len() == 1 {
            let variables = [("mask", least.0.clone()), ("volume", words.ml(least.1))];
            return Some(words.with("summary-one-mask", &variables));
        }
        let all = measure::agreement(regions).last().map_or(0.0, |level| level.volume_ml);
        let first = words.with(
            "summary-masks",
            &[
                ("count", volumes.len().to_string()),
                ("smallest", least.0.clone()),
                ("smallest-volume", words.ml(least.1)),
                ("largest", most.0.clone()),
                ("largest-volume", words.ml(most.1)),
                ("shared", words.ml(all)),
                ("union", words.ml(regions.union_ml())),
            ],
        );
        let pairs = measure::pairs(&time.index, regions);
        let dice = |pair: &Pair| pair.value("dice");
        let worst =
            pairs.iter().filter_map(|pair| Some((pair, dice(pair)?))).min_by(|a, b| a.1.total_cmp(&b.1));
        let second = worst.map(|(pair, dice)| {
            words.with(
                "summary-pairs",
                &[
                    ("a", self.name(&pair.a)),
                    ("b", self.name(&pair.b)),
                    ("dice", words.number(&format!("{dice:.3}"))),
                ],
            )
        });
        Some([Some(first), second].into_iter().flatten().collect::<Vec<_>>().join(" "))
    }

    /// Volumes, agreement and regions of every date.
    pub fn dates(&self) -> Vec<Block> {
        self.case
            .time_points
            .iter()
            .zip(self.compared)
            .flat_map(|(time, found)| self.date(time, found))
            .collect()
    }

    fn date(&self, time: &TimePoint, compared: &DateComparison) -> Vec<Block> {
        let mut blocks =
            vec![Block::Heading(self.heading("section-masks", time)), Block::Table(self.masks(time))];
        if time.masks.len() < 2 {
            return blocks;
        }
        blocks.push(Block::Heading(self.heading("section-agreement", time)));
        blocks.extend(agreement::pairs(compared, &|id| self.name(id), self.words));
        if let Some(raters) = &compared.raters {
            blocks.push(Block::Text(format!("{}:", self.words.get("raters"))));
            blocks.push(agreement::raters(raters, self.words));
        }
        blocks.push(Block::Table(self.agreement(time)));
        if !time.regions.list().is_empty() {
            blocks.push(Block::Heading(self.heading("section-regions", time)));
            blocks.push(Block::Table(self.regions(time)));
        }
        blocks
    }

    fn masks(&self, time: &TimePoint) -> Table {
        let words = self.words;
        let regions = &time.regions;
        let union_ml = regions.union_ml();
        let row = |(k, m): (usize, &glioscope_core::case::CaseMask)| {
            vec![
                self.name(m.mask.id()),
                words.ml(regions.mask_ml(k)),
                words.ml(m.native_volume_ml),
                words.percent(if union_ml == 0.0 { 0.0 } else { regions.mask_ml(k) / union_ml }),
            ]
        };
        Table {
            head: ["mask", "volume", "own-volume", "share"].map(|key| words.get(key)).into(),
            text_columns: 1,
            rows: time.masks.iter().enumerate().map(row).collect(),
            note: None,
        }
    }

    fn agreement(&self, time: &TimePoint) -> Table {
        let words = self.words;
        let row = |level: &Agreement| {
            vec![level.masks.to_string(), words.ml(level.volume_ml), format::count(level.voxels)]
        };
        Table {
            head: ["active-masks", "volume", "voxels"].map(|key| words.get(key)).into(),
            text_columns: 1,
            rows: measure::agreement(&time.regions).iter().map(row).collect(),
            note: None,
        }
    }

    fn regions(&self, time: &TimePoint) -> Table {
        let words = self.words;
        let regions = &time.regions;
        let mut list: Vec<_> = regions.list().iter().collect();
        list.sort_by(|a, b| b.voxels.cmp(&a.voxels).then(a.bits.cmp(&b.bits)));
        let left_out = list.len().saturating_sub(MOST_REGIONS);
        let row = |region: &&glioscope_core::Region| {
            vec![
                self.redactor.text(&self.doc.edit.masks.region(regions.mask_ids(), region.bits)),
                words.ml(region.volume_ml),
                words.percent(region.volume_ml / regions.union_ml()),
            ]
        };
        let mut note = words.get("regions-note");
        if left_out > 0 {
            note =
                format!("{note} {}", words.with("regions-left-out", &[("left-out", left_out.to_string())]));
        }
        Table {
            head: ["region", "volume", "share"].map(|key| words.get(key)).into(),
            text_columns: 1,
            rows: list.iter().take(MOST_REGIONS).map(row).collect(),
            note: Some(note),
        }
    }

    /// Volumes over the dates and the change between them; nothing for one date.
    pub fn changes(&self) -> Vec<Block> {
        let words = self.words;
        if self.case.time_points.len() < 2 {
            return Vec::new();
        }
        let mut blocks = vec![Block::Heading(words.get("section-series"))];
        let (series, labels, at) = self.series();
        let number = |v: f64| words.number(&decimal::text(v, 0));
        let plot = Plot::over_time(words.get("volumes-plot"), &at, &labels, &series, &number);
        blocks.extend(plot.map(Block::Plot));
        blocks.push(Block::Table(self.series_table(&series, &labels)));
        if !self.changes.is_empty() {
            blocks.push(Block::Heading(words.get("section-change")));
            blocks.push(Block::Table(self.change_table()));
            blocks.extend(self.changes.iter().filter_map(|change| self.displaced(change)).map(Block::Text));
            if let Some(report) = self.self_check {
                blocks.extend(self_checks::blocks(report, &self.name(&report.mask), words));
            }
        }
        let moved: Vec<(String, String)> =
            self.case.aligned.iter().map(|aligned| self.aligned(aligned)).collect();
        if !moved.is_empty() {
            blocks.push(Block::Heading(words.get("aligned-images")));
            blocks.push(Block::Facts(moved));
        }
        blocks
    }

    fn aligned(&self, aligned: &glioscope_core::case::Aligned) -> (String, String) {
        let words = self.words;
        let what = if aligned.is_mask { self.name(&aligned.id) } else { self.redactor.text(&aligned.id) };
        let what = if aligned.time.is_empty() { what } else { format!("{what}, {}", aligned.time) };
        let how = self.redactor.text(&aligned.by.join("; "));
        let consistency = aligned.consistency_mm.map(|mm| words.number(&format!("{mm:.2} mm")));
        let consistency = consistency.map(|mm| words.with("consistency", &[("mm", mm)]));
        let around = aligned.loop_mm.map(|mm| words.number(&format!("{mm:.2} mm")));
        let around = around.map(|mm| words.with("consistency-loop", &[("mm", mm)]));
        let seen = match &aligned.accepted {
            Some(day) => words.with("alignment-accepted", &[("date", day.clone())]),
            None => words.get("alignment-not-accepted"),
        };
        (
            what,
            [Some(how), consistency, around, Some(seen)].into_iter().flatten().collect::<Vec<_>>().join("; "),
        )
    }

    /// The volume of each mask over the dates, names of the dates, and their places on a time axis.
    fn series(&self) -> (Vec<Series>, Vec<String>, Vec<f64>) {
        let times = &self.case.time_points;
        let mut series: Vec<(String, Series)> = Vec::new();
        for (n, time) in times.iter().enumerate() {
            let colors = colors_of(self.doc, time);
            for (k, mask) in time.masks.iter().enumerate() {
                let id = mask.mask.id();
                if !series.iter().any(|(known, _)| known == id) {
                    let (name, values) = (self.name(id), vec![None; times.len()]);
                    series.push((id.to_owned(), Series { name, color: colors.mask(k), values }));
                }
                if let Some((_, one)) = series.iter_mut().find(|(known, _)| known == id) {
                    one.values[n] = Some(time.regions.mask_ml(k));
                }
            }
        }
        let labels = self.case.time_labels();
        let at =
            dates::days_since_first(&labels).unwrap_or_else(|| (0..labels.len()).map(|n| n as f64).collect());
        let labels = labels.into_iter().map(str::to_owned).collect();
        (series.into_iter().map(|(_, one)| one).collect(), labels, at)
    }

    fn series_table(&self, series: &[Series], labels: &[String]) -> Table {
        let words = self.words;
        let row = |one: &Series| {
            let values = one.values.iter().map(|v| v.map_or_else(|| words.get("unknown"), |v| words.ml(v)));
            std::iter::once(one.name.clone()).chain(values).collect()
        };
        Table {
            head: std::iter::once(words.get("mask")).chain(labels.iter().cloned()).collect(),
            text_columns: 1,
            rows: series.iter().map(row).collect(),
            note: None,
        }
    }

    /// What is said of components that moved rather than grew; nothing where none did.
    fn displaced(&self, change: &ChangeReport) -> Option<String> {
        let words = self.words;
        let sentence = |group: &GroupReport| {
            let found = group.displacement.as_ref()?;
            let key = match found.explains {
                Explains::All => "displaced-not-grown",
                Explains::AllButGrowth => "displaced-and-grown",
                Explains::AllButShrinkage => "displaced-and-shrunk",
                Explains::Little => return None,
            };
            let volume_ml: f64 = group.to.iter().map(|part| part.volume_ml).sum();
            let volume = words.ml(volume_ml);
            let (by, uncertainty) = (words.mm(Some(found.length_mm)), words.mm(Some(found.uncertainty_mm)));
            let between = format!("{} \u{2192} {}", change.from, change.to);
            let mask = self.name(&change.mask);
            let values = [
                ("mask", mask),
                ("between", between),
                ("volume", volume),
                ("by", by),
                ("uncertainty", uncertainty),
            ];
            let told_by = match group.tissue.as_ref().and_then(|tissue| tissue.moved()) {
                None => "displaced-by-masks",
                Some(true) => "displaced-with-tissue",
                Some(false) => "displaced-tissue-stayed",
            };
            Some(format!("{} {}", words.with(key, &values), words.get(told_by)))
        };
        let mut sentences: Vec<String> = change.components.iter().filter_map(sentence).collect();
        if !sentences.is_empty() {
            sentences.push(words.get("displaced-note"));
        }
        sentences.extend(self.moved_with_tissue(change));
        (!sentences.is_empty()).then(|| sentences.join(" "))
    }

    /// What the tissue around a change says of it, or why it says nothing.
    fn moved_with_tissue(&self, change: &ChangeReport) -> Vec<String> {
        let words = self.words;
        let named = || {
            [
                ("mask", self.name(&change.mask)),
                ("between", format!("{} \u{2192} {}", change.from, change.to)),
            ]
        };
        let mut sentences = Vec::new();
        for group in &change.components {
            let Some(tissue) = &group.tissue else { continue };
            let volume_ml: f64 = group.to.iter().map(|part| part.volume_ml).sum();
            for (key, counts) in
                [("tissue-not-grown", tissue.growth), ("tissue-not-shrunk", tissue.recession)]
            {
                if counts.displaced_share() < format::LEAST_MARKED {
                    continue;
                }
                let share = words.number(&format!("{:.0} %", counts.displaced_share() * 100.0));
                let rest =
                    [("volume", words.ml(volume_ml)), ("share", share), ("by", words.mm(tissue.moved_mm))];
                sentences.push(words.with(key, &named().into_iter().chain(rest).collect::<Vec<_>>()));
            }
        }
        if !sentences.is_empty() {
            sentences.push(words.get("tissue-note"));
        }
        let why = change.surroundings.as_ref().and_then(|around| around.not_said).and_then(|why| match why {
            NotSaid::NothingMoved => None,
            NotSaid::NoImage => Some("tissue-no-image"),
            NotSaid::OtherSequence => Some("tissue-other-sequence"),
            NotSaid::TooLittleTissue => Some("tissue-too-little"),
            NotSaid::TooLittleInCommon => Some("tissue-nothing-common"),
            NotSaid::FitFailed => Some("tissue-fit-failed"),
        });
        if let Some(why) = why {
            let why = [("why", words.get(why))];
            sentences
                .push(words.with("tissue-not-said", &named().into_iter().chain(why).collect::<Vec<_>>()));
        }
        sentences
    }

    fn change_table(&self) -> Table {
        let words = self.words;
        let row = |change: &ChangeReport| {
            let lengths = if has_no_surface_change(change) {
                [words.get("only-volumes"), String::new(), String::new()]
            } else {
                let most = |l: &Lengths| match l.p95_mm {
                    Some(p95) => format!("{} ({})", words.mm(l.max_mm), words.number(&format!("{p95:.1}"))),
                    None => words.mm(None),
                };
                [most(&change.growth), most(&change.recession), uncertainty(change, words)]
            };
            let volumes = [
                self.name(&change.mask),
                format!("{} \u{2192} {}", change.from, change.to),
                words.ml(change.from_ml),
                words.ml(change.to_ml),
                words.signed_percent(change.from_ml, change.to_ml),
            ];
            volumes.into_iter().chain(lengths).collect()
        };
        let registration = self.changes.first().map(|change| {
            let from = match change.uncertainty_mm.registration_from {
                "consistency" => "registration-measured",
                _ => "registration-stated",
            };
            let mm = words.number(&format!("{:.2} mm", change.uncertainty_mm.registration_mm));
            words.with("change-note", &[("registration", mm), ("registration-from", words.get(from))])
        });
        let head = ["mask", "between", "before", "after", "difference", "growth", "recession", "uncertainty"];
        Table {
            head: head.map(|key| words.get(key)).into(),
            text_columns: 2,
            rows: self.changes.iter().map(row).collect(),
            note: registration,
        }
    }

    /// The lesions over the dates.
    pub fn lesions(&self) -> Vec<Block> {
        let words = self.words;
        let Some(report) = self.lesions else { return Vec::new() };
        let shown = || report.lesions.iter().filter(|lesion| !lesion.small);
        let rows: Vec<Vec<String>> = shown()
            .take(MOST_LESIONS)
            .flat_map(|lesion| self.lesion_rows(lesion, report.dates.len() > 1))
            .collect();
        if rows.is_empty() {
            return Vec::new();
        }
        let how = match report.mode {
            DiameterMode::LongestThenPerpendicular => "lesions-note",
            DiameterMode::LargestProduct => "lesions-note-product",
        };
        let mut notes = vec![words.get(how), words.get("digits-note")];
        let mut counted = |key: &str, count: usize| {
            let least = words.ml(report.smallest_ml);
            let sentence = words.with(key, &[("count", count.to_string()), ("least", least)]);
            notes.extend((count > 0).then_some(sentence));
        };
        counted("lesions-small", report.lesions.len() - shown().count());
        counted("lesions-left-out", shown().count().saturating_sub(MOST_LESIONS));
        counted("lesions-links", report.proposed().count());
        let has_dates = report.dates.len() > 1;
        let all = ["lesion", "date", "volume", "lesion-change", "diameters", "product", "became"];
        let of_dates = |key: &str| matches!(key, "date" | "lesion-change" | "became");
        let head = all.into_iter().filter(|key| has_dates || !of_dates(key));
        let masks = report.of.split('+').map(|id| self.name(id)).collect::<Vec<_>>().join("+");
        vec![
            Block::Heading(words.with("section-lesions", &[("mask", masks)])),
            Block::Table(Table {
                head: head.map(|key| words.get(key)).collect(),
                text_columns: if has_dates { 2 } else { 1 },
                rows,
                note: Some(notes.join(" ")),
            }),
        ]
        .into_iter()
        .chain(self.beside_lesions(report).map(Block::Table))
        .collect()
    }

    /// Values of an image in lesions, and how surfaces moved, where the reader asked for them.
    fn beside_lesions(&self, report: &LesionsReport) -> Option<Table> {
        let words = self.words;
        let shown = || report.lesions.iter().filter(|lesion| !lesion.small).take(MOST_LESIONS);
        let dates = || shown().flat_map(|lesion| &lesion.dates);
        let image = dates().find_map(|date| date.values.as_ref()).map(|values| values.image.clone());
        let has_surface = dates().any(|date| date.surface.is_some());
        if image.is_none() && !has_surface {
            return None;
        }
        let number = |value: Option<f64>| {
            value.map_or_else(String::new, |value| words.number(&format::four_digits(value)))
        };
        let of_values = ["values-mean", "values-most", "values-peak", "values-times-ml"];
        let of_surface = ["surface-grew", "surface-receded"];
        let mut head = vec![words.get("lesion"), words.get("date")];
        if image.is_some() {
            head.extend(of_values.map(|key| words.get(key)));
        }
        if has_surface {
            head.extend(of_surface.map(|key| words.get(key)));
        }
        let row = |lesion: &LesionReport, date: &LesionDate| {
            let name = self.redactor.text(lesion.name.as_deref().unwrap_or(&lesion.id));
            let mut row = vec![name, date.time.clone()];
            if image.is_some() {
                let values = date.values.as_ref();
                let of = |value: fn(&Values) -> Option<f64>| number(values.and_then(value));
                row.extend([of(|v| v.mean), of(|v| v.max), of(|v| v.peak), of(|v| v.mean_times_ml)]);
            }
            if has_surface {
                let moved = date.surface.as_ref();
                let mm =
                    |lengths: &Lengths| words.number(&format!("{:.1} mm", lengths.p95_mm.unwrap_or(0.0)));
                row.push(moved.map_or_else(String::new, |moved| mm(&moved.growth)));
                row.push(moved.map_or_else(String::new, |moved| mm(&moved.recession)));
            }
            row
        };
        let rows = shown().flat_map(|lesion| lesion.dates.iter().map(move |date| (lesion, date)));
        let rows = rows.map(|(lesion, date)| row(lesion, date)).collect();
        let mut notes = Vec::new();
        if let Some(image) = &image {
            notes.push(words.with("values-note", &[("image", self.redactor.text(image))]));
        }
        if has_surface {
            notes.push(words.get("surface-note"));
        }
        Some(Table { head, text_columns: 2, rows, note: Some(notes.join(" ")) })
    }

    fn lesion_rows(&self, lesion: &LesionReport, has_dates: bool) -> Vec<Vec<String>> {
        let words = self.words;
        let row = |(number, date): (usize, &LesionDate)| {
            let before = number.checked_sub(1).and_then(|before| lesion.dates.get(before)?.volume_ml);
            let change = match (before.filter(|ml| *ml > 0.0), date.volume_ml) {
                (Some(before), Some(now)) => words.signed_percent(before, now),
                _ => String::new(),
            };
            let volume = match date.volume_ml {
                None => words.get("unknown"),
                Some(_) if date.parts.is_empty() => words.get("not-there"),
                Some(ml) => words.ml(ml),
            };
            let diameters = match (date.d1_mm, date.d2_mm) {
                (Some(d1), Some(d2)) => {
                    let mut text = words.number(&format!("{d1:.2} × {d2:.2} mm"));
                    if date.measurable == Some(false) {
                        text = format!("{text}, {}", words.get("not-measurable"));
                    }
                    text
                }
                _ => String::new(),
            };
            let product =
                date.product_mm2.map(|mm2| words.number(&format!("{mm2:.1} mm²"))).unwrap_or_default();
            let became = |kind: &EventKind| {
                let name: &str = kind.into();
                words.get(&format!("event-{name}"))
            };
            let mut events: Vec<String> = date.events.iter().map(became).collect();
            if date.parts.len() > 1 {
                events.push(words.with("pieces", &[("count", date.parts.len().to_string())]));
            }
            events.extend(date.state.map(|state| {
                words.get(match state {
                    LinkState::Proposed => "link-proposed",
                    LinkState::Verified => "link-verified",
                    LinkState::Edited => "link-edited",
                })
            }));
            let mut row = vec![self.redactor.text(lesion.name.as_deref().unwrap_or(&lesion.id))];
            if has_dates {
                row.push(date.time.clone());
            }
            row.push(volume);
            if has_dates {
                row.push(change);
            }
            row.extend([diameters, product]);
            if has_dates {
                row.push(events.join(", "));
            }
            row
        };
        lesion.dates.iter().enumerate().map(row).collect()
    }

    /// The grid of all numbers.
    pub fn grid(&self) -> String {
        let [nx, ny, nz] = self.case.grid.dims();
        let spacing = decimal::sizes(self.case.grid.spacing_mm().to_array(), 3);
        let spacing = self.words.number(spacing.trim_end_matches(" mm"));
        self.words.with("grid-line", &[("dims", format!("{nx} × {ny} × {nz}")), ("spacing", spacing)])
    }

    /// What a mask is called in the report.
    fn name(&self, id: &str) -> String {
        self.redactor.text(&self.doc.edit.masks.name(id))
    }

    fn heading(&self, key: &str, time: &TimePoint) -> String {
        if time.label.is_empty() {
            return self.words.get(key);
        }
        self.words.with(&format!("{key}-at"), &[("date", time.label.clone())])
    }

    /// Names at any date, in the order first met.
    fn distinct(&self, names: impl Fn(&TimePoint) -> Vec<String>) -> Vec<String> {
        let mut out: Vec<String> = Vec::new();
        for name in self.case.time_points.iter().flat_map(names) {
            let name = self.redactor.text(&name);
            if !out.contains(&name) {
                out.push(name);
            }
        }
        out
    }
}

/// Whether there are no lengths: dates that aren't aligned, no place shared, or nothing at one of the dates.
fn has_no_surface_change(change: &ChangeReport) -> bool {
    change.has_volumes_only() || change.from_ml == 0.0 || change.to_ml == 0.0
}

/// The uncertainty along the axes: one length, or the least and the most where they differ.
fn uncertainty(change: &ChangeReport, words: &Words) -> String {
    let axes = change.uncertainty_mm.axes_mm;
    let (least, most) =
        (axes.into_iter().fold(f64::INFINITY, f64::min), axes.into_iter().fold(0.0, f64::max));
    let [least, most] = [least, most].map(|mm| words.number(&format!("{mm:.1}")));
    if least == most { format!("{most} mm") } else { format!("{least}\u{2013}{most} mm") }
}
