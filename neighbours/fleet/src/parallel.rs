//! The same work on many items, on all processors.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// What `work` makes of each item, in the order of the items, whatever thread did it.
pub(crate) fn map<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let done: Vec<Mutex<Option<R>>> = items.iter().map(|_| Mutex::new(None)).collect();
    let workers = std::thread::available_parallelism()
        .map_or(1, usize::from)
        .min(items.len());
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let own = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(own) else { break };
                    let made = work(item);
                    *done[own].lock().unwrap_or_else(PoisonError::into_inner) = Some(made);
                }
            });
        }
    });
    done.into_iter()
        .filter_map(|made| made.into_inner().unwrap_or_else(PoisonError::into_inner))
        .collect()
}
