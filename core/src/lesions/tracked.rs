//! Lesions over the dates, as data.

use std::collections::BTreeMap;

use super::{
    edits::{Anchor, NotApplied},
    event::Event,
    find::Found,
    links::{Link, Node},
    parts::Part,
};

/// What counts as one at a date: a component, or several that the user merged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unit {
    /// Number of the date.
    pub date: usize,
    /// Numbers of its parts at this date.
    pub parts: Vec<usize>,
    /// Whether all are small.
    pub small: bool,
    /// Number of the lesion that it is of.
    pub lesion: usize,
    /// Whether a link leads to an earlier date.
    pub has_earlier: bool,
    /// Whether a link leads to a later date.
    pub has_later: bool,
}

/// One lesion over all dates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lesion {
    /// `A`, `B` … by first date, then volume at it: lesions that are more than small come first.
    pub id: String,
    /// What the user calls it.
    pub name: Option<String>,
    /// Whether it is small at all dates.
    pub small: bool,
    /// Its units, by date.
    pub units: Vec<usize>,
}

/// Lesions and what became of them.
#[derive(Clone, Debug)]
pub struct Tracked {
    /// The components, after splits.
    pub found: Found,
    /// What counts as one at each date, by date and first part.
    pub units: Vec<Unit>,
    /// The lesions, in the order of their ids.
    pub lesions: Vec<Lesion>,
    /// All links, by their ends.
    pub links: Vec<Link>,
    /// Links that the user took away.
    pub unlinked: Vec<Link>,
    /// Components that the user said are no lesions.
    pub(super) ignored: Vec<Node>,
    /// What became of the lesions, by date.
    pub events: Vec<Event>,
    /// Edits that have no effect.
    pub not_applied: Vec<NotApplied>,
    pub(super) unit_of: BTreeMap<Node, usize>,
}

impl Tracked {
    pub(super) fn unit_of(&self, node: Node) -> Option<usize> {
        self.unit_of.get(&node).copied()
    }

    /// The component of a date.
    pub(super) fn part(&self, (date, part): Node) -> Option<&Part> {
        self.found.parts(date)?.parts.get(part)
    }

    /// Consecutive dates between which lesions are linked.
    pub(super) fn linkable_pairs(&self) -> impl Iterator<Item = [usize; 2]> {
        self.found.pairs.iter().filter(|(_, reason)| reason.is_none()).map(|(pair, _)| *pair)
    }

    /// An anchor of a component, for edits.
    pub(super) fn anchor(&self, node: Node) -> Option<Anchor> {
        let time = self.found.times.get(node.0)?.clone();
        Some(Anchor { time, of: self.found.of.clone(), at_mm: self.part(node)?.anchor_mm })
    }
}
