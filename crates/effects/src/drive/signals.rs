//! Motion and effort of the axes over time, cleaned: gaps kept apart, smoothed, differentiated, averaged to a usable rate.
//!
//! Acceleration is the second derivative of a position with noise, so all signals pass one zero-phase low-pass (a
//! Gaussian) before anything is differentiated or regressed: the same on both sides of the equation keeps it exact
//! (Young and Jakeman 1980; Janot et al. 2014 for drives). Its width is the least at which the acceleration's own noise
//! is small against the acceleration. m or rad, seconds, and the effort's own unit. States and commands are paired by
//! stamp.

use std::collections::BTreeMap;

use probecell_msgs::sensor_msgs::JointState;

use crate::session::{Session, seconds};

/// Highest rate that friction and inertia need, Hz; faster records are averaged down to it.
const RATE: f64 = 250.0;
/// Samples kept per standard deviation of the low-pass.
const OVERSAMPLED: f64 = 1.0;
/// Noise of the acceleration over the acceleration.
const QUIET: f64 = 0.05;
/// Widest low-pass, s.
const SLOWEST: f64 = 0.5;
/// Fewest samples of an axis.
const FEWEST: usize = 50;
/// A step longer than this many usual steps is a gap.
const GAP: f64 = 2.5;

/// One axis over time.
#[derive(Debug, Clone, Default)]
pub struct Signals {
    /// Axis name.
    pub axis: String,
    /// Seconds from the first sample.
    pub time: Vec<f64>,
    /// Number of the uninterrupted piece of the record each sample belongs to.
    pub piece: Vec<usize>,
    /// Measured position, m or rad.
    pub position: Vec<f64>,
    /// Measured speed, m/s or rad/s.
    pub speed: Vec<f64>,
    /// Acceleration, from the speed, m/s² or rad/s².
    pub acceleration: Vec<f64>,
    /// Effort in the unit in which it was recorded, such as N, N m or A; empty where the record has none.
    pub effort: Vec<f64>,
    /// Commanded position, m or rad; empty where the record has none.
    pub command: Vec<f64>,
    /// Speed of the command, m/s or rad/s; empty where the record has none.
    pub command_speed: Vec<f64>,
    /// Direction of the command, kept while it rests: −1 to 1.
    pub direction: Vec<f64>,
    /// Standard deviation of the low-pass, s; 0 where none was needed.
    pub width: f64,
    /// Standard deviation of the noise of the speed as given here, m/s or rad/s.
    pub speed_noise: f64,
    /// The same of the acceleration, m/s² or rad/s².
    pub acceleration_noise: f64,
    /// The same of the effort, in its unit.
    pub effort_noise: f64,
    /// The same of the position, m or rad.
    pub position_noise: f64,
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
///
/// `inertia` gives that of an axis, 0 where its acceleration does not count.
pub fn signals(session: &Session, inertia: &dyn Fn(&str) -> f64) -> Vec<Signals> {
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
        if let Some(signals) = of_axis(inertia(&axis), axis, &samples) {
            result.push(signals);
        }
    }
    result
}

fn ticks(state: &JointState) -> i64 {
    (seconds(&state.header.stamp) * 1e5).round() as i64
}

fn value(state: &JointState, axis: &str, values: &[f64]) -> Option<f64> {
    let index = state.name.iter().position(|name| name == axis)?;
    values.get(index).copied().filter(|value| value.is_finite())
}

