//! The end of a process, asked for by SIGINT or SIGTERM.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use signal_hook::{
    consts::{SIGINT, SIGTERM},
    iterator::Signals,
};

/// Calls `on_signal` at the first SIGINT or SIGTERM, on a thread of its own.
///
/// # Errors
/// The signals cannot be taken, or the thread cannot be started.
pub fn on_end(on_signal: impl FnOnce() + Send + 'static) -> anyhow::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(move || {
            if signals.forever().next().is_some() {
                on_signal();
            }
        })?;
    Ok(())
}

/// True once SIGINT or SIGTERM has come.
///
/// # Errors
/// See [`on_end`].
pub fn end_flag() -> anyhow::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&flag);
    on_end(move || set.store(true, Ordering::SeqCst))?;
    Ok(flag)
}
