//! An instant of a session.

use probecell_msgs::{builtin_interfaces::Time, std_msgs::Header};
use serde::{Deserialize, Serialize};

/// Nanoseconds since 1970-01-01 UTC, as ROS stamps count them.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Stamp(pub i64);

impl Stamp {
    /// The instant `seconds` later (earlier when negative), to the nanosecond.
    pub fn after_s(self, seconds: f64) -> Self {
        Self(self.0.saturating_add((seconds * 1e9).round() as i64))
    }

    /// Seconds from `earlier` to this instant.
    pub fn since_s(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }

    /// The header of a message that is made at this instant; `frame_id` is empty where no field refers to a frame.
    pub fn header(self, frame_id: &str) -> Header {
        Header {
            stamp: self.time(),
            frame_id: frame_id.to_owned(),
        }
    }

    /// As the message field. Instants before 1970 or after 2106 saturate, since the field's seconds are 32 bits.
    pub fn time(self) -> Time {
        Time::from_nanos(self.0)
    }
}

impl From<&Time> for Stamp {
    fn from(time: &Time) -> Self {
        Self(time.nanos())
    }
}
