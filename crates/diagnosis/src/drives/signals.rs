//! Motion and effort of the axes over time, cleaned: even steps, gaps kept apart, derivatives, averaged to a usable rate.
//!
//! m or rad, seconds, and the effort's own unit. States and commands are paired by stamp.

use std::collections::BTreeMap;

use probecell_msgs::sensor_msgs::JointState;

use crate::session::{Session, seconds};

/// Highest rate that friction and inertia need, Hz; faster records are averaged down to it.
const RATE: f64 = 250.0;
/// A step longer than this many usual steps is a gap.
const GAP: f64 = 2.5;

/// One axis over time.
#[derive(Debug, Clone, Default)]
pub(super) struct Signals {
    /// Axis name.
    pub(super) axis: String,
    /// Seconds from the first sample.
    pub(super) time: Vec<f64>,
    /// Number of the uninterrupted piece of the record each sample belongs to.
    pub(super) piece: Vec<usize>,
    /// Measured position.
    pub(super) position: Vec<f64>,
    /// Measured speed.
    pub(super) speed: Vec<f64>,
    /// Acceleration, from the speed.
    pub(super) acceleration: Vec<f64>,
    /// Effort; empty where the record has none.
    pub(super) effort: Vec<f64>,
    /// Commanded position; empty where the record has none.
    pub(super) command: Vec<f64>,
    /// Speed of the command.
    pub(super) command_speed: Vec<f64>,
}

struct Sample {
    time: f64,
    position: f64,
    speed: Option<f64>,
    effort: Option<f64>,
    command: Option<f64>,
    command_speed: Option<f64>,
}

/// Signals of every axis that moves.
pub(super) fn signals(session: &Session) -> Vec<Signals> {
    let mut commands: BTreeMap<i64, &JointState> = BTreeMap::new();
    for command in &session.joint_commands {
        commands.insert(ticks(command), command);
    }
    let mut axes: Vec<String> = Vec::new();
    for name in session.joint_states.iter().flat_map(|state| &state.name) {
        if !axes.contains(name) {
            axes.push(name.clone());
        }
    }
    let mut result = Vec::new();
    for axis in axes {
        let mut samples: Vec<Sample> = session
            .joint_states
            .iter()
            .filter_map(|state| {
                let command = commands.get(&ticks(state)).copied();
                Some(Sample {
                    time: seconds(&state.header.stamp),
                    position: value(state, &axis, &state.position)?,
                    speed: value(state, &axis, &state.velocity),
                    effort: value(state, &axis, &state.effort),
                    command: command.and_then(|command| value(command, &axis, &command.position)),
                    command_speed: command
                        .and_then(|command| value(command, &axis, &command.velocity)),
                })
            })
            .collect();
        samples.sort_by(|one, other| one.time.total_cmp(&other.time));
        samples.dedup_by(|one, other| one.time == other.time);
        if let Some(signals) = of_axis(axis, &samples) {
            result.push(signals);
        }
    }
    result
}

fn ticks(state: &JointState) -> i64 {
    (seconds(&state.header.stamp) * 1e5).round() as i64
}

fn value(state: &JointState, axis: &str, values: &[f64]) -> Option<f64> {
    let place = state.name.iter().position(|name| name == axis)?;
    values.get(place).copied().filter(|value| value.is_finite())
}

fn of_axis(axis: String, samples: &[Sample]) -> Option<Signals> {
    if samples.len() < 50 {
        return None;
    }
    let mut steps: Vec<f64> = samples
        .windows(2)
        .map(|pair| pair[1].time - pair[0].time)
        .collect();
    steps.sort_by(f64::total_cmp);
    let step = steps[steps.len() / 2];
    let start = samples[0].time;
    let time: Vec<f64> = samples.iter().map(|sample| sample.time - start).collect();
    let mut piece = vec![0; samples.len()];
    for index in 1..samples.len() {
        piece[index] = piece[index - 1] + usize::from(time[index] - time[index - 1] > GAP * step);
    }
    let position: Vec<f64> = samples.iter().map(|sample| sample.position).collect();
    let all = |pick: &dyn Fn(&Sample) -> Option<f64>| -> Option<Vec<f64>> {
        samples.iter().map(pick).collect()
    };
    let speed = all(&|sample| sample.speed).unwrap_or_else(|| derivative(&time, &piece, &position));
    let acceleration = derivative(&time, &piece, &speed);
    let command = all(&|sample| sample.command).unwrap_or_default();
    let command_speed = if command.is_empty() {
        Vec::new()
    } else {
        all(&|sample| sample.command_speed).unwrap_or_else(|| derivative(&time, &piece, &command))
    };
    let effort = all(&|sample| sample.effort).unwrap_or_default();
    let width = ((1.0 / step) / RATE).floor().max(1.0) as usize;
    let thin = |values: &[f64]| average(values, &piece, width);
    Some(Signals {
        axis,
        time: thin(&time),
        position: thin(&position),
        speed: thin(&speed),
        acceleration: thin(&acceleration),
        effort: thin(&effort),
        command: thin(&command),
        command_speed: thin(&command_speed),
        piece: chunks(&piece, width)
            .map(|(first, _)| piece[first])
            .collect(),
    })
}

/// Central differences inside pieces.
pub(super) fn derivative(time: &[f64], piece: &[usize], values: &[f64]) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    (0..values.len())
        .map(|index| {
            let before = if index > 0 && piece[index - 1] == piece[index] {
                index - 1
            } else {
                index
            };
            let after = if index < last && piece[index + 1] == piece[index] {
                index + 1
            } else {
                index
            };
            if after == before {
                0.0
            } else {
                (values[after] - values[before]) / (time[after] - time[before])
            }
        })
        .collect()
}

/// Runs of at most `width` samples of one piece: first and one past the last.
fn chunks(piece: &[usize], width: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut next = 0;
    std::iter::from_fn(move || {
        let first = next;
        while next < piece.len() && next - first < width && piece[next] == piece[first] {
            next += 1;
        }
        (next > first).then_some((first, next))
    })
}

fn average(values: &[f64], piece: &[usize], width: usize) -> Vec<f64> {
    if values.is_empty() {
        return Vec::new();
    }
    chunks(piece, width)
        .map(|(first, end)| values[first..end].iter().sum::<f64>() / (end - first) as f64)
        .collect()
}
