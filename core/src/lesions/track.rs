//! Which components of all dates are one lesion.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    sync::Arc,
};

use crate::Progress;

use super::{
    edits::{Anchor, Edit, NotApplied},
    error::LesionsError,
    events::events,
    find::Found,
    links::{Link, LinkState, LinkedBy, Node},
    parts::Part,
    sets::Sets,
    split,
    tracked::{Lesion, Tracked, Unit},
};

/// The state of all that edits change.
struct State {
    found: Found,
    links: Vec<Link>,
    unlinked: Vec<Link>,
    merged: Vec<[Node; 2]>,
    ignored: Vec<Node>,
    names: Vec<(Node, String)>,
}

/// Makes lesions of the components found, with the user's edits.
///
/// # Errors
/// [`LesionsError`] where a split can't be computed, or the user cancels.
pub fn track(found: &Found, edits: &[Edit], progress: &Progress) -> Result<Tracked, LesionsError> {
    let mut state = State {
        found: found.clone(),
        links: Vec::new(),
        unlinked: Vec::new(),
        merged: Vec::new(),
        ignored: Vec::new(),
        names: Vec::new(),
    };
    let mut not_applied = Vec::new();
    let mut note = |number: usize, edit: &Edit, reason: String| {
        not_applied.push(NotApplied { number, edit: edit.clone(), reason });
    };
    let is_split = |edit: &Edit| matches!(edit, Edit::Split { .. });
    for (number, edit) in edits.iter().enumerate().filter(|(_, edit)| is_split(edit)) {
        progress.check()?;
        if let Err(reason) = state.split(edit)? {
            note(number, edit, reason);
        }
    }
    if edits.iter().any(is_split) {
        state.found.link()?;
    }
    state.links.clone_from(&state.found.links);
    for (number, edit) in edits.iter().enumerate().filter(|(_, edit)| !is_split(edit)) {
        if let Err(reason) = state.apply(edit) {
            note(number, edit, reason);
        }
    }
    not_applied.sort_by_key(|edit| edit.number);
    Ok(state.tracked(not_applied))
}

impl State {
    fn node(&self, anchor: &Anchor) -> Result<Node, String> {
        let node = self.found.node(anchor)?;
        if self.ignored.contains(&node) {
            return Err("found a component that is ignored, expected one that counts".into());
        }
        Ok(node)
    }

    /// Both components, the earlier first.
    fn nodes(&self, from: &Anchor, to: &Anchor) -> Result<[Node; 2], String> {
        let mut nodes = [self.node(from)?, self.node(to)?];
        nodes.sort_unstable();
        Ok(nodes)
    }

    fn link_between(&self, [from, to]: [Node; 2]) -> Result<usize, String> {
        let found = self.links.iter().position(|link| (link.from, link.to) == (from, to));
        found.ok_or_else(|| "found no link between these components, expected one".to_owned())
    }

    fn split(&mut self, edit: &Edit) -> Result<Result<(), String>, LesionsError> {
        let Edit::Split { at, seeds_mm } = edit else { return Ok(Ok(())) };
        let (date, part) = match self.node(at) {
            Ok(node) => node,
            Err(reason) => return Ok(Err(reason)),
        };
        let measures = self.found.measures();
        let Some(Some(date)) = self.found.dates.get_mut(date) else { return Ok(Ok(())) };
        let (parts, mask) = Arc::make_mut(date);
        let Some(whole) = parts.parts.get(part) else { return Ok(Ok(())) };
        let pieces = match split::at_neck(&whole.runs, &parts.grid, *seeds_mm)? {
            Ok(pieces) => pieces,
            Err(reason) => return Ok(Err(reason)),
        };
        let made = pieces.into_iter().filter_map(|runs| Part::new(runs, &parts.grid, &measures));
        parts.parts.splice(part..=part, made);
        parts.place(mask);
        Ok(Ok(()))
    }

