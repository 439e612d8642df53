//! Results that a view asks for: computed on a worker when first needed, kept under the key of
//! their inputs, dropped when nobody asks for that key any more.

use std::{
    sync::{Arc, mpsc},
    thread,
};

use glioscope_core::Progress;

/// The state of a result.
pub enum Lookup<'a, V> {
    /// It is here.
    Ready(&'a Arc<V>),
    /// A worker is at it.
    Working(&'a Progress),
    /// It can't be had; why.
    Failed(&'a str),
}

struct Job<K, V> {
    key: K,
    progress: Progress,
    receive: mpsc::Receiver<Result<V, String>>,
}

/// One kind of result, the one last asked for.
pub struct Derived<K, V> {
    kept: Option<(K, Result<Arc<V>, String>)>,
    job: Option<Job<K, V>>,
}

impl<K, V> Default for Derived<K, V> {
    fn default() -> Self {
        Self { kept: None, job: None }
    }
}

impl<K: PartialEq, V: Send + 'static> Derived<K, V> {
    /// The result for `key`: kept, or begun now with `compute` on a worker, which calls `wake` when
    /// done. A job for another key is cancelled. With `wait` it is computed here and now: for files.
    pub fn get(
        &mut self,
        key: K,
        wait: bool,
        wake: impl FnOnce() + Send + 'static,
        compute: impl FnOnce(&Progress) -> Result<V, String> + Send + 'static,
    ) -> Lookup<'_, V> {
        self.receive();
        let kept = self.kept.as_ref().is_some_and(|(have, _)| *have == key);
        if let Some(job) = self.job.take_if(|job| job.key != key || kept) {
            job.progress.cancel();
        }
        if !kept && self.job.is_none() {
            let progress = Progress::new();
            if wait {
                self.kept = Some((key, compute(&progress).map(Arc::new)));
            } else {
                let (send, receive) = mpsc::channel();
                let worker_progress = progress.clone();
                thread::spawn(move || {
                    // Nobody may want it any more.
                    let _ = send.send(compute(&worker_progress));
                    wake();
                });
                self.job = Some(Job { key, progress, receive });
            }
        }
        match (&self.job, &self.kept) {
            (Some(job), _) => Lookup::Working(&job.progress),
            (None, Some((_, Ok(value)))) => Lookup::Ready(value),
            (None, Some((_, Err(why)))) => Lookup::Failed(why),
            (None, None) => Lookup::Failed("nothing was computed"),
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
        let Some(job) = &self.job else { return };
        let result = match job.receive.try_recv() {
            Err(mpsc::TryRecvError::Empty) => return,
            Ok(result) => result,
            Err(mpsc::TryRecvError::Disconnected) => Err("the worker stopped without an answer".into()),
        };
        if let Some(job) = self.job.take() {
            self.kept = Some((job.key, result.map(Arc::new)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_is_computed_once_a_key_and_a_stale_job_is_cancelled() {
        let mut derived: Derived<u32, u32> = Derived::default();
        let Lookup::Ready(first) = derived.get(1, true, || {}, |_| Ok(10)) else { panic!("not ready") };
        assert_eq!(**first, 10);
        let again = derived.get(1, true, || {}, |_| panic!("computed twice"));
        assert!(matches!(again, Lookup::Ready(v) if **v == 10));

        let (woken, wait) = mpsc::channel();
        let slow = |progress: &Progress| loop {
            progress.check().map_err(|_| "cancelled".to_owned())?;
            thread::yield_now();
        };
        let wake = woken.clone();
        assert!(matches!(derived.get(2, false, move || wake.send(2).unwrap(), slow), Lookup::Working(_)));
        assert!(matches!(
            derived.get(3, false, move || woken.send(3).unwrap(), |_| Ok(30)),
            Lookup::Working(_)
        ));
        let mut who: Vec<i32> = wait.iter().collect();
        who.sort_unstable();
        assert_eq!(who, [2, 3], "both workers ended");
        assert!(matches!(derived.get(3, false, || {}, |_| Ok(0)), Lookup::Ready(v) if **v == 30));
    }

    #[test]
    fn a_failure_is_told_and_not_tried_again() {
        let mut derived: Derived<u32, u32> = Derived::default();
        assert!(matches!(derived.get(1, true, || {}, |_| Err("no".into())), Lookup::Failed("no")));
        assert!(matches!(derived.get(1, true, || {}, |_| Ok(1)), Lookup::Failed("no")));
    }
}
