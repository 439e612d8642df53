//! Goes to a region, a component, the largest growth or disagreement: crosshair and lens move there.

use std::time::Instant;

use glam::DVec3;

use super::GlioscopeApp;
use crate::{
    command::{AppCommand, Command, EditCommand, LookCommand, Workstation},
    format,
    model::document::ball_radius_mm,
    world::{
        Results,
        jobs::Lookup,
        places::{At, Place, largest_growth},
    },
};

/// Largest number of components offered in lists.
const MAX_COMPONENTS: usize = 20;
/// Smallest lens at the largest growth.
const MIN_RADIUS_MM: f64 = 5.0;

/// Where a command goes.
struct Destination {
    /// Index of the time point.
    time: usize,
    center_mm: DVec3,
    radius_mm: f64,
    notice: String,
}

/// State of a command that goes somewhere.
enum Search {
    /// A worker is looking.
    Working,
    /// There is no such place, and why.
    Nowhere(String),
    Found(Destination),
}

/// The commands that go to regions and components of the time point shown, with their texts; none until they are found.
pub fn choices(work: &Workstation, results: &Results) -> Vec<(String, Command)> {
    let Some(doc) = &work.doc else { return Vec::new() };
    let Some(time_point) = work.world.time_point(doc) else { return Vec::new() };
    let Some(places) = results.places.cached(time_point, doc.edit.ellipsoids.neighbors) else {
        return Vec::new();
    };
    let regions = &time_point.regions;
    let name = |bits| doc.edit.masks.region(regions.mask_ids(), bits);
    let text = |place: &Place| {
        let ml = format::ml(place.volume_ml);
        match place.at {
            At::Disagreement => None,
            At::Region(bits) => {
                let ml = regions.get(bits).map_or(ml, |region| format::ml(region.volume_ml));
                Some((format!("Go to {}, {ml}", name(bits)), AppCommand::GoToRegion(bits)))
            }
            At::Component(bits, number) => Some((
                format!("Go to component {number} of {}, {ml}", name(bits)),
                AppCommand::GoToComponent(bits, number),
            )),
        }
    };
    let found = places.iter().filter_map(text).map(|(text, command)| (text, command.into()));
    found.take(regions.list().len() + MAX_COMPONENTS).collect()
}

impl GlioscopeApp {
    /// Looks for the places of the time point shown, so that lists have them.
    pub(super) fn look_for_places(&mut self) {
        if let Some(doc) = &self.work.doc
            && let Some(time_point) = self.work.world.time_point(doc)
        {
            self.results.places.get(time_point, doc.edit.ellipsoids.neighbors, &self.ask);
        }
    }

    /// Goes where the pending command wants to, once that is known.
    pub(super) fn go_to_pending(&mut self) {
        let Some(command) = self.going_to.clone() else { return };
        let search = self.search(&command);
        if !matches!(search, Some(Search::Working)) {
            self.going_to = None;
        }
        match search {
            Some(Search::Found(destination)) => {
                let now = Instant::now();
                self.work.apply(&LookCommand::SetTime(destination.time).into(), now);
                let go = EditCommand::GoTo(destination.center_mm, destination.radius_mm);
                self.work.apply(&go.into(), now);
                self.work.notice = Some(destination.notice.into());
            }
            Some(Search::Nowhere(why)) => self.work.notice = Some(why.into()),
            Some(Search::Working) => self.work.notice = Some("Looking for the place…".into()),
            None => {}
        }
    }

    fn search(&mut self, command: &AppCommand) -> Option<Search> {
        let at = match command {
            AppCommand::GoToGrowth => return self.growth(),
            AppCommand::GoToDisagreement => At::Disagreement,
            AppCommand::GoToRegion(bits) => At::Region(*bits),
            AppCommand::GoToComponent(bits, number) => At::Component(*bits, *number),
            _ => return None,
        };
        let doc = self.work.doc.as_ref()?;
        let time_point = self.work.world.time_point(doc)?;
        let places = match self.results.places.get(time_point, doc.edit.ellipsoids.neighbors, &self.ask) {
            Lookup::Ready(places) => places,
            Lookup::Working(_) => return Some(Search::Working),
            Lookup::Failed(error) => return Some(Search::Nowhere(error.to_string())),
        };
        let Some(place) = places.iter().find(|place| place.at == at) else {
            let why = match at {
                At::Disagreement => "The masks agree everywhere.",
                At::Region(_) | At::Component(..) => "This date has no such region.",
            };
            return Some(Search::Nowhere(why.to_owned()));
        };
        let name = |bits| doc.edit.masks.region(time_point.regions.mask_ids(), bits);
        let what = match at {
            At::Disagreement => "Largest connected piece where masks disagree".to_owned(),
            At::Region(bits) => name(bits),
            At::Component(bits, number) => format!("Component {number} of {}", name(bits)),
        };
        Some(Search::Found(Destination {
            time: doc.nav.time,
            center_mm: place.center_mm,
            radius_mm: ball_radius_mm(place.volume_ml, time_point.index.grid()),
            notice: format!("{what}: {}", format::ml(place.volume_ml)),
        }))
    }

    fn growth(&mut self) -> Option<Search> {
        let doc = self.work.doc.as_ref()?;
        let case = self.work.world.case()?;
        let compared = match self.results.comparison.get(case, &doc.edit.change, &self.ask) {
            None => {
                return Some(Search::Nowhere("There are no two dates with one mask to compare.".to_owned()));
            }
            Some(Lookup::Working(_)) => return Some(Search::Working),
            Some(Lookup::Failed(error)) => return Some(Search::Nowhere(error.to_string())),
            Some(Lookup::Ready(compared)) => compared,
        };
        let [from, to] = &compared.labels;
        let mask = doc.edit.masks.name(&compared.report.mask);
        let Some(vector) = largest_growth(&compared.change) else {
            return Some(Search::Nowhere(format!("{mask} grew nowhere from {from} to {to}.")));
        };
        let doubt = if vector.flags.within_uncertainty { ", within uncertainty" } else { "" };
        Some(Search::Found(Destination {
            time: compared.choice.dates[1],
            center_mm: vector.to_mm,
            radius_mm: (1.5 * vector.signed_mm).max(MIN_RADIUS_MM),
            notice: format!(
                "{mask} grew {} here from {from} to {to}{doubt}",
                format::length_mm(vector.signed_mm)
            ),
        }))
    }
}
