//! Results that views request: computed on a worker when first needed, cached under the key of their inputs, and
//! replaced by the result for the next key requested.

use std::{
    fmt,
    sync::{Arc, Weak, mpsc},
    thread,
};

use glioscope_core::Progress;

use crate::error::AppError;

/// Callback that wakes the window from another thread.
#[derive(Clone)]
pub struct Waker(Arc<dyn Fn() + Send + Sync>);

impl Waker {
    /// A waker that calls `wake`.
    pub fn new(wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self(Arc::new(wake))
    }

    /// A waker that requests a repaint of the window.
    pub fn of(ctx: &egui::Context) -> Self {
        let ctx = ctx.clone();
        Self::new(move || ctx.request_repaint())
    }

    /// Calls the callback.
    pub fn wake(&self) {
        (self.0)();
    }
}

impl Default for Waker {
    /// A waker that does nothing.
    fn default() -> Self {
        Self::new(|| {})
    }
}

impl fmt::Debug for Waker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Waker")
    }
}

/// How results are requested.
#[derive(Clone, Debug, Default)]
pub struct Ask {
    /// Compute on the calling thread instead of on a worker: for export to files.
    pub wait: bool,
    /// Called when a worker has finished.
    pub wake: Waker,
}

/// Identity of the volume or case that a result belongs to, as part of its cache key. Doesn't keep it alive.
#[derive(Debug)]
pub struct Handle<T>(Weak<T>);

