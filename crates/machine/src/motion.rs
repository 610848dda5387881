//! How long the axes take from one set of positions to another, and where they are on the way.
//!
//! ```text
//!  velocity            ___________________
//!     v ______________/                   \
//!                    /|                   |\
//!                   / |                   | \
//!                  /  |                   |  \
//!      0 _________/   |                   |   \________  time
//!          ramp hold ramp     cruise     ramp hold ramp
//!           +j   0    -j         0        -j   0    +j      jerk
//! ```
//!
//! Every axis moves from rest to rest. With top speed v alone the distance d takes d/v. With acceleration a the profile
//! is a trapezoid, d/v + v/a, or a triangle, 2·√(d/a), where v is not reached. With jerk j as well it has seven phases
//! (an S-curve; L. Biagiotti and C. Melchiorri, "Trajectory Planning for Automatic Machines and Robots", Springer 2008,
//! section 3.4), of which those are left out that the distance is too short for. All axes start together, so the slowest
//! decides; what is slower by nature (a clamped rotary axis) adds its clamping time whenever it moves. Positions are m or
//! rad, times s. Targets are approached with an exact stop unless blending is declared: then the controller begins a
//! positioning move while the one before it still brakes, so that a share of the shorter of both ramps is saved.
//!
//! Top speeds come from the robot description (`<limit velocity="…">`), the rest from the section `[motion]` of the cell
//! file. A machine that declares neither acceleration nor jerk is timed by its top speeds alone.
//!
//! ```
//! use machine::motion::AxisLimits;
//!
//! let axis = AxisLimits { acceleration: Some(2.0), jerk: Some(40.0), ..AxisLimits::at_speed(0.4) };
//! // 0.2 m: 0.2/0.4 at top speed, 0.4/2 to get there, 2/40 to build up the acceleration.
//! assert!((axis.profile(0.2).duration() - (0.5 + 0.2 + 0.05)).abs() < 1e-12);
//! ```

use serde::{Deserialize, Serialize};

/// Speed assumed for an axis whose description gives none, m/s or rad/s: slow, so that it is avoided.
const UNKNOWN_SPEED: f64 = 0.05;

/// What limits the motion of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// Top speed, m/s or rad/s.
    pub velocity: f64,
    /// Largest acceleration, m/s² or rad/s²; `None`: top speed is reached at once.
    pub acceleration: Option<f64>,
    /// Largest jerk, m/s³ or rad/s³; `None`: the acceleration is reached at once.
    pub jerk: Option<f64>,
    /// Time to release and to clamp the axis again, half of it before and half after each motion, s.
    pub clamping: f64,
}

impl AxisLimits {
    /// An axis that is limited by its top speed alone, m/s or rad/s.
    pub fn at_speed(velocity: f64) -> Self {
        Self {
            velocity,
            acceleration: None,
            jerk: None,
            clamping: 0.0,
        }
    }

    /// True where the position over time is a straight line.
    fn is_uniform(&self) -> bool {
        self.acceleration.is_none() && self.jerk.is_none() && self.clamping == 0.0
    }

    /// Time from rest to a speed (m/s or rad/s), s.
    fn ramp(&self, speed: f64) -> f64 {
        match (self.acceleration, self.jerk) {
            (None, None) => 0.0,
            (Some(a), None) => speed / a,
            (acceleration, Some(j)) => {
                let a = acceleration.unwrap_or(f64::INFINITY);
                if speed * j <= a * a {
                    2.0 * (speed / j).sqrt()
                } else {
                    speed / a + a / j
                }
            }
        }
    }

    /// The fastest motion over a distance (m or rad, of either sign) from rest to rest.
    pub fn profile(&self, distance: f64) -> Profile {
        let d = distance.abs();
        let v = self.velocity;
        if d == 0.0 {
            return Profile::default();
        }
        let cruising = |ramp: f64, hold: f64| Profile {
            clamping: self.clamping,
            ramp,
            hold,
            cruise: (d / v - (2.0 * ramp + hold)).max(0.0),
            velocity: v,
        };
        let short = |ramp: f64, hold: f64| Profile {
            clamping: self.clamping,
            ramp,
            hold,
            cruise: 0.0,
            velocity: d / (2.0 * ramp + hold),
        };
        match (self.acceleration, self.jerk) {
            (None, None) => cruising(0.0, 0.0),
            (Some(a), None) if d * a <= v * v => short(0.0, (d / a).sqrt()),
            (Some(a), None) => cruising(0.0, v / a),
            (acceleration, Some(j)) => {
                let a = acceleration.unwrap_or(f64::INFINITY);
                let (ramp, hold) = if v * j <= a * a {
                    ((v / j).sqrt(), 0.0)
                } else {
                    (a / j, v / a - a / j)
                };
                if d >= v * (2.0 * ramp + hold) {
                    return cruising(ramp, hold);
                }
                let ramp = a / j;
                if d >= 2.0 * a * ramp * ramp {
                    // d = a·(ramp + hold)·(2·ramp + hold)
                    let hold = 0.5 * ((ramp * ramp + 4.0 * d / a).sqrt() - 3.0 * ramp);
                    short(ramp, hold.max(0.0))
                } else {
                    short((0.5 * d / j).cbrt(), 0.0)
                }
            }
        }
    }
}

