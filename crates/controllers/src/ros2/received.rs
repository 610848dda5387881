//! What the robot has published: positions of its joints, level of its probe, and latched positions.
//!
//! Instants are ns since 1970 by the robot's clock: of joints the stamp of their message, of the level of the probe the
//! instant of its publication, which `std_msgs/Bool` has no field for. Positions are m or rad in the order of the axes. What has
//! come since something was sent is told by the order of arrival at this host, whatever the stamps say.

use std::{
    collections::{BTreeMap, VecDeque},
    time::{Duration, Instant},
};

use machine::{Chain, JointKind};
use probecell_msgs::{from_cdr, sensor_msgs::JointState};

use super::{action::Action, calls::Pending, config::RawConfig, publisher::Publisher, wire};
use crate::driver::RosSample;

/// Samples of the joints are kept for this long, ns.
const KEPT: i64 = 5_000_000_000;
/// A robot that stands has moved by less than this (m or rad) ...
const STILL: f64 = 1e-4;
/// ... within this time, ns.
const STILL_FOR: i64 = 50_000_000;
/// An axis moves at its top speed times this at most; a robot overshoots a little, and descriptions are rounded.
const OVER_SPEED: f64 = 1.5;
/// s; two samples may be this much further apart than their stamps say.
const STAMP_JITTER: f64 = 5e-3;
/// What was wrong with the robot's messages keeps it from moving for this long.
const REMEMBERED: Duration = Duration::from_secs(5);

/// Positions at an instant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Joints {
    pub(super) stamp: i64,
    /// When the sample has come; none where it was computed.
    pub(super) arrival: Option<Instant>,
    pub(super) positions: Vec<f64>,
    /// m/s or rad/s; empty where the robot does not publish that of each joint.
    pub(super) velocities: Vec<f64>,
    /// N or N m; likewise.
    pub(super) efforts: Vec<f64>,
}

impl Joints {
    /// Computed positions at an instant.
    pub(super) fn at(stamp: i64, positions: Vec<f64>) -> Self {
        Self {
            stamp,
            arrival: None,
            positions,
            velocities: Vec::new(),
            efforts: Vec::new(),
        }
    }
}

/// An axis as the robot names it, and how fast it moves.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) name: String,
    /// Top speed, m/s or rad/s; none where the robot description states none.
    pub(super) speed: Option<f64>,
    pub(super) unit: &'static str,
}

/// A contact: the probe has tripped.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trip {
    /// ns by the clock of its publisher.
    pub(super) stamp: i64,
    /// How long the probe had rested.
    rested: Duration,
}

/// What a contact cancels as soon as it arrives.
struct Guard {
    action: Action,
    rested: Duration,
}

/// The newest messages of the robot.
pub(super) struct Received {
    axes: Vec<Axis>,
    joints: VecDeque<Joints>,
    of_joints: Publisher,
    joints_at: Option<Instant>,
    level: Option<bool>,
    of_level: Publisher,
    level_at: Option<Instant>,
    /// When the level has changed.
    changed: Option<Instant>,
    /// The newest contacts, the last of which has the number `tripped`.
    trips: VecDeque<Trip>,
    tripped: u64,
    latched: VecDeque<Joints>,
    of_latched: Option<Publisher>,
    latches: u64,
    guard: Option<Guard>,
    cancel: Option<Pending>,
    faults: u64,
    fault: Option<(Instant, String)>,
    /// Why the last message of the joints could not be used.
    unusable: Option<String>,
}

impl Received {
    pub(super) fn new(axes: Vec<Axis>, config: &RawConfig) -> Self {
        let contact = &config.contact;
        let latched = contact.latched_joint_states.as_deref();
        Self {
            axes,
            joints: VecDeque::new(),
            of_joints: Publisher::new(&config.joint_states),
            joints_at: None,
            level: None,
            of_level: Publisher::new(&contact.topic),
            level_at: None,
            changed: None,
            trips: VecDeque::new(),
            tripped: 0,
            latched: VecDeque::new(),
            of_latched: latched.map(Publisher::new),
            latches: 0,
            guard: None,
            cancel: None,
            faults: 0,
            fault: None,
            unusable: None,
        }
    }

