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
pub(crate) fn on_end(on_signal: impl FnOnce() + Send + 'static) -> anyhow::Result<()> {
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
pub(crate) fn end_flag() -> anyhow::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let set = Arc::clone(&flag);
    on_end(move || set.store(true, Ordering::SeqCst))?;
    Ok(flag)
}

/// Asks the kernel to send SIGTERM when the process that started this one ends.
pub(crate) fn end_with_parent() -> anyhow::Result<()> {
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))?;
    Ok(())
}