    fn apply(&mut self, edit: &Edit) -> Result<(), String> {
        match edit {
            Edit::Split { .. } => {}
            Edit::Link { from, to } => {
                let [from, to] = self.nodes(from, to)?;
                if from.0 == to.0 {
                    return Err("found two components of one date, expected two dates (or a merger)".into());
                }
                let is_same = |link: &Link| (link.from, link.to) == (from, to);
                let removed = self.unlinked.iter().position(is_same).map(|at| self.unlinked.remove(at));
                match (self.links.iter_mut().find(|link| is_same(link)), removed) {
                    (Some(link), _) => link.state = LinkState::Edited,
                    (None, Some(link)) => self.links.push(Link { state: LinkState::Edited, ..link }),
                    (None, None) => self.links.push(Link {
                        from,
                        to,
                        by: LinkedBy::Edit,
                        overlap_voxels: None,
                        distance_mm: None,
                        state: LinkState::Edited,
                    }),
                }
            }
            Edit::Unlink { from, to } => {
                let at = self.link_between(self.nodes(from, to)?)?;
                let link = self.links.remove(at);
                self.unlinked.push(Link { state: LinkState::Edited, ..link });
            }
            Edit::Merge { from, to } => {
                let [from, to] = self.nodes(from, to)?;
                if from == to {
                    return Err("found one component, expected two".into());
                }
                if from.0 != to.0 {
                    return Err("found components of two dates, expected one date (or a link)".into());
                }
                self.merged.push([from, to]);
            }
            Edit::Ignore { at } => {
                let node = self.node(at)?;
                self.ignored.push(node);
                self.links.retain(|link| link.from != node && link.to != node);
            }
            Edit::Name { at, name } => {
                let node = self.node(at)?;
                self.names.push((node, name.clone()));
            }
            Edit::Verify { from, to } => {
                let at = self.link_between(self.nodes(from, to)?)?;
                if let Some(link) = self.links.get_mut(at) {
                    link.state = LinkState::Verified;
                }
            }
            Edit::VerifyAll => self.links.iter_mut().for_each(|link| link.state = LinkState::Verified),
        }
        Ok(())
    }

    fn tracked(mut self, not_applied: Vec<NotApplied>) -> Tracked {
        self.ignored.sort_unstable();
        self.ignored.dedup();
        let ignored = self.ignored;
        self.links.retain(|link| !ignored.contains(&link.from) && !ignored.contains(&link.to));
        self.links.sort_by_key(|link| (link.from, link.to));
        let counts: Vec<usize> = (0..self.found.dates.len())
            .map(|date| self.found.parts(date).map_or(0, |parts| parts.parts.len()))
            .collect();
        let all =
            counts.iter().enumerate().flat_map(|(date, count)| (0..*count).map(move |part| (date, part)));
        let nodes: Vec<Node> = all.filter(|node| ignored.binary_search(node).is_err()).collect();
        let place = |node: Node| nodes.binary_search(&node).ok();
        let mut units = Sets::new(nodes.len());
        for [a, b] in &self.merged {
            if let (Some(a), Some(b)) = (place(*a), place(*b)) {
                units.join(a, b);
            }
        }
        let mut lesions = units.clone();
        for link in &self.links {
            if let (Some(a), Some(b)) = (place(link.from), place(link.to)) {
                lesions.join(a, b);
            }
        }
        let mut made = Made { found: &self.found, units: Vec::new(), unit_of: BTreeMap::new() };
        let mut unit_of_root: BTreeMap<usize, usize> = BTreeMap::new();
        for (at, node) in nodes.iter().enumerate() {
            let lesion = lesions.root(at);
            made.add(*node, lesion, unit_of_root.entry(units.root(at)));
        }
        for link in &self.links {
            for (node, is_from) in [(link.from, true), (link.to, false)] {
                let unit = made.unit_of.get(&node).and_then(|at| made.units.get_mut(*at));
                if let Some(unit) = unit {
                    if is_from { unit.has_later = true } else { unit.has_earlier = true }
                }
            }
        }
        let Made { mut units, unit_of, .. } = made;
        let lesions = named(&self.found, &mut units);
        let mut tracked = Tracked {
            found: self.found,
            units,
            lesions,
            links: self.links,
            unlinked: self.unlinked,
            ignored,
            events: Vec::new(),
            not_applied,
            unit_of,
        };
        for (node, name) in self.names {
            let lesion = tracked.unit_of(node).and_then(|at| tracked.units.get(at)).map(|unit| unit.lesion);
            if let Some(lesion) = lesion.and_then(|lesion| tracked.lesions.get_mut(lesion)) {
                lesion.name = Some(name.trim().to_owned()).filter(|name| !name.is_empty());
            }
        }
        tracked.events = events(&tracked);
        tracked
    }
}