    /// Takes a sample of the joints.
    pub(super) fn take_joints(&mut self, sample: RosSample<'_>) {
        let topic = self.of_joints.topic();
        match self.read(sample, topic) {
            Ok(joints) => self.add_joints(joints, sample),
            Err(text) => self.unusable = Some(text),
        }
    }

    fn add_joints(&mut self, joints: Joints, sample: RosSample<'_>) {
        let heard = self
            .of_joints
            .hear(sample.arrival, joints.stamp, sample.publisher);
        let is_one = heard.is_ok();
        if let Err(text) = heard {
            self.unusable = Some(text.clone());
            self.note(sample.arrival, text);
        }
        // Stamps of samples rise strictly.
        if let Some(last) = self.joints.back() {
            if joints.stamp <= last.stamp {
                return;
            }
            if let (true, Some(text)) = (is_one, self.jump(last, &joints)) {
                self.note(sample.arrival, text);
            }
        }
        self.joints_at = Some(sample.arrival);
        self.unusable = None;
        let oldest = joints.stamp - KEPT;
        while self.joints.front().is_some_and(|one| one.stamp < oldest) {
            self.joints.pop_front();
        }
        self.joints.push_back(joints);
    }

    /// What is said of an axis that cannot have moved so far between two samples.
    fn jump(&self, last: &Joints, new: &Joints) -> Option<String> {
        let time = (new.stamp - last.stamp) as f64 * 1e-9;
        let pairs = last.positions.iter().zip(&new.positions);
        self.axes.iter().zip(pairs).find_map(|(axis, (from, to))| {
            let speed = axis.speed?;
            let way = (to - from).abs();
            let unit = axis.unit;
            (way > speed * OVER_SPEED * (time + STAMP_JITTER)).then(|| {
                format!(
                    "{}: joint {:?} jumps by {way:.4} {unit} in {:.1} ms, and its top speed is {speed:.3} {unit}/s",
                    self.of_joints.topic(),
                    axis.name,
                    time * 1e3
                )
            })
        })
    }

    /// Takes positions that the robot has latched.
    pub(super) fn take_latched(&mut self, sample: RosSample<'_>) {
        let Some(publisher) = &self.of_latched else {
            return;
        };
        match self.read(sample, publisher.topic()) {
            Ok(joints) => {
                let publisher = self.of_latched.as_mut();
                let heard =
                    publisher.map(|one| one.hear(sample.arrival, joints.stamp, sample.publisher));
                if let Some(Err(text)) = heard {
                    self.note(sample.arrival, text);
                }
                self.latches += 1;
                self.latched.push_back(joints);
                if self.latched.len() > 16 {
                    self.latched.pop_front();
                }
            }
            Err(text) => self.note(sample.arrival, text),
        }
    }

    /// Takes the level of the probe. A contact cancels what it is to cancel before anything else is thought of.
    pub(super) fn take_level(&mut self, sample: RosSample<'_>) {
        let Some(level) = wire::flag(sample.payload) else {
            return;
        };
        let at = sample.arrival;
        if level && self.level == Some(false) {
            let rested = self
                .changed
                .map_or(Duration::MAX, |since| at.saturating_duration_since(since));
            if let Some(guard) = self.guard.take_if(|guard| rested >= guard.rested) {
                self.cancel = Some(guard.action.cancel(at));
            }
            self.tripped += 1;
            self.trips.push_back(Trip {
                stamp: sample.source_time,
                rested,
            });
            if self.trips.len() > 64 {
                self.trips.pop_front();
            }
        }
        if self.level != Some(level) {
            self.changed = self.level.and(Some(at));
        }
        self.level = Some(level);
        self.level_at = Some(at);
        if let Err(text) = self.of_level.hear(at, sample.source_time, sample.publisher) {
            self.note(at, text);
        }
    }

    fn note(&mut self, at: Instant, text: String) {
        self.faults += 1;
        self.fault = Some((at, text));
    }