fn of_axis(inertia: f64, axis: String, samples: &[Sample]) -> Option<Signals> {
    if samples.len() < FEWEST {
        return None;
    }
    let instants: Vec<f64> = samples.iter().map(|sample| sample.time).collect();
    let step = usual_step(&instants);
    let piece = pieces(&instants, step);
    let time: Vec<f64> = instants
        .iter()
        .map(|instant| instant - instants[0])
        .collect();
    let all = |pick: &dyn Fn(&Sample) -> Option<f64>| -> Option<Vec<f64>> {
        samples.iter().map(pick).collect()
    };
    let raw_position: Vec<f64> = samples.iter().map(|sample| sample.position).collect();
    let raw_speed = all(&|sample| sample.speed);
    let raw_effort = all(&|sample| sample.effort).unwrap_or_default();
    let effort =
        (raw_effort.iter().map(|f| f * f).sum::<f64>() / raw_effort.len().max(1) as f64).sqrt();
    // An acceleration whose noise is small against the effort needs no care.
    let enough = if inertia > 0.0 {
        QUIET * effort / inertia
    } else {
        0.0
    };
    let smoothing = Smoothing::of(&time, &piece, &raw_position, raw_speed.as_deref(), enough);
    let smooth = |values: &[f64]| smoothed(values, &piece, smoothing.width / step);
    let position = smooth(&raw_position);
    let speed = raw_speed.map_or_else(|| derivative(&time, &piece, &position), |v| smooth(&v));
    let acceleration = derivative(&time, &piece, &speed);
    let raw_command = all(&|sample| sample.command).unwrap_or_default();
    let direction = direction(&raw_command, 4.0 * noise(&raw_command));
    let command = smooth(&raw_command);
    let command_speed = if command.is_empty() {
        Vec::new()
    } else {
        all(&|sample| sample.command_speed)
            .map_or_else(|| derivative(&time, &piece, &command), |v| smooth(&v))
    };
    let kernel = kernel(smoothing.width / step);
    let kept = kernel
        .iter()
        .map(|weight| weight * weight)
        .sum::<f64>()
        .sqrt();
    let rate = if smoothing.width > 0.0 {
        (OVERSAMPLED / smoothing.width).min(RATE)
    } else {
        RATE
    };
    let width = ((1.0 / step) / rate).floor().max(1.0) as usize;
    let thin = |values: &[f64]| average(values, &piece, width);
    Some(Signals {
        axis,
        effort_noise: noise(&raw_effort) * kept,
        position_noise: noise(&raw_position) * kept,
        speed_noise: smoothing.speed_noise,
        acceleration_noise: smoothing.acceleration_noise,
        width: smoothing.width,
        time: thin(&time),
        position: thin(&position),
        speed: thin(&speed),
        acceleration: thin(&acceleration),
        effort: thin(&smooth(&raw_effort)),
        command: thin(&command),
        command_speed: thin(&command_speed),
        direction: thin(&smooth(&direction)),
        piece: chunks(&piece, width)
            .map(|(first, _)| piece[first])
            .collect(),
    })
}

/// Usual step of instants in order of time, s.
pub fn usual_step(instants: &[f64]) -> f64 {
    let mut steps: Vec<f64> = instants.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2]
}

/// Number of the uninterrupted piece that each of some instants belongs to, s, whose usual step this is.
pub fn pieces(instants: &[f64], step: f64) -> Vec<usize> {
    let mut piece = vec![0; instants.len()];
    for index in 1..instants.len() {
        let is_gap = instants[index] - instants[index - 1] > GAP * step;
        piece[index] = piece[index - 1] + usize::from(is_gap);
    }
    piece
}

/// A low-pass and what noise it leaves.
struct Smoothing {
    width: f64,
    speed_noise: f64,
    acceleration_noise: f64,
}

impl Smoothing {
    /// The narrowest low-pass that leaves an acceleration whose noise is [`QUIET`] of it, or below `enough`.
    fn of(
        time: &[f64],
        piece: &[usize],
        position: &[f64],
        speed: Option<&[f64]>,
        enough: f64,
    ) -> Self {
        let step = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
        let own = noise(speed.unwrap_or(position));
        let mut samples = 0.0;
        loop {
            let kernel = kernel(samples);
            let once = differenced(&kernel);
            let gain = |kernel: &[f64]| kernel.iter().map(|w| w * w).sum::<f64>().sqrt();
            let (speed_noise, acceleration_noise) = if speed.is_some() {
                (own * gain(&kernel), own * gain(&once) / step)
            } else {
                let twice = differenced(&once);
                (own * gain(&once) / step, own * gain(&twice) / (step * step))
            };
            let slow = smoothed(speed.unwrap_or(position), piece, samples);
            let mut last = derivative(time, piece, &slow);
            if speed.is_none() {
                last = derivative(time, piece, &last);
            }
            let size = (last.iter().map(|a| a * a).sum::<f64>() / last.len() as f64).sqrt();
            let bound = enough.max(QUIET * size);
            if acceleration_noise <= bound || samples * step > SLOWEST || samples > 200.0 {
                return Self {
                    width: samples * step,
                    speed_noise,
                    acceleration_noise,
                };
            }
            samples = if samples == 0.0 { 0.7 } else { samples * 1.35 };
        }
    }
}

