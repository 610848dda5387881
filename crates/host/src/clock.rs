//! The clock of a cell: it begins with the wall clock and continues with the monotonic one.
//!
//! Stamps of all processes of a host are the system's monotonic clock plus one offset, which the launcher fixes at the start
//! of the cell and passes on. A wall clock that is set, by a person or by NTP, neither stops a timer nor puts stamps out of
//! order; [`WallClock`] notices it.
//!
//! A cell whose machine is simulated can have a simulated clock instead ([`crate::sim_time`]).

use std::{
    fmt,
    fs::File,
    io,
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
    str::FromStr,
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
fn offset() -> i64 {
    *OFFSET.get_or_init(|| wall() - monotonic())
}

/// Takes over the offset (ns) of the cell that this process belongs to. True unless another one is in use already.
fn set_offset(offset: i64) -> bool {
    *OFFSET.get_or_init(|| offset) == offset
}

/// The simulated clock that this process follows.
static SIMULATED: OnceLock<(PathBuf, File)> = OnceLock::new();

/// The instant now. It never goes back.
pub fn now() -> Stamp {
    let mut instant = [0; 8];
    match SIMULATED.get() {
        Some((_, file)) if file.read_exact_at(&mut instant, 0).is_ok() => {
            Stamp(i64::from_le_bytes(instant))
        }
        _ => Stamp(monotonic() + offset()),
    }
}

/// The file of the simulated clock that this process follows; none by the clock of the system.
pub fn simulated() -> Option<&'static Path> {
    SIMULATED.get().map(|(path, _)| path.as_path())
}

/// The clock of a cell, as its launcher passes it on to a process: a number, or the path of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CellClock {
    /// ns from the monotonic clock of the system to stamps.
    Offset(i64),
    /// The file of a simulated clock.
    Simulated(PathBuf),
}

impl CellClock {
    /// That of the system, also in a process that follows a simulated one.
    pub fn of_system() -> Self {
        Self::Offset(offset())
    }

    /// The one of this process.
    pub fn of_this_process() -> Self {
        simulated().map_or_else(
            || Self::Offset(offset()),
            |path| Self::Simulated(path.to_owned()),
        )
    }

    /// Follows it from now on, unless this process follows one already.
    ///
    /// # Errors
    /// The file of a simulated clock cannot be read.
    pub fn follow(self) -> io::Result<()> {
        match self {
            Self::Offset(offset) => {
                set_offset(offset);
            }
            Self::Simulated(path) => {
                let file = File::open(&path)?;
                file.read_exact_at(&mut [0; 8], 0)?;
                SIMULATED.get_or_init(|| (path, file));
            }
        }
        Ok(())
    }
}

impl FromStr for CellClock {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok((text.parse()).map_or_else(|_| Self::Simulated(text.into()), Self::Offset))
    }
}

impl fmt::Display for CellClock {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Offset(offset) => write!(formatter, "{offset}"),
            Self::Simulated(path) => write!(formatter, "{}", path.display()),
        }
    }
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