struct Made<'a> {
    found: &'a Found,
    units: Vec<Unit>,
    unit_of: BTreeMap<Node, usize>,
}

impl Made<'_> {
    fn add(&mut self, node: Node, lesion: usize, entry: Entry<'_, usize, usize>) {
        let at = *entry.or_insert_with(|| {
            let (date, parts) = (node.0, Vec::new());
            let unit = Unit { date, parts, small: true, lesion, has_earlier: false, has_later: false };
            self.units.push(unit);
            self.units.len() - 1
        });
        let part = self.found.parts(node.0).and_then(|parts| parts.parts.get(node.1));
        if let Some(unit) = self.units.get_mut(at) {
            unit.parts.push(node.1);
            unit.small &= part.is_some_and(|part| part.small);
        }
        self.unit_of.insert(node, at);
    }
}

/// The lesions of units, whose lesions are any numbers yet, and become those of the list.
fn named(found: &Found, units: &mut [Unit]) -> Vec<Lesion> {
    let mut by_root: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (at, unit) in units.iter().enumerate() {
        by_root.entry(unit.lesion).or_default().push(at);
    }
    let mut all: Vec<(Lesion, usize, f64, [f64; 3])> = Vec::new();
    for members in by_root.into_values() {
        let of = |at: &usize| units.get(*at);
        let first = members.iter().filter_map(of).map(|unit| unit.date).min().unwrap_or(0);
        let at_first = members.iter().filter_map(of).filter(|unit| unit.date == first);
        let parts: Vec<&Part> = at_first
            .flat_map(|unit| unit.parts.iter().filter_map(|n| found.parts(unit.date)?.parts.get(*n)))
            .collect();
        let volume_ml = parts.iter().map(|part| part.volume_ml).sum();
        let centers = parts.iter().map(|part| part.centroid_mm.to_array());
        let center_mm = centers.min_by(order).unwrap_or_default();
        let small = members.iter().filter_map(of).all(|unit| unit.small);
        let lesion = Lesion { id: String::new(), name: None, small, units: members };
        all.push((lesion, first, volume_ml, center_mm));
    }
    all.sort_by(|a, b| {
        (a.0.small, a.1).cmp(&(b.0.small, b.1)).then(b.2.total_cmp(&a.2)).then_with(|| order(&a.3, &b.3))
    });
    let mut lesions: Vec<Lesion> = all.into_iter().map(|(lesion, ..)| lesion).collect();
    for (number, lesion) in lesions.iter_mut().enumerate() {
        lesion.id = letters(number);
        for at in &lesion.units {
            if let Some(unit) = units.get_mut(*at) {
                unit.lesion = number;
            }
        }
    }
    lesions
}

fn order(a: &[f64; 3], b: &[f64; 3]) -> std::cmp::Ordering {
    let parts = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
    parts.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
}

/// `A` to `Z`, `AA`, `AB` …
fn letters(number: usize) -> String {
    let (mut rest, mut out) = (number + 1, Vec::new());
    while rest > 0 {
        rest -= 1;
        out.push(char::from(b'A' + (rest % 26) as u8));
        rest /= 26;
    }
    out.iter().rev().collect()
}