/// Standard deviation of white noise under a smooth signal, from fifth differences; 0 for too few samples.
pub fn noise(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values
        .windows(6)
        .map(|w| (w[5] - 5.0 * w[4] + 10.0 * w[3] - 10.0 * w[2] + 5.0 * w[1] - w[0]).abs())
        .collect();
    sizes.sort_by(f64::total_cmp);
    // Σ of the squared binomials of 5 is 252.
    let middle = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    1.4826 * middle / 252.0_f64.sqrt()
}

/// Gaussian weights of a standard deviation in samples.
fn kernel(samples: f64) -> Vec<f64> {
    let reach = (4.0 * samples).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|k| {
            if samples > 0.0 {
                (-0.5 * (k as f64 / samples).powi(2)).exp()
            } else {
                1.0
            }
        })
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// Weights of the central difference of what a kernel gives.
fn differenced(kernel: &[f64]) -> Vec<f64> {
    let at = |k: usize| {
        k.checked_sub(2)
            .and_then(|k| kernel.get(k))
            .copied()
            .unwrap_or(0.0)
    };
    (0..kernel.len() + 2)
        .map(|k| 0.5 * (at(k + 2) - at(k)))
        .collect()
}

/// Zero-phase Gaussian low-pass inside pieces. Near an end it fits a straight line under its weights, so that a moving
/// axis is not held back there.
pub fn smoothed(values: &[f64], piece: &[usize], samples: f64) -> Vec<f64> {
    if samples <= 0.0 || values.is_empty() {
        return values.to_vec();
    }
    let kernel = kernel(samples);
    let reach = kernel.len() / 2;
    (0..values.len())
        .map(|index| {
            let inside = |at: usize| at < values.len() && piece[at] == piece[index];
            let whole = index >= reach && inside(index - reach) && inside(index + reach);
            if whole {
                let window = &values[index - reach..=index + reach];
                return window.iter().zip(&kernel).map(|(v, w)| v * w).sum();
            }
            let (mut s0, mut s1, mut s2, mut t0, mut t1) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (place, weight) in kernel.iter().enumerate() {
                let Some(at) = (index + place).checked_sub(reach).filter(|&at| inside(at)) else {
                    continue;
                };
                let x = place as f64 - reach as f64;
                s0 += weight;
                s1 += weight * x;
                s2 += weight * x * x;
                t0 += weight * values[at];
                t1 += weight * x * values[at];
            }
            let determinant = s0 * s2 - s1 * s1;
            if determinant > 1e-12 * s0 * s0 {
                (s2 * t0 - s1 * t1) / determinant
            } else {
                t0 / s0
            }
        })
        .collect()
}

/// Which way a signal went last, −1 to 1, by play of a width: rests and noise do not turn it.
fn direction(values: &[f64], width: f64) -> Vec<f64> {
    let (low, high) = values
        .iter()
        .fold((f64::MAX, f64::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    let half = 0.5 * width.max(1e-5 * (high - low)).max(f64::MIN_POSITIVE);
    let mut behind = values.first().copied().unwrap_or(0.0);
    values
        .iter()
        .map(|&value| {
            behind = behind.clamp(value - half, value + half);
            (value - behind) / half
        })
        .collect()
}

/// Central differences inside pieces, in the unit of the values per second: one for each value.
///
/// `time` (s) and `piece` are those of the values, and of the same length.
pub fn derivative(time: &[f64], piece: &[usize], values: &[f64]) -> Vec<f64> {
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
