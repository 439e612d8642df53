//! The report of `lesions --json`. Field names are stable.

use std::collections::BTreeMap;

use crate::{Connectivity, Progress, case::Case, glam::DVec3};
use serde::Serialize;

use super::{
    diameters::{DiameterMode, Diameters},
    edits::{ANCHOR_MM, Anchor, Edit, NotApplied},
    error::LesionsError,
    event::{Event, EventKind},
    find::{Options, find},
    links::{Link, LinkState, LinkedBy, Node},
    parts::Part,
    series::{Point, Series, Tests},
    track::track,
    tracked::{Lesion, Tracked, Unit},
    values::{SurfaceMove, Values},
};

/// Lesions of a case over its dates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LesionsReport {
    /// Name of the case.
    pub case: String,
    /// The mask, or the masks of a union joined by `+`.
    pub of: String,
    /// Neighbours of a voxel within a component.
    pub connectivity: u32,
    /// Smaller components are small.
    pub smallest_ml: f64,
    /// Components without a common voxel are linked up to this distance.
    pub within_mm: f64,
    /// How diameters are measured.
    pub mode: DiameterMode,
    /// The dates, in time order.
    pub dates: Vec<DateReport>,
    /// Consecutive dates with the mask, and whether their lesions are linked.
    pub pairs: Vec<PairReport>,
    /// The lesions; small ones last.
    pub lesions: Vec<LesionReport>,
    /// What became of them.
    pub events: Vec<EventReport>,
    /// Which components are linked.
    pub links: Vec<LinkReport>,
    /// Links that the user took away.
    pub unlinked: Vec<LinkReport>,
    /// Components that the user said are no lesions.
    pub ignored: Vec<PartReport>,
    /// All lesions together, small ones too.
    pub total: Series,
    /// Edits without an effect.
    pub edits_not_applied: Vec<NotApplied>,
    /// What is uncertain, in one line each.
    pub warnings: Vec<String>,
}

/// One date.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DateReport {
    /// Its label.
    pub time: String,
    /// Days since the first date; `None` where the dates aren't calendar dates.
    pub days: Option<f64>,
    /// Number of components that count; `None` where the date lacks the mask, like all that follow.
    pub components: Option<usize>,
    /// How many of them are small.
    pub small: Option<usize>,
    /// Volume of all that count.
    pub volume_ml: Option<f64>,
    /// Whether components are measured on the grid that the mask was drawn on; else on the case grid.
    pub on_native_grid: Option<bool>,
}

/// Two consecutive dates.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairReport {
    /// The earlier.
    pub from: String,
    /// The later.
    pub to: String,
    /// Why their lesions aren't linked; `None` where they are.
    pub not_linked: Option<String>,
}

/// One lesion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LesionReport {
    /// `A`, `B` …
    pub id: String,
    /// What the user calls it.
    pub name: Option<String>,
    /// Whether it is small at all dates.
    pub small: bool,
    /// At each date of the case.
    pub dates: Vec<LesionDate>,
    /// Its growth.
    pub series: Series,
}

/// A lesion at a date.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LesionDate {
    /// Label of the date.
    pub time: String,
    /// Days since the first date.
    pub days: Option<f64>,
    /// Its volume; 0 where it isn't there, `None` where that isn't known: the date lacks the mask, or isn't linked to
    /// those at which the lesion is.
    pub volume_ml: Option<f64>,
    /// Its longer diameter: of its component with the largest product; `None` where it isn't there.
    pub d1_mm: Option<f64>,
    /// The diameter at right angles to it.
    pub d2_mm: Option<f64>,
    /// Sum of the products of its components' diameters.
    pub product_mm2: Option<f64>,
    /// Whether one of its components is measurable by RANO.
    pub measurable: Option<bool>,
    /// What happened to it since the date before.
    pub events: Vec<EventKind>,
    /// The least that a user did for a link that leads here; `None` without one.
    pub state: Option<LinkState>,
    /// Values of the image that was asked for; `None` without one, and where it isn't there.
    pub values: Option<Values>,
    /// How its surface moved since the date before, where that was asked for and both dates have it in one space.
    pub surface: Option<SurfaceMove>,
    /// Its components.
    pub parts: Vec<PartReport>,
}

