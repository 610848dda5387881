//! Effects on the time of moves: limits that the machine keeps in place of the declared ones, one file each.
//!
//! A row is the sequence of moves from one touch to the next: back, across and to the next approach at the limits of the axes, then the
//! probing move at its feed. Measured is the time between the stamps of both touches, promised is what the motion model
//! ([`machine::motion`]) gives for the same moves. An effect replaces one number of that model, so it is not linear: its
//! [`MotionParameter`] says which numbers are tried, and what the model makes of one. Seconds, m or rad.

mod acceleration;
mod axis_limit;
mod blending;
mod dwell;
mod jerk;
mod latency;
mod moves;
mod probing;
mod speed_override;
mod track;
mod velocity;

use machine::{Motion, motion::AxisLimits};

use crate::effect::{ActsOn, Effect, Instance, Subject};

pub use moves::{FEED_DEVIATIONS, Interval, Moves, MovesError, moves};

/// Numbers that are tried of a limit.
const TRIED: usize = 24;
/// Largest factor between a limit and the declared one.
const FARTHEST: f64 = 10.0;

/// An effect on the time of moves.
pub trait MotionEffect: Effect {
    /// The numbers of the motion model that it may replace; none where the moves of the session cannot show it.
    fn limits(&self, moves: &Moves) -> Vec<MotionParameter>;

    /// What to do about it, after `[motion]`: `name` of it has the size `size`, `instead` of a declared one.
    fn sized_remedy(&self, of: &Instance<'_>, name: &str, size: &str, instead: &str) -> String;
}

/// All of them, in the order in which equals are named.
pub const ALL: &[&dyn MotionEffect] = &[
    &acceleration::ACCELERATION,
    &velocity::VELOCITY,
    &jerk::JERK,
    &dwell::Dwell,
    &latency::Latency,
    &speed_override::SpeedOverride,
    &blending::Blending,
];

/// How a number is varied.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// By factors: a limit.
    Logarithmic,
    /// By differences: a time or a share.
    Linear,
}

/// A number of the motion model that may be another than declared.
pub struct MotionParameter {
    /// Identifier of the effect.
    pub effect: String,
    /// Name of the number in reports.
    pub name: &'static str,
    /// Its unit in reports.
    pub unit: &'static str,
    /// Its declared value, in [`Self::unit`]; `None`: no such limit is declared.
    pub declared: Option<f64>,
    /// How it is varied.
    pub scale: Scale,
    /// Values that are tried, in [`Self::unit`].
    pub tried: Vec<f64>,
    /// Least and largest value, in [`Self::unit`].
    pub range: [f64; 2],
    set: Setter,
}

/// Makes a motion model keep a value.
type Setter = Box<dyn Fn(&mut Motion, f64)>;

impl MotionParameter {
    /// Makes a motion model keep this value.
    pub fn set(&self, motion: &mut Motion, value: f64) {
        (self.set)(motion, value.clamp(self.range[0], self.range[1]));
    }

    /// A limit by its declared value.
    fn around(effect: String, (name, unit): (&'static str, &'static str), declared: f64) -> Self {
        let tried = logarithmic(declared / FARTHEST, declared * FARTHEST);
        Self {
            effect,
            name,
            unit,
            declared: Some(declared),
            scale: Scale::Logarithmic,
            range: [declared / (2.0 * FARTHEST), declared * 2.0 * FARTHEST],
            tried,
            set: Box::new(|_, _| {}),
        }
    }

    /// A limit of which nothing is declared, between two values.
    fn between(
        effect: String,
        (name, unit): (&'static str, &'static str),
        [least, most]: [f64; 2],
    ) -> Self {
        Self {
            tried: logarithmic(least, most),
            range: [0.5 * least, 2.0 * most],
            declared: None,
            ..Self::around(effect, (name, unit), least)
        }
    }

    /// A time or a share.
    fn linear(
        effect: &str,
        (name, unit): (&'static str, &'static str),
        declared: f64,
        tried: Vec<f64>,
        range: [f64; 2],
    ) -> Self {
        Self {
            scale: Scale::Linear,
            tried,
            range,
            ..Self::around(effect.to_owned(), (name, unit), declared)
        }
    }