impl<T> Handle<T> {
    /// The identity of `owner`'s value.
    pub fn of(owner: &Arc<T>) -> Self {
        Self(Arc::downgrade(owner))
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
    /// It is available.
    Ready(&'a Arc<V>),
    /// A worker is computing it.
    Working(&'a Progress),
    /// It can't be computed, and why.
    Failed(&'a AppError),
}

/// A worker that computes one value.
pub struct Job<V> {
    /// Its progress; also cancels it.
    pub progress: Progress,
    receive: mpsc::Receiver<Result<V, AppError>>,
}

impl<V: Send + 'static> Job<V> {
    /// Starts `compute` on a worker, which calls `wake` when it has finished.
    pub fn start(
        wake: Waker,
        compute: impl FnOnce(&Progress) -> Result<V, AppError> + Send + 'static,
    ) -> Self {
        let progress = Progress::new();
        let (send, receive) = mpsc::channel();
        let worker_progress = progress.clone();
        let failed = send.clone();
        let started = thread::Builder::new().spawn(move || {
            // Fails where the receiver is gone, and the value with it is not needed.
            let _ = send.send(compute(&worker_progress));
            wake.wake();
        });
        if let Err(error) = started {
            let found = format!("no thread ({error})");
            let _ = failed.send(Err(AppError::wrong("a worker", found, "a system that allows another")));
        }
        Self { progress, receive }
    }

    /// The result, once it is available; never blocks.
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

/// Progress for display: label and percentage.
pub fn progress_text(progress: &Progress) -> String {
    let label = progress.label();
    match progress.fraction() {
        Some(fraction) => format!("{label} {:.0} %", fraction * 100.0),
        None => label,
    }
}

/// A cached result: the one for the key last requested.
pub struct Derived<K, V> {
    cached: Option<(K, Result<Arc<V>, AppError>)>,
    job: Option<(K, Job<V>)>,
}

impl<K, V> Default for Derived<K, V> {
    fn default() -> Self {
        Self { cached: None, job: None }
    }
}

impl<K: PartialEq, V: Send + 'static> Derived<K, V> {
    /// The result for `key`: from the cache, or started now with `compute`. A job for another key is cancelled.
    pub fn get(
        &mut self,
        key: K,
        ask: &Ask,
        compute: impl FnOnce(&Progress) -> Result<V, AppError> + Send + 'static,
    ) -> Lookup<'_, V> {
        self.receive();
        let is_cached = self.cached.as_ref().is_some_and(|(cached_key, _)| *cached_key == key);
        if let Some((_, job)) = self.job.take_if(|(job_key, _)| *job_key != key || is_cached) {
            job.progress.cancel();
        }
        if !is_cached && self.job.is_none() {
            if ask.wait {
                self.cached = Some((key, compute(&Progress::new()).map(Arc::new)));
            } else {
                self.job = Some((key, Job::start(ask.wake.clone(), compute)));
            }
        }
        match (&self.job, &self.cached) {
            (Some((_, job)), _) => Lookup::Working(&job.progress),
            (None, Some((_, Ok(value)))) => Lookup::Ready(value),
            (None, Some((_, Err(why)))) => Lookup::Failed(why),
            (None, None) => Lookup::Failed(&AppError::Unavailable("nothing was computed")),
        }
    }

    /// The result for `key`, if it is available: starts no job.
    pub fn cached(&self, key: &K) -> Option<&Arc<V>> {
        self.cached.as_ref().filter(|(cached_key, _)| cached_key == key)?.1.as_ref().ok()
    }

    /// The result last computed, which may be for an older key.
    pub fn last(&self) -> Option<&Arc<V>> {
        self.cached.as_ref()?.1.as_ref().ok()
    }

    /// Cancels a worker that is computing one.
    pub fn stop(&mut self) {
        if let Some((_, job)) = self.job.take() {
            job.progress.cancel();
        }
    }

    /// Whether a worker is computing one. Takes what a worker has finished: nobody may ask for it any more.
    pub fn working(&mut self) -> bool {
        self.receive();
        self.job.is_some()
    }

    fn receive(&mut self) {
        if let Some(result) = self.job.as_ref().and_then(|(_, job)| job.poll())
            && let Some((key, _)) = self.job.take()
        {
            self.cached = Some((key, result.map(Arc::new)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocking() -> Ask {
        Ask { wait: true, ..Ask::default() }
    }

    #[test]
    fn a_result_is_computed_once_per_key_and_a_stale_job_is_cancelled() {
        let mut derived: Derived<u32, u32> = Derived::default();
        let Lookup::Ready(first) = derived.get(1, &blocking(), |_| Ok(10)) else { panic!("not ready") };
        assert_eq!(**first, 10);
        let again = derived.get(1, &blocking(), |_| panic!("computed twice"));
        assert!(matches!(again, Lookup::Ready(v) if **v == 10));

        let (woken, wakes) = mpsc::channel();
        let slow = |progress: &Progress| loop {
            progress.check()?;
            thread::yield_now();
        };
        let on_worker = |who: u32| {
            let woken = woken.clone();
            Ask { wait: false, wake: Waker::new(move || woken.send(who).unwrap()) }
        };
        assert!(matches!(derived.get(2, &on_worker(2), slow), Lookup::Working(_)));
        assert!(matches!(derived.get(3, &on_worker(3), |_| Ok(30)), Lookup::Working(_)));
        drop(woken);
        let mut who: Vec<u32> = wakes.iter().take(2).collect();
        who.sort_unstable();
        assert_eq!(who, [2, 3], "both workers ended");
        assert!(matches!(derived.get(3, &Ask::default(), |_| Ok(0)), Lookup::Ready(v) if **v == 30));
    }

    #[test]
    fn a_finished_job_that_nobody_asks_for_any_more_is_not_working() {
        let mut derived: Derived<u32, u32> = Derived::default();
        let (woken, wakes) = mpsc::channel();
        let ask = Ask { wait: false, wake: Waker::new(move || woken.send(()).unwrap()) };
        assert!(matches!(derived.get(1, &ask, |_| Ok(10)), Lookup::Working(_)));
        wakes.recv().unwrap();
        assert!(!derived.working());
        assert!(matches!(derived.get(1, &ask, |_| panic!("computed twice")), Lookup::Ready(v) if **v == 10));
    }

    #[test]
    fn a_failure_is_reported_and_not_retried() {
        let mut derived: Derived<u32, u32> = Derived::default();
        let failure = || Err(AppError::Unavailable("no"));
        assert!(matches!(
            derived.get(1, &blocking(), move |_| failure()),
            Lookup::Failed(AppError::Unavailable("no"))
        ));
        assert!(matches!(
            derived.get(1, &blocking(), |_| Ok(1)),
            Lookup::Failed(AppError::Unavailable("no"))
        ));
    }
}