/// One component.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartReport {
    /// The component, for edits.
    pub anchor: Option<Anchor>,
    /// Number of its voxels.
    pub voxels: u64,
    /// Their volume.
    pub volume_ml: f64,
    /// Mean of their centres, RAS+ millimetres.
    pub centroid_mm: DVec3,
    /// Size of its box along R, A and S.
    pub extent_mm: DVec3,
    /// Whether it is small.
    pub small: bool,
    /// Whether it is measurable by RANO.
    pub measurable: bool,
    /// Its diameters.
    #[serde(flatten)]
    pub diameters: Diameters,
}

/// What became of a lesion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EventReport {
    /// What happened.
    pub kind: EventKind,
    /// Id of the lesion.
    pub lesion: String,
    /// Label of the earlier date.
    pub from_time: String,
    /// Label of the later date.
    pub to_time: String,
    /// Components of the earlier date.
    pub from: Vec<Anchor>,
    /// Components of the later date.
    pub to: Vec<Anchor>,
}

/// A link.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkReport {
    /// Component of the earlier date.
    pub from: Option<Anchor>,
    /// Component of the later date.
    pub to: Option<Anchor>,
    /// How it is known.
    pub by: LinkedBy,
    /// Volume that both have, on the case grid.
    pub overlap_ml: Option<f64>,
    /// Distance between the nearest centres of their voxels; of links by distance.
    pub distance_mm: Option<f64>,
    /// Whether a user looked at it.
    pub state: LinkState,
}

/// The lesions of `case`, with the user's edits.
///
/// # Errors
/// As [`find`] and [`track`].
pub fn report(
    case: &Case,
    options: &Options,
    edits: &[Edit],
    progress: &Progress,
) -> Result<LesionsReport, LesionsError> {
    Ok(LesionsReport::of(&track(&find(case, options, progress)?, edits, progress)?))
}

impl LesionsReport {
    /// The lesion that has a component at a place: the same component, or one whose own place is as near as edits reach.
    pub fn lesion_at(&self, at: &Anchor) -> Option<&LesionReport> {
        let is_at = |part: &PartReport| {
            let own = part.anchor.as_ref();
            own.is_some_and(|own| own.time == at.time && own.at_mm.distance(at.at_mm) < ANCHOR_MM)
        };
        self.lesions.iter().find(|lesion| lesion.dates.iter().flat_map(|date| &date.parts).any(is_at))
    }

    /// The links that no user has looked at.
    pub fn proposed(&self) -> impl Iterator<Item = &LinkReport> {
        self.links.iter().filter(|link| link.state == LinkState::Proposed)
    }

    /// The report of lesions already tracked.
    pub fn of(tracked: &Tracked) -> Self {
        let found = &tracked.found;
        let time = |at: usize| found.times.get(at).cloned().unwrap_or_default();
        let mut tests = Tests::default();
        let view = View::new(tracked);
        let dates: Vec<DateReport> = (0..found.times.len()).map(|at| view.date(at)).collect();
        let point =
            |date: &DateReport| Point { time: date.time.clone(), days: date.days, volume_ml: date.volume_ml };
        let total = Series::new(dates.iter().map(point).collect(), &mut tests);
        let link = |link: &Link| LinkReport {
            from: tracked.anchor(link.from),
            to: tracked.anchor(link.to),
            by: link.by,
            overlap_ml: link.overlap_voxels.map(|voxels| voxels as f64 * found.case_voxel_ml),
            distance_mm: link.distance_mm,
            state: link.state,
        };
        let anchors = |units: &[usize]| -> Vec<Anchor> {
            let units = units.iter().filter_map(|at| tracked.units.get(*at));
            units
                .flat_map(|unit| unit.parts.iter().filter_map(|part| tracked.anchor((unit.date, *part))))
                .collect()
        };
        let event = |event: &Event| EventReport {
            kind: event.kind,
            lesion: tracked.lesions.get(event.lesion).map(|lesion| lesion.id.clone()).unwrap_or_default(),
            from_time: time(event.dates[0]),
            to_time: time(event.dates[1]),
            from: anchors(&event.from),
            to: anchors(&event.to),
        };
        let pair = |([a, b], reason): &([usize; 2], Option<String>)| PairReport {
            from: time(*a),
            to: time(*b),
            not_linked: reason.clone(),
        };
        Self {
            case: found.case.clone(),
            of: found.of.clone(),
            connectivity: Connectivity::TwentySix.neighbors(),
            smallest_ml: found.options.smallest_ml,
            within_mm: found.options.within_mm,
            mode: found.options.mode,
            dates,
            pairs: found.pairs.iter().map(pair).collect(),
            lesions: (0..)
                .zip(&tracked.lesions)
                .map(|(n, lesion)| view.lesion(n, lesion, &mut tests))
                .collect(),
            events: tracked.events.iter().map(event).collect(),
            links: tracked.links.iter().map(link).collect(),
            unlinked: tracked.unlinked.iter().map(link).collect(),
            ignored: tracked.ignored.iter().filter_map(|node| view.part(*node)).collect(),
            total,
            edits_not_applied: tracked.not_applied.clone(),
            warnings: found.warnings.clone(),
        }
    }
}

