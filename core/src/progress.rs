//! How far a job is, and whether it should stop.

use std::sync::{
    Arc, Mutex, PoisonError,
    atomic::{AtomicBool, AtomicU64, Ordering},
};

/// Shared between a worker, who writes it, and a window or terminal, who reads it. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    done: AtomicU64,
    total: AtomicU64,
    cancelled: AtomicBool,
    label: Mutex<String>,
}

/// The user asked to stop. Nothing was changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

impl Progress {
    /// A fresh one: nothing done, nothing known, not cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds to the amount of work that is known to be ahead, in bytes or any one unit.
    pub fn expect(&self, units: u64) {
        self.0.total.fetch_add(units, Ordering::Relaxed);
    }

    /// Adds to the work done.
    ///
    /// # Errors
    /// [`Cancelled`] when the user asked to stop: return it at once.
    pub fn advance(&self, units: u64) -> Result<(), Cancelled> {
        self.0.done.fetch_add(units, Ordering::Relaxed);
        self.check()
    }

    /// # Errors
    /// [`Cancelled`] when the user asked to stop.
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.0.cancelled.load(Ordering::Relaxed) { Err(Cancelled) } else { Ok(()) }
    }

    /// Asks the worker to stop.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }

    /// Says what is being done: an id or a step, no patient data.
    pub fn say(&self, label: impl Into<String>) {
        *self.0.label.lock().unwrap_or_else(PoisonError::into_inner) = label.into();
    }

    /// What is being done.
    pub fn label(&self) -> String {
        self.0.label.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Done over expected, 0 to 1; `None` while the amount of work is unknown.
    pub fn fraction(&self) -> Option<f64> {
        let total = self.0.total.load(Ordering::Relaxed);
        let done = self.0.done.load(Ordering::Relaxed);
        (total > 0).then(|| (done as f64 / total as f64).min(1.0))
    }
}