    fn read(&self, sample: RosSample<'_>, topic: &str) -> Result<Joints, String> {
        let message: JointState = from_cdr(sample.payload).map_err(|error| error.to_string())?;
        let value = |name: &String, values: &[f64]| {
            let index = message.name.iter().position(|known| known == name);
            let value = index.and_then(|index| values.get(index)).copied();
            value.filter(|value| value.is_finite())
        };
        let names = || self.axes.iter().map(|axis| &axis.name);
        let positions = names().map(|name| {
            value(name, &message.position)
                .ok_or_else(|| format!("{topic}: joint {name:?} has no position"))
        });
        // ros2_control publishes NaN for what a joint does not report.
        let of_all = |values: &[f64]| {
            let all: Option<Vec<f64>> = names().map(|name| value(name, values)).collect();
            all.unwrap_or_default()
        };
        let positions = positions.collect::<Result<_, _>>()?;
        let stamp = message.header.stamp.nanos();
        if stamp == 0 {
            return Err(format!(
                "the stamps of {topic} are zero: its publisher must stamp its messages with the time"
            ));
        }
        Ok(Joints {
            stamp,
            arrival: Some(sample.arrival),
            positions,
            velocities: of_all(&message.velocity),
            efforts: of_all(&message.effort),
        })
    }

    /// Names of the robot's joints, in the order of the axes.
    pub(super) fn joint_names(&self) -> Vec<String> {
        self.axes.iter().map(|axis| axis.name.clone()).collect()
    }