/// What several parts of the report ask of lesions.
struct View<'a> {
    tracked: &'a Tracked,
    /// Dates of one number are linked, directly or through others between.
    space: Vec<usize>,
    /// The least state of the links that lead to each unit.
    states: Vec<Option<LinkState>>,
    /// Events by lesion and later date.
    events: BTreeMap<(usize, usize), Vec<EventKind>>,
}

impl<'a> View<'a> {
    fn new(tracked: &'a Tracked) -> Self {
        let mut space = vec![0; tracked.found.times.len()];
        for ([_, later], reason) in &tracked.found.pairs {
            if reason.is_some() {
                space.iter_mut().skip(*later).for_each(|number| *number += 1);
            }
        }
        let mut states = vec![None; tracked.units.len()];
        for link in &tracked.links {
            if let Some(state) = tracked.unit_of(link.to).and_then(|at| states.get_mut(at)) {
                *state = Some(state.map_or(link.state, |least: LinkState| least.min(link.state)));
            }
        }
        let mut events: BTreeMap<_, Vec<EventKind>> = BTreeMap::new();
        for event in &tracked.events {
            events.entry((event.lesion, event.dates[1])).or_default().push(event.kind);
        }
        Self { tracked, space, states, events }
    }

    fn days(&self, date: usize) -> Option<f64> {
        self.tracked.found.days.as_ref()?.get(date).copied()
    }

    fn time(&self, date: usize) -> String {
        self.tracked.found.times.get(date).cloned().unwrap_or_default()
    }

    fn date(&self, date: usize) -> DateReport {
        let counting: Option<Vec<&Part>> = self.tracked.found.parts(date).map(|parts| {
            let counts = |(n, _): &(usize, &Part)| self.tracked.unit_of((date, *n)).is_some();
            parts.parts.iter().enumerate().filter(counts).map(|(_, part)| part).collect()
        });
        DateReport {
            time: self.time(date),
            days: self.days(date),
            components: counting.as_ref().map(Vec::len),
            small: counting.as_ref().map(|parts| parts.iter().filter(|part| part.small).count()),
            volume_ml: counting.as_ref().map(|parts| sum(parts.iter().map(|part| part.volume_ml))),
            on_native_grid: self.tracked.found.parts(date).map(|parts| parts.is_native),
        }
    }

    fn part(&self, node: Node) -> Option<PartReport> {
        let part = self.tracked.part(node)?;
        Some(PartReport {
            anchor: self.tracked.anchor(node),
            voxels: part.voxels,
            volume_ml: part.volume_ml,
            centroid_mm: part.centroid_mm,
            extent_mm: part.extent_mm,
            small: part.small,
            measurable: part.diameters.measurable(),
            diameters: part.diameters,
        })
    }

