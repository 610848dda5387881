//! The clock of a cell: it begins with the wall clock and continues with the monotonic one.
//!
//! Stamps of all processes of a host are the system's monotonic clock plus one offset, which the launcher fixes at the start
//! of the cell and passes on. A wall clock that is set, by a person or by NTP, neither stops a timer nor puts stamps out of
//! order; [`WallClock`] notices it.

use std::{
    sync::OnceLock,
    time::{SystemTime, UNIX_EPOCH},
};

use graph::Stamp;
use rustix::time::{ClockId, clock_gettime};

/// ns from the monotonic clock to the stamps of this process.
static OFFSET: OnceLock<i64> = OnceLock::new();

/// ns of the system's monotonic clock.
fn monotonic() -> i64 {
    let time = clock_gettime(ClockId::Monotonic);
    time.tv_sec * 1_000_000_000 + time.tv_nsec
}

/// ns since 1970 by the wall clock.
fn wall() -> i64 {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// The wall clock shows an instant that no stamp holds.
#[derive(Debug, thiserror::Error)]
#[error(
    "the clock of this computer is set {0}: stamps hold 1970 to 2106; set it, by hand or by NTP, and start again"
)]
pub struct ClockOutOfRange(&'static str);

/// # Errors
/// The wall clock is set before 1970 or after 2106, which the 32-bit seconds of a stamp do not hold.
pub fn check() -> Result<(), ClockOutOfRange> {
    checked(SystemTime::now())
}

fn checked(wall: SystemTime) -> Result<(), ClockOutOfRange> {
    let since = wall
        .duration_since(UNIX_EPOCH)
        .map_err(|_| ClockOutOfRange("before 1970"))?;
    u32::try_from(since.as_secs()).map_err(|_| ClockOutOfRange("after 2106"))?;
    Ok(())
}

/// Offset of this process's stamps from the monotonic clock of the system, ns; fixed when it is first asked for.
pub fn offset() -> i64 {
    *OFFSET.get_or_init(|| wall() - monotonic())
}

/// Takes over the offset (ns) of the cell that this process belongs to. True unless another one is in use already.
pub fn set_offset(offset: i64) -> bool {
    *OFFSET.get_or_init(|| offset) == offset
}

/// The instant now. It never goes back.
pub fn now() -> Stamp {
    Stamp(monotonic() + offset())
}

/// Notices that the wall clock was set.
#[derive(Clone, Copy, Debug)]
pub struct WallClock {
    /// ns; wall clock less stamps when it was set last.
    ahead: i64,
}

impl WallClock {
    /// s; a smaller difference is no step.
    const STEP: f64 = 0.1;

    /// The wall clock as it is now.
    pub fn read() -> Self {
        Self {
            ahead: wall() - now().0,
        }
    }

    /// s by which the wall clock was set since the last step, if it was.
    pub fn stepped(&mut self) -> Option<f64> {
        self.step_to(wall(), now())
    }

    fn step_to(&mut self, wall: i64, now: Stamp) -> Option<f64> {
        let ahead = wall - now.0;
        let step = (ahead - self.ahead) as f64 * 1e-9;
        (step.abs() > Self::STEP).then(|| {
            self.ahead = ahead;
            step
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_of_the_wall_clock_is_noticed_once_and_drift_is_not() {
        let second = 1_000_000_000;
        let mut clock = WallClock { ahead: 0 };
        assert_eq!(clock.step_to(10 * second, Stamp(10 * second)), None);
        assert_eq!(
            clock.step_to(11 * second + 5_000_000, Stamp(11 * second)),
            None
        );
        let back = clock.step_to((12 - 3600) * second, Stamp(12 * second));
        assert!(back.is_some_and(|step| (step + 3600.0).abs() < 0.01));
        assert_eq!(
            clock.step_to((13 - 3600) * second, Stamp(13 * second)),
            None
        );
    }

    #[test]
    fn a_clock_that_no_stamp_holds_is_refused() {
        let seconds = std::time::Duration::from_secs;
        let after_2038 = UNIX_EPOCH + seconds(1 << 31);
        assert!(checked(after_2038).is_ok());
        let early = checked(UNIX_EPOCH - seconds(1)).unwrap_err();
        assert!(early.to_string().contains("before 1970"), "{early}");
        let late = checked(UNIX_EPOCH + seconds(1 << 32)).unwrap_err();
        assert!(late.to_string().contains("after 2106"), "{late}");
    }

    #[test]
    fn stamps_follow_the_monotonic_clock_and_begin_with_the_wall_clock() {
        let (before, stamp, after) = (wall(), now().0, wall());
        assert!((before - 1_000_000..=after + 1_000_000).contains(&stamp));
        assert!(set_offset(offset()) && !set_offset(offset() + 1));
    }
}