    /// A limit that the recorded axes show between two values, if they show it at all: `None` where these hold the declared one.
    fn seen(mut self, seen: Option<[f64; 2]>) -> Option<Self> {
        let Some([least, most]) = seen else {
            return Some(self);
        };
        if self
            .declared
            .is_some_and(|declared| (least..=most).contains(&declared))
        {
            return None;
        }
        self.range = [least, most];
        self.tried = vec![least, 0.5 * (least + most), most];
        Some(self)
    }

    fn setting(self, set: impl Fn(&mut Motion, f64) + 'static) -> Self {
        Self {
            set: Box::new(set),
            ..self
        }
    }

    /// The same for the limits of one axis.
    fn of_axis(self, axis: usize, set: impl Fn(&mut AxisLimits, f64) + 'static) -> Self {
        self.setting(move |motion, value| {
            if let Some(limits) = motion.axes_mut().get_mut(axis) {
                set(limits, value);
            }
        })
    }
}

fn logarithmic(least: f64, most: f64) -> Vec<f64> {
    let step = (most / least).ln() / (TRIED - 1) as f64;
    (0..TRIED)
        .map(|k| least * (step * k as f64).exp())
        .collect()
}

/// What an effect on the time of moves acts on.
const fn acts_on() -> ActsOn {
    ActsOn::of(Subject::Motion)
}

/// Every number of the motion model that these moves may show to be another.
pub fn library(moves: &Moves) -> Vec<MotionParameter> {
    ALL.iter().flat_map(|effect| effect.limits(moves)).collect()
}

/// What to do about an effect that has this size, in the words of the trade; `declared` as in [`MotionParameter`].
pub fn remedy(effect: &str, name: &str, size: &str, declared: Option<&str>) -> Option<String> {
    let mut named = ALL.iter().copied();
    let (found, of) =
        named.find_map(|found| Some((found, Instance::parse(found.id(), effect)?)))?;
    let instead = declared.map_or_else(String::new, |declared| format!(" instead of {declared}"));
    let remedy = found.sized_remedy(&of, name, size, &instead);
    Some(format!("[motion] {remedy}"))
}

#[cfg(test)]
pub(crate) mod specimen {
    use machine::{Motion, motion::AxisLimits};

    use super::{Interval, MotionParameter, Moves};

    /// Two linear axes; moves of 10 mm to 0.3 m of either, with a stop on the way.
    pub(crate) fn moves() -> Moves {
        let limits = AxisLimits {
            acceleration: Some(2.0),
            jerk: Some(50.0),
            ..AxisLimits::at_speed(0.3)
        };
        let interval = |k: usize| {
            let far = 0.01 + 0.0145 * (k % 21) as f64;
            let near = 0.02 + 0.005 * (k % 5) as f64;
            let end = if k.is_multiple_of(2) {
                [far, near]
            } else {
                [near, far]
            };
            let mut interval = Interval {
                time: k as f64,
                sequences: [k as u64, k as u64 + 1],
                points: [k as u32, k as u32 + 1],
                start: vec![0.0, 0.0],
                end: end.to_vec(),
                retreat: 0.0,
                targets: vec![vec![0.5 * end[0], 0.0], end.to_vec()],
                distance: 0.002 + 1e-4 * (k % 7) as f64,
                feed: 0.003,
                measured: 0.0,
            };
            if k.is_multiple_of(3) {
                interval.targets.push(vec![0.0, 0.0]);
                interval.end = vec![0.0, 0.0];
            }
            interval
        };
        Moves {
            axes: vec![("X".to_owned(), false), ("Y".to_owned(), false)],
            declared: Motion::new(vec![limits; 2], 0.0),
            intervals: (0..40).map(interval).collect(),
            feed_seen: None,
            remarks: Vec::new(),
        }
    }

    /// How much longer each row takes where a number of a limit is this one.
    pub(crate) fn longer(limit: &MotionParameter, value: f64) -> Vec<f64> {
        let moves = moves();
        let mut motion = moves.declared.clone();
        limit.set(&mut motion, value);
        let (with, without) = (moves.durations(&motion), moves.durations(&moves.declared));
        with.iter()
            .zip(without)
            .map(|(with, without)| with - without)
            .collect()
    }
}