    fn lesion(&self, number: usize, lesion: &Lesion, tests: &mut Tests) -> LesionReport {
        let spaces: Vec<usize> = lesion
            .units
            .iter()
            .filter_map(|at| self.space.get(self.tracked.units.get(*at)?.date).copied())
            .collect();
        let dates: Vec<LesionDate> = (0..self.tracked.found.times.len())
            .map(|date| {
                let is_known = self.space.get(date).is_some_and(|space| spaces.contains(space));
                self.lesion_at(number, lesion, date, is_known)
            })
            .collect();
        let point =
            |date: &LesionDate| Point { time: date.time.clone(), days: date.days, volume_ml: date.volume_ml };
        let series = Series::new(dates.iter().map(point).collect(), tests);
        LesionReport { id: lesion.id.clone(), name: lesion.name.clone(), small: lesion.small, dates, series }
    }

    fn lesion_at(&self, number: usize, lesion: &Lesion, date: usize, is_known: bool) -> LesionDate {
        let is_here = |(_, unit): &(usize, &Unit)| unit.date == date;
        let units = lesion.units.iter().filter_map(|at| Some((*at, self.tracked.units.get(*at)?)));
        let units: Vec<(usize, &Unit)> = units.filter(is_here).collect();
        let parts = units.iter().flat_map(|(_, unit)| unit.parts.iter().map(|part| (date, *part)));
        let nodes: Vec<Node> = parts.collect();
        let parts: Vec<PartReport> = nodes.iter().filter_map(|node| self.part(*node)).collect();
        let largest = largest(&parts);
        let is_present = !parts.is_empty();
        let has_mask = self.tracked.found.parts(date).is_some();
        LesionDate {
            time: self.time(date),
            days: self.days(date),
            volume_ml: (has_mask && is_known).then(|| sum(parts.iter().map(|part| part.volume_ml))),
            d1_mm: largest.map(|diameters| diameters.d1.length_mm),
            d2_mm: largest.map(|diameters| diameters.d2.length_mm),
            product_mm2: is_present.then(|| sum(parts.iter().map(|part| part.diameters.product_mm2))),
            measurable: is_present.then(|| parts.iter().any(|part| part.measurable)),
            events: self.events.get(&(number, date)).cloned().unwrap_or_default(),
            values: self.values(date, &nodes),
            surface: self.surface(number, date),
            state: units.iter().filter_map(|(at, _)| self.states.get(*at).copied().flatten()).min(),
            parts,
        }
    }
}

impl View<'_> {
    fn values(&self, date: usize, nodes: &[Node]) -> Option<Values> {
        let parts: Vec<&Part> = nodes.iter().filter_map(|node| self.tracked.part(*node)).collect();
        if parts.is_empty() {
            return None;
        }
        self.tracked.found.beside.values(date, self.tracked.found.parts(date)?, &parts)
    }

    /// The movement to a date from the one before that has the mask.
    fn surface(&self, number: usize, date: usize) -> Option<SurfaceMove> {
        let found = &self.tracked.found;
        let dates = found.pairs.iter().map(|(dates, _)| *dates).find(|[_, later]| *later == date)?;
        let parts_at = |date: usize| -> Vec<usize> {
            let of = self.tracked.units.iter().filter(|unit| unit.date == date && unit.lesion == number);
            of.flat_map(|unit| unit.parts.iter().copied()).collect()
        };
        let parts = dates.map(parts_at);
        if parts.iter().any(Vec::is_empty) {
            return None;
        }
        let [from, to] = dates;
        let of = [(found.parts(to), parts[1].as_slice()), (found.parts(from), parts[0].as_slice())];
        found.beside.moves(dates, self.time(from), of)
    }
}

/// The diameters with the largest product, the first of equals; `None` without a component.
pub(crate) fn largest(parts: &[PartReport]) -> Option<&Diameters> {
    let all = parts.iter().map(|part| &part.diameters);
    all.reduce(|largest, one| if one.product_mm2 > largest.product_mm2 { one } else { largest })
}

/// 0 for none, where the sum of the standard library is -0.
fn sum(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |sum, value| sum + value)
}
