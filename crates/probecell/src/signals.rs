//! The end of a process.

use std::{
    process::Child,
    time::{Duration, Instant},
};

use rustix::process::{Pid, Signal, kill_process};
pub(crate) use terminal::{end_flag, on_end};

/// Between two looks whether a child has ended.
const PERIOD: Duration = Duration::from_millis(20);

/// Asks the kernel to send SIGTERM when the process that started this one ends.
pub(crate) fn end_with_parent() -> anyhow::Result<()> {
    rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))?;
    Ok(())
}

/// Asks a child to end.
pub(crate) fn terminate(child: &mut Child) {
    if matches!(child.try_wait(), Ok(None))
        && let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw)
    {
        // It may have ended between the two lines; then there is nothing to signal.
        kill_process(pid, Signal::TERM).unwrap_or_default();
    }
}

/// Waits until a child has ended; one that does not within `timeout` is killed. Gives its exit status, `None` where a signal ended
/// it.
pub(crate) fn wait_for_end(child: &mut Child, timeout: Duration) -> anyhow::Result<Option<i32>> {
    let deadline = Instant::now() + timeout;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.code());
        }
        if Instant::now() > deadline {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(PERIOD);
    }
}
