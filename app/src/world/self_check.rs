//! The case's check of itself, for the change view: run on a worker when it is asked for.

use std::sync::Arc;

use glioscope_core::{
    case::Case,
    self_check::{
        self, Comes, LesionCheck, Options, Recovered, SelfCheckReport, SurfaceCheck, Target, Where,
    },
};

use super::jobs::{Ask, Derived, Handle, Lookup};
use crate::model::ChangeSetting;

/// Inputs of a check.
#[derive(PartialEq)]
struct Key {
    case: Handle<Case>,
    target: Target,
    options: Options,
}

/// The check last asked for.
#[derive(Default)]
pub struct SelfChecks {
    result: Derived<Key, SelfCheckReport>,
}

impl SelfChecks {
    /// The check of what `setting` compares, started now if necessary; `None` where nothing can be compared.
    pub fn get(
        &mut self,
        case: &Arc<Case>,
        setting: &ChangeSetting,
        ask: &Ask,
    ) -> Option<Lookup<'_, SelfCheckReport>> {
        let key = key(case, setting)?;
        let (case, target, options) = (case.clone(), key.target.clone(), key.options);
        let work = move |progress: &_| Ok(self_check::self_check(&case, &target, &options, progress)?);
        Some(self.result.get(key, ask, work))
    }

    /// The check of what `setting` compares, if it is available: starts no job.
    pub fn cached(&self, case: &Arc<Case>, setting: &ChangeSetting) -> Option<&Arc<SelfCheckReport>> {
        self.result.cached(&key(case, setting)?)
    }

    /// Ends a check that a worker is running.
    pub fn stop(&mut self) {
        self.result.stop();
    }
}

fn key(case: &Arc<Case>, setting: &ChangeSetting) -> Option<Key> {
    let target = Target::of(&setting.chosen(case).ok()?);
    Some(Key { case: Handle::of(case), target, options: Options::of(setting.options()) })
}

/// A line about a check, and whether it is outside of what is good.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CheckLine {
    /// The line.
    pub text: String,
    /// Whether a share lies outside 0.9 to 1.1, lesions were missed, or changes were called falsely.
    pub marked: bool,
}

/// What a check found, one line for each known change of the surface and one for all lesions.
pub fn lines(report: &SelfCheckReport) -> Vec<CheckLine> {
    let unchanged = &report.unchanged;
    let mut lines = vec![CheckLine {
        text: format!("check on this case: false calls {} of {}", unchanged.false_calls, unchanged.runs),
        marked: unchanged.marked,
    }];
    let moved = report.surfaces.iter().filter(|check| check.surface.is_some());
    lines.extend(moved.map(surface_line));
    lines.extend(report.lesions.iter().filter(|check| check.runs > 0).map(lesion_line));
    if report.image.is_none() {
        lines.push(CheckLine { text: "no image: registration is not part of it".into(), marked: false });
    }
    lines
}

fn surface_line(check: &SurfaceCheck) -> CheckLine {
    let share = |r: Option<Recovered>| r.map_or_else(|| "–".to_owned(), |r| format!("{:.2}", r.share));
    let at = match check.at {
        Where::Evenly => "",
        Where::OneSide => " on one side",
    };
    let error = check.surface.and_then(|r| r.standard_error);
    let error = error.map(|error| format!(" ± {error:.2}")).unwrap_or_default();
    let text = format!(
        "known {:+} mm{at}: {}{error} of it as lengths, {} as nearest, volume {}",
        check.known_mm,
        share(check.surface),
        share(check.nearest),
        share(check.volume)
    );
    let marked = [check.surface, check.nearest, check.volume].into_iter().flatten().any(|r| r.marked);
    CheckLine { text: text.replace("known -", "known \u{2212}"), marked }
}

fn lesion_line(check: &LesionCheck) -> CheckLine {
    let what = match check.comes {
        Comes::New => "new",
        Comes::Vanished => "vanished",
    };
    let volume = check.volume.map(|r| format!(", volume {:.2}", r.share)).unwrap_or_default();
    let text = format!("{what} {} ml: {} of {} found{volume}", check.known_ml, check.found, check.runs);
    CheckLine { text, marked: check.marked || check.volume.is_some_and(|r| r.marked) }
}
