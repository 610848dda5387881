//! Stamps as nanoseconds, and geometry as arrays for the kernels.
//!
//! Time counts from 1970; its seconds are the 32 bits of `sec` without a sign, so that it ends in 2106, not in 2038. Geometry keeps
//! the unit of its field.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::{
    MachineState,
    builtin_interfaces::{Duration, Time},
    geometry_msgs::{Point, Quaternion, Vector3},
};

impl MachineState {
    /// True where two states of a machine agree in every driver of thermal growth: a state between two others that agree with it
    /// changes no response and need not be kept.
    pub fn drives_as(&self, other: &Self) -> bool {
        self.temperature_names == other.temperature_names
            && self.temperatures == other.temperatures
            && self.spindle_speed == other.spindle_speed
    }
}

const NANOS_PER_SECOND: i64 = 1_000_000_000;

/// Seconds and the nanoseconds added to them; the nearest that the fields can hold.
fn split(nanos: i64) -> (i32, u32) {
    match i32::try_from(nanos.div_euclid(NANOS_PER_SECOND)) {
        Ok(sec) => (sec, nanos.rem_euclid(NANOS_PER_SECOND) as u32),
        Err(_) if nanos < 0 => (i32::MIN, 0),
        Err(_) => (i32::MAX, NANOS_PER_SECOND as u32 - 1),
    }
}

fn join(sec: i32, nanosec: u32) -> i64 {
    i64::from(sec) * NANOS_PER_SECOND + i64::from(nanosec)
}

impl Time {
    /// The instant `nanos` ns after 1970; instants beyond the 32-bit seconds become the first or last instant.
    pub fn from_nanos(nanos: i64) -> Self {
        let (sec, nanosec) = match u32::try_from(nanos.div_euclid(NANOS_PER_SECOND)) {
            Ok(sec) => (sec, nanos.rem_euclid(NANOS_PER_SECOND) as u32),
            Err(_) if nanos < 0 => (0, 0),
            Err(_) => (u32::MAX, NANOS_PER_SECOND as u32 - 1),
        };
        Self {
            sec: sec.cast_signed(),
            nanosec,
        }
    }

    /// Nanoseconds since 1970; never negative.
    pub fn nanos(self) -> i64 {
        i64::from(self.sec.cast_unsigned()) * NANOS_PER_SECOND + i64::from(self.nanosec)
    }
}

impl From<Time> for SystemTime {
    fn from(stamp: Time) -> Self {
        UNIX_EPOCH + std::time::Duration::from_nanos(stamp.nanos().unsigned_abs())
    }
}

impl Duration {
    /// A span of `nanos` ns; spans beyond the 32-bit seconds become the shortest or longest span.
    pub fn from_nanos(nanos: i64) -> Self {
        let (sec, nanosec) = split(nanos);
        Self { sec, nanosec }
    }

    /// Length in nanoseconds.
    pub fn nanos(self) -> i64 {
        join(self.sec, self.nanosec)
    }
}

macro_rules! as_array {
    ($ty:ident, [$($axis:ident),+], $length:literal) => {
        impl From<[f64; $length]> for $ty {
            fn from([$($axis),+]: [f64; $length]) -> Self {
                Self { $($axis),+ }
            }
        }

        impl From<$ty> for [f64; $length] {
            fn from($ty { $($axis),+ }: $ty) -> Self {
                [$($axis),+]
            }
        }

        impl From<&$ty> for [f64; $length] {
            fn from(value: &$ty) -> Self {
                (*value).into()
            }
        }
    };
}

as_array!(Point, [x, y, z], 3);
as_array!(Vector3, [x, y, z], 3);
as_array!(Quaternion, [x, y, z, w], 4);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_keep_every_nanosecond_until_2106_and_spans_their_sign() {
        for nanos in [0, 1, 999_999_999, 1_753_000_000_123_456_789] {
            assert_eq!(Time::from_nanos(nanos).nanos(), nanos);
            assert_eq!(Duration::from_nanos(nanos).nanos(), nanos);
            assert_eq!(Duration::from_nanos(-nanos).nanos(), -nanos);
        }
        // 2038-01-19T03:14:08Z and 2100-01-01T00:00:00Z.
        for seconds in [1_i64 << 31, 4_102_444_800] {
            let nanos = seconds * NANOS_PER_SECOND + 5;
            assert_eq!(Time::from_nanos(nanos).nanos(), nanos);
        }
        let span = Duration {
            sec: -1,
            nanosec: 999_999_999,
        };
        assert_eq!(Duration::from_nanos(-1), span);
    }

    #[test]
    fn stamps_beyond_the_field_stop_at_its_ends() {
        assert_eq!(
            Time::from_nanos(i64::MAX),
            Time {
                sec: -1,
                nanosec: 999_999_999
            }
        );
        assert_eq!(Time::from_nanos(i64::MIN), Time::default());
    }

    #[test]
    fn an_orientation_that_nobody_set_is_no_rotation() {
        assert_eq!(
            <[f64; 4]>::from(Quaternion::default()),
            [0.0, 0.0, 0.0, 1.0]
        );
    }
}
