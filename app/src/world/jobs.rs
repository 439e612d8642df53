//! Results that a view asks for: computed on a worker when first needed, kept under the key of
//! their inputs, dropped when nobody asks for that key any more.

use std::{
    fmt,
    sync::{Arc, Weak, mpsc},
    thread,
};

use glioscope_core::Progress;

use crate::error::AppError;

/// Wakes the window from another thread.
#[derive(Clone)]
pub struct Waker(Arc<dyn Fn() + Send + Sync>);

impl Waker {
    /// Calls `wake` each time.
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self(Arc::new(wake))
    }

    /// Asks a window for another frame.
    pub fn of(ctx: &egui::Context) -> Self {
        let ctx = ctx.clone();
        Self::new(move || ctx.request_repaint())
    }

    /// Wakes it.
    pub fn wake(&self) {
        (self.0)();
    }
}

impl Default for Waker {
    /// Wakes nobody.
    fn default() -> Self {
        Self::new(|| {})
    }
}

impl fmt::Debug for Waker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Waker")
    }
}

/// How results are asked for.
#[derive(Clone, Debug, Default)]
pub struct Ask {
    /// Compute here and now instead of on a worker: for files.
    pub wait: bool,
    /// Called when a worker is done.
    pub wake: Waker,
}

/// Which volume or case a result is of, without keeping it alive: what results are kept under.
#[derive(Debug)]
pub struct Handle<T>(Weak<T>);

impl<T> Handle<T> {
    /// The handle of what `of` holds.
    pub fn of(of: &Arc<T>) -> Self {
        Self(Arc::downgrade(of))
    }
}

impl<T> Clone for Handle<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> PartialEq for Handle<T> {
    fn eq(&self, other: &Self) -> bool {
        self.0.ptr_eq(&other.0)
    }
}

/// The state of a result.
pub enum Lookup<'a, V> {
    /// It is here.
    Ready(&'a Arc<V>),
    /// A worker is at it.
    Working(&'a Progress),
    /// It can't be had; why.
    Failed(&'a AppError),
}

/// A worker that computes one value.
pub struct Job<V> {
    /// How far it is; asks it to stop.
    pub progress: Progress,
    receive: mpsc::Receiver<Result<V, AppError>>,
}

impl<V: Send + 'static> Job<V> {
    /// Starts `compute` on a worker, which wakes the window when it is done.
    pub fn start(
        wake: Waker,
        compute: impl FnOnce(&Progress) -> Result<V, AppError> + Send + 'static,
    ) -> Self {
        let progress = Progress::new();
        let (send, receive) = mpsc::channel();
        let worker_progress = progress.clone();
        thread::spawn(move || {
            // The window may be gone: then nobody wants the value.
            let _ = send.send(compute(&worker_progress));
            wake.wake();
        });
        Self { progress, receive }
    }

    /// The value, once there is one.
    pub fn poll(&self) -> Option<Result<V, AppError>> {
        match self.receive.try_recv() {
            Ok(result) => Some(result),
            Err(mpsc::TryRecvError::Empty) => None,
            Err(mpsc::TryRecvError::Disconnected) => {
                Some(Err(AppError::wrong("a worker", "no answer when it stopped", "a value or a reason")))
            }
        }
    }
}

/// Progress as words: what is being done and how far.
pub fn progress_text(progress: &Progress) -> String {
    let label = progress.label();
    match progress.fraction() {
        Some(fraction) => format!("{label} {:.0} %", fraction * 100.0),
        None => label,
    }
}

/// One kind of result, the one last asked for.
pub struct Derived<K, V> {
    kept: Option<(K, Result<Arc<V>, AppError>)>,
    job: Option<(K, Job<V>)>,
}

impl<K, V> Default for Derived<K, V> {
    fn default() -> Self {
        Self { kept: None, job: None }
    }
}

impl<K: PartialEq, V: Send + 'static> Derived<K, V> {
    /// The result for `key`: kept, or begun now with `compute`. A job for another key is cancelled.
    pub fn get(
        &mut self,
        key: K,
        ask: &Ask,
        compute: impl FnOnce(&Progress) -> Result<V, AppError> + Send + 'static,
    ) -> Lookup<'_, V> {
        self.receive();
        let kept = self.kept.as_ref().is_some_and(|(have, _)| *have == key);
        if let Some((_, job)) = self.job.take_if(|(of, _)| *of != key || kept) {
            job.progress.cancel();
        }
        if !kept && self.job.is_none() {
            if ask.wait {
                self.kept = Some((key, compute(&Progress::new()).map(Arc::new)));
            } else {
                self.job = Some((key, Job::start(ask.wake.clone(), compute)));
            }
        }
        match (&self.job, &self.kept) {
            (Some((_, job)), _) => Lookup::Working(&job.progress),
            (None, Some((_, Ok(value)))) => Lookup::Ready(value),
            (None, Some((_, Err(why)))) => Lookup::Failed(why),
            (None, None) => Lookup::Failed(&AppError::Nothing("nothing was computed")),
        }
    }

    /// The result for `key`, if it is here: nothing is begun.
    pub fn kept(&self, key: &K) -> Option<&Arc<V>> {
        self.kept.as_ref().filter(|(have, _)| have == key)?.1.as_ref().ok()
    }

    /// The result last computed, whether or not it is current.
    pub fn last(&self) -> Option<&Arc<V>> {
        self.kept.as_ref()?.1.as_ref().ok()
    }

    /// Whether a worker is at it.
    pub fn working(&self) -> bool {
        self.job.is_some()
    }

    fn receive(&mut self) {
        if let Some(result) = self.job.as_ref().and_then(|(_, job)| job.poll())
            && let Some((key, _)) = self.job.take()
        {
            self.kept = Some((key, result.map(Arc::new)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waiting() -> Ask {
        Ask { wait: true, ..Ask::default() }
    }

    #[test]
    fn a_result_is_computed_once_per_key_and_a_stale_job_is_cancelled() {
        let mut derived: Derived<u32, u32> = Derived::default();
        let Lookup::Ready(first) = derived.get(1, &waiting(), |_| Ok(10)) else { panic!("not ready") };
        assert_eq!(**first, 10);
        let again = derived.get(1, &waiting(), |_| panic!("computed twice"));
        assert!(matches!(again, Lookup::Ready(v) if **v == 10));

        let (woken, wait) = mpsc::channel();
        let slow = |progress: &Progress| loop {
            progress.check()?;
            thread::yield_now();
        };
        let asked = |who: u32| {
            let woken = woken.clone();
            Ask { wait: false, wake: Waker::new(move || woken.send(who).unwrap()) }
        };
        assert!(matches!(derived.get(2, &asked(2), slow), Lookup::Working(_)));
        assert!(matches!(derived.get(3, &asked(3), |_| Ok(30)), Lookup::Working(_)));
        drop(woken);
        let mut who: Vec<u32> = wait.iter().take(2).collect();
        who.sort_unstable();
        assert_eq!(who, [2, 3], "both workers ended");
        assert!(matches!(derived.get(3, &Ask::default(), |_| Ok(0)), Lookup::Ready(v) if **v == 30));
    }

    #[test]
    fn a_failure_is_reported_and_not_tried_again() {
        let mut derived: Derived<u32, u32> = Derived::default();
        let no = || Err(AppError::Nothing("no"));
        assert!(matches!(derived.get(1, &waiting(), move |_| no()), Lookup::Failed(AppError::Nothing("no"))));
        assert!(matches!(derived.get(1, &waiting(), |_| Ok(1)), Lookup::Failed(AppError::Nothing("no"))));
    }
}
