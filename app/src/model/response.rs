//! What a reader states for the response criteria.

use std::collections::BTreeMap;

use glioscope_core::{
    case::Case,
    response::{Assessment, Criterion, History},
};
use serde::{Deserialize, Serialize};

/// The longest name of an author, characters.
pub const MOST_AUTHOR: usize = 100;
/// The most answers of BT-RADS that are kept.
pub const MOST_ANSWERS: usize = 10_000;

/// The response that is evaluated, and what its reader states.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResponseSetting {
    /// Criteria, and what images don't show; `None`: no response is evaluated.
    pub history: Option<History>,
    /// The mask of non-enhancing disease, by id, where that is assessed besides the lesions' mask.
    pub non_enhancing: Option<String>,
    /// Who states it.
    pub author: String,
    /// Answers to the questions of BT-RADS, by label of the date and key of the question.
    #[serde(default)]
    pub bt_rads: BTreeMap<String, BTreeMap<String, String>>,
}

impl ResponseSetting {
    /// With these criteria and what was stated before; `None`: no response.
    pub fn set_criterion(&mut self, criterion: Option<Criterion>) {
        let Some(criterion) = criterion else {
            self.history = None;
            return;
        };
        let assessment = (criterion == Criterion::Rano20).then_some(Assessment::Enhancing);
        match &mut self.history {
            Some(history) => (history.criterion, history.assessment) = (criterion, assessment),
            None => self.history = Some(History::new(criterion, assessment)),
        }
    }

    /// The mask of non-enhancing disease, where `case` has it.
    pub fn other_mask(&self, case: &Case) -> Option<&String> {
        let has = |id: &&String| {
            case.time_points.iter().any(|time| time.masks.iter().any(|m| m.mask.id() == id.as_str()))
        };
        self.non_enhancing.as_ref().filter(has)
    }

    /// Without who stated it, and with `text` done to what the user wrote.
    pub fn anonymous(&mut self, text: impl Fn(&str) -> String) {
        self.author.clear();
        let Some(history) = &mut self.history else { return };
        *history = std::mem::replace(history, History::new(history.criterion, None)).without_authors();
        for name in history.treatment.iter_mut().flatten().filter_map(|treatment| treatment.name.as_mut()) {
            *name = text(name);
        }
        let stated = &mut history.repeatability;
        for stated in [&mut stated.product, &mut stated.longest, &mut stated.volume].into_iter().flatten() {
            stated.source = text(&stated.source);
        }
    }
}