/// A motion of one axis from rest to rest; its second half mirrors the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// s; standstill, half of it before and half after the motion.
    clamping: f64,
    /// s; in which the acceleration is built up, and taken back again.
    ramp: f64,
    /// s; of the largest acceleration.
    hold: f64,
    /// s; of the largest velocity.
    cruise: f64,
    /// m/s or rad/s; the largest.
    velocity: f64,
}

impl Profile {
    /// Time from start to end, s.
    pub fn duration(&self) -> f64 {
        self.moving() + self.clamping
    }

    fn moving(&self) -> f64 {
        2.0 * self.accelerating() + self.cruise
    }

    fn accelerating(&self) -> f64 {
        2.0 * self.ramp + self.hold
    }

    /// Distance covered at an instant after the start (s), m or rad; none before, all after the end.
    pub fn distance_at(&self, time: f64) -> f64 {
        let (moving, half) = (self.moving(), 0.5 * self.moving());
        let time = (time - 0.5 * self.clamping).clamp(0.0, moving);
        if time <= half {
            self.first_half(time)
        } else {
            self.velocity * (self.accelerating() + self.cruise) - self.first_half(moving - time)
        }
    }

    /// Share of the distance covered at an instant after the start (s), 0 to 1.
    pub fn share_at(&self, time: f64) -> f64 {
        let all = self.velocity * (self.accelerating() + self.cruise);
        if all > 0.0 {
            (self.distance_at(time) / all).clamp(0.0, 1.0)
        } else {
            1.0
        }
    }

    /// Speed at an instant after the start (s), m/s or rad/s; 0 before the start and after the end. Where it jumps, at the ends of
    /// a motion without ramps, it is that of the motion.
    pub fn speed_at(&self, time: f64) -> f64 {
        let (moving, time) = (self.moving(), time - 0.5 * self.clamping);
        if time < 0.0 || time > moving {
            return 0.0;
        }
        self.rising_speed(time.min(moving - time))
    }

    /// Share of the distance that is covered per second at an instant after the start (s), 1/s.
    pub fn share_rate_at(&self, time: f64) -> f64 {
        let all = self.velocity * (self.accelerating() + self.cruise);
        if all > 0.0 {
            self.speed_at(time) / all
        } else {
            0.0
        }
    }

    /// Derivative of [`Self::first_half`].
    fn rising_speed(&self, time: f64) -> f64 {
        let (ramp, hold, v) = (self.ramp, self.hold, self.velocity);
        let accelerating = self.accelerating();
        if time >= accelerating {
            return v;
        }
        let a = v / (ramp + hold);
        if time < ramp {
            0.5 * a * time * time / ramp
        } else if time <= ramp + hold {
            a * (time - 0.5 * ramp)
        } else {
            let rest = accelerating - time;
            v - 0.5 * a * rest * rest / ramp
        }
    }

    fn first_half(&self, time: f64) -> f64 {
        let (ramp, hold, v) = (self.ramp, self.hold, self.velocity);
        let accelerating = self.accelerating();
        if time >= accelerating {
            return v * (0.5 * accelerating + time - accelerating);
        }
        let a = v / (ramp + hold);
        if time < ramp {
            a * time.powi(3) / (6.0 * ramp)
        } else if time <= ramp + hold {
            let held = time - ramp;
            a * (ramp * ramp / 6.0 + 0.5 * ramp * held + 0.5 * held * held)
        } else {
            let rest = accelerating - time;
            v * (0.5 * accelerating - rest) + a * rest.powi(3) / (6.0 * ramp)
        }
    }
}

/// How the axes of a machine move together.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    axes: Vec<AxisLimits>,
    dwell: f64,
    /// What holds of all axes.
    pub program: Program,
}

/// How a controller runs a program: what lengthens or shortens its moves whatever axes take part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Program {
    /// Delay before each move, s.
    pub latency: f64,
    /// Standstill after each touch, s.
    pub touch_dwell: f64,
    /// Speed of rapid moves over the top speeds of the axes, ratio.
    pub rapid_override: f64,
    /// Speed of moves at a feed over the programmed feed, ratio.
    pub feed_override: f64,
    /// Share of the shorter of both ramps by which successive positioning moves overlap, 0 (exact stop) to 1.
    pub blending: f64,
}

impl Default for Program {
    fn default() -> Self {
        Self {
            latency: 0.0,
            touch_dwell: 0.0,
            rapid_override: 1.0,
            feed_override: 1.0,
            blending: 0.0,
        }
    }
}

impl Motion {
    /// Axes in the order of a position vector, and the standstill at every target (s).
    pub fn new(axes: Vec<AxisLimits>, dwell: f64) -> Self {
        Self {
            axes,
            dwell,
            program: Program::default(),
        }
    }

