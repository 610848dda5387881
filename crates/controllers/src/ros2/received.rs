//! What the robot has published: positions of its joints, level of its probe, and latched positions.
//!
//! Instants are ns since 1970 by the robot's clock: of joints the stamp of their message, of the level of the probe the
//! instant of its publication, which `std_msgs/Bool` has no field for. Positions are m or rad in the order of the axes.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use machine::Chain;
use probecell_msgs::{from_cdr, sensor_msgs::JointState};

use super::wire;
use crate::driver::RosSample;

/// Samples of the joints are kept for this long, ns.
const KEPT: i64 = 5_000_000_000;
/// A robot that stands has moved by less than this (m or rad) ...
const STILL: f64 = 1e-4;
/// ... within this time, ns.
const STILL_FOR: i64 = 50_000_000;

/// Positions at an instant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Joints {
    pub(super) stamp: i64,
    pub(super) positions: Vec<f64>,
    /// m/s or rad/s; empty where the robot does not publish that of each joint.
    pub(super) velocities: Vec<f64>,
    /// N or N m; likewise.
    pub(super) efforts: Vec<f64>,
}

/// The newest messages of the robot.
#[derive(Debug, Default)]
pub(super) struct Received {
    /// Names of the robot's joints, in the order of the axes.
    names: Vec<String>,
    joints: VecDeque<Joints>,
    joints_at: Option<Instant>,
    level: Option<bool>,
    level_at: Option<Instant>,
    /// Instants at which the probe has tripped.
    trips: VecDeque<i64>,
    latched: VecDeque<Joints>,
    /// Why the last message of the joints could not be used.
    pub(super) unusable: Option<String>,
}

impl Received {
    pub(super) fn new(names: Vec<String>) -> Self {
        Self {
            names,
            ..Self::default()
        }
    }

    /// Takes a sample of the joints.
    pub(super) fn take_joints(&mut self, sample: RosSample<'_>) {
        match self.read(sample.payload) {
            Ok(joints) => {
                // Stamps of samples rise strictly.
                if self
                    .joints
                    .back()
                    .is_some_and(|last| joints.stamp <= last.stamp)
                {
                    return;
                }
                self.joints_at = Some(Instant::now());
                self.unusable = None;
                let oldest = joints.stamp - KEPT;
                while self.joints.front().is_some_and(|one| one.stamp < oldest) {
                    self.joints.pop_front();
                }
                self.joints.push_back(joints);
            }
            Err(text) => self.unusable = Some(text),
        }
    }

    /// Takes positions that the robot has latched.
    pub(super) fn take_latched(&mut self, sample: RosSample<'_>) {
        match self.read(sample.payload) {
            Ok(joints) => {
                self.latched.push_back(joints);
                if self.latched.len() > 16 {
                    self.latched.pop_front();
                }
            }
            Err(text) => self.unusable = Some(text),
        }
    }

    /// Takes the level of the probe.
    pub(super) fn take_level(&mut self, sample: RosSample<'_>) {
        let Some(level) = wire::flag(sample.payload) else {
            return;
        };
        if level && self.level == Some(false) {
            self.trips.push_back(sample.source_time);
            if self.trips.len() > 64 {
                self.trips.pop_front();
            }
        }
        self.level = Some(level);
        self.level_at = Some(Instant::now());
    }

    fn read(&self, payload: &[u8]) -> Result<Joints, String> {
        let message: JointState = from_cdr(payload).map_err(|error| error.to_string())?;
        let value = |name: &String, values: &[f64]| {
            let index = message.name.iter().position(|known| known == name);
            let value = index.and_then(|index| values.get(index)).copied();
            value.filter(|value| value.is_finite())
        };
        let positions = self.names.iter().map(|name| {
            value(name, &message.position).ok_or_else(|| format!("joint {name:?} has no position"))
        });
        // ros2_control publishes NaN for what a joint does not report.
        let of_all = |values: &[f64]| {
            let all: Option<Vec<f64>> = self.names.iter().map(|name| value(name, values)).collect();
            all.unwrap_or_default()
        };
        Ok(Joints {
            stamp: message.header.stamp.nanos(),
            positions: positions.collect::<Result<_, _>>()?,
            velocities: of_all(&message.velocity),
            efforts: of_all(&message.effort),
        })
    }

    /// Names of the robot's joints, in the order of the axes.
    pub(super) fn joint_names(&self) -> &[String] {
        &self.names
    }

    /// The newest sample of the joints.
    pub(super) fn newest(&self) -> Option<&Joints> {
        self.joints.back()
    }

    /// How long nothing has been received of the joints.
    pub(super) fn silence(&self) -> Option<Duration> {
        self.joints_at.map(|at| at.elapsed())
    }

    /// Forgets the robot, which was away.
    pub(super) fn forget(&mut self) {
        *self = Self::new(std::mem::take(&mut self.names));
    }

    /// Level of the probe.
    pub(super) fn level(&self) -> Option<bool> {
        self.level
    }

    /// How long nothing has been received of the probe.
    pub(super) fn level_silence(&self) -> Option<Duration> {
        self.level_at.map(|at| at.elapsed())
    }

    /// The first instant after `since` at which the probe tripped.
    pub(super) fn trip_after(&self, since: i64) -> Option<i64> {
        self.trips.iter().copied().find(|&trip| trip > since)
    }

    /// The first positions latched after `since`.
    pub(super) fn latched_after(&self, since: i64) -> Option<&Joints> {
        self.latched.iter().find(|joints| joints.stamp > since)
    }

    /// Positions at an instant, between the samples before and after it (linear); `None` until both are there.
    pub(super) fn at(&self, instant: i64) -> Option<Joints> {
        let after = self.joints.iter().position(|one| one.stamp >= instant)?;
        let (before, after) = (self.joints.get(after.checked_sub(1)?)?, &self.joints[after]);
        let share = (instant - before.stamp) as f64 / (after.stamp - before.stamp) as f64;
        let pairs = before.positions.iter().zip(&after.positions);
        Some(Joints {
            stamp: instant,
            positions: pairs.map(|(a, b)| a + (b - a) * share).collect(),
            velocities: Vec::new(),
            efforts: Vec::new(),
        })
    }

    /// True where all samples of the last moments, which began after `since`, are one place.
    pub(super) fn stands_since(&self, since: i64) -> bool {
        let Some(last) = self.joints.back() else {
            return false;
        };
        let begin = last.stamp - STILL_FOR;
        if begin < since {
            return false;
        }
        let recent = self
            .joints
            .iter()
            .rev()
            .take_while(|one| one.stamp >= begin);
        recent.into_iter().all(|one| {
            let pairs = one.positions.iter().zip(&last.positions);
            pairs.into_iter().all(|(a, b)| (a - b).abs() < STILL)
        })
    }
}

/// Names of the robot's joints in the order of the axes.
pub(super) fn names(
    chain: &Chain,
    renamed: &std::collections::BTreeMap<String, String>,
) -> Result<Vec<String>, String> {
    if let Some(unknown) = renamed.keys().find(|name| chain.axis_index(name).is_none()) {
        return Err(format!(
            "ros2.joints: {unknown:?} is not an axis of the robot description"
        ));
    }
    let own = chain.axis_names();
    Ok(own
        .map(|name| {
            renamed
                .get(name)
                .cloned()
                .unwrap_or_else(|| name.to_owned())
        })
        .collect())
}