    /// Unit of the positions of an axis.
    pub(super) fn unit(&self, index: usize) -> &'static str {
        self.axes.get(index).map_or("m or rad", |axis| axis.unit)
    }

    /// The newest sample of the joints.
    pub(super) fn newest(&self) -> Option<&Joints> {
        self.joints.back()
    }

    /// Samples of the joints that are stamped after `since`, in order.
    pub(super) fn samples_after(&self, since: i64) -> Vec<&Joints> {
        let samples = self.joints.iter();
        samples.filter(|one| one.stamp > since).collect()
    }

    /// How long nothing has been received of the joints.
    pub(super) fn silence(&self, at: Instant) -> Option<Duration> {
        self.joints_at
            .map(|last| at.saturating_duration_since(last))
    }

    /// Why messages of the joints cannot be used, as far as one says it; empty otherwise.
    pub(super) fn reason(&self) -> String {
        let text = self.unusable.as_ref();
        text.map_or_else(String::new, |text| format!(": {text}"))
    }

    /// Forgets the robot, which was away.
    pub(super) fn forget(&mut self, config: &RawConfig) {
        *self = Self::new(std::mem::take(&mut self.axes), config);
    }

    /// Level of the probe.
    pub(super) fn level(&self) -> Option<bool> {
        self.level
    }

    /// How long nothing has been received of the probe.
    pub(super) fn level_silence(&self, at: Instant) -> Option<Duration> {
        self.level_at.map(|last| at.saturating_duration_since(last))
    }

    /// A contact after a rest of at least `rested` cancels all goals as soon as it arrives.
    pub(super) fn arm(&mut self, action: &Action, rested: Duration) {
        self.cancel = None;
        self.guard = Some(Guard {
            action: action.clone(),
            rested,
        });
    }

    /// No contact cancels anything any more; what one has cancelled.
    pub(super) fn disarm(&mut self) -> Option<Pending> {
        self.guard = None;
        self.cancel.take()
    }

    /// How many contacts, and latched positions, have come.
    pub(super) fn counts(&self) -> [u64; 2] {
        [self.tripped, self.latches]
    }

    /// The first contact that has come after `count` others, after a rest of at least `rested`.
    pub(super) fn trip_after(&self, count: u64, rested: Duration) -> Option<Trip> {
        let new = (self.tripped - count) as usize;
        let mut trips = self.trips.iter().skip(self.trips.len().saturating_sub(new));
        trips.find(|trip| trip.rested >= rested).copied()
    }

    /// The first positions latched after `count` others.
    pub(super) fn latched_after(&self, count: u64) -> Option<&Joints> {
        let new = (self.latches - count) as usize;
        self.latched.get(self.latched.len().saturating_sub(new))
    }

    /// How often a message was wrong: of two publishers, of a clock that goes back, or of a jump.
    pub(super) fn faults(&self) -> u64 {
        self.faults
    }

    /// What was wrong with the newest wrong message, in a sentence.
    pub(super) fn fault(&self) -> &str {
        self.fault.as_ref().map_or("", |(_, text)| text)
    }

    /// The same, where it was in the last seconds.
    pub(super) fn recent_fault(&self, at: Instant) -> Option<&str> {
        let (since, text) = self.fault.as_ref()?;
        (at.saturating_duration_since(*since) < REMEMBERED).then_some(text)
    }

    /// Whether the clocks of joints and contact differ by less than `limit`; false while too few messages have come.
    ///
    /// # Errors
    /// A sentence that names both topics and the difference.
    pub(super) fn one_clock(&self, limit: Duration) -> Result<bool, String> {
        let Some(ahead) = self.of_joints.ahead_of(&self.of_level) else {
            return Ok(false);
        };
        if ahead.unsigned_abs() <= limit.as_nanos() as u64 {
            return Ok(true);
        }
        let (side, size) = if ahead > 0 {
            ("ahead of", ahead)
        } else {
            ("behind", -ahead)
        };
        Err(format!(
            "the clock of {} is {:.1} ms {side} that of {}, and at this feed {:.1} ms are allowed: both need one clock",
            self.of_joints.topic(),
            size as f64 * 1e-6,
            self.of_level.topic(),
            limit.as_secs_f64() * 1e3
        ))
    }

    /// Checks that positions were latched since the goal that was sent at `begun` by the clock of the joints, ns.
    ///
    /// # Errors
    /// A sentence that names both topics and the difference.
    pub(super) fn check_latched(
        &self,
        latched: &Joints,
        begun: i64,
        limit: Duration,
    ) -> Result<(), String> {
        let limit = limit.as_nanos() as i64;
        let joints = self.of_joints.topic();
        let topic = self.of_latched.as_ref().map_or("", Publisher::topic);
        let before = begun.saturating_sub(latched.stamp);
        if before > limit {
            return Err(format!(
                "the positions of {topic} are stamped {:.1} ms before the move began by the clock of {joints}: both need one clock",
                before as f64 * 1e-6
            ));
        }
        let arrival = latched.arrival;
        let ahead = arrival.and_then(|at| self.of_joints.ahead(at, latched.stamp));
        match ahead {
            Some(ahead) if ahead > limit => Err(format!(
                "the positions of {topic} are stamped {:.1} ms ahead of the clock of {joints}: both need one clock",
                ahead as f64 * 1e-6
            )),
            _ => Ok(()),
        }
    }

    /// True where samples that have come after `since` are one place for the last moments.
    pub(super) fn stands_since(&self, since: Option<Instant>) -> bool {
        let Some(last) = self.joints.back() else {
            return false;
        };
        let begin = last.stamp - STILL_FOR;
        for one in self.joints.iter().rev() {
            let pairs = one.positions.iter().zip(&last.positions);
            let is_new = since.is_none_or(|since| one.arrival.is_some_and(|at| at > since));
            if !is_new || pairs.into_iter().any(|(a, b)| (a - b).abs() >= STILL) {
                return false;
            }
            if one.stamp <= begin {
                return true;
            }
        }
        false
    }
}

/// The axes as the robot names them.
pub(super) fn axes(chain: &Chain, renamed: &BTreeMap<String, String>) -> Result<Vec<Axis>, String> {
    if let Some(unknown) = renamed.keys().find(|name| chain.axis_index(name).is_none()) {
        return Err(format!(
            "ros2.joints: {unknown:?} is not an axis of the robot description"
        ));
    }
    let own = (0..chain.axes().len()).map(|index| chain.axis(index));
    Ok(own
        .map(|joint| Axis {
            name: renamed.get(&joint.name).unwrap_or(&joint.name).clone(),
            speed: joint.speed,
            unit: match joint.kind {
                JointKind::Prismatic => "m",
                JointKind::Revolute | JointKind::Fixed => "rad",
            },
        })
        .collect())
}
