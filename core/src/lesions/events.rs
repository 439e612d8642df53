//! What becomes of lesions from date to date.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    event::{Event, EventKind},
    sets::Sets,
    tracked::{Tracked, Unit},
};

/// The events of a tracked case, by date, then by unit.
///
/// Small parts don't count where something else does: they aren't pieces of a split or merger, they are born or gone only
/// as all that their lesion has at a date, and only where it was ever more than small.
pub(super) fn events(tracked: &Tracked) -> Vec<Event> {
    let mut events = Vec::new();
    // Links join units of two dates to groups.
    let mut pairs: Vec<[usize; 2]> = tracked.links.iter().map(|link| [link.from.0, link.to.0]).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let unit = |at: usize| tracked.units.get(at);
    for pair in pairs {
        let links = tracked.links.iter().filter(|link| [link.from.0, link.to.0] == pair);
        let joined: Vec<[usize; 2]> =
            links.filter_map(|link| Some([tracked.unit_of(link.from)?, tracked.unit_of(link.to)?])).collect();
        for group in groups(&joined) {
            let of = |date: usize| -> Vec<usize> {
                group.iter().copied().filter(|at| unit(*at).is_some_and(|unit| unit.date == date)).collect()
            };
            let (from, to) = (of(pair[0]), of(pair[1]));
            let count = |units: &[usize]| {
                units.iter().filter(|at| unit(**at).is_some_and(|unit| !unit.small)).count().max(1)
            };
            let kind = match (count(&from), count(&to)) {
                (1, 1) => EventKind::Continued,
                (1, _) => EventKind::Split,
                (_, 1) => EventKind::Merged,
                _ => EventKind::ManyToMany,
            };
            let lesion = from.first().and_then(|at| unit(*at)).map_or(0, |unit| unit.lesion);
            events.push(Event { kind, dates: pair, from, to, lesion });
        }
    }
    let present: BTreeSet<(usize, usize)> =
        tracked.units.iter().map(|unit| (unit.lesion, unit.date)).collect();
    for [a, b] in tracked.linkable_pairs() {
        let counts = |unit: &Unit, other: usize| {
            let ever = tracked.lesions.get(unit.lesion).is_some_and(|lesion| !lesion.small);
            !unit.small || ever && !present.contains(&(unit.lesion, other))
        };
        for (at, unit) in tracked.units.iter().enumerate() {
            if unit.date == a && !unit.has_later && counts(unit, b) {
                let (from, lesion) = (vec![at], unit.lesion);
                events.push(Event { kind: EventKind::Gone, dates: [a, b], from, to: Vec::new(), lesion });
            }
            if unit.date == b && !unit.has_earlier && counts(unit, a) {
                let (to, lesion) = (vec![at], unit.lesion);
                events.push(Event { kind: EventKind::Born, dates: [a, b], from: Vec::new(), to, lesion });
            }
        }
    }
    let key = |event: &Event| (event.dates[1], event.dates[0], event.lesion, event.kind);
    events.sort_by(|a, b| key(a).cmp(&key(b)).then_with(|| (&a.from, &a.to).cmp(&(&b.from, &b.to))));
    events
}

/// Connected groups of what pairs join, each sorted, by their first members.
fn groups(pairs: &[[usize; 2]]) -> Vec<Vec<usize>> {
    let mut members: Vec<usize> = pairs.iter().flatten().copied().collect();
    members.sort_unstable();
    members.dedup();
    let place = |of: usize| members.binary_search(&of).unwrap_or(0);
    let mut sets = Sets::new(members.len());
    pairs.iter().for_each(|[a, b]| sets.join(place(*a), place(*b)));
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (at, member) in members.iter().enumerate() {
        groups.entry(sets.root(at)).or_default().push(*member);
    }
    groups.into_values().collect()
}
