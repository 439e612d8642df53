//! What is alive: the loaded case and what is derived from it. Never saved.

use std::{
    path::PathBuf,
    sync::{Arc, mpsc},
    thread,
};

use glioscope_core::{
    Check, Progress, RegionVolume,
    case::{self, Case, CaseError, CaseSpec, LoadOptions, TimePoint},
    sample,
};
use glioscope_render::{MaskColors, Scene, slices::PreparedContext};

use crate::{
    document::{CaseRef, Document},
    views::closeup,
};

/// A case and what every view needs of it, made once a load.
pub struct Loaded {
    /// The case.
    pub case: Arc<Case>,
    /// Images ready to slice, in the order of each time point's contexts.
    contexts: Vec<Vec<Arc<PreparedContext>>>,
    /// Cropped regions of each time point; `None` where no voxel is active.
    tumors: Vec<Option<Arc<RegionVolume>>>,
}

impl Loaded {
    /// Derives what views need.
    pub fn new(case: Case) -> Self {
        let contexts = case
            .time_points
            .iter()
            .map(|t| t.contexts.iter().map(|c| Arc::new(PreparedContext::new(c.volume.clone()))).collect())
            .collect();
        let tumors =
            case.time_points.iter().map(|t| RegionVolume::of(&t.index, &t.regions).map(Arc::new)).collect();
        Self { case: Arc::new(case), contexts, tumors }
    }
}

/// What is alive.
#[derive(Default)]
pub struct World {
    loaded: Option<Loaded>,
}

impl World {
    /// A world with a case in it.
    pub fn new(loaded: Loaded) -> Self {
        Self { loaded: Some(loaded) }
    }

    /// The case.
    pub fn case(&self) -> Option<&Arc<Case>> {
        self.loaded.as_ref().map(|l| &l.case)
    }

    /// Number of dates.
    pub fn time_point_count(&self) -> usize {
        self.case().map_or(0, |c| c.time_points.len())
    }

    /// The date the document looks at.
    pub fn time_point(&self, doc: &Document) -> Option<&TimePoint> {
        let case = self.case()?;
        case.time_points.get(doc.nav.time).or_else(|| case.time_points.first())
    }

    /// The image that the slices show.
    pub fn context(&self, doc: &Document) -> Option<(&str, &Arc<PreparedContext>)> {
        let time_point = self.time_point(doc)?;
        let id = doc.nav.context.as_ref()?;
        let at = time_point.contexts.iter().position(|c| c.id == *id)?;
        let prepared = self.loaded.as_ref()?.contexts.get(doc.nav.time)?.get(at)?;
        Some((time_point.contexts[at].id.as_str(), prepared))
    }

    /// Colours of the masks of the current date.
    pub fn colors(&self, doc: &Document) -> MaskColors {
        let asked: Vec<_> =
            self.time_point(doc).map(|t| t.masks.iter().map(|m| m.color).collect()).unwrap_or_default();
        MaskColors::new(doc.edit.palette, &asked).with_coloring(doc.edit.coloring)
    }

    /// The regions of the current date, cropped; `None` where no voxel is active.
    pub fn tumor(&self, doc: &Document) -> Option<&Arc<RegionVolume>> {
        self.loaded.as_ref()?.tumors.get(doc.nav.time)?.as_ref()
    }

    /// The closeup as the document wants it, but for the slice plane.
    pub fn closeup(&self, doc: &Document, dark: bool) -> Scene {
        Scene {
            tumor: self.tumor(doc).cloned(),
            selection: doc.edit.selection.clone(),
            colors: self.colors(doc),
            lens: doc.active_lens(),
            camera: doc.nav.camera,
            background: closeup::background(dark),
            silhouette: [0, 0, 0],
            plane: None,
        }
    }

    /// Everything noticed about the case.
    pub fn checks(&self) -> &[Check] {
        self.case().map_or(&[], |c| &c.checks)
    }
}

/// The case that a reference names, before it is read. A folder's files are opened where their names
/// don't say enough.
///
/// # Errors
/// [`CaseError`]: the manifest, folder or argument is wrong.
pub fn spec_of(case: &CaseRef, options: &LoadOptions, progress: &Progress) -> Result<CaseSpec, CaseError> {
    match case {
        CaseRef::Sample => Ok(sample::sample_spec()),
        CaseRef::Path(path) => case::open_spec(path, options, progress),
        CaseRef::Arguments { masks, contexts } => CaseSpec::from_arguments(masks, contexts),
    }
}

/// What a worker hands back.
pub enum Step {
    /// The case's files were guessed from names: the user sees the guess before it is used.
    Guessed(CaseSpec),
    /// The case is read.
    Loaded(Box<Loaded>),
}

/// A worker that opens a case.
pub struct LoadJob {
    /// What is being opened.
    pub case: CaseRef,
    /// How far it is.
    pub progress: Progress,
    /// Files of fibre tracts beside those that it names.
    pub tracts: Vec<PathBuf>,
    /// A document to continue with, from a session file.
    pub document: Option<Document>,
    receive: mpsc::Receiver<Result<Step, CaseError>>,
}

impl LoadJob {
    /// Starts opening `case` and `tracts` beside it, or reading `accepted`, a spec that the user has
    /// seen. `wake` is called when there is an answer.
    pub fn start(
        case: CaseRef,
        tracts: Vec<PathBuf>,
        accepted: Option<CaseSpec>,
        options: LoadOptions,
        document: Option<Document>,
        wake: impl FnOnce() + Send + 'static,
    ) -> Self {
        let progress = Progress::new();
        let (send, receive) = mpsc::channel();
        let (wanted, beside, worker_progress) = (case.clone(), tracts.clone(), progress.clone());
        thread::spawn(move || {
            // The window may be gone: then nobody wants the result.
            let _ = send.send(open(&wanted, &beside, accepted, &options, &worker_progress));
            wake();
        });
        Self { case, tracts, progress, document, receive }
    }

    /// The answer, once there is one.
    pub fn poll(&self) -> Option<Result<Step, String>> {
        match self.receive.try_recv() {
            Ok(result) => Some(result.map_err(|e| e.to_string())),
            Err(mpsc::TryRecvError::Empty) => None,
            Err(mpsc::TryRecvError::Disconnected) => {
                Some(Err("found a loader that stopped without an answer, expected a case or a reason".into()))
            }
        }
    }
}

fn open(
    case: &CaseRef,
    tracts: &[PathBuf],
    accepted: Option<CaseSpec>,
    options: &LoadOptions,
    progress: &Progress,
) -> Result<Step, CaseError> {
    let mut spec = match accepted {
        Some(spec) => spec,
        None => {
            progress.say("reading names");
            let spec = spec_of(case, options, progress)?;
            if !spec.notes.is_empty() {
                return Ok(Step::Guessed(spec));
            }
            spec
        }
    };
    spec.add_tracts(tracts);
    case::load(&spec, options, progress).map(|case| Step::Loaded(Box::new(Loaded::new(case))))
}

/// Progress as words: what is being done and how far.
pub fn progress_text(progress: &Progress) -> String {
    let label = progress.label();
    match progress.fraction() {
        Some(fraction) => format!("{label} {:.0} %", fraction * 100.0),
        None => label,
    }
}
