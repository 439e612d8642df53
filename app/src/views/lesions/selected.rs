//! What is selected in the timeline.

use glioscope_core::lesions::{Anchor, Edit, LesionReport, LesionsReport, LinkReport, PartReport};

/// Up to two components, or a link.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::views) enum Selected {
    #[default]
    Nothing,
    /// One component.
    One(Anchor),
    /// Two components.
    Two(Anchor, Anchor),
    /// A link, by its ends.
    Link(Anchor, Anchor),
}

impl Selected {
    /// Takes a component: alone, or beside the one that was selected.
    pub fn take(&mut self, anchor: &Anchor, beside: bool) {
        *self = match std::mem::take(self) {
            Self::One(first) if beside && first != *anchor => Self::Two(first, anchor.clone()),
            Self::Two(first, second) if beside && second == *anchor => Self::One(first),
            _ => Self::One(anchor.clone()),
        };
    }

    pub fn has(&self, anchor: &Anchor) -> bool {
        match self {
            Self::One(one) => one == anchor,
            Self::Two(one, two) => one == anchor || two == anchor,
            _ => false,
        }
    }

    pub fn is_link(&self, [from, to]: [&Anchor; 2]) -> bool {
        matches!(self, Self::Link(a, b) if a == from && b == to)
    }

    /// Drops what `report` lacks: components that were split, links that were taken away.
    pub fn keep_in(&mut self, report: &LesionsReport) {
        let has = |anchor: &Anchor| part_of(report, anchor).is_some();
        let is_there = match self {
            Self::Nothing => true,
            Self::One(one) => has(one),
            Self::Two(one, two) => has(one) && has(two),
            Self::Link(from, to) => link_between(report, [from, to]).is_some(),
        };
        if !is_there {
            *self = Self::Nothing;
        }
    }
}

/// The lesion and component at an anchor of the report.
pub(super) fn part_of<'a>(
    report: &'a LesionsReport,
    anchor: &Anchor,
) -> Option<(&'a LesionReport, &'a PartReport)> {
    report.lesions.iter().find_map(|lesion| {
        let parts = lesion.dates.iter().flat_map(|date| &date.parts);
        let part = parts.into_iter().find(|part| part.anchor.as_ref() == Some(anchor))?;
        Some((lesion, part))
    })
}

/// The link between two components, in either order.
pub(super) fn link_between<'a>(report: &'a LesionsReport, [a, b]: [&Anchor; 2]) -> Option<&'a LinkReport> {
    report.links.iter().find(|link| match ends(link) {
        Some([from, to]) => (from, to) == (a, b) || (from, to) == (b, a),
        None => false,
    })
}

/// The two components of a link.
pub(super) fn ends(link: &LinkReport) -> Option<[&Anchor; 2]> {
    Some([link.from.as_ref()?, link.to.as_ref()?])
}

/// An edit for every link that nobody looked at.
pub(super) fn verify_all(report: &LesionsReport) -> Vec<Edit> {
    report
        .proposed()
        .filter_map(ends)
        .map(|[from, to]| Edit::Verify { from: from.clone(), to: to.clone() })
        .collect()
}