    /// By the top speeds of a robot description (m/s, rad/s), in the order of a position vector.
    pub(crate) fn at_speeds(speeds: impl Iterator<Item = Option<f64>>) -> Self {
        let limits = |speed: Option<f64>| AxisLimits::at_speed(speed.unwrap_or(UNKNOWN_SPEED));
        Self::new(speeds.map(limits).collect(), 0.0)
    }

    /// Limits of each axis, in the order of a position vector.
    pub fn axes(&self) -> &[AxisLimits] {
        &self.axes
    }

    /// The same, to be altered.
    pub fn axes_mut(&mut self) -> &mut [AxisLimits] {
        &mut self.axes
    }

    /// Standstill at every target, s.
    pub fn dwell(&self) -> f64 {
        self.dwell
    }

    /// The motion of one axis over a distance (m or rad), at the override of rapid moves.
    fn rapid(&self, axis: &AxisLimits, distance: f64) -> Profile {
        let velocity = axis.velocity * self.program.rapid_override;
        AxisLimits { velocity, ..*axis }.profile(distance)
    }

    /// Time from one set of positions to another (m, rad), with what the controller waits before it and the standstill at
    /// the end: that of the slowest axis, s. Where nothing moves, nothing stops.
    pub fn time(&self, from: &[f64], to: &[f64]) -> f64 {
        let times = self.axes.iter().zip(from.iter().zip(to));
        let slowest = times
            .map(|(axis, (from, to))| self.rapid(axis, to - from).duration())
            .fold(0.0, f64::max);
        if slowest > 0.0 {
            slowest + self.dwell + self.program.latency
        } else {
            slowest
        }
    }

    /// Time along a sequence of targets from a set of positions, s; successive moves overlap where blending is declared.
    pub fn time_along<T: AsRef<[f64]>>(&self, from: &[f64], targets: &[T]) -> f64 {
        let mut at = from;
        let mut before: Option<&[f64]> = None;
        let mut seconds = 0.0;
        for target in targets {
            let target = target.as_ref();
            seconds += self.time(at, target);
            seconds -= before.map_or(0.0, |before| self.overlap(before, at, target));
            before = Some(at);
            at = target;
        }
        seconds
    }

    /// Time by which the move from `via` to `to` begins before the one from `from` to `via` has ended, s.
    pub fn overlap(&self, from: &[f64], via: &[f64], to: &[f64]) -> f64 {
        if self.program.blending == 0.0 {
            return 0.0;
        }
        let ramp = |from: &[f64], to: &[f64]| self.slowest(from, to).accelerating();
        self.program.blending * ramp(from, via).min(ramp(via, to))
    }

    /// Time of a probing move until the touch, s: with the delay before it, and from rest to the feed (m/s). The ball goes
    /// `distance` (m) while the axes go from one set of positions to another.
    pub fn touching(&self, (from, to): (&[f64], &[f64]), distance: f64, feed: f64) -> f64 {
        let feed = (feed * self.program.feed_override).max(1e-6);
        self.program.latency + distance / feed + 0.5 * self.feed_ramp((from, to), distance, feed)
    }

    /// Time from the touch until the machine stands, the standstill after it, and what the way back takes longer because it
    /// begins where the machine stands and not where it touched, s; arguments as of [`Motion::touching`].
    pub fn stopping(&self, ends: (&[f64], &[f64]), distance: f64, feed: f64) -> f64 {
        let feed = (feed * self.program.feed_override).max(1e-6);
        let ramp = self.feed_ramp(ends, distance, feed);
        if ramp == 0.0 {
            return self.program.touch_dwell;
        }
        let (from, to) = ends;
        let beyond = 0.5 * feed * ramp / distance;
        let stands: Vec<f64> = (from.iter().zip(to))
            .map(|(from, to)| from + beyond * (from - to))
            .collect();
        self.program.touch_dwell + ramp + self.time(&stands, to) - self.time(from, to)
    }

    /// Time in which the slowest axis of a move gathers its share of a feed (m/s of the ball), s.
    fn feed_ramp(&self, (from, to): (&[f64], &[f64]), distance: f64, feed: f64) -> f64 {
        if distance <= 0.0 {
            return 0.0;
        }
        let shares = self.axes.iter().zip(from.iter().zip(to));
        let ramps = shares.map(|(axis, (from, to))| axis.ramp((to - from).abs() / distance * feed));
        ramps.fold(0.0, f64::max)
    }

    fn slowest(&self, from: &[f64], to: &[f64]) -> Profile {
        let profiles = self.axes.iter().zip(from.iter().zip(to));
        profiles
            .map(|(axis, (from, to))| self.rapid(axis, to - from))
            .max_by(|one, other| one.duration().total_cmp(&other.duration()))
            .unwrap_or_default()
    }

    /// The motion of the slowest axis, with which the others keep in step on the straight line between both sets of
    /// positions, before the standstill; `None` where that line is covered at constant speed without one.
    pub fn leading(&self, from: &[f64], to: &[f64]) -> Option<Profile> {
        let waits = self.dwell + self.program.latency;
        if waits == 0.0 && self.axes.iter().all(AxisLimits::is_uniform) {
            return None;
        }
        (!self.axes.is_empty()).then(|| self.slowest(from, to))
    }
}
