//! Progress and cancellation of a job.

use std::sync::{
    Arc, Mutex, PoisonError,
    atomic::{AtomicBool, AtomicU64, Ordering},
};

/// Shared by a worker, which writes it, and a window or terminal, which reads it. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    done: AtomicU64,
    total: AtomicU64,
    cancelled: Arc<AtomicBool>,
    label: Mutex<String>,
}

/// The user cancelled the job. Nothing was changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

impl Progress {
    /// No work done, none expected, not cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds to the expected work, in bytes or any other single unit.
    pub fn expect(&self, units: u64) {
        self.0.total.fetch_add(units, Ordering::Relaxed);
    }

    /// Adds to the work done.
    ///
    /// # Errors
    /// [`Cancelled`] after [`Progress::cancel`]: return it at once.
    pub fn advance(&self, units: u64) -> Result<(), Cancelled> {
        self.0.done.fetch_add(units, Ordering::Relaxed);
        self.check()
    }

    /// # Errors
    /// [`Cancelled`] after [`Progress::cancel`].
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.0.cancelled.load(Ordering::Relaxed) { Err(Cancelled) } else { Ok(()) }
    }

    /// Asks the worker to stop.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// The progress of a part of the work: cancelled with the whole, but its work and label don't show.
    pub fn part(&self) -> Self {
        Self(Arc::new(Inner { cancelled: self.0.cancelled.clone(), ..Inner::default() }))
    }

    /// Sets the label of the current step: an id or the step's name, no patient data.
    pub fn say(&self, label: impl Into<String>) {
        *self.0.label.lock().unwrap_or_else(PoisonError::into_inner) = label.into();
    }

    /// The label of the current step.
    pub fn label(&self) -> String {
        self.0.label.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Done over expected work, 0 to 1; `None` while no work is expected.
    pub fn fraction(&self) -> Option<f64> {
        let total = self.0.total.load(Ordering::Relaxed);
        let done = self.0.done.load(Ordering::Relaxed);
        (total > 0).then(|| (done as f64 / total as f64).min(1.0))
    }
}
